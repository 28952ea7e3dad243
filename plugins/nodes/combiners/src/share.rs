//! Decides what a vote counts beside its weight, and how weights are kept away from extremes; not where they come from.

use athermal_core::node::Votes;

/// What a vote counts whose regressors are so far outside of those of its fit: 1 up to the edge, then by the inverse square, as
/// `auto_weighted` weighs an error that is so many times as large.
pub fn trust(novelty: f64) -> f64 {
    if novelty > 1.0 {
        1.0 / (novelty * novelty)
    } else {
        1.0
    }
}

/// Draws the weights of the votes that are there towards equal ones, and makes them add up to one.
pub(crate) fn shrink(weights: &mut [f64], votes: Votes<'_>, shrinkage: f64) {
    let count = votes.present().count() as f64;
    let total: f64 = votes.present().map(|(voter, _)| weights[voter]).sum();
    for (voter, _) in votes.present() {
        let own = if total > 0.0 {
            weights[voter] / total
        } else {
            1.0 / count
        };
        weights[voter] = (1.0 - shrinkage) * own + shrinkage / count;
    }
}

/// Lifts weights that add up to one to a floor, at the cost of the larger ones: of all weights not below it these are the nearest in
/// their proportions.
pub(crate) fn raise(weights: &mut [f64], votes: Votes<'_>, floor: f64) {
    let count = votes.present().count();
    if floor <= 0.0 {
        return;
    }
    if floor * count as f64 >= 1.0 {
        votes
            .present()
            .for_each(|(voter, _)| weights[voter] = 1.0 / count as f64);
        return;
    }
    let mut scale = 1.0;
    // What is taken from the larger ones may bring another below the floor, but each only once.
    for _ in 0..count {
        let (mut above, mut below) = (0.0, 0.0);
        for (voter, _) in votes.present() {
            if weights[voter] * scale < floor {
                below += floor;
            } else {
                above += weights[voter];
            }
        }
        scale = (1.0 - below) / above;
    }
    for (voter, _) in votes.present() {
        weights[voter] = (weights[voter] * scale).max(floor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raised(weights: &[f64], floor: f64) -> Vec<f64> {
        let mut weights = weights.to_vec();
        let votes = vec![0.0; weights.len()];
        raise(&mut weights, Votes(&votes), floor);
        weights
    }

    #[test]
    fn small_weights_are_lifted_and_the_others_keep_their_proportions() {
        let weights = raised(&[0.01, 0.33, 0.66], 0.1);
        let expected = [0.1, 0.3, 0.6];
        for (weight, expected) in weights.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-15, "{weights:?}");
        }
    }

    #[test]
    fn a_weight_that_lifting_others_brings_below_the_floor_is_lifted_too() {
        let weights = raised(&[0.0, 0.205, 0.795], 0.2);
        for (weight, expected) in weights.iter().zip([0.2, 0.2, 0.6]) {
            assert!((weight - expected).abs() < 1e-15, "{weights:?}");
        }
    }

    #[test]
    fn a_floor_above_an_equal_share_makes_all_equal() {
        assert_eq!(raised(&[0.0, 1.0], 0.7), [0.5, 0.5]);
    }

    #[test]
    fn shrinking_leaves_absent_votes_alone_and_adds_up_to_one() {
        let mut weights = [9.0, f64::NAN, 3.0];
        shrink(&mut weights, Votes(&[0.0, f64::NAN, 0.0]), 0.5);
        assert_eq!((weights[0], weights[2]), (0.625, 0.375));
        assert!(weights[1].is_nan());
    }
}
