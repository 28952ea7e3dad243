//! A combiner at work: votes combined, and truths handed to it once the embargo lets them through.

use super::gather::Gathered;
use crate::channel::unless_infinite;
use crate::compile::{AuxPorts, TruthLink};
use crate::engine::idle::Answer;
use crate::engine::learning::{DueTruth, Embargo};
use crate::engine::state::NodeState;
use crate::node::{Combine, Combiner, Evidence, Restored, Votes};
use crate::time::{Duration, Instant};

/// A combiner in a running plan, with the truths that the embargo still withholds from it.
pub(crate) struct Vote {
    combine: Box<dyn Combine>,
    withheld: Option<Embargo>,
    /// Both ends of the interval of this tick and its extent, for a combiner that gives intervals.
    interval: Option<[f64; 3]>,
    /// What each vote of this tick weighs, for whoever reads it or a deviation.
    weights: Vec<f64>,
    /// The novelty of each vote of this tick; NaN where it is not known.
    novelty: Vec<f64>,
    /// How many truths it has seen that there was a vote for.
    truths: u64,
    pub(crate) wires: Wires,
}

/// What a combiner reads and where what it gives goes.
pub(crate) struct Wires {
    /// The gather of the votes.
    pub(crate) voters: usize,
    /// The gather of the novelties of votes, and which these are, where it heeds them or shows its own.
    pub(crate) novelties: Option<(usize, Box<[usize]>)>,
    /// The gather of the state that it goes by, where it goes by one.
    pub(crate) state: Option<usize>,
    pub(crate) slot: usize,
    /// What it gives beside its prediction, where it gives anything.
    pub(crate) beside: Option<Box<AuxPorts>>,
}

impl Vote {
    pub(crate) fn new(
        spec: &dyn Combiner,
        wires: Wires,
        voters: usize,
        link: Option<TruthLink>,
    ) -> Self {
        let interval = spec.coverage().map(|_| [f64::NAN; 3]);
        // The interval that was given for a truth is written down with the votes for it.
        let width = voters + interval.map_or(0, |ends| ends.len());
        Self {
            combine: spec.build(voters),
            withheld: link.map(|link| Embargo::new(link, width)),
            interval,
            weights: vec![f64::NAN; voters],
            novelty: vec![f64::NAN; voters],
            truths: 0,
            wires,
        }
    }

    /// Hands the combiner the state that it goes by.
    pub(crate) fn go_by(&mut self, state: f64, now: Instant) {
        self.combine.state(now, state);
    }

    /// Hands the combiner how far each vote of this tick comes from outside of its fit.
    pub(crate) fn heed(&mut self, gathered: &[Gathered]) {
        if let Some((gather, which)) = &self.wires.novelties {
            for (&nth, novelty) in which.iter().zip(&gathered[*gather].values) {
                self.novelty[nth] = *novelty;
            }
            self.combine.heed(&self.novelty);
        }
    }

    /// How far the votes that have been weighed come from outside of their fits: the mean by their weights, of those of which it is
    /// known.
    pub(crate) fn novelty(&self) -> f64 {
        let (mut sum, mut known) = (0.0, 0.0);
        for (weight, novelty) in self.weights.iter().zip(&self.novelty) {
            if *weight > 0.0 && !novelty.is_nan() {
                sum += weight * novelty;
                known += weight;
            }
        }
        sum / known
    }

    /// Why the votes of this tick are combined as they are.
    pub(crate) fn reason(&self, votes: &Gathered) -> f64 {
        self.combine.reason(Votes(&votes.values))
    }

    /// Hands over what the embargo lets through at `now`.
    #[inline]
    pub(crate) fn release(&mut self, now: Instant) {
        if let Some(withheld) = &self.withheld {
            let newest = withheld.newest(now);
            self.hand_over(newest);
            self.combine.advance(newest);
        }
    }

    #[inline]
    fn hand_over(&mut self, newest: Instant) {
        if let Some(withheld) = &mut self.withheld {
            withheld.release(newest, |released| {
                self.truths += observe(&mut *self.combine, self.weights.len(), released);
            });
        }
    }

    /// Combines the votes of this tick: the result and its stamp.
    #[inline]
    pub(crate) fn run(&mut self, votes: &Gathered, now: Instant) -> (f64, Instant) {
        let combined = unless_infinite(self.combine.combine(Votes(&votes.values)));
        if let Some(ends) = &mut self.interval {
            let [lower, upper] = self.combine.interval(Votes(&votes.values));
            *ends = [lower, upper, self.combine.extent()];
        }
        if let Some(withheld) = &mut self.withheld {
            let ends = self.interval.as_ref().map_or(&[][..], |ends| &ends[..]);
            withheld.run(now, [&votes.values[..], ends]);
        }
        (combined, votes.oldest().unwrap_or(now))
    }

