//! Decides from which of the models that may be started from the search goes on, and what the starts of filters count in it.

use super::anywhere::off_rest;
use super::initial;
use super::residuals::{Counted, Left};
use super::search::Judged;
use super::{Orders, Polynomials, PredictionError, Samples};
use crate::NumericsError;

/// How much smaller the sum of squares must become for a step of a rough search to be worth another, as a share of it.
const ROUGH: f64 = 1e-4;
/// Rough searches that end with sums that differ by this share ended in the same model.
const ALIKE: f64 = 1e-3;
/// Of the models to which rough searches lead, so many are searched on.
const MOST_ENDS: usize = 3;
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
    /// Where the search of a model of these orders begins.
    pub(super) fn begun(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
        radius: f64,
    ) -> Result<Begun, NumericsError> {
        let several = has_several_ends(orders);
        let most = if several { usize::MAX } else { 1 };
        let Led {
            models,
            counted,
            mut steps,
        } = self.led(orders, samples, first, radius, most)?;
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

    /// The models to begin with, of which at most so many are searched roughly where it takes that to know what starts count.
    fn led(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
        radius: f64,
        most: usize,
    ) -> Result<Led, NumericsError> {
        let mut models = initial::starts(orders, samples, self.penalty, radius)?;
        if most > 1 {
            models.extend(self.with_shorter_filters(orders, samples, first, radius, most));
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

    /// The best model whose longest filters have a coefficient less, which is 0: no search that begins there errs more.
    fn with_shorter_filters(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
        radius: f64,
        most: usize,
    ) -> Option<Polynomials> {
        let longest = longest_filter(orders);
        if longest < 2 {
            return None;
        }
        let mut shorter = orders.clone();
        for input in &mut shorter.inputs {
            input.nf = input.nf.min(longest - 1);
        }
        let led = self.led(&shorter, samples, first, radius, most).ok()?;
        let ends = self.ends(led.models, samples, &led.counted, radius, most);
        let mut model = ends.ok()?.0.swap_remove(0).model;
        for (transfer, input) in model.inputs.iter_mut().zip(&orders.inputs) {
            transfer.f.resize(input.nf, 0.0);
        }
        Some(model)
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

/// Whether the least error is looked for from several starts: what one of several filters lacks another takes over, from where
/// no small step leads on. Of filters with one pole each that has not been seen.
fn has_several_ends(orders: &Orders) -> bool {
    let filters = orders.inputs.iter().filter(|input| input.nf > 0);
    filters.count() > 1 && longest_filter(orders) > 1
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
