//! The estimator whose states are found from the past.

use std::ops::RangeInclusive;

use athermal_core::diagnostic::counted;
use athermal_core::node::{
    Forms, InputPort, Mistake, Regressors, Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal_core::time::Duration;
use athermal_numerics::{
    NumericsError, Polynomials, Record, Samples, StateOrder, Subspace, Transfer,
};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::identified::{Found, IdentifiedTrainer, Identify, identified};
use crate::unsolved::unsolved;

/// The horizon, in steps, where it is not stated and rows allow it.
const USUAL: usize = 10;
/// A spread of truths below this share of their mean is rounding.
const ROUNDING: f64 = 1e-13;
/// Values of a past: more would take the memory of many rows.
const LARGEST_PAST: usize = 1000;

/// A state-space model by subspace identification: states that sum up what the past says of the future.
///
/// `x(t + 1) = A x(t) + B u(t) + K e(t)`, `y(t) = ȳ + C x(t) + D u(t) + e(t)` (Van Overschee and De Moor 1996,
/// chapter 4; Ljung 1999, section 10.6). Past truths and features explain a part of the next `horizon` truths, beside
/// the features meanwhile. That part is decomposed by singular values: as many as count, and chance does not explain
/// (Wachter 1980), are states. `A` and `C` follow by least squares from how those go on. `B`, `D`, the Kalman gain
/// `K` and the states in which records begin are then found such that one-step errors are least. That takes a few
/// steps by Gauss and Newton (Ljung 1999, section 10.2) from the gain that the covariances of what is left give. The
/// singular values are printed and kept. A mode that would grow is brought back to one that barely fades. `A` and `C`
/// are not searched for, so that a fit takes a few passes over the rows; `oe` or `armax` may come closer from there.
///
/// The fitted model keeps the difference equation that says the same, `A(q) y = Σ B_i(q) u_i + C(q) e`, and is
/// followed as a filter in it. A sample is what the run at `t` saw and the truth at `t + ahead`. Samples are a step
/// apart: `every`, by default the span of the truth, since truths whose windows overlap share their noise. Where
/// several come within a step, each begins a series of its own. All series are fitted together and followed side by
/// side. The time between two truths of a series counts as so many steps, rounded. Running, it takes each truth that
/// the embargo lets through. Those that are missing are estimated from the truths that follow too, as in a Kalman
/// filter (Jones 1980). Where truths or rows are missing in the fit, windows end and begin again. A segment begins
/// with its first truth, as if that and the features had always been what they are. So does what comes after more
/// steps without features than ten, or than the model reaches back where that is more. With `learn = false` it stays
/// at rest. The port `std_dev` is the standard deviation of the truth about its prediction, larger after truths that
/// are missing. Features that are missing are taken for the last ones, and what that adds to the error is not in it.
/// Since the answer changes with time alone, the node runs at every tick.
///
/// The port `novelty` is that of `linear`, of the features as the run saw them; the truths that are followed do not change it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateSpace {
    /// How many states, 1 to 20; or how that is found from the singular values, such as
    /// `{ by = "threshold", share = 0.25 }`.
    #[serde(default)]
    pub states: States,
    /// How many steps past and future have each, 2 to 100; as many as there are states where that is more. Without it ten, or
    /// fewer where that is too many for the rows, or where a past would have more than 1000 values. A past has one value of the
    /// truth and one of each feature at every step. Rows without a gap have to make twice as many windows of past and future, each
    /// with one a step later, as a past has values.
    #[serde(default)]
    #[schemars(range(min = 2, max = 100))]
    pub horizon: Option<usize>,
    /// How future truths are weighed before their singular values are found.
    #[serde(default)]
    pub weighting: Weighting,
    /// How long a step is; without it the span of the truth, or where that is nothing the typical time between truths.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Option<Duration>,
}

/// How many states a model has.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum States {
    /// So many.
    Given(#[schemars(range(min = 1, max = 20))] usize),
    /// As many as the singular values show.
    Chosen(By),
}

