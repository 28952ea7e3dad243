//! The keys of an estimator's table that the framework reads itself, and what they may be.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::node::{Forms, Mistake};
use crate::quantity::Quantity;
use crate::time::Duration;

/// What the framework reads of an estimator's table.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EstimatorKeys {
    /// How far ahead of now the truth is predicted: `"5min"` is a forecast, `"0s"` a virtual sensor.
    pub(crate) ahead: Option<Duration>,
    /// Which truths it is fitted on.
    pub(crate) train: Train,
    /// Whether it goes on learning while it runs: `true`, or a table of limits.
    pub(crate) learn: Option<Learn>,
    /// What becomes of predictions from regressors outside of those of the fit, where the port `novelty` is above 1.
    pub(crate) outside: Option<Outside>,
}

/// What becomes of predictions from regressors outside of those of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outside {
    /// Their distance from what is predicted in the middle of the rows of the fit is divided by the novelty, which is the default. The standard deviation `σ` becomes `√((novelty · σ)² + d²)`, `d` being how far the prediction has moved.
    Shrink,
    /// There is none.
    Absent,
    /// They stay as they are.
    Pass,
}

impl Outside {
    /// As graph files have it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Shrink => "shrink",
            Self::Absent => "absent",
            Self::Pass => "pass",
        }
    }
}

/// Which rows an estimator is trained on.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Train {
    /// Those whose absolute value is within these limits.
    pub(crate) abs_truth: Limits,
}

/// Limits of an absolute value.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Limits {
    /// Only those below.
    pub(crate) below: Option<Quantity>,
    /// Only those at or above.
    pub(crate) above: Option<Quantity>,
}

/// The key `learn` of an estimator.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema)]
#[schemars(untagged)]
pub(crate) enum Learn {
    /// Whether it goes on learning while it runs.
    Switch(bool),
    /// It does, within these limits.
    Within(LearnLimits),
}

/// What is not learned from.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct LearnLimits {
    /// Truths that miss their prediction by more than this multiple of the recent root mean square error, above 1; what the fit
    /// was off by stands for the first, but for kinds that go on from the last truths, such as `kalman`. Errors of a kind that
    /// states how unsure it is are in units of its `std_dev`, so that after a gap it may be off by more. A truth that is left
    /// out counts as twice that error; when all of four windows of the truth and at least 20 have been, what was before is forgotten, so
    /// that a change that stays is learned.
    #[schemars(extend("exclusiveMinimum" = 1.0))]
    pub(crate) outliers: f64,
    /// Rows of which a regressor lies farther outside the range of the fit than this multiple of its width; 1 where it is not
    /// given. The level of `kalman` follows them all the same, and its coefficients stay. Not for kinds that follow a state
    /// alone, such as `armax`, which is followed whatever the regressors are.
    #[schemars(with = "f64", range(min = 0.0))]
    pub(crate) margin: Option<f64>,
}

impl Default for LearnLimits {
    fn default() -> Self {
        Self {
            outliers: 6.0,
            margin: None,
        }
    }
}

impl<'de> Deserialize<'de> for Learn {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("true, false or a table of limits")
            .truth(Self::Switch)
            .table(Self::Within)
            .read(deserializer)
    }
}

impl LearnLimits {
    /// What cannot be meant of a kind; `ranged` where its fit keeps the range of its regressors.
    pub(super) fn mistakes(self, ranged: bool) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        let Self { outliers, margin } = self;
        if outliers.is_nan() || outliers <= 1.0 {
            let message = format!("`outliers` is {outliers} and must be above 1");
            let mistake = Mistake::at("learn.outliers", message);
            mistakes.push(mistake.help("4 to 10 keeps spikes out; inf lets everything in"));
        }
        if let Some(margin) = margin
            && (margin.is_nan() || margin < 0.0)
        {
            let message = format!("`margin` is {margin} and must be 0 or more");
            let mistake = Mistake::at("learn.margin", message);
            mistakes.push(mistake.help("0 is the range of the fit itself, inf any"));
        }
        if margin.is_some() && !ranged {
            let message =
                "its fit keeps no range of the regressors, so that `margin` would do nothing";
            let mistake = Mistake::at("learn.margin", message);
            mistakes
                .push(mistake.help("leave `margin` out: its state is followed wherever they are"));
        }
        mistakes
    }
}
