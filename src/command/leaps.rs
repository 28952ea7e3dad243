//! Decides in which channels of a fit's data leaps are told of, and in what words; what a leap is, is decided elsewhere.

use std::cell::RefCell;

use athermal::core::compile::{Plan, SourceChannel};
use athermal::core::recording::{Event, Recording, RecordingError, Rows};
use athermal::diagnosis::leap::{Finder, Leaps, finders};
use athermal::diagnosis::of_truths;
use serde::Serialize;

use crate::figures::{instant, number};
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
    let channels = plan.sources.iter().zip(of_truths(plan)).zip(finders(plan));
    let looked = channels
        .enumerate()
        .filter_map(|(place, ((source, of_truth), finder))| {
            Some(Looked {
                place,
                source: source.clone(),
                of_truth,
                finder: finder?,
            })
        });
    looked.collect()
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
        leaps,
    } in all
    {
        let then = if *of_truth {
            "was it moved, or zeroed anew? That is learned as drift: begin another file there, or leave the rows of the \
             largest drifts out by `train.abs_truth`"
                .to_owned()
        } else {
            format!(
                "did the sensor fail? That is learned too: leave such samples out by a `range` in [signals.{signal}]; nine in \
                 ten are between {} and {}",
                number(leaps.usual.0),
                number(leaps.usual.1)
            )
        };
        terminal.warning(format_args!(
            "{channel} {leaps}, at {}: {then}",
            instant(leaps.first.at_s),
        ));
    }
}
