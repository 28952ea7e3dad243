//! The estimator with both: drift from past drift and temperatures.

use athermal_core::node::{
    Estimator, InputPort, Mistake, Regressors, Trainer, TrainingSetup, TruthLags,
};

use crate::features::too_many;
use crate::keys::keys;
use crate::lag_order::LagOrder;
use crate::lags::repeated;
use crate::order::Order;
use crate::regression::LinearTrainer;
use crate::selection::Selection;
use crate::solver::by_solver;

keys! {
    /// Autoregression with exogenous inputs: linear regression of the truth on features and on its own past.
    ///
    /// `ŷ(t + ahead) = b₀ + Σ b_j x_j(t − F) + Σ a_l y(t − L_l)` (Ljung 1999, section 4.2). With a selection, lags are
    /// candidates like the features. The answer changes with time alone, so the node runs at every tick.
    ///
    /// The port `std_dev` is the standard deviation of the truth about the prediction, as `linear` gives it, and so is `novelty`.
    /// With the solver `sgd` and `learn = true` it goes on learning while it runs; the port `learning` then tells what became of the
    /// newest truth, in the numbers of `rls`.
    pub struct Arx {
        lags feature_lags solver;
        /// How features and lags are chosen; without it, all are used.
        #[serde(default)]
        pub selection: Option<Selection>,
        /// How many of the first lags are used, where that is left open, such as `{ by = "aicc", na = "1..6", nb = "1..3" }`; without it
        /// all are. Orders are compared by ordinary least squares, whatever the solver; it fits the chosen one.
        #[serde(default)]
        pub order: Option<Order>,
    }
}

impl Arx {
    fn lag_order(&self) -> Option<LagOrder> {
        self.order
            .map(|order| LagOrder::new(order, &self.lags, &self.feature_lags))
    }
}

impl Estimator for Arx {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what the prediction is made of beside the past"),
                InputPort::truth("what is predicted, from its own past and the features"),
                InputPort::freeze(),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: self.feature_lags.clone(),
            truth_lags: TruthLags::At(self.lags.clone()),
            every_tick: true,
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = self.solver.mistakes();
        mistakes.extend(repeated("lags", &self.lags));
        mistakes.extend(repeated("feature_lags", &self.feature_lags));
        let selects = self.selection.is_some();
        mistakes.extend(
            self.lag_order()
                .iter()
                .flat_map(|order| order.mistakes(selects)),
        );
        mistakes
    }

    by_solver!();

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        too_many(features, self.feature_lags.len())
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let trainer = LinearTrainer::new(setup, self.solver.clone(), self.selection);
        Box::new(trainer.with_order(self.lag_order()))
    }
}

athermal_core::register!(Arx, Estimator, "arx");
