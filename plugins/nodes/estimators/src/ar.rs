//! The endogenous estimator: drift from past drift.

use athermal_core::node::{
    Estimator, InputPort, Mistake, Regressors, Trainer, TrainingSetup, TruthLags,
};

use crate::keys::keys;
use crate::lag_order::LagOrder;
use crate::lags::repeated;
use crate::order::Order;
use crate::regression::LinearTrainer;
use crate::solver::by_solver;

keys! {
    /// Autoregression: linear regression of the truth on its own past.
    ///
    /// `ŷ(t + ahead) = b₀ + Σ b_l y(t − L_l)` (Ljung 1999, section 4.2). Lags count back from the instant of the run, and the
    /// value taken is the last one at or before the instant asked for. A lag whose window overlaps the predicted one is an
    /// error. The answer changes with time alone, so the node runs at every tick.
    ///
    /// The port `std_dev` is the standard deviation of the truth about the prediction, as `linear` gives it, and so is `novelty`.
    /// With the solver `sgd` and `learn = true` it goes on learning while it runs; the port `learning` then tells what became of the
    /// newest truth, in the numbers of `rls`.
    pub struct Ar {
        lags solver;
        /// How many of the first lags are used, where that is left open, such as `{ by = "aicc", na = "1..6" }`; without it
        /// all are. Orders are compared by ordinary least squares, whatever the solver; it fits the chosen one.
        #[serde(default)]
        pub order: Option<Order>,
    }
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

    by_solver!();

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(LinearTrainer::new(setup, self.solver.clone(), None).with_order(self.lag_order()))
    }
}

athermal_core::register!(Ar, Estimator, "ar");
