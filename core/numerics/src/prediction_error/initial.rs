//! Decides where the search for a model starts: with least squares on long regressions, which need no start.

use super::brought::{Past, through};
use super::residuals::Left;
use super::segment::Counted;
use super::{Orders, Polynomials, Samples, Transfer};
use crate::{GramBlocks, LeastSquares, NumericsError, Standardization};

/// How often the filters of Steiglitz and McBride are renewed.
const RENEWALS: usize = 20;

/// Where poles are looked for beside.
const POLES: [f64; 6] = [0.5, 0.8, 0.9, 0.95, 0.98, 0.995];
/// The same where values are missing, which may come much less often than samples.
const SLOW_POLES: [f64; 3] = [0.998, 0.999, 0.9995];

/// Models to start from; the best of them is taken.
pub(super) fn starts(
    orders: &Orders,
    samples: &Samples,
    penalty: f64,
    radius: f64,
) -> Result<Vec<Polynomials>, NumericsError> {
    let mut differenced = samples.filled();
    for _ in 0..orders.differences {
        differenced = differenced.differenced();
    }
    let whole = |model: Polynomials| Polynomials {
        differences: orders.differences,
        ..model.stabilised(radius)
    };
    let direct = Orders {
        differences: 0,
        ..orders.clone()
    };
    let filtered = orders.inputs.iter().any(|input| input.nf > 0);
    let plants = if filtered {
        let searched = steiglitz_mcbride(&direct, &differenced, penalty);
        let given = POLES
            .iter()
            .map(|&pole| one_pole(&direct, &differenced, penalty, pole));
        let (found, failed): (Vec<_>, Vec<_>) = std::iter::once(searched)
            .chain(given)
            .partition(Result::is_ok);
        if found.is_empty() {
            failed.into_iter().collect::<Result<Vec<_>, _>>()?
        } else {
            found.into_iter().flatten().collect()
        }
    } else {
        let mut sparse = Vec::new();
        if samples.missing() > 0 && orders.na > 0 && orders.differences == 0 {
            let poles = POLES.iter().chain(&SLOW_POLES);
            let found = poles.map(|&pole| from_known(orders, samples, penalty, pole));
            sparse.extend(found.filter_map(Result::ok).map(whole));
        }
        match regression(&direct, &differenced, penalty, 0) {
            Ok(found) => vec![found],
            // Values are too far apart for it.
            Err(_) if !sparse.is_empty() => return Ok(sparse),
            Err(error) => return Err(error),
        }
    };
    let mut starts = Vec::new();
    for plant in plants {
        // Segments may be too short for the longer regressions, which are but a better start.
        if orders.nc + orders.nd > 0 {
            starts.extend(with_noise(&direct, &plant, &differenced).map(whole));
        }
        if !filtered && orders.nc > 0 {
            starts.extend(hannan_rissanen(&direct, &differenced, penalty).map(whole));
        }
        starts.push(whole(plant));
    }
    Ok(starts)
}

/// Least squares of `y` on its own past and that of the inputs, and with `longer` of it on as many more of both.
fn regression(
    orders: &Orders,
    samples: &Samples,
    penalty: f64,
    longer: usize,
) -> Result<Polynomials, NumericsError> {
    let (na, nb) = (orders.na + longer, |nb: usize| nb + longer);
    let mut model = Polynomials::zero(orders);
    model.a = vec![0.0; na];
    for (transfer, input) in model.inputs.iter_mut().zip(&orders.inputs) {
        *transfer = Transfer {
            delay: input.nk,
            b: vec![0.0; nb(input.nb)],
            f: Vec::new(),
        };
    }
    let columns = na
        + model
            .inputs
            .iter()
            .map(|input| input.b.len())
            .sum::<usize>();
    let mut rows = Rows::new(columns);
    for segment in samples.segments() {
        let values = samples.values(segment.clone());
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| samples.input(segment.clone(), nth))
            .collect();
        for sample in na..values.len() {
            let past = (1..=na).map(|lag| -values[sample - lag]);
            let of_inputs = model.inputs.iter().zip(&inputs).flat_map(|(of, values)| {
                let before = values[0];
                (0..of.b.len()).map(move |j| Past { values, before }.at(sample, of.delay + j))
            });
            rows.push(past.chain(of_inputs), values[sample]);
        }
    }
    let (found, intercept) = rows.solve(penalty)?;
    let (a, mut b) = found.split_at(na);
    model.a.copy_from_slice(a);
    for input in &mut model.inputs {
        let (own, rest) = b.split_at(input.b.len());
        input.b.copy_from_slice(own);
        b = rest;
    }
    model.level = level(intercept, &model.a);
    for (transfer, input) in model.inputs.iter_mut().zip(&orders.inputs) {
        if longer == 0 {
            transfer.f = vec![0.0; input.nf];
        }
    }
    if longer == 0 {
        // The noise is white, to begin with.
        model.c = vec![0.0; orders.nc];
        model.d = vec![0.0; orders.nd];
    } else {
        (model.c, model.d) = (Vec::new(), Vec::new());
    }
    Ok(model)
}

