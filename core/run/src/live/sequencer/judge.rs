//! Which stamps are of the future, and whether the last tick was: what time it is at the sources, and who decides that.
//!
//! A trusted host decides alone. Without one a stamp that is too far ahead waits until it is known what it was:
//!
//! | what its channel does | what it was |
//! |---|---|
//! | it returns to the old time | a wrong stamp: refused |
//! | it goes on for three stamps with the clock, and nobody goes on at the old time | a gap: accepted, with all that waited |
//! | the same, and others go on at the old time | the majority of sources decides, then the host's unsure clock; else the old time stays |
//! | its stamps run faster than time | a backlog, which decides nothing |
//!
//! Sources whose stamps come in order have times of their own: they are not judged and do not decide, and the last tick is right where
//! it is theirs.

use super::Rules;
use super::pace::{MINUTE, Pace};
use crate::live::Moment;
use crate::time::{Duration, Instant};

/// How much faster than the host a source's clock is allowed to fall behind until its newest stamp no longer counts: 100 ppm.
const DRIFT: i64 = 10_000;
/// The host's unsure clock decides nothing where it is further away: an edge PC boots in 1970.
const UNSURE: Duration = Duration::from_ns(86_400_000_000_000);

/// Knows what time it is at the sources.
#[derive(Debug)]
pub(super) struct Judge {
    future: Duration,
    wait: Duration,
    channels: Vec<Judged>,
    /// By source, of the vote under way.
    votes: Vec<i32>,
    /// The newest stamp that was accepted, and when.
    newest: Option<(Instant, Moment)>,
    /// The host's time at the start of the monotonic clock, and whether it is known to be right.
    host: Option<(Instant, bool)>,
    /// When the last segment began because the last tick was of the future. From then on no stamp moves what is the newest by leaps.
    back: Option<Moment>,
}

/// What is known of a channel.
#[derive(Debug, Clone, Copy)]
struct Judged {
    source: usize,
    is_in_order: bool,
    pace: Pace,
    /// The stamp that came last.
    came: Option<Instant>,
    /// How many of its samples wait.
    waiting: usize,
    /// Since when its stamps have been too far ahead.
    ahead: Option<Moment>,
}

/// What a stamp that is too far ahead comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It is that time now: what waited there is no longer ahead.
    Gap,
    /// It is not that time: the clock of its source is wrong.
    Wrong,
    /// Not known yet.
    Open,
}

impl Judge {
    pub(super) fn new(rules: &Rules) -> Self {
        let judged = |of: &super::ChannelRules| Judged {
            source: of.source,
            is_in_order: rules.is_in_order(of.source),
            pace: Pace::default(),
            came: None,
            waiting: 0,
            ahead: None,
        };
        Self {
            future: rules.future,
            wait: rules.wait,
            channels: rules.channels.iter().map(judged).collect(),
            votes: vec![0; rules.sources.len()],
            newest: None,
            host: None,
            back: None,
        }
    }

    /// The host's time now, and whether it is known to be right.
    pub(super) fn set_host(&mut self, host: Instant, now: Moment, is_trusted: bool) {
        self.host = Some((host - (now - Moment::START), is_trusted));
    }

    /// The host's time, as far as anything is known of it.
    pub(super) fn host(&self, now: Moment) -> Option<Instant> {
        self.host.map(|(epoch, _)| epoch + (now - Moment::START))
    }

    /// The host's time, where it is known to be right.
    pub(super) fn trusted(&self, now: Moment) -> Option<Instant> {
        self.host(now).filter(|_| self.is_trusted())
    }

    pub(super) fn is_trusted(&self) -> bool {
        self.host.is_some_and(|(_, is_trusted)| is_trusted)
    }

    /// The newest stamp that was accepted and the time since.
    pub(super) fn newest(&self, now: Moment) -> Option<Instant> {
        self.newest.map(|(newest, when)| newest + (now - when))
    }

    /// Looks at a stamp that came, whatever becomes of it. True where the pace of its channel is known anew.
    pub(super) fn look(&mut self, channel: usize, stamp: Instant, now: Moment) -> bool {
        let of = &mut self.channels[channel];
        of.came = Some(stamp);
        of.pace.look(stamp, now, self.wait)
    }

