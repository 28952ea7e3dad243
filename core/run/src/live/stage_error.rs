//! Decides why a graph cannot take over from what runs, and how it is said.

use std::fmt;

use crate::compile::Plan;
use crate::document::TimeBase;
use crate::engine::{EngineError, RestoreError};
use crate::unit::Unit;

/// Why a graph cannot take over.
#[derive(Debug, Clone, PartialEq)]
pub enum StageError {
    /// It reads channels that no samples are given for.
    MissingChannels {
        /// The channels.
        channels: Vec<String>,
    },
    /// It reads time in another way.
    OtherTime {
        /// How what runs does.
        running: TimeBase,
        /// How the new graph does.
        new: TimeBase,
    },
    /// It gives an output in another unit, by which whoever reads the output would not go.
    OtherUnit {
        /// The output.
        output: String,
        /// In which unit what runs gives it.
        running: Unit,
        /// In which the new graph does.
        new: Unit,
    },
    /// What was fitted does not belong to it.
    Engine(EngineError),
    /// A node of it panicked while it was made ready.
    Panicked {
        /// Which, when, and what it says.
        text: String,
    },
    /// Nothing is staged.
    NothingStaged,
    /// There is no graph before, or it is no longer warm.
    NothingToTakeBack,
    /// Ticks were missed, so that what runs is not known here.
    NotMirrored,
    /// What runs has no control.
    NoControl,
    /// What runs has not been copied in time.
    NoCopy,
    /// A node does not take its own state back, so that the graph cannot be copied to the engine thread.
    NotCopied(RestoreError),
    /// Another graph has been committed and not yet taken over.
    Busy,
}

impl StageError {
    /// Why a plan cannot take over from another, as far as the two of them show.
    #[must_use]
    pub fn between(running: &Plan, new: &Plan) -> Option<Self> {
        if new.time != running.time {
            return Some(Self::OtherTime {
                running: running.time.clone(),
                new: new.time.clone(),
            });
        }
        let unit = |plan: &Plan, slot: usize| plan.channels[slot].channel.unit.clone();
        new.outputs.iter().find_map(|output| {
            let mut outputs = running.outputs.iter();
            let was = outputs.find(|was| was.name == output.name)?;
            let (was, is) = (unit(running, was.slot), unit(new, output.slot));
            (was != is).then(|| Self::OtherUnit {
                output: output.name.clone(),
                running: was,
                new: is,
            })
        })
    }
}

impl fmt::Display for StageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MissingChannels { channels } => write!(
                f,
                "the new graph reads {}, for which no samples are given: what is read is settled when the run begins, by the graphs and channels that it is given then",
                channels.join(", ")
            ),
            Self::OtherTime { running, new } => write!(
                f,
                "the new graph reads time from {new} and what runs from {running}: let both have the same [time]"
            ),
            Self::OtherUnit {
                output,
                running,
                new,
            } => write!(
                f,
                "the new graph gives the output `{output}` in {new} and what runs in {running}: give it in that, or another name"
            ),
            Self::Engine(error) => write!(f, "{error}"),
            Self::Panicked { text } => write!(f, "the new graph cannot be made ready: {text}"),
            Self::NothingStaged => write!(f, "no graph is staged: stage one first"),
            Self::NothingToTakeBack => write!(
                f,
                "there is no graph to go back to: none was replaced, or too long ago"
            ),
            Self::NotMirrored => write!(
                f,
                "ticks were missed, so that there is nothing to compare with: commit without a comparison"
            ),
            Self::NoControl => write!(
                f,
                "the graph that runs has no control, so that it cannot be replaced: a host makes it replaceable when it begins"
            ),
            Self::NoCopy => write!(
                f,
                "what runs could not be copied in time, since there is no pause between its ticks: try again"
            ),
            Self::NotCopied(error) => write!(f, "the new graph cannot be handed over: {error}"),
            Self::Busy => write!(
                f,
                "a committed graph has not been taken over yet: wait for the next tick"
            ),
        }
    }
}

impl std::error::Error for StageError {}
