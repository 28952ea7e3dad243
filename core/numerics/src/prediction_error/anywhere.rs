//! Decides how filters of inputs stand at samples anywhere, from which follows how they may stand where nothing of before is
//! known; not what samples tell of where they began.

use serde::{Deserialize, Serialize};

use super::segment::{Counted, Segment};
use super::starts::Start;
use super::{Polynomials, Samples, Transfer};

/// Filters are taken to be at rest unless they are then on average more than three times as far off as the best guess, in mean
/// squares: many runs begin shortly after a rest, nearer to it than samples anywhere.
const AT_REST: f64 = 9.0;

/// Where the filter of an input begins where only the inputs are known.
///
/// What a filter gave until then is guessed from its input by the best linear predictor, by least squares through 0 over samples
/// anywhere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beginning {
    /// The guess, in times of the input.
    pub times: f64,
    /// The mean square of how far off the guess is.
    pub square: f64,
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
    let mut sums = vec![[0.0; 3]; model.inputs.len()];
    let count = anywhere(model, samples, starts, |before, inputs| {
        for ([of_input, both, own], (before, input)) in
            sums.iter_mut().zip(before.iter().zip(inputs))
        {
            *of_input += input * input;
            *both += before * input;
            *own += before * before;
        }
    });
    let (mut off, mut off_rest) = (0.0, 0.0);
    let mut beginning = |(of, &[of_input, both, own]): (&Transfer, &[f64; 3])| {
        let (gain, times) = (of.gain(), both / of_input);
        if of.f.is_empty() || !times.is_finite() {
            return Beginning {
                times: gain,
                square: 0.0,
            };
        }
        let square = (own - times * both).max(0.0) / count.max(1) as f64;
        off += square;
        off_rest += square + (gain - times).powi(2) * of_input / count.max(1) as f64;
        Beginning { times, square }
    };
    let all: Vec<Beginning> = model.inputs.iter().zip(&sums).map(&mut beginning).collect();
    // Written so that NaN is at rest.
    if off_rest.is_finite() && off_rest > AT_REST * off {
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
        let (persistence, pole) = (0.5, 0.95);
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
            determined: 0.0,
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
        assert!(near(filtered.times, times), "{filtered:?}, {times}");
        assert!(near(filtered.square, square), "{filtered:?}, {square}");
        assert_eq!((known.times, known.square), (3.0, 0.0));
    }
}
