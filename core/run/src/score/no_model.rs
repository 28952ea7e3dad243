//! What no model predicts of a truth: nothing of a rate, and of a level, whose zero is arbitrary, its mean over the fit.

use std::collections::BTreeMap;

use crate::compile::Plan;
use crate::unit::Unit;

/// The mean of each truth that is a level, over the data of a fit.
pub type Levels = BTreeMap<String, f64>;

/// What no model predicts of a truth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum NoModel {
    /// Zero: the truth is a rate or a change.
    #[default]
    Zero,
    /// The mean of a level over the fit.
    MeanOfFit(f64),
    /// The mean of a level over the instants that are scored, where no fit knows one.
    Mean,
}

impl NoModel {
    /// What is predicted of a slot without a model.
    #[must_use]
    pub fn of(plan: &Plan, slot: usize, levels: &Levels) -> Self {
        match levels.get(&plan.channels[slot].name) {
            _ if !is_level(plan, slot) => Self::Zero,
            Some(mean) => Self::MeanOfFit(*mean),
            None => Self::Mean,
        }
    }

    /// Its value, for truths that are scored together.
    #[must_use]
    pub fn value(self, truths: impl Iterator<Item = f64>) -> f64 {
        match self {
            Self::Zero => 0.0,
            Self::MeanOfFit(mean) => mean,
            Self::Mean => super::table::mean(truths).unwrap_or(0.0),
        }
    }

    /// What it is, to stand behind its name; nothing of zero.
    #[must_use]
    pub fn remark(self) -> &'static str {
        match self {
            Self::Zero => "",
            Self::MeanOfFit(_) => " (the mean of the fit)",
            Self::Mean => " (the mean)",
        }
    }
}

/// Quantities whose values are levels; others, such as speeds and flows, have a zero of their own.
const OF_LEVELS: [&str; 12] = [
    "m", "rad", "1", "K", "V", "A", "Ohm", "g", "Pa", "N", "m/s2", "F",
];

/// Whether a channel is a level with an arbitrary zero, such as a position: measured as one, or made of such by a node that keeps it.
#[must_use]
pub fn is_level(plan: &Plan, slot: usize) -> bool {
    let channel = &plan.channels[slot];
    let unit = &channel.channel.unit;
    if unit.is_temperature_point() {
        return true;
    }
    let same = |text: &&str| Unit::parse(text).is_ok_and(|of| unit.measures_same(&of));
    let is_frequency = unit.text().ends_with("Hz");
    if !(is_frequency || OF_LEVELS.iter().any(same)) {
        return false;
    }
    let Some(node) = channel.node else {
        return true;
    };
    let node = &plan.nodes[node];
    let mut entries = node.role.inputs().flat_map(|of| &plan.gathers[of].entries);
    !(node.kind.facts)().is_change && entries.any(|entry| is_level(plan, entry.slot))
}

/// Sums of the truths that are levels, as an engine is stepped over the data of a fit.
#[derive(Debug, Default)]
pub(crate) struct Means(Vec<(usize, f64, u64)>);

impl Means {
    pub(crate) fn new(plan: &Plan) -> Self {
        let truths = plan.channels.iter().filter_map(|of| of.predicts);
        let mut truths: Vec<usize> = truths.filter(|&slot| is_level(plan, slot)).collect();
        truths.sort_unstable();
        truths.dedup();
        Self(truths.into_iter().map(|slot| (slot, 0.0, 0)).collect())
    }

    pub(crate) fn look(&mut self, value: impl Fn(usize) -> f64) {
        for (slot, sum, count) in &mut self.0 {
            let value = value(*slot);
            if !value.is_nan() {
                *sum += value;
                *count += 1;
            }
        }
    }

    /// Of each the sum of its values, and how many there are.
    pub(crate) fn sums(&self) -> Vec<(f64, u64)> {
        self.0
            .iter()
            .map(|(_, sum, count)| (*sum, *count))
            .collect()
    }

    /// Takes values that were summed elsewhere.
    pub(crate) fn add(&mut self, sums: &[(f64, u64)]) {
        for ((_, sum, count), (more, of)) in self.0.iter_mut().zip(sums) {
            *sum += more;
            *count += of;
        }
    }

    pub(crate) fn levels(&self, plan: &Plan) -> Levels {
        let known = self.0.iter().filter(|(_, _, count)| *count > 0);
        let mean = |(slot, sum, count): &(usize, f64, u64)| {
            (plan.channels[*slot].name.clone(), sum / *count as f64)
        };
        known.map(mean).collect()
    }
}
