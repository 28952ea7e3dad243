//! Finds columns that are another reading of what drifts: encoder counts, motor steps, a copy, what was commanded. They explain it down to
//! its noise, and nothing of why it drifts.

use super::column::{Column, Kind};
use super::survey::{Series, Survey};
use athermal_analysis::diagnosis::noise::{of_second_differences, spread};
use athermal_analysis::figures::number;

/// Values that are compared at most, evenly over the log.
const COMPARED: usize = 5_000;
/// The differences that are compared are over such a share of the log: long enough to rise above noise, short enough that most of them hold
/// no zeroing.
const OF_LOG: usize = 50;
/// What is left where a column follows is at most so many times the noise of both, and what it explains at least so many times that.
const LEFT: f64 = 1.5;
const EXPLAINED: f64 = 8.0;
/// Where all of it moves at each row, noise is not known apart; nothing but a reading leaves one of so many parts.
const PARTS: f64 = 100.0;

/// The standard deviation of the noise of a series, and at least that of its steps (an even one has 1/12).
fn noise(of: &Series) -> f64 {
    let second = of.values.windows(3).map(|of| of[0] - 2.0 * of[1] + of[2]);
    let steps = of.values.windows(2).map(|of| (of[1] - of[0]).abs());
    let smallest = steps
        .filter(|step| *step > 0.0)
        .fold(f64::INFINITY, f64::min);
    of_second_differences(second).max(smallest / 12_f64.sqrt())
}

/// Least squares of `y` on one series or two, without those that are far off, as over a zeroing: the factors and the spread of what is left.
fn left(y: &[f64], of: &[&[f64]]) -> Option<([f64; 2], f64)> {
    let x = |nth: usize, row: usize| of.get(nth).map_or(0.0, |of| of[row]);
    let mut rows: Vec<usize> = (0..y.len()).collect();
    rows.retain(|&row| (y[row] + x(0, row) + x(1, row)).is_finite());
    let all = rows.clone();
    let (mut factors, mut spread_left) = ([0.0; 2], f64::INFINITY);
    for _ in 0..5 {
        let sum = |f: &dyn Fn(usize) -> f64| rows.iter().map(|&row| f(row)).sum::<f64>();
        let (aa, ab, bb) = (
            sum(&|row| x(0, row) * x(0, row)),
            sum(&|row| x(0, row) * x(1, row)),
            sum(&|row| x(1, row) * x(1, row)),
        );
        let (ay, by) = (
            sum(&|row| x(0, row) * y[row]),
            sum(&|row| x(1, row) * y[row]),
        );
        let two = aa * bb - ab * ab;
        factors = match of.len() {
            1 => [ay / aa, 0.0],
            _ => [(ay * bb - by * ab) / two, (by * aa - ay * ab) / two],
        };
        // Two that say nearly the same are one.
        if rows.len() < 20 || aa == 0.0 || of.len() > 1 && two <= 1e-6 * aa * bb {
            return None;
        }
        let rest = |row: usize| y[row] - factors[0] * x(0, row) - factors[1] * x(1, row);
        spread_left = spread(all.iter().map(|&row| rest(row)));
        rows = all
            .iter()
            .copied()
            .filter(|&row| rest(row).abs() <= 3.0 * spread_left)
            .collect();
    }
    Some((factors, spread_left))
}

/// Leaves out what follows a drifting column down to its noise, alone or as one of two, and is in a unit of length, angle or none. What is
/// kept stays; where nothing else could explain a drift, all of it does, with a warning.
pub fn leave_out(survey: &Survey, columns: &mut [Column], keep: &[String]) {
    let mut readings: Vec<(usize, String)> = Vec::new();
    let may_follow =
        |of: &Column| of.kind == Kind::Drive && of.may_be_a_reading() && !keep.contains(&of.name);
    let drifting = columns.iter().enumerate();
    for (truth, column) in drifting.filter(|(_, of)| of.kind == Kind::Drifting) {
        let series = &survey.series[truth];
        let every = series.values.len().div_ceil(COMPARED).max(1);
        let instants: Vec<f64> = series.time_s.iter().copied().step_by(every).collect();
        let lag = (instants.len() / OF_LOG).max(1);
        let differences = |of: &Series| -> Vec<f64> {
            let values = of.at(&instants);
            values
                .iter()
                .zip(values.iter().skip(lag))
                .map(|(a, b)| b - a)
                .collect()
        };
        let y = differences(series);
        let all = spread(y.iter().copied().filter(|of| of.is_finite()));
        let own = noise(series);
        let tried: Vec<usize> = (0..columns.len())
            .filter(|&of| {
                may_follow(&columns[of]) && readings.iter().all(|(known, _)| *known != of)
            })
            .collect();
        let of_tried: Vec<(Vec<f64>, f64)> = tried
            .iter()
            .map(|&of| (differences(&survey.series[of]), noise(&survey.series[of])))
            .collect();
        let alone = (0..tried.len()).map(|one| vec![one]);
        let pairs = (0..tried.len()).flat_map(|one| (0..one).map(move |other| vec![other, one]));
        let mut found: Vec<usize> = Vec::new();
        for of in alone.chain(pairs) {
            if of.iter().any(|nth| found.contains(nth)) {
                continue;
            }
            let x: Vec<&[f64]> = of.iter().map(|&nth| &*of_tried[nth].0).collect();
            let Some((factors, rest)) = left(&y, &x) else {
                continue;
            };
            // Of differences, whose variance is twice that of values.
            let beside = of
                .iter()
                .zip(factors)
                .map(|(&nth, by)| (by * of_tried[nth].1).powi(2));
            let both = (2.0 * (own * own + beside.sum::<f64>())).sqrt();
            let is_noise = all >= EXPLAINED * both && rest <= LEFT * both;
            if !is_noise && rest > all / PARTS {
                continue;
            }
            for &nth in &of {
                let other = of
                    .iter()
                    .find(|other| **other != nth)
                    .map(|other| &columns[tried[*other]].name);
                let beside = other.map_or_else(String::new, |other| format!(" with {other}"));
                let follows = format!(
                    "it follows {}{beside} down to its noise (of {} {} it leaves {})",
                    column.name,
                    number(all),
                    column.unit,
                    number(rest),
                );
                readings.push((tried[nth], follows));
            }
            found.extend(of);
        }
    }
    let causes = columns
        .iter()
        .filter(|of| matches!(of.kind, Kind::Temperature | Kind::Drive));
    let has_other = causes.count() > readings.len();
    for (of, follows) in readings {
        let column = &mut columns[of];
        if has_other {
            let name = column.name.clone();
            column.leave_out(format!(
                "{follows}, and so reads the same and is no cause; --keep {name} takes it all the same"
            ));
        } else {
            column.warn(format!(
                "{follows}: if it is another reading of it, it explains nothing; log a temperature beside"
            ));
        }
    }
}