/// How the number of states is found from the singular values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "by", rename_all = "snake_case", deny_unknown_fields)]
pub enum By {
    /// Those before the one that falls most, in proportion to the one before it; half the horizon at most.
    Gap {},
    /// Those of at least a share of the largest.
    Threshold {
        /// The share, above 0 and below 1.
        #[serde(default = "quarter")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
        share: f64,
    },
}

/// How future truths are weighed before their singular values are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Not at all (Van Overschee and De Moor 1994).
    N4sid,
    /// Without what future features tell of the past (Verhaegen 1994).
    Moesp,
    /// The same, and in units of what is left: singular values are then canonical correlations (Larimore 1990).
    #[default]
    Cva,
}

fn quarter() -> f64 {
    0.25
}

impl Default for States {
    fn default() -> Self {
        Self::Chosen(By::Threshold { share: quarter() })
    }
}

impl<'de> Deserialize<'de> for States {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a whole number or a table such as `{ by = \"gap\" }`")
            .whole(Self::Given)
            .table(Self::Chosen)
            .read(deserializer)
    }
}

identified!(
    StateSpace,
    "state_space",
    [
        InputPort::held("features", "what the prediction is made of").or_none(),
        InputPort::truth("what is predicted")
    ]
);

impl StateSpace {
    /// It says itself what the kinds that are identified have in common.
    fn asked(&self) -> &Self {
        self
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: vec![Duration::ZERO],
            every_tick: true,
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        Vec::new()
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        let shortest = *self.horizons().start();
        let past = shortest.saturating_mul(features + 1);
        if past <= LARGEST_PAST {
            return Vec::new();
        }
        let shorter = match self.shortened(shortest) {
            None => "",
            Some(Shortened::ByStates) => {
                ", or ask for fewer `states`, which allow a shorter horizon"
            }
            Some(Shortened::ByHorizon) => ", or give a shorter `horizon`",
        };
        let message = format!(
            "{features} features over a horizon of {shortest} steps make a past of {past} values, and at most {LARGEST_PAST} are \
             fitted"
        );
        let mistake =
            Mistake::at("inputs.features", message).help(format!("name fewer features{shorter}"));
        vec![mistake]
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(IdentifiedTrainer::new(setup, self.clone()))
    }

    /// The horizons that may be taken: fewer steps than there are states do not show them.
    fn horizons(&self) -> RangeInclusive<usize> {
        let states = match self.states {
            States::Given(states) => states,
            States::Chosen(_) => 0,
        };
        let shortest = self.horizon.unwrap_or(2).max(states);
        shortest..=self.horizon.unwrap_or(USUAL).max(shortest)
    }

    /// What to ask for so that a horizon becomes shorter than this; none where there is no shorter one.
    fn shortened(&self, horizon: usize) -> Option<Shortened> {
        match self.states {
            _ if horizon <= 2 => None,
            States::Given(states) if states >= horizon => Some(Shortened::ByStates),
            States::Given(_) | States::Chosen(_) => Some(Shortened::ByHorizon),
        }
    }

    fn subspace(&self, horizon: usize, series: usize) -> Subspace {
        Subspace {
            horizon,
            weighting: match self.weighting {
                Weighting::N4sid => athermal_numerics::Weighting::N4sid,
                Weighting::Moesp => athermal_numerics::Weighting::Moesp,
                Weighting::Cva => athermal_numerics::Weighting::Cva,
            },
            order: match self.states {
                States::Given(states) => StateOrder::Given(states),
                States::Chosen(By::Gap {}) => StateOrder::LargestGap,
                States::Chosen(By::Threshold { share }) => StateOrder::Threshold(share),
            },
            alike: series,
            feedthrough: true,
            refined: true,
        }
    }
}

/// What makes a horizon shorter.
#[derive(Debug, Clone, Copy)]
enum Shortened {
    ByStates,
    ByHorizon,
}

impl Identify for StateSpace {
    fn every(&self) -> Option<Duration> {
        self.every
    }