    /// By how much a stamp is of the future, as far as that is to be asked; none where it is not.
    pub(super) fn ahead(
        &mut self,
        channel: usize,
        stamp: Instant,
        now: Moment,
    ) -> Option<Duration> {
        let trusted = self.trusted(now);
        let newest = self.newest(now);
        if self.channels[channel].is_in_order {
            return None;
        }
        let all = [trusted, newest];
        let mut known = all.iter().flatten().map(|time| stamp - *time).peekable();
        let ahead = *known.peek()?;
        if !known.all(|ahead| ahead > self.future) {
            return None;
        }
        self.channels[channel].ahead.get_or_insert(now);
        Some(ahead)
    }

    /// A stamp of a channel was accepted.
    pub(super) fn accepted(&mut self, channel: usize, stamp: Instant, now: Moment) {
        self.channels[channel].ahead = None;
        let Some((newest, when)) = self.newest else {
            self.newest = Some((stamp, now));
            return;
        };
        // A backlog does not move what is the newest; a clock that is slow by no more than its drift does.
        let since = now - when;
        let drift = Duration::from_ns(since.as_ns() / DRIFT);
        if stamp >= newest + since - drift {
            let farthest = newest + since + drift;
            let stamp = self.back.map_or(stamp, |_| stamp.min(farthest));
            self.newest = Some((stamp, now));
        }
    }

    /// It is the time of a stamp now.
    pub(super) fn set(&mut self, stamp: Instant, now: Moment) {
        self.newest = Some((stamp, now));
    }

    /// The times of what follows may start again.
    pub(super) fn begin(&mut self) {
        self.newest = None;
    }

    /// The last tick was of the future: it is the time of a stamp before it.
    pub(super) fn go_back(&mut self, stamp: Instant, now: Moment) {
        self.set(stamp, now);
        self.back = Some(now);
    }

    /// A sample of a channel waits.
    pub(super) fn waits(&mut self, channel: usize) {
        self.channels[channel].waiting += 1;
    }

    /// A sample of a channel waits no longer.
    pub(super) fn waited(&mut self, channel: usize) {
        let waiting = &mut self.channels[channel].waiting;
        *waiting = waiting.saturating_sub(1);
    }

    pub(super) fn has_waiting(&self, channel: usize) -> bool {
        self.channels[channel].waiting > 0
    }

    /// What a stamp of a channel comes to that is too far ahead, where nobody trusts the host. `is_full`: no more can wait.
    pub(super) fn weigh(
        &mut self,
        (channel, stamp): (usize, Instant),
        now: Moment,
        is_full: bool,
    ) -> Verdict {
        let of = &self.channels[channel];
        let since = of.ahead.unwrap_or(now);
        let goes = of.pace.goes(3, now) && is_within(of.pace.time(now), stamp, self.future);
        if !goes && !is_full {
            return Verdict::Open;
        }
        let old = self.newest(now).unwrap_or(stamp);
        let Vote { score, opposed } = self.vote(now, |pace, time, future| {
            let is_there = is_within(time, stamp, future) && pace.goes(3, now);
            let is_old = is_within(time, old, future) && pace.goes(2, now);
            i32::from(is_there) - i32::from(is_old)
        });
        if !opposed || goes && score > 0 {
            return Verdict::Gap;
        }
        if !is_full && now - since < MINUTE && score + self.undecided(now) > 0 {
            return Verdict::Open;
        }
        match goes && score == 0 && self.is_nearer(stamp, old, now) {
            true => Verdict::Gap,
            false => Verdict::Wrong,
        }
    }