/// The level about which a model lies whose regression has this intercept.
fn level(intercept: f64, a: &[f64]) -> f64 {
    let gain = 1.0 + a.iter().sum::<f64>();
    if gain.abs() > 1e-3 {
        intercept / gain
    } else {
        0.0
    }
}

/// The longest first regression, but for models that look back further themselves.
const LONGEST: usize = 40;

/// The residuals of a long regression stand in for the innovations, on which the short one is then done too (Hannan and
/// Rissanen 1982).
fn hannan_rissanen(
    orders: &Orders,
    samples: &Samples,
    penalty: f64,
) -> Result<Polynomials, NumericsError> {
    let count = samples.count() as f64;
    let longer = (count.ln().powf(1.5).ceil() as usize)
        .min(LONGEST)
        .max(orders.nc + 1);
    let most = samples.count() / (8 * (1 + samples.width()));
    let longer = longer.min(most).min(samples.longest() / 2).max(1);
    let long = regression(orders, samples, penalty, longer)?;
    let innovations = residuals_of(&long, samples);
    let mut rows = Rows::new(0);
    let mut model = Polynomials::zero(orders);
    let reach = orders.na.max(orders.nc);
    for (segment, innovations) in samples.segments().zip(&innovations) {
        let values = samples.values(segment.clone());
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| samples.input(segment.clone(), nth))
            .collect();
        for sample in reach..values.len() {
            let past = (1..=orders.na).map(|lag| -values[sample - lag]);
            let of_inputs = orders.inputs.iter().zip(&inputs).flat_map(|(of, values)| {
                let before = values[0];
                (0..of.nb).map(move |j| Past { values, before }.at(sample, of.nk + j))
            });
            let noise = (1..=orders.nc).map(|lag| innovations[sample - lag]);
            let row = past.chain(of_inputs).chain(noise);
            if innovations[sample - orders.nc..=sample]
                .iter()
                .all(|e| !e.is_nan())
            {
                rows.push(row, values[sample]);
            }
        }
    }
    let (found, intercept) = rows.solve(penalty)?;
    let mut found = found.into_iter();
    let mut next = |place: &mut f64| *place = found.next().unwrap_or(0.0);
    model.a.iter_mut().for_each(&mut next);
    for input in &mut model.inputs {
        input.b.iter_mut().for_each(&mut next);
    }
    model.c.iter_mut().for_each(&mut next);
    model.level = level(intercept, &model.a);
    Ok(model)
}

/// The residuals by segment; NaN where there is none.
fn residuals_of(model: &Polynomials, samples: &Samples) -> Vec<Vec<f64>> {
    let found = Left::by(model, samples, &Counted::from(0)).residuals;
    let segments = samples.segments().zip(found);
    let filled = segments.map(|(segment, found)| {
        let mut own = vec![f64::NAN; segment.len() - found.len()];
        own.extend(found);
        own
    });
    filled.collect()
}

/// `C` and `D` of what the plant leaves over.
fn with_noise(
    orders: &Orders,
    plant: &Polynomials,
    samples: &Samples,
) -> Result<Polynomials, NumericsError> {
    let mut model = plant.clone();
    let white = Polynomials {
        c: Vec::new(),
        d: Vec::new(),
        ..plant.clone()
    };
    let mut left = Samples::new(0);
    for noise in residuals_of(&white, samples) {
        left.segment();
        let known = noise.iter().filter(|value| !value.is_nan());
        known.for_each(|&value| left.push([], value));
    }
    let of_noise = Orders {
        na: orders.nd,
        nc: orders.nc,
        ..Orders::default()
    };
    let noise = if orders.nc == 0 {
        regression(&of_noise, &left, 0.0, 0)?
    } else {
        hannan_rissanen(&of_noise, &left, 0.0)?
    };
    (model.c, model.d) = (noise.c, noise.a);
    Ok(model)
}

