//! Decides whether a candidate predicts no worse than what runs, on the same ticks and truths.

use serde::Serialize;

use crate::engine::Engine;
use crate::recording::Event;
use crate::score::Watch;
use crate::time::{Duration, Instant};

/// A candidate and what runs, compared for a while.
#[derive(Debug)]
pub struct Shadow {
    margin: f64,
    duration: Duration,
    began: Option<Instant>,
    now: Option<Instant>,
    running: Watch,
    candidate: Watch,
}

/// What a comparison has come to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether the stated time has passed.
    pub over: bool,
    /// How both did, by output.
    pub outputs: Vec<Compared>,
    /// Root mean square over the outputs of the candidate's error relative to that of what runs.
    pub ratio: Option<f64>,
    /// Whether the candidate is not worse by more than the margin; none before there is anything to compare.
    pub passes: Option<bool>,
}

/// One output, as both predicted it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// The output: `predicted.Z1`.
    pub output: String,
    /// Instants with a truth and both predictions.
    pub n: usize,
    /// Root mean square error of what runs.
    pub running_rmse: f64,
    /// Root mean square error of the candidate.
    pub candidate_rmse: f64,
}

impl Shadow {
    pub(super) fn new(
        running: &Engine,
        candidate: &Engine,
        duration: Duration,
        margin: f64,
    ) -> Self {
        Self {
            margin,
            duration,
            began: None,
            now: None,
            running: Watch::new(running.plan()),
            candidate: Watch::new(candidate.plan()),
        }
    }

    /// Looks at what a tick did to both.
    pub(super) fn look(&mut self, running: &Engine, candidate: &Engine, event: Event) {
        if let Event::Row(now) = event {
            self.began.get_or_insert(now);
            self.now = Some(now);
        }
        self.running.look(running, event);
        self.candidate.look(candidate, event);
    }

    /// What it has come to so far.
    #[must_use]
    pub fn verdict(&self, running: &Engine, candidate: &Engine) -> Verdict {
        let outputs: Vec<_> = running
            .plan()
            .outputs
            .iter()
            .filter_map(|output| {
                let other = candidate
                    .plan()
                    .outputs
                    .iter()
                    .find(|other| other.name == output.name)?;
                let (truth, before) = self.running.prediction(output.slot)?;
                let (same_truth, after) = self.candidate.prediction(other.slot)?;
                (running.plan().channels[truth.slot].name
                    == candidate.plan().channels[same_truth.slot].name)
                    .then(|| compare(&output.name, &truth.values, before, after))?
            })
            .collect();
        let squares = outputs
            .iter()
            .map(|compared| (compared.candidate_rmse / compared.running_rmse).powi(2));
        let ratio =
            (!outputs.is_empty()).then(|| (squares.sum::<f64>() / outputs.len() as f64).sqrt());
        let over = matches!((self.began, self.now), (Some(began), Some(now)) if now - began >= self.duration);
        // Written so that a ratio that is no number does not pass.
        Verdict {
            over,
            passes: ratio.map(|ratio| ratio <= 1.0 + self.margin),
            ratio,
            outputs,
        }
    }
}

fn compare(output: &str, truths: &[f64], running: &[f64], candidate: &[f64]) -> Option<Compared> {
    let both = || {
        let all = truths.iter().zip(running).zip(candidate);
        all.filter(|((_, a), b)| !a.is_nan() && !b.is_nan())
            .map(|((truth, a), b)| (a - truth, b - truth))
    };
    let n = both().count();
    let rmse = |squares: f64| (squares / n as f64).sqrt();
    (n > 0).then(|| Compared {
        output: output.to_owned(),
        n,
        running_rmse: rmse(both().map(|(a, _)| a * a).sum()),
        candidate_rmse: rmse(both().map(|(_, b)| b * b).sum()),
    })
}
