//! Least squares for drift models: Gram blocks, ridge, selection by cross-validation, recursions, correlations; the Kalman
//! filter of structural models; transfer functions by the prediction error; changes of a mean.
//!
//! Decides how rows of regressors become statistics and how statistics become coefficients. Does not decide where rows
//! come from, what a regressor is called or what its unit is. Everything runs on the calling thread, and the same rows
//! in the same order give the same bits.
//!
//! ```
//! use athermal_numerics::{GramBlocks, LeastSquares, Standardization};
//!
//! let mut training = GramBlocks::new(2);
//! for i in 0..100 {
//!     let t = f64::from(i);
//!     let x = [t, (0.1 * t).sin()];
//!     training.push(&x, 3.0 * x[0] - 5.0 * x[1] + 7.0);
//! }
//! let gram = training.total();
//! let scales = Standardization::of(&gram).scales;
//! let fit = LeastSquares::ordinary().solve(&gram, &[0, 1], &scales, training.rows())?;
//! assert!((fit.coefficients[0] - 3.0).abs() < 1e-9 && (fit.intercept - 7.0).abs() < 1e-9);
//! # Ok::<(), athermal_numerics::NumericsError>(())
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod active_set;
mod agreement;
mod blocks;
mod change;
mod checks;
mod cholesky;
mod collinearity;
mod correlation;
mod dot;
mod elastic_net;
mod error;
mod folds;
mod forward_regression;
mod gram;
mod huber;
mod kalman;
mod least_squares;
mod left_out;
mod likeness;
mod non_negative;
mod normal_equations;
mod novelty;
mod orthogonal;
mod penalty;
mod pool;
mod prediction_error;
mod prediction_variance;
mod prior;
mod quiet_folds;
mod rls;
mod robust;
mod scaler;
mod scratch;
mod selection;
mod sgd;
mod state_space;

pub use agreement::{Agreement, Look};
pub use blocks::{BLOCK_ROWS, DEFAULT_ROW_MEMORY, GramBlocks, Rows};
pub use change::{Adwin, AdwinOptions, MeanChange, PageHinkley, PageHinkleyOptions};
pub use collinearity::Collinearity;
pub use correlation::{
    LjungBox, NORMAL_95, autocorrelation, autocorrelation_errors, autocorrelation_pairs,
    bound_of_farthest, cross_correlation, cross_correlation_error, cross_correlation_pairs,
    ljung_box,
};
pub use elastic_net::{ElasticNet, SparseFit};
pub use error::NumericsError;
pub use folds::{FoldRows, Folds, Split};
pub use forward_regression::{ErrorReduction, ForwardModel, ForwardRegression};
pub use gram::Gram;
pub use huber::{Huber, HuberFit};
pub use kalman::{
    Followed, Forecast, Innovation, Kalman, Movement, Passage, Resetting, Series, Structural,
    follow, most_likely,
};
pub use least_squares::{
    DEFAULT_CONDITION_BOUND, DEFAULT_RCOND, LeastSquares, LinearFit, Method, SINGULAR_BOUND,
};
pub use left_out::{LeftOut, ridges_left_out};
pub use non_negative::non_negative_least_squares;
pub use novelty::Novelty;
pub use penalty::{cross_validated_penalties, generalised_cross_validation, logarithmic_grid};
pub use pool::{FEWEST_MACHINES, MachineRows, Pooled, pool};
pub use prediction_error::{
    Beginning, Fading, InformationCriteria, InputOrders, Orders, Polynomials, PredictionError,
    PredictionErrorFit, Samples, Stepper, Transfer,
};
pub use prediction_variance::PredictionVariance;
pub use prior::{CoefficientPrior, Known, PriorFit, Pull};
pub use quiet_folds::quiet_folds;
pub use rls::{Learned, Rls, RlsFit, information_of};
pub use robust::{median, robust_deviation};
pub use scaler::{Standardization, Standardizer};
pub use selection::{
    CandidateScore, Candidates, Change, Direction, Search, Selection, SelectionScore,
    SelectionStep, Smallest, Start, Stepwise, StepwiseSelection, StepwiseStep,
};
pub use sgd::{LearningRate, Sgd, SgdOptions};
pub use state_space::{
    DifferenceEquation, Identification, Record, StateOrder, StateSpace, Subspace, Weighting,
};

#[cfg(test)]
mod draws;
#[cfg(test)]
mod oracle;
