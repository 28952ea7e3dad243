//! Decides from which of the models that may be started from the search goes on, and what the starts of filters count in it.

use super::anywhere::off_rest;
use super::initial;
use super::residuals::Left;
use super::search::Judged;
use super::segment::Counted;
use super::{Orders, Polynomials, PredictionError, Samples};
use crate::NumericsError;

/// How much smaller the sum of squares must become for a step of a rough search to be worth another, as a share of it.
const ROUGH: f64 = 1e-4;
/// Rough searches that end with sums that differ by this share ended in the same model.
const ALIKE: f64 = 1e-3;
/// Of the models to which rough searches lead, so many are searched on.
const MOST_ENDS: usize = 3;
/// Where filters cannot stand in for each other, so many rough searches begin, from the best starts.
const FEW: usize = 4;
/// The least mean square of how far from rest a filter begins, so that what its start counts is a number.
const LEAST_SQUARE: f64 = 1e-12;

/// Where a search begins.
pub(super) struct Begun {
    pub(super) start: Judged,
    pub(super) counted: Counted,
    /// Steps of the rough searches that led there.
    pub(super) steps: usize,
}

/// Where it may begin.
struct Led {
    models: Vec<Polynomials>,
    counted: Counted,
    steps: usize,
}

impl PredictionError {
    /// Where the search of a model of these orders begins, which contains those that are known.
    pub(super) fn begun(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
        radius: f64,
        known: &[Polynomials],
    ) -> Result<Begun, NumericsError> {
        let several = !known.is_empty() || shorter(orders, samples).is_some();
        let most = match orders.inputs.iter().filter(|input| input.nf > 0).count() {
            _ if !several => 1,
            ..=1 => FEW,
            _ => usize::MAX,
        };
        let mut known = known.to_vec();
        if several && known.is_empty() {
            let fewer = [shorter(orders, samples), with_fewer_values(orders)];
            let contained = fewer.into_iter().flatten();
            known.extend(
                contained.filter_map(|fewer| self.contained(&fewer, samples, first, radius, most)),
            );
        }
        let Led {
            models,
            counted,
            mut steps,
        } = self.led(orders, samples, first, radius, most, &known)?;
        let start = if several {
            let (mut ends, more) = self.ends(models, samples, &counted, radius, most)?;
            steps += more;
            ends.swap_remove(0)
        } else {
            let mut judged = self.in_order(models, samples, &counted).into_iter();
            judged.next().ok_or(NumericsError::NotFinite)?
        };
        Ok(Begun {
            start,
            counted,
            steps,
        })
    }

    /// The models to begin with, of which at most so many are searched roughly where it takes that to know what starts count: among
    /// them those that are known or, where none is, the best of those with a coefficient less.
    fn led(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
        radius: f64,
        most: usize,
        known: &[Polynomials],
    ) -> Result<Led, NumericsError> {
        let mut models = initial::starts(orders, samples, self.penalty, radius)?;
        models.extend(known.iter().filter_map(|model| model.padded(orders)));
        if most > 1 && known.is_empty() {
            let contained = shorter(orders, samples)
                .and_then(|fewer| self.contained(&fewer, samples, first, radius, most));
            models.extend(contained.and_then(|model| model.padded(orders)));
        }
        if let (Some(level), 0) = (self.level, orders.differences) {
            models.iter_mut().for_each(|model| model.level = level);
        }
        if orders.starts() > 0 && self.start_spread.is_finite() {
            let counted = self.counted(orders, first);
            return self.roughly(models, samples, &counted, radius, most);
        }
        Ok(Led {
            counted: self.counted(orders, first),
            models,
            steps: 0,
        })
    }

    /// What counts in a search of which nothing is known of starts.
    fn counted(&self, orders: &Orders, first: usize) -> Counted {
        Counted {
            measured: self.measured.max(orders.measured()),
            ..Counted::from(first)
        }
    }

    /// The best model of these orders, which others contain: no search errs more that begins with it.
    fn contained(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
        radius: f64,
        most: usize,
    ) -> Option<Polynomials> {
        let led = self.led(orders, samples, first, radius, most, &[]).ok()?;
        let ends = self.ends(led.models, samples, &led.counted, radius, most);
        Some(ends.ok()?.0.swap_remove(0).model)
    }

