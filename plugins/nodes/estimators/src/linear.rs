//! The exogenous estimator: drift from temperatures.

use athermal_core::node::{Estimator, InputPort, Mistake, Regressors, Trainer, TrainingSetup};

use crate::features::{FEATURES, TRUTH, present_features, too_many};
use crate::keys::keys;
use crate::regression::LinearTrainer;
use crate::selection::Selection;
use crate::solver::by_solver;

keys! {
    /// Linear regression of the truth on features.
    ///
    /// `ŷ(t + ahead) = b₀ + Σ b_j x_j(t)`. Features are standardised over all training rows (mean 0, population
    /// variance 1) before the solver sees them; the stated coefficients are for the features as they are. With a
    /// selection, features are chosen by cross-validation. `method = "forward"` adds them one by one, as in Mandelli,
    /// Dankwart and Napoli, section 3.3. `by = "sensor"` and `most = 2` show which two sensors are worth their price.
    /// The penalty of ridge can be chosen too, for all candidates before a selection and for those chosen after it:
    /// `alpha = { by = "cross_validation", folds = 5 }`.
    ///
    /// The port `std_dev` is the standard deviation of the truth about the prediction, in the unit of the truth (not
    /// with the solver `sgd`). It is `s √(1 + 1/n + (x − x̄)ᵀ (XᵀX + αI)⁻¹ (x − x̄))` on standardised features, `s²`
    /// the residual variance (Draper and Smith 1998, section 3.1). For ridge it is the posterior of Hastie,
    /// Tibshirani and Friedman (2009, section 3.4.1). It takes the data for more of the same: `conformal` measures
    /// how often an interval holds.
    ///
    /// The port `novelty` shows how far the features are outside of those of the fit, 1 at their edge, outside of
    /// which one row of a thousand lay. Larger values in a direction in which they varied in the fit hardly count, a
    /// new direction does. The standardised features are `z` of `p` columns, and the fit has `n` rows. `ZᵀZ / n` has
    /// the eigenvectors `v` and eigenvalues `λ`, of which those above 0.05 count, at most twelve. The novelty is the
    /// root of `(‖z‖² − Σ λ / (λ + 0.001) (vᵀz)²) / (‖z‖² + p)` over its 99.9 % quantile. A fit whose rows do not fit
    /// in memory has none.
    ///
    /// With the solver `sgd` and `learn = true` it goes on learning while it runs; the port `learning` then tells what became of the
    /// newest truth, in the numbers of `rls`.
    pub struct Linear {
        solver;
        /// How features are chosen; without it, all are used.
        #[serde(default)]
        pub selection: Option<Selection>,
    }
}

impl Estimator for Linear {
    fn inputs() -> &'static [InputPort] {
        const { &[FEATURES, TRUTH, InputPort::freeze()] }
    }

    fn regressors(&self) -> Regressors {
        present_features()
    }

    fn mistakes(&self) -> Vec<Mistake> {
        self.solver.mistakes()
    }

    by_solver!();

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        too_many(features, 1)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(LinearTrainer::new(
            setup,
            self.solver.clone(),
            self.selection,
        ))
    }
}

athermal_core::register!(Linear, Estimator, "linear");