/// Least squares of `F y = Σ B u`, with inputs and outputs filtered by the last `1/F`, until that stays (Steiglitz and McBride
/// 1965); all inputs share one `F`, of which those of lower order get what comes nearest.
fn steiglitz_mcbride(
    orders: &Orders,
    samples: &Samples,
    penalty: f64,
) -> Result<Polynomials, NumericsError> {
    let nf = orders
        .inputs
        .iter()
        .map(|input| input.nf)
        .max()
        .unwrap_or(0);
    let mut shared = vec![0.0; nf];
    let mut best: Option<(f64, Polynomials)> = None;
    for _ in 0..RENEWALS {
        let mut filtered = Samples::new(samples.width());
        for segment in samples.segments().filter(|segment| !segment.is_empty()) {
            filtered.segment();
            let through = |x: &[f64]| through(&shared, x, x[0]).0;
            let values = through(samples.values(segment.clone()));
            let inputs: Vec<Vec<f64>> = (0..samples.width())
                .map(|nth| through(&samples.input(segment.clone(), nth)))
                .collect();
            for (sample, value) in values.iter().enumerate() {
                filtered.push(inputs.iter().map(|input| input[sample]), *value);
            }
        }
        let as_regression = Orders {
            na: nf,
            inputs: orders.inputs.clone(),
            ..Orders::default()
        };
        let found = regression(&as_regression, &filtered, penalty, 0)?.stabilised(1.0);
        let before = std::mem::replace(&mut shared, found.a.clone());
        let mut model = Polynomials::zero(orders);
        for ((transfer, found), input) in model
            .inputs
            .iter_mut()
            .zip(&found.inputs)
            .zip(&orders.inputs)
        {
            *transfer = if input.nf == nf {
                Transfer {
                    f: shared.clone(),
                    ..found.clone()
                }
            } else {
                nearest(
                    &Transfer {
                        f: shared.clone(),
                        ..found.clone()
                    },
                    input.nf,
                )
            };
        }
        model.level = level_left(&model, samples);
        let sum = Left::by(&model, samples, &Counted::from(0)).squares;
        if sum.is_finite() && best.as_ref().is_none_or(|(least, _)| sum < *least) {
            best = Some((sum, model));
        }
        let moved = before.iter().zip(&shared).map(|(a, b)| (a - b).abs());
        if moved.into_iter().all(|by| by < 1e-9) {
            break;
        }
    }
    best.map(|(_, model)| model).ok_or(NumericsError::NotFinite)
}

/// What the inputs leave over on average, had they always been as they are on average.
fn level_left(model: &Polynomials, samples: &Samples) -> f64 {
    let mean =
        |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / samples.count().max(1) as f64;
    let all = 0..samples.count();
    let inputs = model.inputs.iter().enumerate();
    let brought =
        inputs.map(|(nth, of)| of.gain() * mean(&mut samples.input(all.clone(), nth).into_iter()));
    mean(&mut samples.values(all.clone()).iter().copied()) - brought.sum::<f64>()
}

/// Least squares of `y` on inputs that have gone through filters with one pole, which is given.
fn one_pole(
    orders: &Orders,
    samples: &Samples,
    penalty: f64,
    pole: f64,
) -> Result<Polynomials, NumericsError> {
    let mut filtered = Samples::new(samples.width());
    for segment in samples.segments().filter(|segment| !segment.is_empty()) {
        filtered.segment();
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| {
                let input = samples.input(segment.clone(), nth);
                let has_filter = orders.inputs[nth].nf > 0;
                if has_filter {
                    through(&[-pole], &input, input[0]).0
                } else {
                    input
                }
            })
            .collect();
        for (sample, value) in samples.values(segment.clone()).iter().enumerate() {
            filtered.push(inputs.iter().map(|input| input[sample]), *value);
        }
    }
    let as_regression = Orders {
        inputs: orders.inputs.clone(),
        ..Orders::default()
    };
    let found = regression(&as_regression, &filtered, penalty, 0)?;
    let mut model = Polynomials::zero(orders);
    for (transfer, found) in model.inputs.iter_mut().zip(found.inputs) {
        transfer.b = found.b;
        if let Some(first) = transfer.f.first_mut() {
            *first = -pole;
        }
    }
    model.level = found.level;
    Ok(model)
}

