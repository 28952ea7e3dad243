//! What one pass of a model over a recording yields.

use athermal_core::compile::Plan;
use athermal_core::engine::Engine;
use athermal_core::time::{Duration, Instant};
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use athermal_run::recording::{Event, Recording};
use athermal_run::score::{ScoreOptions, Trace, TruthTrace, trace_as};

use super::gap::Gaps;

/// A model's pass over a recording.
#[derive(Debug, Clone)]
pub struct Observation {
    /// Every truth and its predictions.
    pub trace: Trace,
    /// Every measured channel.
    pub sources: Vec<SourceStatistics>,
    /// First and last instant of each segment that has a row.
    pub segments: Vec<Option<(Instant, Instant)>>,
    /// The times between rows, breaks left out.
    pub(super) rows: Gaps,
    /// Of each slot, at how many rows it had a value.
    pub(super) valid: Vec<u64>,
}

/// The facts about a measured channel without its course.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SourceStatistics {
    /// Valid samples.
    pub samples: u64,
    /// Their mean.
    pub mean: f64,
    squares: f64,
    /// The sum of squared differences from one sample to the next.
    steps: f64,
    newest: f64,
    gaps: Gaps,
    last: Option<Instant>,
}

impl SourceStatistics {
    fn look(&mut self, now: Instant, value: f64) {
        self.samples += 1;
        let before = value - self.mean;
        self.mean += before / self.samples as f64;
        self.squares += before * (value - self.mean);
        let last = self.last.replace(now);
        if let Some(last) = last {
            self.gaps.push(now - last);
            self.steps += (value - self.newest).powi(2);
        }
        self.newest = value;
    }

    /// The noise of single samples: √(mean of squared successive differences / 2) (von Neumann 1941); 0 of less than two.
    #[must_use]
    pub fn noise(&self) -> f64 {
        (self.steps / 2.0 / self.gaps.count().max(1) as f64).sqrt()
    }

    /// The standard deviation of the samples; 0 of none.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }

    /// The median time between samples; none for less than two.
    #[must_use]
    pub fn interval(&self) -> Option<Duration> {
        self.gaps.median()
    }
}

/// Steps a model over a recording, cold, and writes down what the diagnoses start from.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn observe(model: &Model, recording: &dyn Recording) -> Result<Observation, FitError> {
    let count = model.plan.sources.len();
    let mut sources = vec![SourceStatistics::default(); count];
    let mut segments = vec![None];
    let mut rows = Gaps::default();
    let mut valid = vec![0; model.plan.channels.len()];
    let mut look = |engine: &Engine, event: Event| match event {
        Event::Segment => {
            segments.push(None);
            sources.iter_mut().for_each(|source| source.last = None);
        }
        Event::Row(now) => {
            count_valid(engine, &mut valid);
            if let Some(period) = segments.last_mut() {
                let (from, last) = period.unwrap_or((now, now));
                if period.is_some() {
                    rows.push(now - last);
                }
                *period = Some((from, now));
            }
            for (slot, source) in sources.iter_mut().enumerate() {
                let value = engine.value(slot);
                if !value.is_nan() {
                    source.look(now, value);
                }
            }
        }
    };
    let options = ScoreOptions {
        levels: model.levels(),
        ..ScoreOptions::default()
    };
    let trace = trace_as(&model.plan, &model.fitted, recording, &options, &mut look)?;
    Ok(Observation {
        trace,
        sources,
        segments,
        rows,
        valid,
    })
}

/// Counts each slot that has a value.
pub(super) fn count_valid(engine: &Engine, valid: &mut [u64]) {
    for (slot, count) in valid.iter_mut().enumerate() {
        *count += u64::from(!engine.value(slot).is_nan());
    }
}

impl Observation {
    /// A time between two values of a truth so short that nine gaps of ten reach as far, breaks left out; none for less than two.
    /// Where gaps vary, or many values are missing at random, few fall together within it, and many places are empty instead.
    pub(super) fn interval(truth: &TruthTrace) -> Option<Duration> {
        let mut gaps = Gaps::default();
        for pair in truth.times.windows(2).filter(|of| of[0].0 == of[1].0) {
            gaps.push(pair[1].1 - pair[0].1);
        }
        gaps.quantile(1, 10)
    }
}

/// Whether a prediction goes by a name: that of its channel, its node or its axis.
#[must_use]
pub fn is_called(prediction: &str, name: &str) -> bool {
    let parts = prediction.split_once('.');
    prediction == name || parts.is_some_and(|(node, axis)| node == name || axis == name)
}

/// Whether a prediction is among those asked for by name: every one where none is named.
#[must_use]
pub fn is_asked(prediction: &str, of: &[String]) -> bool {
    of.is_empty() || of.iter().any(|name| is_called(prediction, name))
}

/// Which prediction of a truth is meant: of those asked for the first that the graph puts out, else the last one; of all where none
/// of this truth is asked for.
pub(super) fn main_prediction(plan: &Plan, truth: &TruthTrace, of: &[String]) -> Option<usize> {
    let out = |slot: usize| plan.outputs.iter().any(|output| output.slot == slot);
    let asked = |nth: &usize| is_asked(&plan.channels[truth.predictions[*nth].slot].name, of);
    let all = 0..truth.predictions.len();
    let any_asked = all.clone().any(|nth| asked(&nth));
    let mut meant = all.filter(|nth| !any_asked || asked(nth));
    let last = meant.clone().next_back();
    meant.find(|&nth| out(truth.predictions[nth].slot)).or(last)
}

#[cfg(test)]
mod tests {
    use super::is_called;

    #[test]
    fn a_prediction_goes_by_its_channel_its_node_and_its_axis() {
        for name in ["vote.Z1", "vote", "Z1"] {
            assert!(is_called("vote.Z1", name));
        }
        assert!(!is_called("vote.Z1", "Z"));
        assert!(is_called("vote", "vote"));
    }
}
