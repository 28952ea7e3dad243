//! How the graph of a running service is replaced: staged, compared, handed over, taken back. Who does it stands in the journal.

use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::{Running, StageError, Staged, Verdict};
use athermal_run::model::Model;

use super::{Service, ServiceEvent};
use crate::aside::{PATIENCE, within};
use crate::engine::Engine;
use crate::folder::StatePaths;
use crate::keeper::CommitError;
use crate::time::Duration;

/// A comparison under way.
#[derive(Debug, Clone)]
pub(super) struct Comparison {
    /// Whether the graph takes over by itself where it is no worse.
    pub(super) commits: bool,
    /// Who asked for it.
    by: String,
}

impl Service {
    /// Makes a graph ready to take over: what it can take of what runs is carried, the rest is warmed by the past.
    ///
    /// # Errors
    /// When it cannot take over, or be kept; what runs, and what was staged before, is untouched.
    pub fn stage(&mut self, model: &Model, by: &str) -> Result<&Staged, CommitError> {
        // Kept before it is staged: where it cannot be, what was staged stays so. One that cannot be run is refused there.
        if let Some(revision) = model.revision() {
            let (folder, model) = (StatePaths::clone(&self.folder), model.clone());
            within(move || folder.keep_model(&model, &revision)).ok_or(CommitError::Hangs)??;
        }
        self.await_replica();
        let staged = self.keeper.control().stage(model, false)?;
        let revision = staged.revision().to_owned();
        self.note_fit(model);
        self.comparison = None;
        self.note(&format!("{by}: staged {revision}"));
        let staged = self.keeper.look().staged();
        Ok(staged.ok_or(StageError::NothingStaged)?)
    }

    /// Compares the staged graph with what runs for so long; with `commits` it takes over then, if its error is larger by no more than
    /// `margin`, and is let go otherwise.
    ///
    /// # Errors
    /// When nothing is staged, or ticks were missed.
    pub fn shadow(
        &mut self,
        duration: Duration,
        margin: f64,
        commits: bool,
        by: &str,
    ) -> Result<(), CommitError> {
        self.keeper.control().shadow(duration, margin)?;
        let by = by.to_owned();
        self.note(&format!("{by}: shadow for {duration}, margin {margin}"));
        self.comparison = Some(Comparison { commits, by });
        Ok(())
    }

    /// Lets the staged graph take over before the next tick, whatever a comparison has come to.
    ///
    /// # Errors
    /// When nothing is staged, or it cannot be kept; what is staged stays so.
    pub fn commit(&mut self, by: &str) -> Result<(), CommitError> {
        let revision = self.staged().map(|of| of.revision().to_owned());
        self.keeper.commit()?;
        self.hand_over(by, revision);
        self.comparison = None;
        Ok(())
    }

    /// Lets the graph before the last swap take over again, as it would be had it never been replaced.
    ///
    /// # Errors
    /// When there is none that is still warm, or it cannot be kept.
    pub fn rollback(&mut self, by: &str) -> Result<(), CommitError> {
        let revision = self.previous().map(|of| of.revision().to_owned());
        self.keeper.rollback()?;
        self.hand_over(by, revision);
        Ok(())
    }

    /// Lets go of what is staged.
    ///
    /// # Errors
    /// When nothing is.
    pub fn discard(&mut self, by: &str) -> Result<(), CommitError> {
        let control = self.keeper.control();
        let revision = control.staged().map(|of| of.revision().to_owned());
        let revision = revision.ok_or(StageError::NothingStaged)?;
        control.discard();
        self.comparison = None;
        self.note(&format!("{by}: discarded {revision}"));
        Ok(())
    }

    /// The graph that is staged.
    #[must_use]
    pub fn staged(&self) -> Option<&Staged> {
        self.keeper.look().staged()
    }

    /// What the comparison of the staged graph has come to; none where there is none.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        self.keeper.look().verdict()
    }

    /// What runs, after the ticks that have been taken in; none after ticks have been missed.
    #[must_use]
    pub fn running(&self) -> Option<Running<'_>> {
        self.keeper.look().running()
    }

    /// The nodes of it that were given up, and why.
    #[must_use]
    pub fn given_up(&self) -> &[String] {
        self.keeper.look().given_up()
    }

    /// A copy of it, to the same bits, while something needs one.
    #[must_use]
    pub fn replica(&self) -> Option<&Engine> {
        self.keeper.look().replica()
    }

    /// Waits until there is a copy of what runs, for as long as the engine thread may take.
    pub(super) fn await_replica(&mut self) {
        let began = Clock::now();
        while !self.keeper.control().needs_replica() && began.elapsed() < PATIENCE {
            self.engine.thread().unpark();
            std::thread::sleep(Wait::from_millis(1));
        }
    }

    /// The graph before the last swap, while it is warm: it can be taken back.
    #[must_use]
    pub fn previous(&self) -> Option<&Engine> {
        self.keeper.look().beside()[1]
    }

    fn hand_over(&mut self, by: &str, revision: Option<String>) {
        let revision = revision.unwrap_or_default();
        self.note(&format!("{by}: {revision} is to take over"));
    }

    /// Keeps in mind when a model was fitted.
    pub(super) fn note_fit(&mut self, model: &Model) {
        if let (Some(revision), Some(card)) = (model.revision(), &model.card) {
            self.cards.insert(revision, card.clone());
        }
    }

    /// Keeps the model that was given, where that has not been possible.
    pub(super) fn keep_model(&mut self) {
        self.unkept.take_if(|model| {
            let (folder, model) = (StatePaths::clone(&self.folder), model.clone());
            let revision = model.revision().unwrap_or_default();
            within(move || folder.keep_model(&model, &revision).is_ok()) == Some(true)
        });
    }

    /// Looks whether a comparison is over, and does what was asked for then.
    pub(super) fn compare(&mut self, events: &mut Vec<ServiceEvent>) {
        let Some(verdict) = self.verdict().filter(|of| of.over) else {
            return;
        };
        let Some(Comparison { commits, by }) = self.comparison.take() else {
            return;
        };
        let revision = self
            .staged()
            .map_or_else(String::new, |of| of.revision().to_owned());
        let passes = verdict.passes == Some(true);
        let ratio = verdict.ratio;
        let outcome = match verdict.passes {
            Some(true) => "no worse",
            Some(false) => "worse",
            None => "without anything to compare it by",
        };
        self.note(&format!("{by}: {revision} compared, {outcome}"));
        events.push(ServiceEvent::Compared { revision, verdict });
        if !commits {
            return;
        }
        let outcome = match passes {
            true => self.commit(&by),
            false => self.discard(&by).and(Err(CommitError::Worse { ratio })),
        };
        if let Err(error) = outcome {
            events.push(ServiceEvent::NotTakenOver(error.to_string()));
        }
    }
}
