//! Decides whether a candidate predicts no worse than what runs, on the same ticks and truths.

use schemars::JsonSchema;
use serde::Serialize;

use crate::compile::Plan;
use crate::engine::Engine;
use crate::figures::{apart, counted};
use crate::score::{PairedPrediction, link};
use crate::time::{Duration, Instant};

/// A candidate and what runs, compared for a while.
#[derive(Debug)]
pub struct Shadow {
    margin: f64,
    left: Duration,
    pairs: Vec<Pair>,
}

/// What a comparison has come to.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
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

impl Verdict {
    /// What it has come to, a line for each output.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = "in the shadow:".to_owned();
        for of in &self.outputs {
            let [running, new] = apart([of.running_rmse, of.candidate_rmse]);
            let instants = counted(of.n as u64, "instant");
            let (output, unit) = (&of.output, &of.unit);
            text += &format!(
                "\n  {output}: RMSE {running} running, {new} new, in {unit}, over {instants}"
            );
        }
        match self.ratio {
            Some(ratio) => text += &format!("\n  new to running: {ratio:.3}"),
            None => text += " there was nothing to compare",
        }
        text
    }
}

/// One output, as both predicted it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Compared {
    /// The output: `predicted.Z1`.
    pub output: String,
    /// The unit of errors: that of the truth, or K where that is a temperature.
    pub unit: String,
    /// Instants with a truth and both predictions.
    pub n: usize,
    /// Root mean square error of what runs.
    pub running_rmse: f64,
    /// Root mean square error of the candidate.
    pub candidate_rmse: f64,
}

/// An output of both, and the truth, as the running graph has it, that both predict.
#[derive(Debug)]
struct Pair {
    output: String,
    unit: String,
    truth: usize,
    running: Predicted,
    candidate: Predicted,
    n: usize,
}

/// One side of a pair.
#[derive(Debug)]
struct Predicted {
    paired: PairedPrediction,
    squares: f64,
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
            left: duration,
            pairs: pairs(running.plan(), candidate.plan()),
        }
    }

    /// Looks at what a tick did to both, `elapsed` after the one before.
    pub(super) fn look(
        &mut self,
        running: &Engine,
        candidate: &Engine,
        now: Instant,
        elapsed: Duration,
    ) {
        self.left -= elapsed;
        for pair in &mut self.pairs {
            let truth = running.value(pair.truth);
            let a = pair.running.paired.error(running, now, truth);
            let b = pair.candidate.paired.error(candidate, now, truth);
            if a.is_nan() || b.is_nan() {
                continue;
            }
            pair.n += 1;
            pair.running.squares += a.powi(2);
            pair.candidate.squares += b.powi(2);
        }
    }

    /// What follows belongs to another segment.
    pub(super) fn segment(&mut self) {
        for pair in &mut self.pairs {
            pair.running.paired.clear();
            pair.candidate.paired.clear();
        }
    }

    /// What it has come to so far.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let compared = self.pairs.iter().filter(|pair| pair.n > 0);
        let outputs: Vec<_> = compared.map(Pair::compared).collect();
        let squares = outputs.iter().map(|compared| {
            let (running, candidate) = (compared.running_rmse, compared.candidate_rmse);
            // Two that are without error are equally good.
            if candidate == running {
                1.0
            } else {
                (candidate / running).powi(2)
            }
        });
        let ratio =
            (!outputs.is_empty()).then(|| (squares.sum::<f64>() / outputs.len() as f64).sqrt());
        Verdict {
            over: self.left <= Duration::ZERO,
            // Written so that a ratio that is no number does not pass.
            passes: ratio.map(|ratio| ratio <= 1.0 + self.margin),
            ratio,
            outputs,
        }
    }
}

/// The outputs of one name in both plans that predict the same: the same truth, at the same horizon, in the same unit.
fn pairs(running: &Plan, candidate: &Plan) -> Vec<Pair> {
    let pair = |output: &crate::compile::PlannedOutput| {
        let other = candidate
            .outputs
            .iter()
            .find(|other| other.name == output.name)?;
        let (here, there) = (
            &running.channels[output.slot],
            &candidate.channels[other.slot],
        );
        let (truth, same) = (
            &running.channels[here.predicts?],
            &candidate.channels[there.predicts?],
        );
        let predicts_same = truth.name == same.name
            && truth.channel.unit == same.channel.unit
            && truth.channel.span == same.channel.span
            && here.channel.ahead == there.channel.ahead;
        if !predicts_same {
            return None;
        }
        let link = link(running, output.slot)?;
        let predicted = |slot| Predicted {
            paired: PairedPrediction::new(slot, &link),
            squares: 0.0,
        };
        Some(Pair {
            output: output.name.clone(),
            unit: truth.channel.unit.difference().to_string(),
            truth: link.slot,
            running: predicted(output.slot),
            candidate: predicted(other.slot),
            n: 0,
        })
    };
    running.outputs.iter().filter_map(pair).collect()
}

impl Pair {
    fn compared(&self) -> Compared {
        let rmse = |squares: f64| (squares / self.n as f64).sqrt();
        Compared {
            output: self.output.clone(),
            unit: self.unit.clone(),
            n: self.n,
            running_rmse: rmse(self.running.squares),
            candidate_rmse: rmse(self.candidate.squares),
        }
    }
}
