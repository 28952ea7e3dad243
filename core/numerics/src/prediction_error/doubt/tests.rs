//! What a stepper expects after a start at which filters may be anywhere, beside what all samples together tell.

use faer::Mat;
use faer::linalg::solvers::Solve;

use super::super::{Polynomials, Stepper, Transfer};
use crate::draws::uniform;

const SQUARES: [f64; 2] = [30.0, 4.0];
/// Of noise that is followed.
const NOISE: f64 = 7.0;
/// Of noise that may be anywhere, by hand.
const MOST_NOISE: f64 = 1e6;

/// How near what is known by hand of a model is.
fn near(model: &Polynomials, found: f64, expected: f64) -> bool {
    let share = if model.differences > 0 { 1e-4 } else { 1e-9 };
    (found - expected).abs() < share * (1.0 + expected.abs())
}

/// A slow filter and one that swings, with such noise.
fn model(c: &[f64], d: &[f64], differences: usize) -> Polynomials {
    let filter = |f: &[f64]| Transfer {
        delay: 0,
        b: vec![0.3],
        f: f.to_vec(),
    };
    Polynomials {
        a: vec![],
        inputs: vec![filter(&[-0.98]), filter(&[-1.6, 0.8])],
        c: c.to_vec(),
        d: d.to_vec(),
        differences,
        level: 0.0,
    }
}

fn models() -> [Polynomials; 5] {
    [
        model(&[], &[], 0),
        model(&[0.6, 0.2], &[], 0),
        model(&[], &[-0.7], 0),
        model(&[0.5], &[-1.1, 0.3], 0),
        model(&[0.4], &[-0.3], 1),
    ]
}

/// What is not known: what filters gave, the noise about the first sample where it is followed, innovations before it and of each.
struct Unknown {
    covariance: Mat<f64>,
    /// What each leads to in each sample.
    samples: Mat<f64>,
}

impl Unknown {
    fn of(model: &Polynomials, count: usize) -> Self {
        let (whitening, nc) = (model.whitening(), model.c.len());
        let all = 4 + nc + count;
        let mut covariance = Mat::<f64>::identity(all, all);
        covariance[(0, 0)] = SQUARES[0];
        // The autocorrelation of an autoregression of second order (Brockwell and Davis 1991, section 3.3).
        let [f1, f2] = model.inputs[1].f[..] else {
            panic!("two coefficients");
        };
        let alike = -f1 / (1.0 + f2);
        for (i, j, of) in [(1, 1, 1.0), (2, 2, 1.0), (1, 2, alike), (2, 1, alike)] {
            covariance[(i, j)] = SQUARES[1] * of;
        }
        let followed = !whitening.is_empty();
        // Where the first sample says what it is, it is as unsure as that noise may be.
        covariance[(3, 3)] = if model.differences > 0 {
            MOST_NOISE
        } else {
            NOISE
        };
        let mut samples = Mat::zeros(count, all);
        for unknown in 0..all {
            let is = |nth: usize| f64::from(u8::from(nth == unknown));
            let (mut slow, mut swing) = (is(0), [is(1), is(2)]);
            let mut noise = vec![is(3); whitening.len()];
            for sample in 0..count {
                slow *= -model.inputs[0].f[0];
                swing = [-f1 * swing[0] - f2 * swing[1], swing[0]];
                let innovation = |lag: usize| is(4 + nc + sample - lag);
                let c = (1..).zip(&model.c).map(|(lag, c)| c * innovation(lag));
                let moved = innovation(0) + c.sum::<f64>();
                let back = whitening.iter().zip(&noise).map(|(w, n)| w * n);
                let mut own = moved - back.sum::<f64>();
                if followed && sample == 0 {
                    own = is(3);
                } else if followed {
                    noise.rotate_right(1);
                    noise[0] = own;
                }
                samples[(sample, unknown)] = slow + swing[0] + own;
            }
        }
        Self {
            covariance,
            samples,
        }
    }

    /// What the last sample is expected to be and with which variance, where some of those before it are known.
    fn expected(&self, known: &[Option<f64>]) -> (f64, f64) {
        let covariance = &self.samples * &self.covariance * self.samples.transpose();
        let told = known.iter().enumerate();
        let told: Vec<(usize, f64)> = told.filter_map(|(nth, of)| Some((nth, (*of)?))).collect();
        let (count, last) = (told.len(), known.len());
        let among = Mat::from_fn(count, count, |i, j| covariance[(told[i].0, told[j].0)]);
        let with = Mat::from_fn(count, 1, |i, _| covariance[(told[i].0, last)]);
        let weights = among.partial_piv_lu().solve(&with);
        let expected = (0..count).map(|i| weights[(i, 0)] * told[i].1).sum();
        let explained: f64 = (0..count).map(|i| weights[(i, 0)] * with[(i, 0)]).sum();
        (expected, covariance[(last, last)] - explained)
    }
}

