//! Statistics of the samples in trailing windows.

use std::collections::VecDeque;

use athermal_core::channel::{ABSENT, COLD, Channel};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach,
    Restored, State, Tick,
};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::slope::kernel::LIMIT;
use crate::sorted::Sorted;
use crate::summary::Summary;
use crate::windows::{Cold, Windows, half, over, three};

/// Statistics of the samples of each channel in trailing windows: their mean, and more by the name of a port.
///
/// Of the `n` samples in the window `mean = Σ x_i / n`, `std² = Σ (x_i − mean)² / (n − 1)`. Each sample with time in
/// `(t − T, t]` counts once, however far apart they lie. The ports are `mean` (the default), `std` (standard deviation
/// by n − 1), `min`, `max`, `range` (largest less smallest), `median` and `count`. So
/// `inputs.features = ["calm", "calm:range"]` reads the means and ranges of a node `calm`. Of temperatures `std` and
/// `range` are in the unit of their differences: K of Cel and K, `[degR]` of `[degF]`. Sums are never subtracted from,
/// so that a spike leaves no trace once it has left the window (Chan, Golub and LeVeque 1983).
///
/// A value exists, as that of a `slope` does, once the window reaches back no further than the channel's first value,
/// holds `min_samples` samples and these span `min_coverage` of it. It summarises the window and what the samples
/// summarise themselves. Where it is a truth, or made of what a truth is made of, the embargo and the search for
/// leaks go by that.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Moving {
    /// The lengths of the windows, such as `["150s", "5min"]`, or a dynamic range of them as of a `slope`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub windows: Windows,
    /// The fewest samples in a window, 1 or more.
    #[serde(default = "three")]
    #[schemars(range(min = 1))]
    pub min_samples: usize,
    /// The share of the window that its samples must span, 0 to below 1: `n` regular samples a window span `1 − 1/n` of it.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1.0))]
    pub min_coverage: f64,
    /// Whether a window that reaches back before the channel's first value has a value.
    #[serde(default)]
    pub cold: Cold,
}

/// The output ports, in order.
const PORTS: [&str; 7] = ["mean", "std", "min", "max", "range", "median", "count"];
const MEAN: usize = 0;
const STD: usize = 1;
const MIN: usize = 2;
const MAX: usize = 3;
const RANGE: usize = 4;
const MEDIAN: usize = 5;

impl Feature for Moving {
    fn inputs() -> &'static [InputPort] {
        const {
            &[InputPort::fresh(
                "signal",
                "what the statistics are taken of",
            )]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("mean", "the mean of the samples in the window"),
                PortSummary::new("std", "their standard deviation, by n − 1"),
                PortSummary::new("min", "the smallest"),
                PortSummary::new("max", "the largest"),
                PortSummary::new("range", "the largest less the smallest"),
                PortSummary::new("median", "the median"),
                PortSummary::new("count", "how many there are"),
            ]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        self.windows.mistakes()
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let windows = self.windows.lengths().map_err(|mistake| vec![mistake])?;
        let values = over(inputs.port("signal"), &windows);
        let port = |name| {
            let unit = |channel: &Channel| match name {
                "std" | "range" => channel.unit.difference(),
                "count" => athermal_core::unit::Unit::one(),
                _ => channel.unit.clone(),
            };
            let channel = |channel: &Channel| Channel {
                unit: unit(channel),
                ..channel.clone()
            };
            OutputPort {
                name,
                channels: values.iter().map(channel).collect(),
            }
        };
        Ok(PORTS.map(port).into())
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn memory(&self) -> Duration {
        let lengths = self.windows.lengths().unwrap_or_default();
        lengths.into_iter().max().unwrap_or(Duration::ZERO)
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        let windows = self.windows.lengths().unwrap_or_default();
        let is_wanted = |port: usize| wanted.get(port).copied().unwrap_or(false);
        let window = |length: &Duration| Window::new(*length, is_wanted(MEDIAN));
        let series = Series {
            first: None,
            samples: VecDeque::new(),
            dropped: 0,
            windows: windows.iter().map(window).collect(),
        };
        Box::new(Running {
            spec: self.clone(),
            wanted: std::array::from_fn(is_wanted),
            series: vec![series; inputs.port("signal").len()],
        })
    }
}

