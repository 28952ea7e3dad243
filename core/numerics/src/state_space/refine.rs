//! Decides with which `B`, `D` and gain one-step forecasts err least; not what `A` and `C` are.

use faer::Mat;

use super::lagged::{Products, pseudo_inverse, pseudo_inverse_left};
use super::model::spectral_radius;
use super::{Record, StateSpace};
use crate::NumericsError;

/// The most steps with the gain, and halvings of one.
const MOST_STEPS: usize = 10;
const MOST_HALVINGS: u32 = 8;
/// The share of the squares of errors that a step takes away where another is worth its pass over the rows. Steps beyond it
/// follow the noise: they lower these squares and no others.
const WORTH: f64 = 0.01;
/// The share of the squares of outputs that errors have where there is no noise, and so nothing to find a gain from.
const EXACT: f64 = 1e-18;
/// Time constants that pass within the longest record: a filter that forgets more slowly than so is not looked for, since the
/// states in which records begin could then explain anything.
const FORGOTTEN: f64 = 5.0;
/// The slowest filter that is looked for in any record.
const SLOWEST_FILTER: f64 = 0.9995;

/// Finds `B`, `D`, the gain and the state in which each record begins such that one-step forecasts err least, `A` and `C`
/// given, from the gain that the model has.
///
/// With the gain given, that is linear (Ljung 1999, section 10.6); with it, steps by Gauss and Newton (Ljung 1999, section
/// 10.2), halved where errors would become larger. The covariances of what a regression on states leaves have in them how
/// uncertain those states are, with which the gain from them is too small on few rows; this one does not go by them.
/// Without noise the gain is 0.
pub(super) fn refine(
    model: &mut StateSpace,
    records: &[Record<'_>],
    width: usize,
    feedthrough: bool,
) -> Result<(), NumericsError> {
    let order = model.order();
    let search = Search {
        records,
        width,
        feedthrough,
    };
    model.b = Mat::zeros(order, width);
    model.d = vec![0.0; width];
    let starts = vec![vec![0.0; order]; records.len()];
    let blank = Candidate {
        model: model.clone(),
        starts,
    };
    let mut best = blank.moved(&search.step(&blank, Free::Inputs)?, 1.0);
    let mut left = search.squares(&best);
    let mut most = MOST_STEPS;
    let outputs = records.iter().flat_map(|record| record.outputs);
    if left <= EXACT * outputs.map(|y| y * y).sum::<f64>() {
        best.model.k = vec![0.0; order];
        most = 0;
    }
    let slowest = search.slowest(&best.model);
    for _ in 0..most {
        let step = search.step(&best, Free::InputsAndGain)?;
        let better = (0..MOST_HALVINGS).find_map(|halvings| {
            let shorter = best.moved(&step, 0.5_f64.powi(halvings.cast_signed()));
            let squares = search.squares(&shorter);
            (squares < left && radius(&shorter.model) <= slowest).then_some((shorter, squares))
        });
        let Some((moved, squares)) = better else {
            break;
        };
        let worth = left - squares > WORTH * left;
        (best, left) = (moved, squares);
        if !worth {
            break;
        }
    }
    let last = search.step(&best, Free::Inputs)?;
    *model = best.moved(&last, 1.0).model;
    Ok(())
}

/// The state in which a record begins from which its one-step errors are least.
pub(super) fn beginning(
    model: &StateSpace,
    record: &Record<'_>,
) -> Result<Vec<f64>, NumericsError> {
    let order = model.order();
    let begin = order * model.d.len();
    let of_start = Responses {
        model,
        direct: 0,
        of_gain: 0,
    };
    let products = of_start.products(record, &vec![0.0; order]);
    let own = products.submatrix(begin, begin, order, order);
    let with_errors = products.submatrix(begin, begin + order, order, 1);
    let start = pseudo_inverse(&own.to_owned())? * with_errors;
    Ok((0..order).map(|i| start[(i, 0)]).collect())
}

/// The largest modulus among the eigenvalues of `A − K C`.
fn radius(model: &StateSpace) -> f64 {
    spectral_radius(&filter(model))
}

fn filter(model: &StateSpace) -> Mat<f64> {
    let order = model.order();
    Mat::from_fn(order, order, |i, j| {
        model.a[(i, j)] - model.k[i] * model.c[j]
    })
}

/// What a step changes beside the states in which records begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Free {
    Inputs,
    InputsAndGain,
}

struct Search<'a> {
    records: &'a [Record<'a>],
    width: usize,
    feedthrough: bool,
}

/// A model, and the state in which each record begins.
struct Candidate {
    model: StateSpace,
    starts: Vec<Vec<f64>>,
}

/// What is added to a candidate.
struct Step {
    b: Mat<f64>,
    d: Vec<f64>,
    k: Vec<f64>,
    starts: Vec<Vec<f64>>,
}

impl Candidate {
    fn moved(&self, step: &Step, share: f64) -> Self {
        let along = |at: &[f64], changes: &[f64]| -> Vec<f64> {
            let both = at.iter().zip(changes);
            both.map(|(at, change)| at + share * change).collect()
        };
        let Self { model, starts } = self;
        let both = starts.iter().zip(&step.starts);
        Self {
            model: StateSpace {
                a: model.a.clone(),
                b: Mat::from_fn(model.b.nrows(), model.b.ncols(), |i, j| {
                    model.b[(i, j)] + share * step.b[(i, j)]
                }),
                c: model.c.clone(),
                d: along(&model.d, &step.d),
                k: along(&model.k, &step.k),
            },
            starts: both.map(|(start, step)| along(start, step)).collect(),
        }
    }
}

