//! A combiner that does no harm.

use athermal_core::node::{Combine, Combiner, InputPort, Kept, Mistake, Votes};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::errors::{ByErrors, Errors, Rule};
use crate::mean::mean;
use crate::memory::Memory;
use crate::share::trust;

/// Passes a prediction on only while it does no harm: while its recent error is below that of predicting zero.
///
/// It passes while `Σ (y − ŷ)² < Σ y²` over the truths in memory. Otherwise it predicts zero, which is what a machine
/// without a model does. Before `min_truths` truths have been compared, nothing is known to do harm and the prediction
/// passes. One from far outside of its fit is held back before its truth comes: where its `novelty` is above
/// `most_novel`. The port `reason` says why: 0 it passes and has done no harm, 1 it is held back. 2 is that it passes
/// since too little is known, 3 that it is held back as it is too novel. The port `weights` says 0 while it is held
/// back. Of several predictions the mean of those that are there is guarded, and held back when one of them does harm
/// on the truths that it predicted. Where all have a standard deviation, the port `std_dev` passes it on, or that of
/// their mixture; while the prediction is held back there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Guard {
    /// How long an error is remembered, counted from when the embargo lets its truth through: `"15min"`, `{ truths = 12 }`, or
    /// ever less by `{ half_life = "15min" }`, and not at all after ten half-lives.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory: Memory,
    /// How many truths of a prediction must be in memory before it is held back; 1 or more. With a `half_life` they count for less
    /// with age: one so short that fewer are ever left holds nothing back.
    #[serde(default = "five")]
    #[schemars(range(min = 1))]
    pub min_truths: usize,
    /// Above which `novelty` a prediction is held back, 1 or more. At the default of 3 one that shrinks has lost two thirds.
    #[serde(default = "three")]
    #[schemars(range(min = 1.0))]
    pub most_novel: f64,
}

fn five() -> usize {
    5
}

fn three() -> f64 {
    3.0
}

/// The numbers of the port `reason`.
mod reason {
    pub(super) const HARMLESS: f64 = 0.0;
    pub(super) const HARMS: f64 = 1.0;
    pub(super) const UNKNOWN: f64 = 2.0;
    pub(super) const NOVEL: f64 = 3.0;
}

impl Combiner for Guard {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "the prediction that is guarded"),
                InputPort::truth("what it predicts, for its errors"),
            ]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        match self.memory {
            Memory::Truths(last) if last.truths < self.min_truths => {
                let message = format!(
                    "`min_truths` is {} and the memory holds {} at most",
                    self.min_truths, last.truths
                );
                vec![Mistake::at("min_truths", message)]
            }
            _ => Vec::new(),
        }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn heeds_novelty(&self) -> bool {
        true
    }

    fn has_reason(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.memory.longest()
    }

    fn keeps(&self, voters: usize, every: Duration) -> Vec<Kept> {
        self.memory.keeps(2 * voters, every)
    }

    fn is_endless(&self) -> bool {
        self.memory.is_endless()
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        let rule = Guarding {
            min_truths: self.min_truths as f64,
            least_trust: trust(self.most_novel),
            voters,
        };
        // Behind the voters stands for each of them one that predicts zero whenever it predicts.
        Box::new(ByErrors::new(rule, 2 * voters, self.memory))
    }
}

/// Compares the votes with predicting zero.
struct Guarding {
    min_truths: f64,
    /// What a vote at the most novelty counts.
    least_trust: f64,
    voters: usize,
}

impl Guarding {
    /// What is known of the votes that are there: that one is too novel or does harm counts before that one is not known yet.
    fn judge(&self, errors: &Errors, votes: Votes<'_>) -> f64 {
        let means = errors.means();
        let mut judged = reason::HARMLESS;
        for (voter, _) in votes.present() {
            let zero = self.voters + voter;
            if errors
                .trust()
                .is_some_and(|trust| trust[voter] < self.least_trust)
            {
                return reason::NOVEL;
            }
            match (means[voter], means[zero]) {
                (Some(own), Some(of_zero)) if errors.count(zero) >= self.min_truths => {
                    if own >= of_zero {
                        return reason::HARMS;
                    }
                }
                _ => judged = reason::UNKNOWN,
            }
        }
        judged
    }

    fn passes(&self, errors: &Errors, votes: Votes<'_>) -> bool {
        ![reason::HARMS, reason::NOVEL].contains(&self.judge(errors, votes))
    }
}

impl Rule for Guarding {
    fn combine(&self, errors: &Errors, votes: Votes<'_>) -> f64 {
        let mean = mean(votes);
        if mean.is_nan() || self.passes(errors, votes) {
            mean
        } else {
            0.0
        }
    }

    fn weights(&self, errors: &Errors, votes: Votes<'_>, weights: &mut [f64]) {
        let passes = if self.passes(errors, votes) { 1.0 } else { 0.0 };
        let count = votes.present().count() as f64;
        for (voter, _) in votes.present() {
            weights[voter] = passes / count;
        }
    }

