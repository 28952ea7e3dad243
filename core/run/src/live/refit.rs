//! Decides how a running graph is fitted again beside its work; whether the new fit takes over is decided by staging it.

use std::thread::JoinHandle;

use crossbeam::channel::{Receiver, TryRecvError, bounded};

use super::Control;
use crate::diagnostic::panic_text;
use crate::fit::{FitError, FitOptions, FitReport, fit};
use crate::model::Model;
use crate::recording::{Recording, Table};
use crate::time::Instant;

/// A fit that is being made on a thread of its own.
///
/// Stage the model that comes of it, let it run in the shadow and commit it: that is the recalculation without downtime of
/// Mandelli, Dankwart and Napoli, section 6.
#[derive(Debug)]
pub struct Refit {
    outcome: Receiver<Result<(Model, FitReport), FitError>>,
    thread: Option<JoinHandle<()>>,
}

impl Refit {
    /// Fits a model's graph anew on given data.
    #[must_use]
    pub fn on(model: &Model, data: impl Recording + Send + 'static, options: FitOptions) -> Self {
        let (sender, outcome) = bounded(1);
        let mut model = model.clone();
        let thread = std::thread::spawn(move || {
            let fitted = fit(&model.plan, &data, &options, &mut |_| {}).map(|(fitted, report)| {
                model.fitted = fitted;
                // The card is of data that the new fit has not seen.
                model.card = None;
                (model, report)
            });
            // Nobody may be waiting any more.
            let _ = sender.send(fitted);
        });
        Self {
            outcome,
            thread: Some(thread),
        }
    }

    /// The outcome, once there is one; it is given once.
    pub fn poll(&mut self) -> Option<Result<(Model, FitReport), FitError>> {
        match self.outcome.try_recv() {
            Ok(outcome) => self.over(Some(outcome)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => self.over(None),
        }
    }

    /// Waits for the outcome; none where it has been given already.
    pub fn wait(mut self) -> Option<Result<(Model, FitReport), FitError>> {
        let outcome = self.outcome.recv().ok();
        self.over(outcome)
    }

    /// The thread has ended: with an outcome, or by a panic where none has been given before.
    fn over(
        &mut self,
        outcome: Option<Result<(Model, FitReport), FitError>>,
    ) -> Option<Result<(Model, FitReport), FitError>> {
        let joined = self.thread.take()?.join();
        outcome.or_else(|| {
            let text = panic_text(&*joined.err()?);
            Some(Err(FitError::Panicked { text }))
        })
    }
}

impl Control {
    /// Fits a model's graph anew on the retained past between two instants, in the background.
    ///
    /// How far the past reaches back is said by [`Control::retained`]; keep more with [`super::LiveOptions::retain`].
    #[must_use]
    pub fn refit(&self, model: &Model, from: Instant, to: Instant, options: FitOptions) -> Refit {
        let data: Table = self.recording(&model.plan, from, to);
        Refit::on(model, data, options)
    }
}