    /// What starts count where something is known of them: pieces begin anywhere, so that each filter is as far from rest there as
    /// it is on average. That, and how large innovations are, is known afterwards: it is searched roughly, with what the models to
    /// begin with leave wherever their filters begin.
    fn roughly(
        &self,
        begin: Vec<Polynomials>,
        samples: &Samples,
        unknown: &Counted,
        radius: f64,
        most: usize,
    ) -> Result<Led, NumericsError> {
        let rows = samples.counted(unknown.first, unknown.measured) as f64;
        let most_squares = self.start_spread * self.start_spread;
        // Squares that are together more than may be are all as much smaller.
        let counts = |sum: f64, squares: &[f64]| {
            let scale = (most_squares / squares.iter().sum::<f64>()).min(1.0);
            let of = |square: &f64| sum / rows / (scale * square).max(LEAST_SQUARE);
            Counted {
                starts: squares.iter().map(of).collect(),
                ..unknown.clone()
            }
        };
        let free = |model: &Polynomials| Left::by(model, samples, unknown).innovations();
        let least = begin.iter().map(free).fold(f64::INFINITY, f64::min);
        let starts = begin.first().map_or(0, Polynomials::starts);
        let counted = counts(least, &vec![most_squares; starts]);
        let (ends, steps) = self.ends(begin, samples, &counted, radius, most)?;
        let Judged { model, left, .. } = &ends[0];
        let squares = off_rest(model, samples, &left.starts);
        Ok(Led {
            counted: counts(left.sum() / left.mean, &squares),
            steps,
            models: ends.into_iter().map(|end| end.model).collect(),
        })
    }

    /// What these models leave, the best first, without those of which that is no number.
    fn in_order(
        &self,
        models: Vec<Polynomials>,
        samples: &Samples,
        counted: &Counted,
    ) -> Vec<Judged> {
        let models = models.into_iter();
        let judged = models.map(|model| self.judged(model, samples, counted));
        let mut finite: Vec<Judged> = judged.filter(|of| of.sum.is_finite()).collect();
        finite.sort_by(|of, other| of.sum.total_cmp(&other.sum));
        finite
    }

    /// The models to which rough searches from the best of these lead, of at most so many, the best first, and in how many steps
    /// to that.
    fn ends(
        &self,
        begin: Vec<Polynomials>,
        samples: &Samples,
        counted: &Counted,
        radius: f64,
        most: usize,
    ) -> Result<(Vec<Judged>, usize), NumericsError> {
        let begin = self.in_order(begin, samples, counted);
        let searched = begin.into_iter().take(most).map(|start| {
            let (end, steps, _) = self.search(start, samples, counted, radius, ROUGH);
            (end, steps)
        });
        let mut ends: Vec<(Judged, usize)> = searched.collect();
        ends.sort_by(|(of, _), (other, _)| of.sum.total_cmp(&other.sum));
        ends.dedup_by(|(next, _), (of, _)| next.sum <= of.sum * (1.0 + ALIKE));
        ends.truncate(MOST_ENDS);
        let steps = ends.first().ok_or(NumericsError::NotFinite)?.1;
        Ok((ends.into_iter().map(|(end, _)| end).collect(), steps))
    }
}

/// The orders with a coefficient less from whose best model a search begins too, since none of its other starts may be near the
/// least error: of filters with more than one pole, where poles that stand in for each other hold a search that begins with only
/// some of them right, and of noise that is found from values of which some are missing.
fn shorter(orders: &Orders, samples: &Samples) -> Option<Orders> {
    let mut shorter = orders.clone();
    let longest = longest_filter(orders);
    if longest > 1 {
        for input in &mut shorter.inputs {
            input.nf = input.nf.min(longest - 1);
        }
    } else if orders.nc > 1 && samples.missing() > 0 {
        shorter.nc -= 1;
    } else {
        return None;
    }
    Some(shorter)
}

/// The orders with a value less of each input that has several; none where no input has.
fn with_fewer_values(orders: &Orders) -> Option<Orders> {
    let mut fewer = orders.clone();
    for input in &mut fewer.inputs {
        input.nb -= usize::from(input.nb > 1);
    }
    (fewer != *orders).then_some(fewer)
}

