//! The endogenous estimator: drift from past drift.

use athermal_core::node::{
    Estimator, InputPort, Learns, Mistake, PlannedRow, Regressors, Trainer, TrainingSetup,
    TruthLags,
};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::lag_order::LagOrder;
use crate::lags::repeated;
use crate::order::Order;
use crate::regression::LinearTrainer;
use crate::solver::Solver;

/// Autoregression: linear regression of the truth on its own past.
///
/// `ŷ(t + ahead) = b₀ + Σ b_l y(t − L_l)` (Ljung 1999, section 4.2). Lags count back from the instant of the run, and the
/// value taken is the last one at or before the instant asked for. A lag whose window overlaps the predicted one is an
/// error. The answer changes with time alone, so the node runs at every tick.
///
/// The port `std_dev` is the standard deviation of the truth about the prediction, as `linear` gives it, and so is `novelty`.
/// With the solver `sgd` and `learn = true` it goes on learning while it runs; the port `learning` then tells what became of the
/// newest truth, in the numbers of `rls`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ar {
    /// The lags of the truth, such as `["0s", "5min", "10min"]`.
    #[schemars(length(min = 1))]
    pub lags: Vec<Duration>,
    /// How coefficients are found.
    #[serde(default)]
    pub solver: Solver,
    /// How many of the first lags are used, where that is left open, such as `{ by = "aicc", na = "1..6" }`; without it
    /// all are. Orders are compared by ordinary least squares, whatever the solver; it fits the chosen one.
    #[serde(default)]
    pub order: Option<Order>,
}

impl Ar {
    fn lag_order(&self) -> Option<LagOrder> {
        self.order
            .map(|order| LagOrder::new(order, &self.lags, &[]))
    }
}

impl Estimator for Ar {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::truth("what is predicted, from its own past"),
                InputPort::freeze(),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            truth_lags: TruthLags::At(self.lags.clone()),
            every_tick: true,
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = self.solver.mistakes();
        mistakes.extend(repeated("lags", &self.lags));
        mistakes.extend(
            self.lag_order()
                .iter()
                .flat_map(|order| order.mistakes(false)),
        );
        mistakes
    }

    fn learns(&self) -> Learns {
        self.solver.learns()
    }

    fn mistakes_of_row(&self, row: &PlannedRow<'_>) -> Vec<Mistake> {
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

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(LinearTrainer::new(setup, self.solver.clone(), None).with_order(self.lag_order()))
    }
}

athermal_core::register!(Ar, Estimator, "ar");
