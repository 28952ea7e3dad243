//! Whether ticks may be cut after a start or a reconnect.

use super::{Rules, SourceRules};
use crate::moment::Moment;
use crate::time::Duration;

/// Ticks wait until every source has settled, is away for long, or has ended.
#[derive(Debug)]
pub(super) struct Gate {
    settle: Duration,
    links: Vec<Link>,
    /// While no tick may be cut: when that ends at the latest.
    closed: Option<Moment>,
}

#[derive(Debug)]
struct Link {
    silent: Duration,
    state: LinkState,
    /// Whether its last connection lasted. One that comes and goes is not waited for again and again.
    is_steady: bool,
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
            is_steady: true,
        };
        let mut gate = Self {
            settle: rules.settle,
            links: rules.sources.iter().map(link).collect(),
            closed: None,
        };
        gate.close(now);
        gate
    }

    pub(super) fn connected(&mut self, source: usize, now: Moment) {
        self.is_open(now);
        let Some(link) = self.links.get_mut(source) else {
            return;
        };
        link.state = LinkState::Connected(now);
        if link.is_steady {
            self.close(now);
        }
    }

    pub(super) fn away(&mut self, source: usize, now: Moment) {
        self.is_open(now);
        let settle = self.settle;
        if let Some(link) = self.links.get_mut(source) {
            if let LinkState::Connected(since) = link.state {
                link.is_steady = now - since >= settle;
            }
            link.state = LinkState::Away(now);
        }
    }

    pub(super) fn ended(&mut self, source: usize) {
        if let Some(link) = self.links.get_mut(source) {
            link.state = LinkState::Ended;
        }
    }

    /// When it opens; none where it is open.
    pub(super) fn due(&self) -> Option<Moment> {
        let latest = self.closed?;
        let settled = self.links.iter().filter_map(|link| match link.state {
            LinkState::Away(since) => Some(since + link.silent),
            LinkState::Connected(since) => Some(since + self.settle),
            LinkState::Ended => None,
        });
        Some(settled.max().map_or(Moment::START, |all| all.min(latest)))
    }

    /// Whether ticks may be cut.
    pub(super) fn is_open(&mut self, now: Moment) -> bool {
        if self.due().is_some_and(|due| due <= now) {
            self.closed = None;
        }
        self.closed.is_none()
    }

    fn close(&mut self, now: Moment) {
        let longest = self.links.iter().map(|link| link.silent).max();
        let latest = now + self.settle + longest.unwrap_or_default();
        self.closed.get_or_insert(latest);
    }
}