fn begun(model: &Polynomials) -> Stepper {
    let mut stepper = Stepper::new(model.clone());
    stepper.begin(|_| 0.0, |_| 0.0, |nth| SQUARES[nth]);
    stepper
}

fn of_noise(model: &Polynomials) -> f64 {
    if model.differences > 0 {
        f64::INFINITY
    } else {
        NOISE
    }
}

fn doubt(stepper: &Stepper, steps: usize) -> f64 {
    stepper.doubt(steps, &mut vec![0.0; stepper.remembers()])
}

#[test]
fn after_a_start_samples_tell_where_filters_are_as_all_of_them_together_do() {
    for model in models() {
        for seed in 0..4 {
            let (mut chance, mut known) = (uniform(seed), Vec::new());
            let mut stepper = begun(&model);
            for nth in 0..25 {
                let unknown = Unknown::of(&model, nth + 1);
                let value = (nth == 0 || chance() > -0.4).then(|| 5.0 * chance());
                if nth > 0 {
                    let (expected, variance) = unknown.expected(&known);
                    let ahead = 1.0 + doubt(&stepper, 1);
                    assert!(
                        near(&model, ahead, variance),
                        "{model:?}, {nth}: {ahead}, not {variance}"
                    );
                    let found = stepper.step(|_| 0.0, value);
                    assert!(
                        near(&model, found, expected),
                        "{model:?}, {nth}: {found}, not {expected}"
                    );
                } else {
                    stepper.first(|_| 0.0, value.unwrap(), of_noise(&model));
                }
                known.push(value);
            }
        }
    }
}

#[test]
fn further_ahead_the_doubt_of_filters_is_what_they_lead_to_there() {
    for model in models() {
        let variances = model.variances(30);
        for known in 1..8 {
            let mut stepper = begun(&model);
            stepper.first(|_| 0.0, 0.0, of_noise(&model));
            (1..known).for_each(|_| _ = stepper.step(|_| 0.0, Some(0.0)));
            for ahead in 1..20 {
                let mut samples = vec![Some(0.0); known];
                samples.resize(known + ahead - 1, None);
                let (_, expected) = Unknown::of(&model, known + ahead).expected(&samples);
                let found = variances[ahead - 1] + doubt(&stepper, ahead);
                assert!(
                    near(&model, found, expected),
                    "{model:?}, {ahead} after {known}: {found}, not {expected}"
                );
            }
        }
    }
}

#[test]
fn a_filter_is_told_by_its_input_alone_once_it_is_known() {
    let mut stepper = begun(&model(&[], &[], 0));
    stepper.first(|_| 0.0, 10.0, 0.0);
    let mut last = doubt(&stepper, 1);
    assert!(last > 1.0, "{last}");
    // Every hundred samples, since what swings is less unsure at times than afterwards.
    for _ in 0..20 {
        (0..100).for_each(|_| _ = stepper.step(|_| 0.0, Some(0.0)));
        let now = doubt(&stepper, 1);
        assert!(now < last || last == 0.0, "{now} after {last}");
        last = now;
    }
    assert_eq!(last, 0.0);
    let (mut one, mut other) = (stepper.clone(), stepper);
    one.step(|_| 1.0, Some(100.0));
    other.step(|_| 1.0, Some(-100.0));
    assert_eq!(one, other);
}

#[test]
fn noise_that_is_followed_has_the_more_of_a_first_sample_the_more_it_varies() {
    let model = model(&[], &[-0.7], 0);
    for noise in [0.0, 17.0, f64::INFINITY] {
        let mut stepper = Stepper::new(model.clone());
        // As in the sample, one step after.
        let squares = [34.0 / (0.98 * 0.98), 0.0];
        stepper.begin(|_| 0.0, |_| 0.0, |nth| squares[nth]);
        stepper.first(|_| 0.0, 1.0, noise);
        let share = 34.0 / (34.0 + noise);
        let expected = 0.98 * share + 0.7 * (1.0 - share);
        let found = stepper.step(|_| 0.0, None);
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    }
}