    fn identify(
        &self,
        samples: &Samples,
        series: usize,
        report: &mut TrainingReport,
        _order: &mut dyn FnMut(usize, usize),
    ) -> Result<Found, TrainingError> {
        let outputs = || samples.records().flat_map(|record| record.outputs);
        let count = samples.count().max(1) as f64;
        let mean = outputs().sum::<f64>() / count;
        let squares: f64 = outputs().map(|y| (y - mean).powi(2)).sum();
        let scale = (squares / count).sqrt();
        if scale <= ROUNDING * mean.abs() {
            let truth = outputs().next().copied().unwrap_or(mean);
            return Err(TrainingError::Unsolvable {
                reason: format!(
                    "the truth is {truth} on all rows, so there are no states to find; it takes rows on which the truth moves"
                ),
            });
        }
        let scaled: Vec<Vec<f64>> = samples
            .records()
            .map(|record| record.outputs.iter().map(|y| (y - mean) / scale).collect())
            .collect();
        let records: Vec<Record<'_>> = samples
            .records()
            .zip(&scaled)
            .map(|(record, outputs)| Record {
                inputs: record.inputs,
                outputs,
            })
            .collect();
        let width = samples.width();
        let (shortest, longest) = self.horizons().into_inner();
        let longest = longest.min(LARGEST_PAST / (width + 1));
        let horizon = Subspace::longest(shortest..=longest, &records, width).unwrap_or(shortest);
        let found = self.subspace(horizon, series).identify(&records, width);
        let found = found.map_err(|error| match error {
            NumericsError::TooFewStretches { .. } => TrainingError::Unsolvable {
                reason: match self.shortened(horizon) {
                    None => format!("{error}; fewer features need fewer of them"),
                    Some(Shortened::ByStates) => format!(
                        "{error}; fewer `states` allow a shorter horizon, which needs fewer and shorter ones"
                    ),
                    Some(Shortened::ByHorizon) => {
                        format!("{error}; a shorter `horizon` needs fewer and shorter ones")
                    }
                },
            },
            NumericsError::NoStates => TrainingError::Unsolvable {
                reason: "what was before tells nothing of the truth beside what the features of the same time tell, so there \
                         are no states to find; `linear` fits what features do at once"
                    .to_owned(),
            },
            error => unsolved(error),
        })?;
        report.figure("states", found.model.order());
        report.figure("singular_values", &found.singular_values[..]);
        report.figure("stabilised", found.stabilised);
        report.figure("horizon", horizon);
        report.notes.push(note(&found));
        if horizon < USUAL && self.horizon.is_none() {
            let reason = if horizon < longest {
                "rows without a gap are too short for a longer one"
            } else {
                "with so many features a longer one makes too long a past"
            };
            report
                .notes
                .push(format!("a horizon of {horizon} steps: {reason}"));
        }
        let (squares, rows) = found.errors;
        let equation = found.model.difference_equation();
        let inputs = equation.b.iter().map(|b| Transfer {
            delay: 0,
            b: b.iter().map(|b| b * scale).collect(),
            f: Vec::new(),
        });
        let rows = rows.max(1);
        // As many as armax counts of the same orders: each coefficient, and the level.
        let of_inputs: usize = equation.b.iter().map(Vec::len).sum();
        let coefficients = equation.a.len() + of_inputs + equation.c.len() + 1;
        let left = rows.saturating_sub(coefficients).max(1);
        Ok(Found {
            beginnings: Vec::new(),
            mean_level: false,
            squared_errors: squares * scale * scale,
            rows,
            variance: squares * scale * scale / left as f64,
            errors: None,
            model: Polynomials {
                a: equation.a,
                inputs: inputs.collect(),
                c: equation.c,
                d: Vec::new(),
                differences: 0,
                level: mean,
            },
        })
    }
}

