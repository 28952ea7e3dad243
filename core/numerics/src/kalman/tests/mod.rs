//! The filter against statsmodels: the shared oracle, and series with regressors, gaps and irregular times of its own.

use super::{Kalman, Movement, Passage, Series, Structural, follow, most_likely};
use crate::NumericsError;
use crate::oracle::{own_table, own_text, table, text};

mod filter;
mod likelihood;

const OWN: Structural = Structural {
    observation: 0.09,
    level: 0.01,
    trend: Some(0.0001),
    returning: 0.0,
    passage: Passage::Steps,
};

fn number(scalars: &serde_json::Value, path: &[&str]) -> f64 {
    let found = path.iter().fold(scalars, |value, key| &value[key]);
    found.as_f64().unwrap()
}

fn own_scalars() -> serde_json::Value {
    serde_json::from_str(&own_text("kalman/scalars.json")).unwrap()
}

/// The own series: times between rows, regressors row by row, observations.
fn own_series() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let rows = own_table("kalman/series.csv").numbers();
    let times = rows.iter().map(|row| row[0]).collect();
    let regressors = rows.iter().flat_map(|row| [row[1], row[2]]).collect();
    (times, regressors, rows.iter().map(|row| row[3]).collect())
}

fn in_steps(rows: usize) -> Vec<f64> {
    let mut times = vec![1.0; rows];
    times[0] = f64::NAN;
    times
}

/// A series of truths alone.
fn of_truths<'a>(times: &'a [f64], observations: &'a [f64]) -> Series<'a> {
    Series {
        times,
        observations,
        regressors: &[],
        prior: f64::INFINITY,
        shared: 0.0,
    }
}

#[track_caller]
fn near(found: f64, expected: f64, within: f64) {
    assert!(
        (found - expected).abs() <= within,
        "{found} instead of {expected}"
    );
}
