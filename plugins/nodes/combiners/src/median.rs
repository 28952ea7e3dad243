//! The median of votes, plain or of those in the middle.

use std::cell::RefCell;

use athermal_core::node::{Combine, Combiner, InputPort, Votes};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The median of the votes that are there: half of the voters may be wrong without doing harm.
///
/// `ŷ = median ŷ_i`. Of an even number of votes it is the mean of the two in the middle. The port `weights` shows which
/// votes it is made of. Where all voters have a standard deviation, the port `std_dev` is that of the mixture of those,
/// as of `auto_weighted`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Median {}

/// The mean of the votes that are left when the largest and smallest ones are taken away.
///
/// `ŷ = Σ ŷ_i / (n − 2k)` of those that are left. Of `n` votes `k = ⌊share · n⌋` are taken away at either end (Tukey
/// and McLaughlin 1963). The port `weights` shows which are left. Where all voters have a standard deviation, the port
/// `std_dev` is that of the mixture of those, as of `auto_weighted`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Trimmed {
    /// The share of votes that is taken away at either end, 0 to below 0.5.
    #[serde(default = "quarter")]
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 0.5))]
    pub share: f64,
}

fn quarter() -> f64 {
    0.25
}

impl Combiner for Median {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::held("voters", "predictions of the same truth")] }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Middle::new(voters, 0.5))
    }
}

impl Combiner for Trimmed {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::held("voters", "predictions of the same truth")] }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Middle::new(voters, self.share))
    }
}

/// The mean of the votes in the middle.
struct Middle {
    share: f64,
    /// Room for sorting the votes.
    room: RefCell<Vec<f64>>,
}

impl Middle {
    fn new(voters: usize, share: f64) -> Self {
        let room = RefCell::new(vec![0.0; voters]);
        Self { share, room }
    }

    /// How many of so many votes are taken away at either end.
    fn away(&self, count: usize) -> usize {
        let away = (self.share * count as f64).floor() as usize;
        away.min(count.saturating_sub(1) / 2)
    }
}

impl Combine for Middle {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        let mut room = self.room.borrow_mut();
        let mut count = 0;
        for (place, (_, vote)) in room.iter_mut().zip(votes.present()) {
            *place = vote;
            count += 1;
        }
        let sorted = &mut room[..count];
        sorted.sort_unstable_by(f64::total_cmp);
        let away = self.away(count);
        let left = &sorted[away..count - away];
        left.iter().sum::<f64>() / left.len() as f64
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        let count = votes.present().count();
        let left = self.away(count)..count - self.away(count);
        for (voter, vote) in votes.present() {
            let before =
                |&(other, its): &(usize, f64)| its.total_cmp(&vote).then(other.cmp(&voter)).is_lt();
            let rank = votes.present().filter(before).count();
            weights[voter] = if left.contains(&rank) {
                1.0 / left.len() as f64
            } else {
                0.0
            };
        }
    }
}

athermal_core::register!(Median, Combiner, "median");
athermal_core::register!(Trimmed, Combiner, "trimmed");

#[cfg(test)]
mod tests {
    use super::*;

    fn middle(share: f64, votes: &[f64]) -> f64 {
        Middle::new(votes.len(), share).combine(Votes(votes))
    }

    #[test]
    fn the_median_is_the_middle_vote_or_the_mean_of_the_two_in_the_middle() {
        assert_eq!(middle(0.5, &[9.0, 1.0, 2.0]), 2.0);
        assert_eq!(middle(0.5, &[9.0, 1.0, 2.0, 4.0]), 3.0);
        assert_eq!(middle(0.5, &[f64::NAN, 7.0]), 7.0);
        assert!(middle(0.5, &[f64::NAN]).is_nan());
    }

    #[test]
    fn a_quarter_at_either_end_is_taken_away() {
        // numpy: scipy.stats.trim_mean([1, 2, 3, 1000], 0.25) is 2.5.
        assert_eq!(middle(0.25, &[1000.0, 1.0, 3.0, 2.0]), 2.5);
        assert_eq!(middle(0.0, &[1.0, 2.0, 6.0]), 3.0);
    }

    #[test]
    fn the_weights_show_the_votes_that_are_left() {
        let votes = Votes(&[5.0, f64::NAN, 1.0, 5.0, 9.0]);
        let mut weights = [f64::NAN; 5];
        Middle::new(5, 0.25).weights(votes, &mut weights);
        assert!(weights[1].is_nan());
        assert_eq!(
            [weights[0], weights[2], weights[3], weights[4]],
            [0.5, 0.0, 0.5, 0.0]
        );
    }

    #[test]
    fn a_single_wild_vote_of_three_does_no_harm_to_the_median() {
        assert_eq!(middle(0.5, &[1.0, 1e9, 2.0]), 2.0);
    }
}
