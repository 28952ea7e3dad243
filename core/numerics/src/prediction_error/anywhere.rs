//! Decides how filters of inputs stand at samples anywhere, from which follows how they may stand where nothing of before is
//! known; not what samples tell of where they began.

use faer::Mat;
use serde::{Deserialize, Serialize};

use super::residuals::{Counted, Segment};
use super::starts::Start;
use super::{Polynomials, Samples, Transfer};
use crate::state_space::pseudo_inverse_above;

/// Of inputs that tell nearly the same, what is less than this share of them is not gone by.
const DISTINCT: f64 = 1e-8;

/// Filters are taken to be at rest where what they give together is then off by no more than this, in mean squares of what the best
/// guess is off by: where they begin shortly after a rest, they are nearer to it than anywhere.
const AT_REST: f64 = 4.0;

/// Where the filter of an input begins where only the inputs are known.
///
/// What filters gave until then is guessed from the inputs by the best linear predictor, by least squares through 0 over samples
/// anywhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beginning {
    /// The guess, in times of each input.
    pub times: Vec<f64>,
    /// What its error has in common with that of the sum of all filters, as a mean of products: what that sum is off by is
    /// shared like this.
    pub shared: f64,
}

/// The mean square of how far from rest the filter of each value of a start is, over all samples but the first of each segment.
pub(super) fn off_rest(model: &Polynomials, samples: &Samples, starts: &[Start]) -> Vec<f64> {
    let mut sums = vec![0.0; model.inputs.len()];
    let gains: Vec<f64> = model.inputs.iter().map(Transfer::gain).collect();
    let count = anywhere(model, samples, starts, |before, inputs| {
        for (nth, sum) in sums.iter_mut().enumerate() {
            *sum += (before[nth] - gains[nth] * inputs[nth]).powi(2);
        }
    });
    let of_each = model.inputs.iter().zip(&sums);
    of_each
        .flat_map(|(transfer, sum)| vec![sum / count.max(1) as f64; transfer.f.len()])
        .collect()
}

/// Where the filter of each input begins, unless that is hardly better known than that they may be at rest; one without a past is
/// known.
pub(super) fn beginnings(
    model: &Polynomials,
    samples: &Samples,
    starts: &[Start],
) -> Vec<Beginning> {
    let width = model.inputs.len();
    let has_past = |nth: usize| !model.inputs[nth].f.is_empty();
    // Of inputs, of filters with inputs, and of filters with the sum of all.
    let mut own = Mat::<f64>::zeros(width, width);
    let mut across = own.clone();
    let mut with_sum = vec![0.0; width];
    let gains: Vec<f64> = model.inputs.iter().map(Transfer::gain).collect();
    let mut off_rest = 0.0;
    let count = anywhere(model, samples, starts, |before, inputs| {
        let filters = || (0..width).filter(|&nth| has_past(nth));
        let sum: f64 = filters().map(|nth| before[nth]).sum();
        let rest: f64 = filters().map(|nth| gains[nth] * inputs[nth]).sum();
        off_rest += (sum - rest).powi(2);
        for i in 0..width {
            with_sum[i] += before[i] * sum;
            for j in 0..width {
                own[(i, j)] += inputs[i] * inputs[j];
                across[(i, j)] += before[i] * inputs[j];
            }
        }
    });
    let inverse = pseudo_inverse_above(&own, &own, DISTINCT).ok();
    let guess = inverse.map(|inverse| &across * inverse);
    let beginning = |nth: usize| {
        let mut at_rest = vec![0.0; width];
        at_rest[nth] = gains[nth];
        let known = Beginning {
            times: at_rest,
            shared: 0.0,
        };
        let Some(guess) = guess.as_ref().filter(|_| has_past(nth)) else {
            return known;
        };
        let of_sum = |input: usize| -> f64 {
            let filters = (0..width).filter(|&nth| has_past(nth));
            filters.map(|filter| guess[(filter, input)]).sum()
        };
        let explained = (0..width).map(|input| across[(nth, input)] * of_sum(input));
        let shared = (with_sum[nth] - explained.sum::<f64>()) / count.max(1) as f64;
        let times: Vec<f64> = (0..width).map(|input| guess[(nth, input)]).collect();
        if shared.is_finite() && times.iter().all(|times| times.is_finite()) {
            Beginning { times, shared }
        } else {
            known
        }
    };
    let all: Vec<Beginning> = (0..width).map(beginning).collect();
    let off: f64 = all.iter().map(|of| of.shared).sum();
    if off_rest / count.max(1) as f64 > AT_REST * off {
        all
    } else {
        Vec::new()
    }
}

/// Goes through what filters gave before each sample, beside the inputs of that, and counts the samples.
fn anywhere(
    model: &Polynomials,
    samples: &Samples,
    starts: &[Start],
    mut take: impl FnMut(&[f64], &[f64]),
) -> usize {
    let mut count = 0;
    let counted = Counted::from(0);
    let width = model.inputs.len();
    let (mut before, mut inputs) = (vec![0.0; width], vec![0.0; width]);
    for (segment, start) in samples.segments().zip(starts) {
        let length = segment.len();
        let segment = Segment::new(model, samples, segment, &counted);
        let brought = segment.brought(&start.values, false);
        for sample in 1..length {
            for nth in 0..width {
                before[nth] = brought[nth].whole[sample - 1];
                inputs[nth] = segment.inputs[nth][sample];
            }
            take(&before, &inputs);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::super::{InputOrders, Orders};
    use super::*;
    use crate::draws::normal;

    #[test]
    fn what_a_filter_gave_before_is_guessed_from_its_input_as_their_covariance_says() {
        let (persistence, pole) = (0.5, 0.9);
        let inputs = InputOrders {
            nb: 1,
            nk: 0,
            nf: 1,
        };
        let mut model = Polynomials::zero(&Orders {
            inputs: vec![inputs; 2],
            ..Orders::default()
        });
        model.inputs[0].b = vec![1.0];
        model.inputs[0].f = vec![-pole];
        model.inputs[1].b = vec![3.0];
        model.inputs[1].f = Vec::new();
        let (mut draw, mut samples, mut input) = (normal(3), Samples::new(2), 0.0);
        samples.segment();
        for _ in 0..200_000 {
            input = persistence * input + draw();
            samples.push([input, draw()], 0.0);
        }
        let start = Start {
            values: vec![0.0],
            told: 0.0,
        };
        let [filtered, known] = &beginnings(&model, &samples, &[start])[..] else {
            panic!("one for each input");
        };
        // Sums of powers: `Cov(x, u)`, `Var x` and `Var u` of a first-order filter of a first-order input.
        let of_input = 1.0 / (1.0 - persistence * persistence);
        let times = persistence / (1.0 - pole * persistence);
        let both = pole * persistence;
        let own = of_input * (1.0 + both) / ((1.0 - both) * (1.0 - pole * pole));
        let square = own - times * times * of_input;
        let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 0.05;
        assert!(near(filtered.times[0], times), "{filtered:?}, {times}");
        assert!(filtered.times[1].abs() < 0.05, "{filtered:?}");
        assert!(near(filtered.shared, square), "{filtered:?}, {square}");
        assert_eq!((&known.times[..], known.shared), (&[0.0, 3.0][..], 0.0));
    }
}
