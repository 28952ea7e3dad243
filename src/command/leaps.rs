//! Decides in which channels of a fit's data leaps are told of, and in what words; what a leap is, is decided elsewhere.

use std::cell::RefCell;

use athermal::core::compile::{Plan, SourceChannel};
use athermal::core::recording::{Event, Recording, RecordingError, Rows};
use athermal::core::unit::Unit;
use athermal::diagnosis::leap::{Finder, Leap, Leaps};
use athermal::diagnosis::of_truths;
use serde::Serialize;

use crate::figures::{instant, number, times_first};
use crate::terminal::Terminal;

/// Leaps of a channel.
#[derive(Debug, Serialize)]
pub struct Leaping {
    channel: String,
    #[serde(skip)]
    signal: String,
    /// Whether a truth is made of it, so that its leaps are learned as drift.
    of_truth: bool,
    #[serde(flatten)]
    leaps: Leaps,
}

/// A recording whose temperatures, and what truths are made of, are looked at when it is first read.
pub struct LeapWatch<'a> {
    recording: &'a dyn Recording,
    state: RefCell<State>,
}

enum State {
    Unread,
    Read(Vec<Looked>),
}

/// A channel that is looked at, by its place in a row.
struct Looked {
    place: usize,
    source: SourceChannel,
    of_truth: bool,
    finder: Finder,
}

impl<'a> LeapWatch<'a> {
    /// Watches over this recording.
    pub fn new(recording: &'a dyn Recording) -> Self {
        Self {
            recording,
            state: RefCell::new(State::Unread),
        }
    }

    /// What leaps, in the order of the plan.
    pub fn found(self) -> Vec<Leaping> {
        let State::Read(looked) = self.state.into_inner() else {
            return Vec::new();
        };
        let leaping = looked.into_iter().filter_map(|of| {
            let name = of.source.name;
            Some(Leaping {
                signal: name.split('.').next().unwrap_or(&name).to_owned(),
                channel: name,
                of_truth: of.of_truth,
                leaps: of.finder.found()?,
            })
        });
        leaping.collect()
    }
}

impl Recording for LeapWatch<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Rows + '_>, RecordingError> {
        let rows = self.recording.open(plan)?;
        let mut state = self.state.borrow_mut();
        if let State::Read(_) = *state {
            return Ok(rows);
        }
        *state = State::Read(looked(plan));
        Ok(Box::new(Looking {
            rows,
            state: &self.state,
        }))
    }
}

fn looked(plan: &Plan) -> Vec<Looked> {
    let channels = plan.sources.iter().zip(of_truths(plan)).enumerate();
    channels
        .filter(|(place, (_, of_truth))| {
            let unit = &plan.channels[*place].channel.unit;
            *of_truth || unit.measures_same(&Unit::kelvin())
        })
        .map(|(place, (source, of_truth))| Looked {
            place,
            source: source.clone(),
            of_truth,
            finder: Finder::default(),
        })
        .collect()
}

struct Looking<'a> {
    rows: Box<dyn Rows + 'a>,
    state: &'a RefCell<State>,
}

impl Rows for Looking<'_> {
    fn next(&mut self, values: &mut [f64]) -> Result<Option<Event>, RecordingError> {
        let event = self.rows.next(values)?;
        if let State::Read(looked) = &mut *self.state.borrow_mut() {
            for of in looked {
                match event {
                    Some(Event::Row(now)) if of.source.admits(values[of.place]) => {
                        of.finder.push(now.as_ns() as f64 / 1e9, values[of.place]);
                    }
                    Some(Event::Segment) => of.finder.interrupt(),
                    _ => {}
                }
            }
        }
        Ok(event)
    }
}

/// Tells of them.
pub fn tell(terminal: &Terminal, all: &[Leaping]) {
    for Leaping {
        channel,
        signal,
        of_truth,
        leaps: Leaps {
            count,
            first,
            usual,
        },
    } in all
    {
        let Leap { at_s, from, to } = *first;
        let times = times_first(*count);
        let then = if *of_truth {
            "was it moved, or zeroed anew? That is learned as drift: begin another file there, or leave the rows of the \
             largest drifts out by `train.abs_truth`"
                .to_owned()
        } else {
            format!(
                "did the sensor fail? That is learned too: leave such samples out by a `range` in [signals.{signal}]; nine in \
                 ten are between {} and {}",
                number(usual.0),
                number(usual.1)
            )
        };
        terminal.warning(format_args!(
            "{channel} leaps {times} from {} to {} within one sample, at {}: {then}",
            number(from),
            number(to),
            instant(at_s),
        ));
    }
}
