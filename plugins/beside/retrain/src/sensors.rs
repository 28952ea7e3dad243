//! Whether the data of a fit are those of whole sensors. A fit on a broken one would be wrong for as long as it runs.

use std::fmt;

use athermal_core::compile::Plan;
use athermal_core::engine::SampleRange;
use athermal_core::time::{Duration, Instant};
use athermal_run::recording::{Event, Table};

/// A sensor that is broken for a larger part of the data than this.
const PART: f64 = 0.2;
/// Farther outside of the range of the last fit than so many of its widths no whole sensor lies: a machine may have worked in a
/// narrower range then, and a fit on a wider one is what is wanted.
const WIDTHS: f64 = 5.0;
/// So many samples of one value are no standstill yet.
const FEW: u64 = 20;

/// Why the data of a channel are not to be fitted on.
#[derive(Debug, Clone, PartialEq)]
pub struct Broken {
    /// The channel.
    pub channel: String,
    /// What it does.
    pub fault: Fault,
}

/// What a broken sensor does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// It gives nothing for so long.
    Silent(Duration),
    /// It gives the same value for so long.
    Still {
        /// How long.
        length: Duration,
        /// The value, in the unit of the signal.
        value: f64,
    },
    /// It lies farther outside of the range of the last fit than five times that range.
    Beyond {
        /// Its lowest and highest value, in the unit of the signal.
        range: (f64, f64),
        /// Those of the last fit.
        fitted: (f64, f64),
    },
}

/// What is known of a channel so far.
struct Course {
    first: Option<Instant>,
    last: Option<Instant>,
    /// The last value, since when, and how often.
    same: Option<(f64, Instant, u64)>,
    silent: Duration,
    still: (Duration, f64),
    range: (f64, f64),
}

/// The sensors of a plan that are broken in its data. `fitted` are the ranges of the last fit.
#[must_use]
pub fn broken(plan: &Plan, data: &Table, fitted: &[SampleRange]) -> Vec<Broken> {
    let mut rows = data.events().iter().filter_map(|(event, row)| match event {
        Event::Row(at) => Some((*at, row)),
        Event::Segment => None,
    });
    let Some((begin, first)) = rows.next() else {
        return Vec::new();
    };
    let mut courses: Vec<_> = plan.sources.iter().map(|_| Course::new()).collect();
    let mut end = begin;
    for (at, row) in std::iter::once((begin, first)).chain(rows) {
        // Times that start again are another stretch of the same data.
        end = end.max(at);
        for ((course, source), &value) in courses.iter_mut().zip(&plan.sources).zip(row) {
            // What is out of the range of its signal is no sample, as where the graph runs.
            if source.admits(value) {
                course.take(at, value);
            }
        }
    }
    let whole = end - begin;
    let long = Duration::from_ns((whole.as_ns() as f64 * PART) as i64);
    let channels = plan.sources.iter().zip(&mut courses);
    let broken = channels
        .filter(|(source, _)| !source.rests())
        .filter_map(|(source, course)| {
            let known = fitted.iter().find(|of| of.channel == source.name);
            let fault = course.fault(begin, end, long, known)?;
            let channel = source.name.clone();
            Some(Broken { channel, fault })
        });
    broken.collect()
}

impl Course {
    fn new() -> Self {
        Self {
            first: None,
            last: None,
            same: None,
            silent: Duration::ZERO,
            still: (Duration::ZERO, f64::NAN),
            range: (f64::INFINITY, f64::NEG_INFINITY),
        }
    }

    fn take(&mut self, at: Instant, value: f64) {
        self.first = self.first.or(Some(at));
        if let Some(last) = self.last {
            self.silent = self.silent.max(at - last);
        }
        self.last = Some(at);
        self.range = (self.range.0.min(value), self.range.1.max(value));
        match &mut self.same {
            Some((same, since, count)) if *same == value => {
                *count += 1;
                let length = at - *since;
                if *count > FEW && length > self.still.0 {
                    self.still = (length, value);
                }
            }
            same => *same = Some((value, at, 1)),
        }
    }

    fn fault(
        &mut self,
        begin: Instant,
        end: Instant,
        long: Duration,
        fitted: Option<&SampleRange>,
    ) -> Option<Fault> {
        let (first, last) = (self.first.unwrap_or(end), self.last.unwrap_or(begin));
        let silent = self.silent.max(first - begin).max(end - last);
        if silent > long {
            return Some(Fault::Silent(silent));
        }
        let (length, value) = self.still;
        if length > long {
            return Some(Fault::Still { length, value });
        }
        let fitted = fitted.filter(|of| of.exceeded_by(self.range.0, self.range.1) > WIDTHS)?;
        Some(Fault::Beyond {
            range: self.range,
            fitted: (fitted.lowest, fitted.highest),
        })
    }
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.channel)?;
        match self.fault {
            Fault::Silent(length) => write!(f, "gave nothing for {length}"),
            Fault::Still { length, value } => write!(f, "stood still at {value} for {length}"),
            Fault::Beyond { range, fitted } => write!(
                f,
                "lies between {} and {}, far outside of the last fit's {} to {}",
                range.0, range.1, fitted.0, fitted.1
            ),
        }
    }
}