fn note(found: &athermal_numerics::Identification) -> String {
    let values: Vec<String> = found
        .singular_values
        .iter()
        .map(|value| format!("{value:.4}"))
        .collect();
    let states = found.model.order();
    let stabilised = if found.stabilised {
        "; a mode that grew was brought back"
    } else {
        ""
    };
    format!(
        "{}, from the singular values {}{stabilised}",
        counted(states, "state"),
        values.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_core::prng::Prng;

    fn asking(states: States, horizon: Option<usize>) -> StateSpace {
        StateSpace {
            states,
            horizon,
            weighting: Weighting::default(),
            every: None,
        }
    }

    #[test]
    fn too_long_a_past_names_what_makes_it_shorter_and_nothing_that_does_not() {
        let told = |states: States, horizon: Option<usize>, inputs: usize| {
            let asked = asking(states, horizon);
            assert!(asked.mistakes_for(1).is_empty());
            let mistakes = asked.mistakes_for(inputs);
            let help = mistakes[0].help.as_ref().unwrap();
            help.strip_prefix("name ").unwrap().to_owned()
        };
        assert_eq!(told(States::default(), None, 500), "fewer features");
        assert_eq!(told(States::Given(2), Some(2), 500), "fewer features");
        assert_eq!(
            told(States::Given(20), Some(10), 60),
            "fewer features, or ask for fewer `states`, which allow a shorter horizon"
        );
        let horizon = "fewer features, or give a shorter `horizon`";
        assert_eq!(told(States::Given(5), Some(10), 120), horizon);
        assert_eq!(told(States::default(), Some(100), 60), horizon);
    }

    /// What a fit with the defaults tells of so many stretches of 24 samples, of an output that follows the first of nine inputs.
    fn told(stretches: usize, horizon: Option<usize>) -> Result<Vec<String>, TrainingError> {
        let mut prng = Prng::stream(7, "state space");
        let mut random = || prng.between(-0.5, 0.5);
        let mut samples = Samples::new(9);
        for _ in 0..stretches {
            samples.segment();
            let mut output = 0.0;
            for _ in 0..24 {
                let inputs: [f64; 9] = std::array::from_fn(|_| random());
                output = 0.8 * output + inputs[0] + 0.1 * random();
                samples.push(inputs, output);
            }
        }
        let asked = asking(States::default(), horizon);
        let mut report = TrainingReport::default();
        asked.identify(&samples, 1, &mut report, &mut |_, _| {})?;
        Ok(report.notes)
    }

    #[test]
    fn the_horizon_is_shorter_where_rows_without_a_gap_are_and_the_report_says_so() {
        // Pairs of windows of 14 samples are 10 in each of 16 stretches: 7 steps of 10 values need 140, 8 steps 160 of 128.
        let notes = told(16, None).unwrap();
        assert!(
            notes
                .iter()
                .any(|note| note.starts_with("a horizon of 7 steps")),
            "{notes:?}"
        );
        let notes = told(60, None).unwrap();
        assert!(
            !notes.iter().any(|note| note.contains("horizon")),
            "{notes:?}"
        );
    }

    #[test]
    fn a_truth_without_states_is_told_with_its_cause_and_a_way_out() {
        let told = |truth: fn([f64; 2]) -> f64| {
            let mut prng = Prng::stream(7, "state space");
            let mut samples = Samples::new(2);
            samples.segment();
            // Each with its negative, so that inputs are about 0 as those of a fit are.
            for _ in 0..200 {
                let inputs = [prng.between(-0.5, 0.5), prng.between(-0.5, 0.5)];
                samples.push(inputs, truth(inputs));
                let inputs = inputs.map(|input| -input);
                samples.push(inputs, truth(inputs));
            }
            let asked = asking(States::default(), None);
            let found = asked.identify(&samples, 1, &mut TrainingReport::default(), &mut |_, _| {});
            found.unwrap_err().to_string()
        };
        assert_eq!(
            told(|[a, b]| 1.0 + a - b),
            "what was before tells nothing of the truth beside what the features of the same time tell, so there are no \
             states to find; `linear` fits what features do at once"
        );
        assert_eq!(
            told(|_| 20.1),
            "the truth is 20.1 on all rows, so there are no states to find; it takes rows on which the truth moves"
        );
    }

    #[test]
    fn a_horizon_that_is_stated_is_kept_and_one_that_no_row_allows_is_refused() {
        let stated = told(16, Some(10)).unwrap_err().to_string();
        assert!(stated.contains("a shorter `horizon` needs"), "{stated}");
        let told = told(1, None).unwrap_err().to_string();
        assert!(told.contains("fewer features need fewer"), "{told}");
    }
}