    /// The weights by which the votes of this tick are combined.
    pub(crate) fn weigh(&mut self, votes: &Gathered) -> &[f64] {
        self.weights.fill(f64::NAN);
        self.combine
            .weights(Votes(&votes.values), &mut self.weights);
        &self.weights
    }

    /// Both ends of the interval of this tick.
    pub(crate) fn interval(&self) -> [f64; 2] {
        self.interval
            .map_or([f64::NAN; 2], |[lower, upper, _]| [lower, upper])
    }

    /// The standard deviation of the truth about the combination of this tick, from those about the votes, which have been weighed.
    ///
    /// The truth is taken to follow one of the voters, each with the probability of its weight, so that the variance is
    /// `Σ w_i (σ_i² + (ŷ_i − ŷ)²)`: what voters disagree about is uncertain too (Hoeting, Madigan, Raftery and Volinsky 1999,
    /// section 2). NaN where a vote that counts has none, or the weights do not add up to 1.
    pub(crate) fn std_dev(&self, votes: &Gathered, of_votes: &[f64], combined: f64) -> f64 {
        let (mut sum, mut variance) = (0.0, 0.0);
        for ((&weight, &vote), std_dev) in self.weights.iter().zip(&votes.values).zip(of_votes) {
            if weight != 0.0 && !vote.is_nan() {
                sum += weight;
                variance += weight * (std_dev * std_dev + (vote - combined).powi(2));
            }
        }
        // Written so that NaN fails.
        if (sum - 1.0).abs() < 1e-9 && variance >= 0.0 && variance.is_finite() {
            variance.sqrt()
        } else {
            f64::NAN
        }
    }

    /// The answer to any votes.
    pub fn answer(&self, votes: &[f64]) -> Answer {
        let mut weights = vec![f64::NAN; votes.len()];
        self.combine.weights(Votes(votes), &mut weights);
        Answer {
            combined: self.combine.combine(Votes(votes)),
            weights,
            interval: self.combine.interval(Votes(votes)),
        }
    }

    /// The truth to look at after all outputs, if any.
    pub(crate) fn truth(&self) -> Option<usize> {
        Some(self.withheld.as_ref()?.link().slot)
    }

    /// Takes a truth that has just been measured.
    pub(crate) fn observe(&mut self, truth: f64, now: Instant) {
        if let Some(withheld) = &mut self.withheld {
            withheld.observe(truth, now, 0.0);
        }
    }

    /// The segment has ended with this tick: the embargo guards its votes, of which none is still to come.
    pub(crate) fn segment(&mut self, last: Instant) {
        self.hand_over(last);
        if let Some(withheld) = &mut self.withheld {
            withheld.clear();
        }
    }

    /// How many truths came, and how many of them it goes by.
    pub fn evidence(&self) -> Option<(u64, Evidence)> {
        Some((self.truths, self.combine.evidence()?))
    }

    /// What the combiner knows, and what is still withheld from it.
    pub(crate) fn snapshot(&self) -> NodeState {
        let mut state = NodeState::pack(self.combine.snapshot());
        state.learning = self.withheld.as_ref().map(Embargo::state);
        state
    }

    /// Goes on from the state of a combiner of the same voters.
    pub(crate) fn restore(&mut self, state: &NodeState) -> Restored {
        let answer = match state.unpack() {
            Ok(Some(own)) => self.combine.restore(own),
            Ok(None) => Restored::Accepted,
            Err(cold) => cold,
        };
        if let (Some(withheld), Some(from)) = (&mut self.withheld, &state.learning)
            && !matches!(answer, Restored::Cold { .. })
        {
            withheld.restore(from);
        }
        answer
    }

    /// Moves what is remembered to the clock of the segment that begins.
    pub(crate) fn shift(&mut self, shift: Duration) {
        self.combine.segment(shift);
    }
}

/// Hands a truth over; 1 if there was any vote for it.
fn observe(combine: &mut dyn Combine, voters: usize, released: DueTruth<'_>) -> u64 {
    let (votes, interval) = released.row.split_at(voters);
    if let &[lower, upper, extent] = interval {
        combine.judge([lower, upper], extent, released.truth);
    }
    combine.observe(Votes(votes), released.truth, released.arrived);
    u64::from(Votes(votes).present().next().is_some())
}