struct Running {
    spec: Moving,
    wanted: [bool; PORTS.len()],
    series: Vec<Series>,
}

/// The samples of one channel that some window holds.
#[derive(Debug, Clone)]
struct Series {
    /// When the segment's first sample came.
    first: Option<Instant>,
    samples: VecDeque<(Instant, f64)>,
    /// How many samples of the segment have been dropped at the front.
    dropped: u64,
    windows: Vec<Window>,
}

/// One window over the samples of a channel, numbered from the segment's first.
///
/// The older samples are summed up from each of them to the newest of them, the others as they come: a sample leaves by not
/// being in the sum that remains, and every sample is added twice at most.
#[derive(Debug, Clone)]
struct Window {
    length: Duration,
    /// The oldest sample within.
    head: u64,
    /// The first sample that is not among the older ones.
    split: u64,
    /// The summaries of the older samples from each to the newest of them, the newest first.
    older: Vec<Summary>,
    newer: Summary,
    /// All samples within, where somebody asks for their median.
    sorted: Option<Sorted>,
}

impl Window {
    fn new(length: Duration, sorts: bool) -> Self {
        Self {
            length,
            head: 0,
            split: 0,
            older: Vec::new(),
            newer: Summary::NONE,
            sorted: sorts.then(Sorted::default),
        }
    }

    fn take(&mut self, value: f64) {
        self.newer = self.newer.and(&Summary::one(value));
        if let Some(sorted) = &mut self.sorted {
            sorted.insert(value);
        }
    }

    /// Sums up the samples from the head to just before `split`.
    fn sum_older(&mut self, samples: &VecDeque<(Instant, f64)>, dropped: u64, split: u64) {
        let index = |number: u64| usize::try_from(number - dropped).unwrap_or(usize::MAX);
        let (head, end) = (index(self.head), index(split));
        self.older.clear();
        if self.older.capacity() < end - head {
            // Ticks need not come as regularly as they did.
            self.older.reserve(2 * (end - head));
        }
        let mut sum = Summary::NONE;
        for (_, value) in samples.range(head..end).rev() {
            sum = Summary::one(*value).and(&sum);
            self.older.push(sum);
        }
        self.split = split;
    }

    fn summary(&self) -> Summary {
        let older = self.older.last().unwrap_or(&Summary::NONE);
        older.and(&self.newer)
    }
}

impl Series {
    fn push(&mut self, now: Instant, value: f64) {
        self.first.get_or_insert(now);
        self.samples.push_back((now, value));
        let next = self.dropped + self.samples.len() as u64;
        for window in &mut self.windows {
            window.take(value);
            let limit = now - window.length;
            loop {
                let place = usize::try_from(window.head - self.dropped).unwrap_or(usize::MAX);
                let Some(&(at, left)) = self.samples.get(place).filter(|(at, _)| *at <= limit)
                else {
                    break;
                };
                debug_assert!(at < now);
                if window.older.is_empty() {
                    window.sum_older(&self.samples, self.dropped, next);
                    window.newer = Summary::NONE;
                }
                window.older.pop();
                window.head += 1;
                if let Some(sorted) = &mut window.sorted {
                    sorted.remove(left);
                }
            }
        }
        let needed = self.windows.iter().map(|window| window.head).min();
        while needed.is_some_and(|needed| self.dropped < needed) {
            self.samples.pop_front();
            self.dropped += 1;
        }
    }

    /// Why a window of so many samples has no value, if it has none.
    fn lacks(&self, window: &Window, count: f64, spec: &Moving, now: Instant) -> Option<f64> {
        let open = self.first.map_or(Duration::ZERO, |first| now - first);
        if spec.cold == Cold::Absent && open < window.length {
            return Some(COLD);
        }
        let head = usize::try_from(window.head - self.dropped).unwrap_or(usize::MAX);
        let span = self.samples.get(head).map(|&(oldest, _)| now - oldest);
        let enough = count >= spec.min_samples as f64
            && span.is_some_and(|span| span.secs() >= spec.min_coverage * window.length.secs());
        (!enough).then_some(ABSENT)
    }

