//! Thinning: of the samples of an interval one is left. It has the stamp of the interval's end, so that it knows nothing of the future.

use std::collections::VecDeque;

use super::{Event, Samples, Source, SourceError};
use crate::channel::ABSENT;
use crate::compile::Plan;
use crate::time::{Duration, Instant};

/// What is left of the samples of an interval, and how long that is. Intervals end at whole multiples of their length, and hold their end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thinning {
    /// What is left.
    pub left: Left,
    /// The length of an interval.
    pub every: Duration,
}

/// What is left of the samples of an interval. What is no number does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Left {
    /// Their mean.
    Mean,
    /// The last one.
    Last,
    /// Their median.
    Median,
}

impl Left {
    /// Its name in a machine file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Last => "last",
            Self::Median => "median",
        }
    }
}

/// Thins the samples of some channels, by their stamps alone.
#[derive(Debug)]
pub struct Thinner {
    thinning: Thinning,
    /// An interval is over once there is a stamp so far behind its end.
    grace: Duration,
    /// By channel: nothing is taken up to this stamp.
    after: Vec<Instant>,
    newest: Instant,
    /// Nothing is taken up to the end of the last interval that was taken out.
    ended: Instant,
    open: VecDeque<Interval>,
}

#[derive(Debug)]
struct Interval {
    end: Instant,
    channels: Vec<Kept>,
    /// How many samples came before the first of it, and how many are in it.
    before: u64,
    samples: u64,
}

#[derive(Debug, Clone, Default)]
struct Kept {
    is_seen: bool,
    count: u64,
    /// The sum, or the last.
    value: f64,
    /// All of them, for a median.
    all: Vec<f64>,
}

impl Thinner {
    /// For so many channels. An interval is over once there is a stamp more than `grace` behind its end.
    #[must_use]
    pub fn new(thinning: Thinning, channels: usize, grace: Duration) -> Self {
        Self {
            thinning,
            grace,
            after: vec![Instant::MIN; channels],
            newest: Instant::MIN,
            ended: Instant::MIN,
            open: VecDeque::new(),
        }
    }

    /// Nothing of a channel is taken up to a stamp.
    pub fn begin_after(&mut self, channel: usize, stamp: Instant) {
        self.after[channel] = stamp;
        self.ended = self.ended.max(stamp);
    }

    /// The times of what follows may start again; what is open is to be taken out before.
    pub fn begin(&mut self) {
        self.after.fill(Instant::MIN);
        (self.newest, self.ended) = (Instant::MIN, Instant::MIN);
        self.open.clear();
    }

    /// The newest stamp that was taken; [`Instant::MIN`] before the first.
    #[must_use]
    pub fn newest(&self) -> Instant {
        self.newest
    }

    /// The end of the interval of a stamp.
    #[must_use]
    pub fn end_of(&self, stamp: Instant) -> Instant {
        let every = self.thinning.every.as_ns().max(1);
        let over = stamp.as_ns().rem_euclid(every);
        match over {
            0 => stamp,
            over => Instant::from_ns(stamp.as_ns().saturating_add(every - over)),
        }
    }

    /// Takes a sample, before which so many came; false where its interval has been taken out, or its channel has one as new.
    pub fn take(&mut self, channel: usize, stamp: Instant, value: f64, before: u64) -> bool {
        let end = self.end_of(stamp);
        if stamp <= self.after[channel] || end <= self.ended {
            return false;
        }
        self.after[channel] = stamp;
        self.newest = self.newest.max(stamp);
        let place = self.open.partition_point(|of| of.end < end);
        if self.open.get(place).is_none_or(|of| of.end != end) {
            let interval = Interval {
                end,
                channels: vec![Kept::default(); self.after.len()],
                before,
                samples: 0,
            };
            self.open.insert(place, interval);
        }
        let interval = &mut self.open[place];
        interval.samples += 1;
        interval.channels[channel].take(self.thinning.left, value);
        true
    }

    /// Whether the first interval is over.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let first = self.open.front();
        first.is_some_and(|of| of.end + self.grace < self.newest)
    }

    /// The end of the first interval that is open.
    #[must_use]
    pub fn first(&self) -> Option<Instant> {
        self.open.front().map(|of| of.end)
    }

    /// How many samples came before the first one that is in no interval that was taken out.
    #[must_use]
    pub fn before(&self) -> Option<u64> {
        self.open.iter().map(|of| of.before).min()
    }

    /// Takes the first interval out: its end, and how many samples are in it. `each` is given what is left of each channel that had any.
    pub fn pop(&mut self, mut each: impl FnMut(usize, f64)) -> Option<(Instant, u64)> {
        let interval = self.open.pop_front()?;
        self.ended = interval.end;
        for (nth, kept) in interval.channels.into_iter().enumerate() {
            if kept.is_seen {
                each(nth, kept.left(self.thinning.left));
            }
        }
        Some((interval.end, interval.samples))
    }
}