impl Search<'_> {
    /// The squares of one-step errors of all records.
    fn squares(&self, of: &Candidate) -> f64 {
        let mut squares = 0.0;
        for (record, start) in self.records.iter().zip(&of.starts) {
            let expected = of.model.one_step(record, start);
            let errors = record.outputs.iter().zip(&expected);
            squares += errors
                .map(|(y, expected)| (y - expected).powi(2))
                .sum::<f64>();
        }
        squares
    }

    /// The radius that no filter may come to have: that of the one at the beginning, where it is larger than others may have.
    fn slowest(&self, model: &StateSpace) -> f64 {
        let longest = self.records.iter().map(Record::len).max().unwrap_or(0);
        let forgotten = 1.0 - FORGOTTEN / longest.max(1) as f64;
        radius(model).max(forgotten.min(SLOWEST_FILTER))
    }

    /// The least squares of the errors on what one-step forecasts do when `B`, `D`, the gain and the beginnings change.
    fn step(&self, at: &Candidate, free: Free) -> Result<Step, NumericsError> {
        let model = &at.model;
        let (order, width) = (model.order(), self.width);
        let of_states = order * width;
        let direct = if self.feedthrough { width } else { 0 };
        let of_gain = match free {
            Free::Inputs => 0,
            Free::InputsAndGain => order,
        };
        let shared = of_states + direct + of_gain;
        let mut whole = Mat::<f64>::zeros(shared, shared);
        let mut own = Mat::<f64>::zeros(shared, shared);
        let mut with_errors = Mat::<f64>::zeros(shared, 1);
        let mut of_records = Vec::with_capacity(self.records.len());
        for (record, start) in self.records.iter().zip(&at.starts) {
            let products = Responses {
                model,
                direct,
                of_gain,
            }
            .products(record, start);
            let (error, begin) = (shared + order, shared);
            let part = |i, j, rows, columns| products.submatrix(i, j, rows, columns).to_owned();
            // The beginning is this record's own: it is taken out before records are summed.
            let inverse = pseudo_inverse(&part(begin, begin, order, order))?;
            let across = inverse * part(begin, 0, order, shared + order + 1);
            let mine = part(0, 0, shared, shared);
            let taken = part(0, begin, shared, order) * across.subcols(0, shared);
            own += &mine - taken;
            whole += mine;
            with_errors += part(0, error, shared, 1)
                - part(0, begin, shared, order) * across.subcols(error, 1);
            of_records.push(across);
        }
        let found = pseudo_inverse_left(&own, &whole)? * with_errors;
        let found: Vec<f64> = (0..shared).map(|i| found[(i, 0)]).collect();
        let starts = of_records.iter().map(|across| {
            let start = |i: usize| -> f64 {
                let explained: f64 = (0..shared).map(|j| across[(i, j)] * found[j]).sum();
                across[(i, shared + order)] - explained
            };
            (0..order).map(start).collect()
        });
        let mut d = found[of_states..of_states + direct].to_vec();
        d.resize(width, 0.0);
        let mut k = found[of_states + direct..].to_vec();
        k.resize(order, 0.0);
        Ok(Step {
            b: Mat::from_fn(order, width, |i, j| found[j * order + i]),
            d,
            k,
            starts: starts.collect(),
        })
    }
}

/// What one-step forecasts do when something of a model changes.
struct Responses<'a> {
    model: &'a StateSpace,
    /// How many columns `D` and the gain have.
    direct: usize,
    of_gain: usize,
}

impl Responses<'_> {
    /// The products of the responses to `B`, `D`, the gain and the beginning, in this order, and of the errors.
    fn products(&self, record: &Record<'_>, start: &[f64]) -> Mat<f64> {
        let Self {
            model,
            direct,
            of_gain,
        } = *self;
        let (order, width) = (model.order(), model.d.len());
        let of_states = order * width;
        let gain = of_states + direct;
        let begin = gain + of_gain;
        let columns = begin + order;
        let filter = filter(model);
        let mut products = Products::new(columns + 1);
        // Each column is the state that a unit of one change brings about.
        let mut brought = Mat::<f64>::zeros(order, columns);
        for i in 0..order {
            brought[(i, begin + i)] = 1.0;
        }
        let mut row = vec![0.0; columns + 1];
        let forecasts = model.one_step(record, start);
        for (t, (y, expected)) in record.outputs.iter().zip(forecasts).enumerate() {
            let input = record.input(t);
            let error = y - expected;
            for (j, response) in row.iter_mut().take(columns).enumerate() {
                *response = (0..order).map(|i| model.c[i] * brought[(i, j)]).sum();
            }
            for (j, u) in input.iter().enumerate().take(direct) {
                row[of_states + j] += u;
            }
            row[columns] = error;
            products.add(&row);
            brought = &filter * &brought;
            for i in 0..order {
                for (j, u) in input.iter().enumerate() {
                    brought[(i, j * order + i)] += u;
                }
                for (j, u) in input.iter().enumerate().take(direct) {
                    brought[(i, of_states + j)] -= model.k[i] * u;
                }
                if of_gain > 0 {
                    brought[(i, gain + i)] += error;
                }
            }
        }
        products.summed()
    }
}