    /// Whether a stamp shows that the last tick was of the future, although it was stepped.
    pub(super) fn shows_future(
        &mut self,
        (channel, stamp): (usize, Instant),
        last: Instant,
        now: Moment,
    ) -> bool {
        let future = self.future;
        let is_near = last - stamp <= future;
        let is_again = self.back.is_some_and(|back| now - back < MINUTE);
        if is_near || is_again || self.is_of_others(last, now) {
            return false;
        }
        if let Some(host) = self.trusted(now) {
            return last - host > future && stamp - host <= future;
        }
        if !self.channels[channel].pace.lasts(now) {
            return false;
        }
        // Of those that are before it, it is the time of most.
        let Vote { score, .. } = self.vote(now, |pace, time, future| {
            let is_before = last - time > future && pace.goes(2, now);
            let is_there = is_within(time, stamp, future);
            i32::from(is_before && is_there) - i32::from(is_before && !is_there)
        });
        if score < 0 {
            return false;
        }
        // Whoever is not before it shows that it was not of the future.
        let Vote { score, .. } = self.vote(now, |pace, time, future| {
            let is_before = last - time > future;
            i32::from(is_before && pace.lasts(now)) - i32::from(!is_before && pace.goes(2, now))
        });
        score > 0 || score == 0 && self.is_nearer(stamp, last, now)
    }

    /// Whether the last tick is, or may be, the time of a source in order: a recording or simulation has a time of its own, and goes on.
    fn is_of_others(&self, last: Instant, now: Moment) -> bool {
        let has_begun = now - Moment::START >= MINUTE;
        let mut in_order = self.channels.iter().filter(|of| of.is_in_order);
        in_order.any(|of| {
            of.came
                .map_or(!has_begun, |came| last - came <= self.future)
        })
    }

    /// The source and channel whose clock is ahead of that of a channel, and by how much: the one that is farthest.
    pub(super) fn leader(&self, channel: usize, now: Moment) -> Option<(usize, usize, Duration)> {
        let own = self.channels.get(channel)?.pace;
        let others = self.channels.iter().enumerate();
        let is_accepted = |of: &Judged| of.ahead.is_none() && !of.is_in_order;
        let others = others.filter(|(_, of)| of.pace.goes(3, now) && is_accepted(of));
        let (leader, of) = others.max_by_key(|(_, of)| of.pace.offset())?;
        let ahead = of.pace.offset() - own.offset();
        (own.goes(1, now) && ahead > self.wait).then_some((of.source, leader, ahead))
    }

    /// The largest of stamp less arrival that channels of a source show that have gone with the clock for a minute; none unless all of
    /// them that give anything do.
    pub(super) fn lasting(&self, source: usize, now: Moment) -> Option<Duration> {
        let own = self.channels.iter().filter(|of| of.source == source);
        let mut own = own.filter(|of| of.pace.goes(1, now)).map(|of| &of.pace);
        own.try_fold(None, |most: Option<Duration>, of| {
            let offset = of.lasts(now).then(|| of.offset())?;
            Some(Some(most.map_or(offset, |most| most.max(offset))))
        })?
    }

    /// Each source decides as most of its channels do.
    fn vote(&mut self, now: Moment, side: impl Fn(&Pace, Instant, Duration) -> i32) -> Vote {
        self.votes.fill(0);
        let mut opposed = false;
        for of in self.channels.iter().filter(|of| !of.is_in_order) {
            let side = side(&of.pace, of.pace.time(now), self.future);
            opposed |= side < 0;
            if let Some(votes) = self.votes.get_mut(of.source) {
                *votes += side;
            }
        }
        let score = self.votes.iter().map(|votes| votes.signum()).sum();
        Vote { score, opposed }
    }

    /// How many sources have not shown what time it is for them, and may yet decide otherwise than in the last vote.
    fn undecided(&self, now: Moment) -> i32 {
        let is_open = |source: &usize| {
            let mut own = self.channels.iter().filter(|of| of.source == *source);
            let goes = |of: &Judged| of.is_in_order || of.pace.goes(3, now);
            self.votes[*source] == 0 && !own.any(goes)
        };
        (0..self.votes.len()).filter(is_open).count() as i32
    }

    /// Whether the host's unsure clock is nearer to one time than to another.
    fn is_nearer(&self, one: Instant, other: Instant, now: Moment) -> bool {
        let Some(host) = self.host(now) else {
            return false;
        };
        let off = |time: Instant| (time - host).max(host - time);
        off(one) < off(other) && off(one) <= UNSURE
    }
}

fn is_within(one: Instant, other: Instant, within: Duration) -> bool {
    one - other <= within && other - one <= within
}

struct Vote {
    /// Sources for, less those against.
    score: i32,
    /// Whether any channel is against.
    opposed: bool,
}