/// Least squares of the values that are known on inputs that have gone through `1/A` with one pole, which is given, whatever is
/// missing between them.
fn from_known(
    orders: &Orders,
    samples: &Samples,
    penalty: f64,
    pole: f64,
) -> Result<Polynomials, NumericsError> {
    let mut rows = Rows::new(0);
    for segment in samples.segments().filter(|segment| !segment.is_empty()) {
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| {
                let input = samples.input(segment.clone(), nth);
                through(&[-pole], &input, input[0]).0
            })
            .collect();
        for (sample, &value) in samples.values(segment).iter().enumerate() {
            let of_inputs = orders.inputs.iter().zip(&inputs).flat_map(|(of, values)| {
                let before = values[0];
                (0..of.nb).map(move |j| Past { values, before }.at(sample, of.nk + j))
            });
            if !value.is_nan() {
                rows.push(of_inputs, value);
            }
        }
    }
    let (found, level) = rows.solve(penalty)?;
    let mut found = found.into_iter();
    let mut model = Polynomials {
        level,
        ..Polynomials::zero(orders)
    };
    for b in model.inputs.iter_mut().flat_map(|input| &mut input.b) {
        *b = found.next().unwrap_or(0.0);
    }
    model.a[0] = -pole;
    Ok(model)
}

/// The transfer function with fewer coefficients in `F` whose answer to an impulse is nearest, as Steiglitz and McBride find it.
fn nearest(transfer: &Transfer, nf: usize) -> Transfer {
    let own = Orders {
        inputs: vec![super::InputOrders {
            nb: transfer.b.len(),
            nk: transfer.delay,
            nf,
        }],
        ..Orders::default()
    };
    let mut impulse = vec![0.0; 1 + 20 * transfer.f.len().max(5)];
    impulse[1] = 1.0;
    let (answer, _) = through(&transfer.f, &impulse, 0.0);
    let past = Past {
        values: &answer,
        before: 0.0,
    };
    let mut samples = Samples::new(1);
    for (sample, &input) in impulse.iter().enumerate() {
        let b = transfer.b.iter().enumerate();
        let value = b
            .map(|(j, b)| b * past.at(sample, transfer.delay + j))
            .sum();
        samples.push([input], value);
    }
    let found = if nf == 0 {
        regression(&own, &samples, 0.0, 0)
    } else {
        steiglitz_mcbride(&own, &samples, 0.0)
    };
    let found = found.ok().and_then(|model| model.inputs.into_iter().next());
    found.unwrap_or_else(|| Transfer {
        f: vec![0.0; nf],
        ..transfer.clone()
    })
}

/// Rows of a regression.
struct Rows {
    blocks: Option<GramBlocks>,
    row: Vec<f64>,
}

impl Rows {
    fn new(columns: usize) -> Self {
        Self {
            blocks: None,
            row: Vec::with_capacity(columns),
        }
    }

    fn push(&mut self, row: impl Iterator<Item = f64>, value: f64) {
        self.row.clear();
        self.row.extend(row);
        let width = self.row.len();
        let blocks = self
            .blocks
            .get_or_insert_with(|| GramBlocks::with_row_memory(width, 0));
        blocks.push(&self.row, value);
    }

    /// The coefficients and the intercept.
    fn solve(self, penalty: f64) -> Result<(Vec<f64>, f64), NumericsError> {
        let blocks = self.blocks.ok_or(NumericsError::TooFewRows {
            needed: 2,
            found: 0,
        })?;
        let gram = blocks.total();
        let columns: Vec<usize> = (0..gram.width()).collect();
        let scales = Standardization::of(&gram).scales;
        let fit = LeastSquares::ridge(penalty).solve(&gram, &columns, &scales, None)?;
        Ok((fit.coefficients, fit.intercept))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::uniform;
    use crate::{InputOrders, PredictionError};

    #[test]
    fn values_that_are_far_apart_tell_what_happens_in_each_step_between_them() {
        let (mut samples, mut u, mut value) = (Samples::new(1), uniform(3), 0.0);
        for sample in 0..15_000 {
            let input = u();
            value = 0.97 * value + input + 0.1 * u();
            if sample % 30 == 0 {
                samples.push([input], value);
            } else {
                samples.push_missing([input]);
            }
        }
        let orders = |na| Orders {
            na,
            inputs: vec![InputOrders {
                nb: 1,
                nf: 0,
                nk: 0,
            }],
            ..Orders::default()
        };
        let search = PredictionError::default();
        let fit = search.fit(&orders(1), &samples, 0).unwrap();
        assert!((fit.model.a[0] + 0.97).abs() < 0.002, "{:?}", fit.model);
        assert!(
            (fit.model.inputs[0].b[0] - 1.0).abs() < 0.02,
            "{:?}",
            fit.model
        );
        // Of two in a row none is known.
        let few = search.fit(&orders(2), &samples, 0).unwrap_err();
        assert_eq!(
            few,
            NumericsError::TooFewRows {
                needed: 6,
                found: 0
            }
        );
    }
}
