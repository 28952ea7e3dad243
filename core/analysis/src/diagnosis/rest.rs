//! How a sensor rests so that nodes that watch over sensors still find it alive.
//!
//! A watch finds a sensor stuck that repeats its value, or dead that has no noise. So where rest makes a node silent, the sensor
//! goes from one side of its mean to the other, sample by sample: by next to nothing, or else by its own noise.

use athermal_core::compile::Plan;
use athermal_core::engine::Engine;
use serde::Serialize;

use super::observation::SourceStatistics;
use super::{inputs, upstream};

/// How sensors rest, the stillest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rest {
    /// Always the mean.
    Still,
    /// The mean, but never the same value twice in a row.
    Alive,
    /// About the mean with the noise that the sensor had.
    Noisy,
}

impl Rest {
    pub(super) const ALL: [Self; 3] = [Self::Still, Self::Alive, Self::Noisy];

    /// By how much a sensor goes to either side of its mean. Values that alternate by `±a` have a noise of `√2 a`.
    pub(super) fn to_either_side(self, of: &SourceStatistics) -> f64 {
        /// Of the noise; and of the mean, so that rounding does not take it away.
        const NEXT_TO_NOTHING: f64 = 1e-6;
        const ROUNDING: f64 = 8.0 * f64::EPSILON;
        match self {
            Self::Still => 0.0,
            Self::Alive => (NEXT_TO_NOTHING * of.noise()).max(ROUNDING * of.mean.abs()),
            Self::Noisy => of.noise() / std::f64::consts::SQRT_2,
        }
    }
}

/// What could not be found of a sensor, since a node gave nothing when it was tried.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SilentNode {
    /// The sensor; none where nothing came even when all of them rested.
    pub sensor: Option<String>,
    /// The estimator whose answer is not known; none where it is what the sensor contributes.
    pub estimator: Option<String>,
    /// The first node that gave nothing.
    pub silent: String,
}

/// The first node on which a slot rests, itself included, that gives nothing.
pub(super) fn silent(plan: &Plan, engine: &Engine, slot: usize) -> String {
    let of_slot = upstream(plan, vec![slot], |node| inputs(plan, node));
    let mut all = (0..of_slot.len()).filter(|&slot| of_slot[slot]);
    let first = all.find(|&slot| engine.value(slot).is_nan());
    name(plan, first.unwrap_or(slot))
}

/// The node of a slot, or the measured channel that it is.
pub(super) fn name(plan: &Plan, slot: usize) -> String {
    match plan.channels[slot].node {
        Some(node) => plan.nodes[node].instance(),
        None => plan.channels[slot].name.clone(),
    }
}
