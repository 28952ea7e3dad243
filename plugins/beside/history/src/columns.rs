//! Which channels are kept: outputs and what is measured first, then all else that is known of each tick.

use athermal_core::compile::Plan;
use athermal_run::live::{TickView, mirrored};
use athermal_serve::shown::Shown;
use serde::{Deserialize, Serialize};

use crate::asked::Channel;

/// The channels of a graph that are kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Columns {
    pub(crate) names: Vec<String>,
    /// The channel that an output is, which is asked for by that name too.
    pub(crate) also: Vec<String>,
    pub(crate) units: Vec<String>,
    /// How long a value counts, in s.
    max_ages: Vec<Option<f64>>,
    #[serde(skip)]
    shown: Vec<Shown>,
}

impl Columns {
    /// Those of a plan, at most so many.
    pub(crate) fn of(plan: &Plan, most: usize) -> Self {
        let outputs = (0..plan.outputs.len()).map(Shown::Output);
        let is_output = |slot: &usize| plan.outputs.iter().any(|of| of.slot == *slot);
        let mirrored = mirrored(plan);
        // What is measured has the first slots.
        let channels = mirrored.iter().filter(|slot| !is_output(slot));
        let all = outputs.chain(channels.copied().map(Shown::Channel));
        let shown: Vec<_> = all.take(most).collect();
        Self {
            names: shown.iter().map(|of| of.name(plan).to_owned()).collect(),
            also: shown
                .iter()
                .map(|of| plan.channels[of.slot(plan)].name.clone())
                .collect(),
            units: shown.iter().map(|of| of.unit(plan)).collect(),
            max_ages: shown
                .iter()
                .map(|of| of.max_age(plan).map(|age| age.as_ns() as f64 / 1e9))
                .collect(),
            shown,
        }
    }

    pub(crate) fn width(&self) -> usize {
        self.names.len()
    }

    pub(crate) fn channel(&self, place: usize) -> Channel {
        Channel {
            channel: self.names[place].clone(),
            unit: self.units[place].clone(),
            max_age_s: self.max_ages[place],
        }
    }

    /// Where a channel stands.
    pub(crate) fn place(&self, name: &str) -> Option<usize> {
        let own = self.names.iter().position(|of| of == name);
        own.or_else(|| self.also.iter().position(|of| of == name))
    }

    /// Their values at a tick.
    pub(crate) fn values(&self, tick: &TickView<'_>) -> Box<[f64]> {
        self.shown.iter().map(|of| of.value(tick)).collect()
    }
}
