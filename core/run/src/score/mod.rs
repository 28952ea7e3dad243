//! Decides how predictions are scored against the truths measured later; not how they are made.

mod evidence;
mod fallback;
mod interval;
mod no_model;
mod paired;
mod table;
mod trace;
mod unscored;
mod watch;

use std::sync::Arc;

pub use crate::engine::Mode;
pub use evidence::Lack;
pub use fallback::FellBack;
pub use interval::IntervalScore;
pub(crate) use no_model::Means;
pub use no_model::{Levels, NoModel, is_level};
pub use paired::{PairedPrediction, link};
pub use table::{RESTRICTS, Score, Scores, hide_much, if_few};
pub use trace::{PredictionTrace, Trace, TruthTrace, trace, trace_as};
pub use unscored::Unscored;
pub use watch::{Prediction, Watch};

use crate::compile::Plan;
use crate::engine::{Engine, Fitted};
use crate::fit::FitError;
use crate::quantity::Quantity;
use crate::recording::{Recording, pass};

/// How predictions are scored.
#[derive(Debug, Clone, Default)]
pub struct ScoreOptions {
    /// Only truths whose absolute value is below count.
    pub abs_truth_below: Option<Quantity>,
    /// Every row on all of its own instants, rather than on those valid for all rows of a truth.
    pub each_on_its_own: bool,
    /// Nothing is learned on the way.
    pub frozen: bool,
    /// From which past truths predictions are made.
    pub mode: Mode,
    /// The means of levels over the fit, which no model predicts of them.
    pub levels: Levels,
}

/// Steps a plan over a recording, cold, and scores every prediction in it.
///
/// A truth at `τ` is compared with the output of the predicting node's last run at or before `τ − ahead`. Estimators that
/// learn do so on the way, each truth after its prediction has been made: test, then train. `progress` is
/// called with the number of ticks stepped so far.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the plan.
pub fn score(
    plan: &Arc<Plan>,
    fitted: &Fitted,
    recording: &dyn Recording,
    options: &ScoreOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Scores, FitError> {
    let mut engine = Engine::new(Arc::clone(plan), fitted)?;
    engine.freeze(options.frozen);
    engine.predict_in(options.mode);
    let mut watch = Watch::new(plan, options.mode);
    let mut stepped = 0;
    let passed = pass(&mut engine, recording, |engine, event, _| {
        watch.look(engine, event);
        stepped += 1;
        if stepped % 4096 == 0 {
            progress(stepped);
        }
    })?;
    Ok(table::table(
        plan,
        &watch,
        &engine,
        passed.period,
        passed.ticks,
        options,
    ))
}
