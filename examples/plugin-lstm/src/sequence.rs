//! Decides which values make up a sequence: how many steps, how far apart, and where they stand in a row of regressors.

use athermal_core::node::{Mistake, Regressor};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The most steps of a sequence.
pub(crate) const MOST_STEPS: usize = 240;

/// The sequence that the network reads: the present values of the features, and earlier ones at even distances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sequence {
    /// How many values of each channel, the present one among them; 1 to 240.
    #[schemars(range(min = 1, max = 240))]
    pub steps: usize,
    /// How far apart they are, such as `"150s"`.
    pub every: Duration,
}

impl Sequence {
    /// How far back each value is read, the present first.
    pub(crate) fn lags(&self) -> Vec<Duration> {
        let every = self.every.as_ns();
        let steps = i64::try_from(self.steps.min(MOST_STEPS)).unwrap_or(1);
        let lag = |step: i64| Duration::from_ns(step.saturating_mul(every));
        (0..steps).map(lag).collect()
    }

    /// What is out of range.
    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        let Self { steps, every } = self;
        if !(1..=MOST_STEPS).contains(steps) {
            let message = format!("`steps` is {steps} and must be from 1 to {MOST_STEPS}");
            mistakes.push(Mistake::at("sequence.steps", message));
        }
        if every.is_zero() || every.is_negative() {
            let message = format!("`every` is {every} and must be above 0");
            let mistake = Mistake::at("sequence.every", message);
            mistakes.push(mistake.help("the shortest window of the features is a good distance"));
        }
        mistakes
    }
}

/// Where the values of a sequence stand in a row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    /// How many channels each step has.
    pub(crate) channels: usize,
    /// The places of the values in a row: the oldest step first, all of its channels side by side.
    pub(crate) places: Vec<usize>,
    /// Their names.
    pub(crate) names: Vec<String>,
    /// The channels that lack a step, since it was too often absent.
    pub(crate) incomplete: Vec<String>,
}

impl Layout {
    /// Looks the values up by the names that the framework gives to lagged regressors.
    pub(crate) fn of(regressors: &[Regressor], lags: &[Duration]) -> Self {
        let name = |channel: &str, lag: &Duration| match lag.is_zero() {
            true => channel.to_owned(),
            false => format!("{channel} lag {lag}"),
        };
        let find = |name: &String| regressors.iter().position(|known| known.name == *name);
        let present = regressors.iter().filter(|r| r.lag.is_zero());
        let (complete, incomplete): (Vec<_>, Vec<_>) = present
            .map(|regressor| regressor.name.as_str())
            .partition(|channel| lags.iter().all(|lag| find(&name(channel, lag)).is_some()));
        let mut names = Vec::new();
        for lag in lags.iter().rev() {
            names.extend(complete.iter().map(|channel| name(channel, lag)));
        }
        Self {
            channels: complete.len(),
            places: names.iter().filter_map(find).collect(),
            names,
            incomplete: incomplete.into_iter().map(str::to_owned).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regressors(names: &[&str]) -> Vec<Regressor> {
        let regressor = |name: &&str| {
            let lag = name.split_once(" lag ").map_or("0s", |(_, lag)| lag);
            let written = serde_json::json!({ "name": name, "unit": "K", "lag": lag });
            serde_json::from_value(written).unwrap()
        };
        names.iter().map(regressor).collect()
    }

    #[test]
    fn the_oldest_step_comes_first_and_a_channel_that_lacks_one_is_left_out() {
        let sequence = Sequence {
            steps: 3,
            every: Duration::from_ns(60_000_000_000),
        };
        let row = regressors(&[
            "f.a",
            "f.b",
            "f.c",
            "f.a lag 1min",
            "f.c lag 1min",
            "f.a lag 2min",
            "f.b lag 2min",
            "f.c lag 2min",
        ]);
        let layout = Layout::of(&row, &sequence.lags());
        assert_eq!(layout.channels, 2);
        assert_eq!(layout.places, [5, 7, 3, 4, 0, 2]);
        assert_eq!(layout.names[..2], ["f.a lag 2min", "f.c lag 2min"]);
        assert_eq!(layout.incomplete, ["f.b"]);
    }
}