fn longest_filter(orders: &Orders) -> usize {
    let lengths = orders.inputs.iter().map(|input| input.nf);
    lengths.max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::brought::through;
    use super::*;
    use crate::InputOrders;
    use crate::draws::normal;

    /// What two inputs that change now and then lead to through filters with one pole and with two.
    fn two_filters(count: usize, seed: u64) -> Samples {
        let mut draw = normal(seed);
        let mut held = |steps: usize| -> Vec<f64> {
            let mut value = 0.0;
            let next = |sample| {
                if sample % steps == 0 {
                    value = draw();
                }
                value
            };
            (0..count).map(next).collect()
        };
        let inputs = [held(4), held(5)];
        let noise = held(1);
        let of = |input: &[f64], b: [f64; 2], f: &[f64]| -> Vec<f64> {
            let filtered = through(f, input, 0.0).0;
            let before = [0.0].into_iter().chain(filtered.iter().copied());
            let both = filtered.iter().zip(before);
            both.map(|(now, before)| b[0] * now + b[1] * before)
                .collect()
        };
        let first = of(&inputs[0], [0.7, -0.3], &[-0.9]);
        let second = of(&inputs[1], [0.4, 0.2], &[-0.5, 0.3]);
        let mut samples = Samples::new(2);
        for sample in 0..count {
            let value = first[sample] + second[sample] + 0.3 * noise[sample];
            samples.push([inputs[0][sample], inputs[1][sample]], value);
        }
        samples.divided(samples.spread())
    }

    #[test]
    fn one_filter_with_more_poles_errs_no_more_than_with_fewer() {
        let search = PredictionError {
            start_spread: std::f64::consts::SQRT_2,
            ..PredictionError::default()
        };
        for seed in 0..6 {
            let mut draw = normal(seed);
            let mut white = |size: f64| -> Vec<f64> { (0..600).map(|_| size * draw()).collect() };
            let (input, noise) = (through(&[-0.9], &white(1.0), 0.0).0, white(0.2));
            let poles = [0.97, 0.8, 0.6].iter();
            let brought = poles.fold(input.clone(), |of, pole| through(&[-pole], &of, 0.0).0);
            let mut samples = Samples::new(1);
            for sample in 1..600 {
                samples.push([input[sample - 1]], 0.01 * brought[sample] + noise[sample]);
            }
            let samples = samples.divided(samples.spread());
            let orders = |nb: usize, nf: usize| Orders {
                inputs: vec![InputOrders { nb, nf, nk: 0 }],
                ..Orders::default()
            };
            let errs = |(nb, nf)| search.fit(&orders(nb, nf), &samples, 2).unwrap();
            let all = [(1, 1), (1, 2), (2, 2), (1, 3), (2, 3)];
            let fits = all.map(|of| errs(of).residual_sum_of_squares);
            for (of, found) in all.iter().zip(fits) {
                for (other, contained) in all.iter().zip(fits) {
                    let contains = other.0 <= of.0 && other.1 <= of.1;
                    assert!(
                        !contains || found <= 1.01 * contained,
                        "{seed}: {of:?} {found}, {other:?} {contained}"
                    );
                }
            }
        }
    }

    #[test]
    fn where_values_are_missing_noise_with_a_longer_memory_begins_with_a_shorter_one() {
        let mut samples = Samples::new(0);
        (0..9).for_each(|_| samples.push([], 1.0));
        let noise = |nc: usize| Orders {
            nc,
            ..Orders::default()
        };
        assert_eq!(shorter(&noise(3), &samples), None);
        samples.push_missing([]);
        assert_eq!(shorter(&noise(3), &samples), Some(noise(2)));
        assert_eq!(shorter(&noise(1), &samples), None);
    }

    #[test]
    fn a_search_begins_with_the_best_that_is_known_and_passes_over_what_it_does_not_contain() {
        let samples = two_filters(300, 1);
        let orders = |nf: [usize; 2]| Orders {
            inputs: nf.map(|nf| InputOrders { nb: 2, nf, nk: 0 }).to_vec(),
            ..Orders::default()
        };
        let found = PredictionError::default()
            .fit(&orders([1, 1]), &samples, 2)
            .unwrap();
        let no_steps = PredictionError {
            most_steps: 0,
            ..PredictionError::default()
        };
        let errs = |nf: [usize; 2], known: &[Polynomials]| {
            let fit = no_steps.fit_beside(&orders(nf), &samples, 2, known);
            fit.unwrap().residual_sum_of_squares
        };
        let model = std::slice::from_ref(&found.model);
        let least = found.residual_sum_of_squares * (1.0 + 1e-9);
        assert!(errs([1, 2], model) <= least && errs([1, 1], &[]) > least);
        assert!(errs([1, 0], model) > least);
    }

    #[test]
    fn a_model_errs_no_more_than_one_that_it_contains() {
        let search = PredictionError {
            start_spread: std::f64::consts::SQRT_2,
            ..PredictionError::default()
        };
        for (count, seed) in [80, 200, 500]
            .into_iter()
            .flat_map(|n| (0..10).map(move |s| (n, s)))
        {
            let samples = two_filters(count, seed);
            let squares = |nf: [usize; 2]| {
                let inputs = nf.map(|nf| InputOrders { nb: 2, nf, nk: 0 });
                let orders = Orders {
                    inputs: inputs.to_vec(),
                    ..Orders::default()
                };
                let fit = search.fit(&orders, &samples, 2).unwrap();
                fit.residual_sum_of_squares
            };
            let [one, longer, two] = [[1, 1], [1, 2], [2, 2]].map(squares);
            // What starts count is not the same in all, by which sums may differ a little.
            let fine = |of: f64, contained: f64| of <= 1.03 * contained;
            assert!(
                fine(longer, one) && fine(two, longer),
                "{count}, {seed}: {one}, {longer}, {two}"
            );
        }
    }
}