    fn reason(&self, errors: &Errors, votes: Votes<'_>) -> f64 {
        let any = votes.present().next();
        any.map_or(f64::NAN, |_| self.judge(errors, votes))
    }

    fn observe(&self, errors: &mut Errors, votes: Votes<'_>, truth: f64, arrived: Instant) {
        for (voter, vote) in votes.present() {
            errors.observe_one(voter, vote, truth, arrived);
            errors.observe_one(self.voters + voter, 0.0, truth, arrived);
        }
    }

    fn needed(&self) -> f64 {
        self.min_truths
    }
}

athermal_core::register!(Guard, Combiner, "guard");

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    #[test]
    fn a_guard_predicts_zero_while_the_prediction_does_harm_and_says_so() {
        let mut guard = Guard {
            memory: Memory::Time(Duration::from_ns(600_000_000_000)),
            min_truths: 2,
            most_novel: 3.0,
        }
        .build(1);
        let vote = Votes(&[7.0]);
        assert_eq!((guard.combine(vote), guard.reason(vote)), (7.0, 2.0));
        guard.observe(vote, 1.0, s(0));
        let one = (guard.combine(vote), guard.reason(vote));
        assert_eq!(one, (7.0, 2.0), "one truth is not enough");
        guard.observe(vote, 1.0, s(60));
        assert_eq!((guard.combine(vote), guard.reason(vote)), (0.0, 1.0));
        let mut weights = [f64::NAN];
        guard.weights(vote, &mut weights);
        assert_eq!(weights, [0.0]);
        guard.advance(s(700));
        let later = (guard.combine(vote), guard.reason(vote));
        assert_eq!(later, (7.0, 2.0), "what is forgotten does not count");
        for second in [700, 760] {
            guard.observe(vote, 6.0, s(second));
        }
        assert_eq!((guard.combine(vote), guard.reason(vote)), (7.0, 0.0));
        assert!(guard.reason(Votes(&[f64::NAN])).is_nan());
    }

    #[test]
    fn of_several_those_that_are_there_are_judged_each_by_the_truths_that_it_predicted() {
        let mut guard = Guard {
            memory: Memory::Time(Duration::from_ns(600_000_000_000)),
            min_truths: 2,
            most_novel: 3.0,
        }
        .build(3);
        let gone = f64::NAN;
        // The first predicts while truths are large, well for their size; the second is good and the third bad while they are small.
        for second in [0, 1] {
            guard.observe(Votes(&[60.0, gone, gone]), 100.0, s(second));
        }
        for second in 2..20 {
            guard.observe(Votes(&[gone, 0.9, gone]), 1.0, s(second));
        }
        guard.observe(Votes(&[gone, gone, 9.0]), 1.0, s(20));
        let judged = |guard: &dyn Combine, votes: [f64; 3]| {
            let votes = Votes(&votes);
            (guard.combine(votes), guard.reason(votes))
        };
        assert_eq!(judged(&*guard, [3.0, 1.0, gone]), (2.0, 0.0));
        assert_eq!(
            judged(&*guard, [gone, 1.0, 3.0]),
            (2.0, 2.0),
            "one truth is not enough"
        );
        guard.observe(Votes(&[gone, gone, 9.0]), 1.0, s(21));
        assert_eq!(judged(&*guard, [gone, 1.0, 3.0]), (0.0, 1.0));
        assert_eq!(judged(&*guard, [gone, 1.0, gone]), (1.0, 0.0));
    }

    #[test]
    fn what_comes_from_far_outside_of_its_fit_is_held_back_before_any_truth() {
        let mut guard = Guard {
            memory: Memory::Time(Duration::from_ns(600_000_000_000)),
            min_truths: 2,
            most_novel: 3.0,
        }
        .build(1);
        let vote = Votes(&[7.0]);
        for (novelty, expected) in [
            (f64::NAN, (7.0, 2.0)),
            (2.9, (7.0, 2.0)),
            (3.1, (0.0, 3.0)),
            (0.5, (7.0, 2.0)),
        ] {
            guard.heed(&[novelty]);
            assert_eq!(
                (guard.combine(vote), guard.reason(vote)),
                expected,
                "{novelty}"
            );
        }
    }

    #[test]
    fn what_fades_counts_for_less_while_no_truth_comes() {
        let half_life = Duration::from_ns(60_000_000_000);
        let mut guard = Guard {
            memory: Memory::HalfLife(crate::memory::Fading { half_life }),
            min_truths: 5,
            most_novel: 3.0,
        }
        .build(1);
        let vote = Votes(&[7.0]);
        for second in 0..20 {
            guard.observe(vote, 1.0, s(second));
        }
        guard.advance(s(20));
        assert_eq!(guard.reason(vote), 1.0);
        // Some 18 are left of twenty, and fewer than five two half-lives later.
        guard.advance(s(20 + 90));
        assert_eq!(guard.reason(vote), 1.0);
        guard.advance(s(20 + 130));
        assert_eq!((guard.combine(vote), guard.reason(vote)), (7.0, 2.0));
    }
}
