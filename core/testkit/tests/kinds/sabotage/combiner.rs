//! A combiner that is sound, and the same with one fault at a time.

use std::cell::Cell;

use super::*;

faulty! {
    /// The mean of the votes, with their range about it.
    pub struct Poll;
    /// Remembers what it has answered.
    Remembers,
    /// Takes nothing for zero.
    ZeroForAbsent,
    /// Weighs what is not there.
    WeighsAbsent,
    /// Says other weights than it goes by.
    OtherWeights,
    /// Says to cover all truths, and more.
    CoversMore,
    /// Mistakes the ends of its interval.
    UpsideDown,
}

impl Combiner for Poll {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::held("voters", "predictions of the same truth")] }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn coverage(&self) -> Option<f64> {
        Some(if self.fault == Fault::CoversMore {
            1.5
        } else {
            0.9
        })
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Answering {
            fault: self.fault,
            last: Cell::new(f64::NAN),
        })
    }
}

struct Answering {
    fault: Fault,
    last: Cell<f64>,
}

impl Combine for Answering {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        let count = match self.fault {
            Fault::ZeroForAbsent => votes.0.len(),
            _ => votes.present().count(),
        };
        let mean = votes.present().map(|(_, vote)| vote).sum::<f64>() / count as f64;
        let last = self.last.replace(mean);
        if votes.present().next().is_none() {
            f64::NAN
        } else if self.fault == Fault::Remembers && last.is_finite() {
            0.5 * (last + mean)
        } else {
            mean
        }
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        if self.fault == Fault::WeighsAbsent {
            weights.fill(0.0);
        }
        let count = match self.fault {
            Fault::ZeroForAbsent | Fault::OtherWeights => votes.0.len(),
            _ => votes.present().count(),
        };
        for (nth, _) in votes.present() {
            weights[nth] = 1.0 / count as f64;
        }
    }

    fn interval(&self, votes: Votes<'_>) -> [f64; 2] {
        let votes = || votes.present().map(|(_, vote)| vote);
        let lowest = votes().fold(f64::NAN, f64::min);
        let highest = votes().fold(f64::NAN, f64::max);
        if self.fault == Fault::UpsideDown {
            [highest, lowest]
        } else {
            [lowest, highest]
        }
    }
}

athermal_core::register!(Poll, Combiner, "sabotaged_votes");

#[test]
fn a_sound_combiner_breaks_no_rule() {
    breaks_only::<Poll>(Case::new(""), &[]);
}

#[test]
fn an_answer_that_changes_later_ones_leaves_a_trace() {
    breaks::<Poll>(
        with("remembers"),
        Rule::NoTrace,
        "answers that nobody wanted",
    );
}

#[test]
fn a_vote_that_is_not_there_is_neither_zero_nor_weighed() {
    for fault in ["zero_for_absent", "weighs_absent", "other_weights"] {
        breaks_only::<Poll>(with(fault), &[Rule::Votes]);
    }
    finds::<Poll>(
        with("zero_for_absent"),
        Rule::Votes,
        "before any truth, it takes vote 0 of 3 for zero where that is absent",
    );
    finds::<Poll>(
        with("weighs_absent"),
        Rule::Votes,
        "before any truth, of [NaN, 41.0, -68.0] the absent vote weighs 0 and not NaN",
    );
    finds::<Poll>(
        with("other_weights"),
        Rule::Votes,
        "before any truth, the answer to [NaN, 41.0, -68.0] is -13.5, and -8.999999999999998 by the weights [NaN, \
         0.3333333333333333, 0.3333333333333333]",
    );
}

#[test]
fn an_interval_stands_about_the_answer_and_covers_a_share() {
    for fault in ["covers_more", "upside_down"] {
        breaks_only::<Poll>(with(fault), &[Rule::Uncertainty]);
    }
    finds::<Poll>(
        with("covers_more"),
        Rule::Uncertainty,
        "`coverage` says that intervals cover 1.5 of the truths, which is no share between 0 and 1",
    );
    finds::<Poll>(
        with("upside_down"),
        Rule::Uncertainty,
        "before any truth, the interval about 44.666666666666664 is from 96 to -7",
    );
}
