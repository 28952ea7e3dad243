//! What of a tick is shown to whoever looks on, by name: outputs, and channels of the graph.

use std::sync::Arc;

use athermal_run::live::{Slots as _, TickView};

use crate::compile::Plan;
use crate::deployment::problem::NotShown;
use crate::diagnostic::{Diagnostics, Names, Place};
use crate::document::Value;
use crate::time::{Duration, Instant};

/// A value of each tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// An output, by its number.
    Output(usize),
    /// A channel, by its slot.
    Channel(usize),
}

impl Shown {
    /// The value of this name; an output before a channel.
    #[must_use]
    pub fn named(plan: &Plan, name: &str) -> Option<Self> {
        let output = plan.outputs.iter().position(|of| of.name == name);
        let channel = || plan.channels.iter().position(|of| of.name == name);
        output
            .map(Self::Output)
            .or_else(|| channel().map(Self::Channel))
    }

    /// All values of a name, each with the rest of its own: of `now` those of `now.X` and `now.Z` with `X` and `Z`, of a whole name that
    /// one with its [`member`].
    #[must_use]
    pub fn all_named(plan: &Plan, name: &str) -> Vec<(String, Self)> {
        if let Some(one) = Self::named(plan, name) {
            return vec![(member(name).to_owned(), one)];
        }
        let rest = |of: &str| Some(of.strip_prefix(name)?.strip_prefix('.')?.to_owned());
        let outputs = plan.outputs.iter().map(|of| &of.name).enumerate();
        let outputs: Vec<_> = outputs
            .filter_map(|(nth, of)| Some((rest(of)?, Self::Output(nth))))
            .collect();
        if !outputs.is_empty() {
            return outputs;
        }
        let channels = plan.channels.iter().map(|of| &of.name).enumerate();
        channels
            .filter_map(|(slot, of)| Some((rest(of)?, Self::Channel(slot))))
            .collect()
    }

    /// The same where a machine file names it; that there is none is reported.
    pub fn declared(
        plan: &Plan,
        (name, place): (&str, Place),
        section: &str,
        diagnostics: &mut Diagnostics,
    ) -> Vec<(String, Self)> {
        let all = Self::all_named(plan, name);
        if all.is_empty() {
            let outputs = plan.outputs.iter().map(|of| of.name.clone());
            let channels = plan.channels.iter().map(|of| of.name.clone());
            let problem = NotShown {
                section: section.to_owned(),
                name: name.to_owned(),
                known: Arc::new(outputs.chain(channels).collect::<Names>()),
            };
            diagnostics.report(place, problem);
        }
        all
    }

    /// The name under which it is asked for.
    #[must_use]
    pub fn name(self, plan: &Plan) -> &str {
        match self {
            Self::Output(nth) => &plan.outputs[nth].name,
            Self::Channel(slot) => &plan.channels[slot].name,
        }
    }

    /// Its slot.
    #[must_use]
    pub fn slot(self, plan: &Plan) -> usize {
        match self {
            Self::Output(nth) => plan.outputs[nth].slot,
            Self::Channel(slot) => slot,
        }
    }

    /// The unit of its values.
    #[must_use]
    pub fn unit(self, plan: &Plan) -> String {
        plan.channels[self.slot(plan)]
            .channel
            .unit
            .text()
            .to_owned()
    }

    /// How long a value counts without a newer one, where that is known.
    #[must_use]
    pub fn max_age(self, plan: &Plan) -> Option<Duration> {
        plan.channels[self.slot(plan)].channel.default_max_age()
    }

    /// Its value at a tick; NaN where it has none, or where that takes a copy of what runs and there is none.
    #[must_use]
    pub fn value(self, tick: &TickView<'_>) -> f64 {
        match self {
            Self::Output(nth) => tick.outputs[nth],
            Self::Channel(slot) => tick.value(slot),
        }
    }

    /// Whether its value is known without a copy of what runs.
    #[must_use]
    pub fn is_mirrored(self, tick: &TickView<'_>) -> bool {
        match self {
            Self::Output(_) => true,
            Self::Channel(slot) => tick.is_mirrored(slot),
        }
    }
}

/// The last value that there was, for as long as it counts.
#[derive(Debug, Clone, Copy)]
pub struct HeldValue {
    value: f64,
    at: Instant,
    max_age: Duration,
}

impl HeldValue {
    /// None so far, of values that count so long.
    #[must_use]
    pub fn new(max_age: Duration) -> Self {
        Self {
            value: f64::NAN,
            at: Instant::MIN,
            max_age,
        }
    }

    /// Takes the value of a tick, NaN where there is no new one: what counts then.
    pub fn take(&mut self, value: f64, at: Instant) -> f64 {
        // What lies before a new segment has no age in it.
        let is_over = at < self.at || self.at > Instant::MIN && at - self.at > self.max_age;
        if !value.is_nan() || is_over {
            (self.value, self.at) = (value, at);
        }
        self.value
    }
}

/// What of the name of a channel says which of several it is: `Z` of `now.Z` and of `now:std_dev.Z@5min`, nothing of `now`.
#[must_use]
pub fn member(name: &str) -> &str {
    let rest = name.split_once('.').map_or("", |(_, rest)| rest);
    rest.split('@').next().unwrap_or(rest)
}

/// Where a key of a section stands, or the section.
#[must_use]
pub fn place_of(section: &Value, key: &str) -> Place {
    let entry = section.as_table().and_then(|of| of.get(key));
    entry.map_or(section.place, |of| of.place)
}
