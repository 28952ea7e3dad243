//! Whether ticks may be cut: after a start, after a reconnect, and while a source is lost in the middle of an instant.
//!
//! At the start every source is waited for until it has settled, is away for long, or has ended. Later one that is back, or lost while
//! an instant holds samples of it, is waited for once: for `settle` at most where another goes on giving. It is waited for again only
//! after a connection that lasted, or where no other gives anything.

use super::{Rules, SourceRules};
use crate::live::Moment;
use crate::time::Duration;

/// Knows which sources are waited for.
#[derive(Debug)]
pub(super) struct Gate {
    settle: Duration,
    links: Vec<Link>,
    /// While no tick may be cut: since when.
    closed: Option<Closed>,
}

#[derive(Debug, Clone, Copy)]
struct Closed {
    since: Moment,
    is_start: bool,
}

#[derive(Debug)]
struct Link {
    silent: Duration,
    state: LinkState,
    /// When it gave something last.
    gave: Option<Moment>,
    /// Whether it is waited for at the moment, and whether it has been since its last connection that lasted.
    is_awaited: bool,
    was_awaited: bool,
}

#[derive(Debug, Clone, Copy)]
enum LinkState {
    Away(Moment),
    Connected(Moment),
    Ended,
}

impl Gate {
    pub(super) fn new(rules: &Rules, now: Moment) -> Self {
        let link = |of: &SourceRules| Link {
            silent: of.silent,
            state: LinkState::Away(now),
            gave: None,
            is_awaited: true,
            was_awaited: false,
        };
        Self {
            settle: rules.settle,
            links: rules.sources.iter().map(link).collect(),
            closed: Some(Closed {
                since: now,
                is_start: true,
            }),
        }
    }

    pub(super) fn connected(&mut self, source: usize, now: Moment) {
        self.is_open(now);
        let others_give = self.others_give(source, now);
        let Some(link) = self.links.get_mut(source) else {
            return;
        };
        link.state = LinkState::Connected(now);
        self.wait_for(source, others_give, now);
    }

    /// `is_amid`: an instant holds samples of it.
    pub(super) fn away(&mut self, source: usize, is_amid: bool, now: Moment) {
        self.is_open(now);
        let others_give = self.others_give(source, now);
        let Some(link) = self.links.get_mut(source) else {
            return;
        };
        if let LinkState::Connected(since) = link.state {
            link.state = LinkState::Away(now);
            let lasted = now - since >= self.settle.max(link.silent);
            link.was_awaited &= !lasted;
            // One that goes again while it settles is not waited for any longer where others give.
            let is_start = self.closed.is_some_and(|closed| closed.is_start);
            link.is_awaited &= is_start || !others_give;
        }
        if is_amid {
            self.wait_for(source, others_give, now);
        }
    }

    pub(super) fn ended(&mut self, source: usize) {
        if let Some(link) = self.links.get_mut(source) {
            link.state = LinkState::Ended;
        }
    }

    /// A source gave something.
    pub(super) fn gave(&mut self, source: usize, now: Moment) {
        if let Some(link) = self.links.get_mut(source) {
            link.gave = Some(now);
        }
    }

    /// When it opens; none where it is open.
    pub(super) fn due(&self) -> Option<Moment> {
        let Closed { since, is_start } = self.closed?;
        let longest = self.links.iter().map(|link| link.silent).max();
        let latest = since + self.settle + longest.unwrap_or_default();
        // Where others give, nobody is waited for longer than `settle`; nor is one that is away once those that are back have settled.
        let giving = || {
            self.links
                .iter()
                .filter(|link| !is_start && link.gives(since))
        };
        let others = giving()
            .any(|link| !link.is_awaited)
            .then_some(since + self.settle);
        let back = giving().filter_map(|link| match link.state {
            LinkState::Connected(back) if link.is_awaited => Some(back + self.settle),
            _ => None,
        });
        let back = back.max().unwrap_or(latest);
        let awaited = self.links.iter().filter(|link| link.is_awaited);
        let settled = awaited.filter_map(|link| match link.state {
            LinkState::Away(since) if is_start => Some(since + link.silent),
            LinkState::Away(since) => Some((since + link.silent).min(back)),
            LinkState::Connected(since) => Some(since + self.settle),
            LinkState::Ended => None,
        });
        let all = settled.max().unwrap_or(Moment::START).min(latest);
        Some(others.map_or(all, |others| all.min(others)))
    }

    /// Whether ticks may be cut.
    pub(super) fn is_open(&mut self, now: Moment) -> bool {
        if self.due().is_some_and(|due| due <= now) {
            self.closed = None;
            self.links
                .iter_mut()
                .for_each(|link| link.is_awaited = false);
        }
        self.closed.is_none()
    }

    fn wait_for(&mut self, source: usize, others_give: bool, now: Moment) {
        let Some(link) = self.links.get_mut(source) else {
            return;
        };
        if link.is_awaited || link.was_awaited && others_give {
            return;
        }
        (link.is_awaited, link.was_awaited) = (true, true);
        let is_start = false;
        self.closed.get_or_insert(Closed {
            since: now,
            is_start,
        });
    }

    /// Whether another source is connected and gave something lately.
    fn others_give(&self, source: usize, now: Moment) -> bool {
        let mut others = self
            .links
            .iter()
            .enumerate()
            .filter(|(nth, _)| *nth != source);
        others.any(|(_, link)| link.gives(now))
    }
}

impl Link {
    /// Whether it is connected, and gave something at a moment, before it within `silent`, or since.
    fn gives(&self, at: Moment) -> bool {
        let is_connected = matches!(self.state, LinkState::Connected(_));
        is_connected && self.gave.is_some_and(|gave| at - gave < self.silent)
    }
}
