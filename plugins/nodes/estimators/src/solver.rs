//! Decides which ways there are to find coefficients, and what their parameters may be.

use std::fmt::Debug;

use athermal_core::node::{Learns, Mistake, PlannedRow};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::penalty::Penalty;
use crate::prior::{Prior, Wanted};

/// How coefficients are found, on standardised regressors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Solver {
    /// Minimises the sum of squares plus `alpha · ‖w‖²`, the intercept free (Hoerl and Kennard 1970). With a prior it
    /// minimises the sum of squares plus `λ (θ − μ)ᵀ Σ⁻¹ (θ − μ)` (Lindley and Smith 1972). Mean and covariance are
    /// those of the coefficients `θ` over the machines of a fleet, the constant among them, in the units of the
    /// regressors. Regressors that the prior does not know have the penalty `alpha`. Of fewer regressors than it knows,
    /// as after a selection, it has the mean and covariance of those.
    Ridge {
        /// The penalty, at least 0, or how it is chosen.
        #[serde(default = "one")]
        alpha: Penalty,
        /// The file of a prior, which `athermal fleet fit --pooled` writes. A relative path starts at this file; what is in it becomes a
        /// part of the graph and of its models.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Option<String>")]
        prior: Option<Prior>,
        /// How many times as much the prior counts as was best over the machines of the fleet, above 0, 1 by default. More is
        /// nearer to the mean.
        #[serde(default = "as_it_is", skip_serializing_if = "is_as_it_is")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        prior_weight: f64,
    },
    /// Minimises the sum of squares. Above a condition number of 1000 it works on the rows by singular values, where they
    /// are kept; above 10⁶ it says so.
    Ols {},
    /// Stochastic gradients with L2 penalty over the rows in their order (Bottou 2010): the step size of row `t` is
    /// `eta0 / t^power`. Coefficients start at 0 and the intercept at the mean of the truth; where others start it at 0, as
    /// scikit-learn does, fits after few epochs differ.
    Sgd {
        /// The penalty per row, at least 0.
        #[serde(default = "small_penalty")]
        #[schemars(range(min = 0.0))]
        alpha: f64,
        /// The first step size, above 0.
        #[serde(default = "first_step")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        eta0: f64,
        /// How fast the step size falls, 0 (not at all) to 1.
        #[serde(default = "quarter")]
        #[schemars(range(min = 0.0, max = 1.0))]
        power: f64,
        /// How often the rows are gone through, 1 to 10,000.
        #[serde(default = "five")]
        #[schemars(range(min = 1, max = 10_000))]
        epochs: usize,
    },
}

/// Where the prior stands.
pub(crate) const PRIOR: &str = "solver.prior";

fn as_it_is() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_as_it_is(weight: &f64) -> bool {
    *weight == as_it_is()
}

fn one() -> Penalty {
    Penalty::Fixed(1.0)
}

fn small_penalty() -> f64 {
    1e-4
}

fn first_step() -> f64 {
    0.01
}

fn quarter() -> f64 {
    0.25
}

fn five() -> usize {
    5
}

impl Default for Solver {
    fn default() -> Self {
        Self::ridge(one())
    }
}

impl Solver {
    /// Ridge without a prior.
    pub(crate) fn ridge(alpha: Penalty) -> Self {
        Self::Ridge {
            alpha,
            prior: None,
            prior_weight: as_it_is(),
        }
    }

    /// The prior, and how many times as much it counts as was best over machines.
    pub(crate) fn prior(&self) -> Option<(&Prior, f64)> {
        match self {
            Self::Ridge {
                prior: Some(prior),
                prior_weight,
                ..
            } => Some((prior, *prior_weight)),
            _ => None,
        }
    }

    /// What is wrong with the prior for the rows of an instance.
    pub(crate) fn mistakes_of_row(&self, row: &PlannedRow<'_>) -> Vec<Mistake> {
        let Some((prior, _)) = self.prior() else {
            return Vec::new();
        };
        let wanted = Wanted {
            instance: row.instance,
            regressors: row.regressors,
            unit: &row.truth.difference(),
            ahead: row.ahead,
        };
        let mistake = prior.meet(wanted).err();
        Vec::from_iter(mistake.map(|message| Mistake::at(PRIOR, message)))
    }

    /// A range of penalties that is none.
    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        match self {
            Self::Ridge { alpha, prior, .. } => {
                let prior = prior.iter().flat_map(|prior| prior.mistakes(PRIOR));
                alpha
                    .mistakes("solver.alpha")
                    .into_iter()
                    .chain(prior)
                    .collect()
            }
            Self::Ols {} | Self::Sgd { .. } => Vec::new(),
        }
    }

    /// Whether estimators go on learning with it.
    pub(crate) fn learns(&self) -> Learns {
        match self {
            Self::Sgd { .. } => Learns::OnRequest,
            Self::Ridge { .. } | Self::Ols {} => Learns::Never {
                help: Some("write `solver = { type = \"sgd\" }`, or use `type = \"rls\"`"),
            },
        }
    }

    /// Whether theory says how far predictions may be off.
    pub(crate) fn has_std_dev(&self) -> bool {
        match self {
            Self::Ridge { .. } | Self::Ols {} => true,
            Self::Sgd { .. } => false,
        }
    }

    /// What to tell of a comparison by least squares, where the fit is another.
    pub(crate) fn beside_least_squares(&self) -> Option<String> {
        let name = match self {
            Self::Ols {} => return None,
            Self::Ridge { .. } => "ridge",
            Self::Sgd { .. } => "sgd",
        };
        Some(format!(
            "orders are compared by ordinary least squares; the chosen one is fitted by `{name}`"
        ))
    }

    /// The penalty of the least squares that this stands for.
    pub(crate) fn penalty(&self) -> Penalty {
        match *self {
            Self::Ridge { alpha, .. } => alpha,
            Self::Ols {} | Self::Sgd { .. } => Penalty::Fixed(0.0),
        }
    }
}

/// What an estimator whose coefficients a solver finds says of itself.
macro_rules! by_solver {
    () => {
        fn learns(&self) -> athermal_core::node::Learns {
            self.solver.learns()
        }

        fn mistakes_of_row(
            &self,
            row: &athermal_core::node::PlannedRow<'_>,
        ) -> Vec<athermal_core::node::Mistake> {
            self.solver.mistakes_of_row(row)
        }

        fn needs_constants(&self) -> bool {
            self.solver.prior().is_some()
        }

        fn has_novelty(&self) -> bool {
            true
        }

        fn has_std_dev(&self) -> bool {
            self.solver.has_std_dev()
        }
    };
}
pub(crate) use by_solver;