    fn clear(&mut self) {
        self.first = None;
        self.samples.clear();
        self.dropped = 0;
        for window in &mut self.windows {
            (window.head, window.split) = (0, 0);
            window.older.clear();
            window.newer = Summary::NONE;
            if let Some(sorted) = &mut window.sorted {
                sorted.clear();
            }
        }
    }
}

impl Operator for Running {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let width = outputs.len() / PORTS.len();
        let mut at = 0;
        for (series, &value) in self.series.iter_mut().zip(tick.port(0)) {
            let first = at;
            at += series.windows.len();
            if value.is_nan() || value.abs() >= LIMIT {
                continue;
            }
            series.push(tick.now, value);
            for (i, window) in series.windows.iter().enumerate() {
                let summary = window.summary();
                let lacks = series.lacks(window, summary.count, &self.spec, tick.now);
                for port in (0..PORTS.len()).filter(|&port| self.wanted[port]) {
                    let value = lacks.unwrap_or_else(|| match port {
                        MEAN => summary.mean,
                        STD => summary.deviation().unwrap_or(ABSENT),
                        MIN => summary.min,
                        MAX => summary.max,
                        RANGE => summary.max - summary.min,
                        MEDIAN => window.sorted.as_ref().map_or(ABSENT, Sorted::median),
                        _ => summary.count,
                    });
                    outputs.set_stamped(port * width + first + i, value, tick.now);
                }
            }
        }
    }

    fn segment(&mut self) {
        self.series.iter_mut().for_each(Series::clear);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        let lengths = self.series.first().map_or_else(Vec::new, |series| {
            series.windows.iter().map(|window| window.length).collect()
        });
        let kept = |series: &Series| Kept {
            first: series.first,
            samples: series.samples.clone(),
            dropped: series.dropped,
            windows: series
                .windows
                .iter()
                .map(|window| (window.head, window.split))
                .collect(),
        };
        Some(Box::new(Windowed {
            lengths,
            series: self.series.iter().map(kept).collect(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let state = match state.known::<Windowed>() {
            Ok(state) => state,
            Err(cold) => return cold,
        };
        if state.series.len() != self.series.len() {
            return Restored::cold("the number of channels differs");
        }
        let own = self.series.iter().flat_map(|series| &series.windows);
        let given = self.series.iter().flat_map(|_| &state.lengths);
        let same = state.series.iter().all(Kept::is_whole)
            && own.map(|window| window.length).eq(given.copied());
        if !same {
            return Restored::cold("the windows differ");
        }
        for (series, kept) in self.series.iter_mut().zip(state.series) {
            series.clear();
            series.first = kept.first;
            series.samples = kept.samples;
            series.samples.reserve(series.samples.len().max(16));
            series.dropped = kept.dropped;
            for (window, (head, split)) in series.windows.iter_mut().zip(kept.windows) {
                window.head = head;
                window.sum_older(&series.samples, series.dropped, split);
                let place = |number: u64| usize::try_from(number - kept.dropped).unwrap_or(0);
                if let Some(sorted) = &mut window.sorted {
                    sorted.reserve(2 * series.samples.len());
                    let within = series.samples.range(place(head)..place(split));
                    within.for_each(|&(_, value)| sorted.insert(value));
                }
                for &(_, value) in series.samples.range(place(split)..) {
                    window.take(value);
                }
            }
        }
        Restored::Accepted
    }
}

/// The state of moving statistics: samples, and where the windows have cut them.
#[derive(Debug, Serialize, Deserialize)]
struct Windowed {
    lengths: Vec<Duration>,
    series: Vec<Kept>,
}

/// The state of one channel.
#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    first: Option<Instant>,
    samples: VecDeque<(Instant, f64)>,
    dropped: u64,
    /// The head and the split of each window.
    windows: Vec<(u64, u64)>,
}

impl Kept {
    /// Whether the windows lie within the samples.
    fn is_whole(&self) -> bool {
        let end = self.dropped + self.samples.len() as u64;
        self.windows
            .iter()
            .all(|&(head, split)| self.dropped <= head && head <= split && split <= end)
    }
}

athermal_core::state!(Windowed, "moving/1");
athermal_core::register!(Moving, Feature, "moving");