impl Kept {
    fn take(&mut self, left: Left, value: f64) {
        self.is_seen = true;
        if value.is_nan() {
            return;
        }
        self.count += 1;
        match left {
            Left::Mean => self.value += value,
            Left::Last => self.value = value,
            Left::Median => self.all.push(value),
        }
    }

    fn left(mut self, left: Left) -> f64 {
        if self.count == 0 {
            return ABSENT;
        }
        match left {
            Left::Mean => self.value / self.count as f64,
            Left::Last => self.value,
            Left::Median => {
                self.all.sort_unstable_by(f64::total_cmp);
                let middle = self.all.len() / 2;
                match self.all.len() % 2 {
                    0 => f64::midpoint(self.all[middle - 1], self.all[middle]),
                    _ => self.all[middle],
                }
            }
        }
    }
}

/// Channels that are thinned together, since they come from one source: by their names.
#[derive(Debug, Clone)]
pub struct ThinnedChannels {
    /// How.
    pub thinning: Thinning,
    /// Which.
    pub channels: Vec<String>,
}

/// A source of the channels of a plan, of which some are thinned. `write` gives the time of the end of an interval as the source would.
#[must_use]
pub fn thin<'a>(
    source: Box<dyn Source + 'a>,
    plan: &Plan,
    rules: &[ThinnedChannels],
    write: impl Fn(Instant) -> String + 'a,
) -> Box<dyn Source + 'a> {
    if rules.is_empty() {
        return source;
    }
    let rule = |of: &ThinnedChannels| {
        let place = |name: &String| plan.sources.iter().position(|of| of.name == *name);
        let places: Vec<_> = of.channels.iter().filter_map(place).collect();
        (
            Thinner::new(of.thinning, places.len(), Duration::ZERO),
            places,
        )
    };
    Box::new(Thinned {
        source,
        rules: rules.iter().map(rule).collect(),
        raw: Samples::default(),
        ready: VecDeque::new(),
        held: None,
        is_over: false,
        write: Box::new(write),
    })
}

struct Thinned<'a> {
    source: Box<dyn Source + 'a>,
    /// With the places of their channels in a row.
    rules: Vec<(Thinner, Vec<usize>)>,
    raw: Samples,
    ready: VecDeque<(Event, Samples)>,
    /// What is not thinned of a row at the end of an interval: they are one row.
    held: Option<(Instant, Samples)>,
    is_over: bool,
    write: Box<dyn Fn(Instant) -> String + 'a>,
}

impl Source for Thinned<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        loop {
            if let Some((event, row)) = self.ready.pop_front() {
                *samples = row;
                return Ok(Some(event));
            }
            if self.is_over {
                return Ok(None);
            }
            match self.source.next(&mut self.raw)? {
                Some(Event::Row(time)) => self.row(time),
                Some(Event::Segment) => {
                    self.end_before(None);
                    self.rules.iter_mut().for_each(|(of, _)| of.begin());
                    self.ready.push_back((Event::Segment, Samples::default()));
                }
                None => {
                    self.end_before(None);
                    self.is_over = true;
                }
            }
        }
    }
}

impl Thinned<'_> {
    fn row(&mut self, time: Instant) {
        self.end_before(Some(time));
        let mut rest = self.raw.clone();
        for (thinner, places) in &mut self.rules {
            let is_there = |place: &usize| !rest.values[*place].is_nan();
            // Time passes also where nothing is measured.
            let is_empty = rest.values.iter().all(|value| value.is_nan());
            for (nth, place) in places.iter().enumerate() {
                if is_there(place) || is_empty && nth == 0 {
                    thinner.take(nth, time, rest.values[*place], 0);
                }
            }
            places.iter().for_each(|place| rest.values[*place] = ABSENT);
        }
        if rest.values.iter().all(|value| value.is_nan()) {
            return;
        }
        // It may yet be given together with the interval that ends there.
        match self.rules.iter().any(|(of, _)| of.first() == Some(time)) {
            true => self.held = Some((time, rest)),
            false => self.ready.push_back((Event::Row(time), rest)),
        }
    }

    /// Gives the rows of all intervals that end before a time, or of all.
    fn end_before(&mut self, time: Option<Instant>) {
        loop {
            let ends = self.rules.iter().filter_map(|(of, _)| of.first());
            let Some(end) = ends.filter(|end| time.is_none_or(|time| *end < time)).min() else {
                return;
            };
            let mut row = match self.held.take_if(|(at, _)| *at == end) {
                Some((_, row)) => row,
                None => Samples {
                    time_text: (self.write)(end),
                    values: vec![ABSENT; self.raw.values.len()],
                },
            };
            for (thinner, places) in &mut self.rules {
                if thinner.first() == Some(end) {
                    thinner.pop(|nth, value| row.values[places[nth]] = value);
                }
            }
            self.ready.push_back((Event::Row(end), row));
        }
    }
}
