//! Decides which value of a series stands for none, as -9999 does, and takes it out.

use athermal_numerics::median;

use super::column::{Column, Kind};
use super::survey::Survey;
use athermal_analysis::figures::{count, number};

/// The share of all values from which on one may stand for none. A rarer one leaps, as that of a failed sensor.
const LEAST_SHARE: f64 = 0.2;
/// It comes and goes at least so often, and there are at least so many others.
const OFTEN: usize = 20;
/// A rarer one is come back from so often, after so many values at most, and is so far aside, as a share of how far nine tenths of all
/// lie apart.
const LEAST_RETURNS: usize = 3;
const LONGEST: usize = 3;
const ASIDE: f64 = 0.5;
/// Others are so many times as far from it as from each other.
const FAR: f64 = 20.0;

impl Survey {
    /// Takes the values out of temperatures and of what drifts that stand for none.
    pub fn leave_out_placeholders(&mut self, columns: &mut [Column]) {
        for (series, column) in self.series.iter_mut().zip(columns) {
            let drifts = column.kind == Kind::Drifting;
            if column.kind == Kind::Unused || !(drifts || column.is_temperature()) {
                continue;
            }
            let Some((value, n)) = placeholder(&series.values) else {
                continue;
            };
            let of = count(series.values.len());
            series.keep(|of| of != value);
            series.placeholder = Some(value);
            let (low, high) = series.extremes();
            let then = if (low..=high).contains(&value) {
                "leave such cells empty: a graph cannot know them from others"
            } else {
                "leave such cells empty"
            };
            column.warn(format!(
                "{} in {} of {of} rows stands for no value, and is taken for none here; {then}",
                number(value),
                count(n)
            ));
        }
    }
}

/// The value that stands for none, where there is one, and how often.
fn placeholder(values: &[f64]) -> Option<(f64, u64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let most = sorted.chunk_by(|a, b| a == b).max_by_key(|run| run.len())?;
    let (value, count) = (most[0], most.len());
    let runs = values.chunk_by(|a, b| (*a == value) == (*b == value));
    let comes = runs.filter(|run| run[0] == value).count();
    let others = || values.iter().filter(|of| **of != value);
    if (count as f64) < LEAST_SHARE * values.len() as f64
        || comes < OFTEN
        || values.len() - count < OFTEN
    {
        return None;
    }
    let changes = others().zip(others().skip(1)).map(|(a, b)| (a - b).abs());
    let usual = median(&mut changes.filter(|change| *change > 0.0).collect::<Vec<_>>())?;
    let away = median(&mut others().map(|of| (of - value).abs()).collect::<Vec<_>>())?;
    (away > FAR * usual).then_some((value, count as u64))
}

/// The one value far from all others to which a series leaps again and again, and from which it comes back at once; and how often.
pub fn nothing(values: &[f64]) -> Option<(f64, u64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    // What stands for none is the lowest or the highest.
    let ends = [sorted.first()?, sorted.last()?].map(|end| *end);
    let at = |share: f64| sorted[(share * (sorted.len() - 1) as f64).round() as usize];
    ends.into_iter().find_map(|value| {
        let others = sorted.iter().filter(|of| **of != value);
        let away = others
            .map(|of| (of - value).abs())
            .fold(f64::INFINITY, f64::min);
        let mut runs = 0;
        let mut longest = 0;
        for run in values.chunk_by(|a, b| (*a == value) == (*b == value)) {
            if run[0] == value {
                (runs, longest) = (runs + 1, longest.max(run.len()));
            }
        }
        let count = sorted.iter().filter(|of| **of == value).count();
        let is_far = away > ASIDE * (at(0.95) - at(0.05));
        (runs >= LEAST_RETURNS && longest <= LONGEST && is_far && count * 4 < sorted.len())
            .then_some((value, count as u64))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn position(row: usize) -> f64 {
        100.0 * (row as f64 / 700.0).sin() + (row as f64 * 2.3).sin()
    }

    #[test]
    fn a_value_between_measured_ones_that_are_far_from_it_stands_for_none() {
        for value in [-9999.0, 1e30, 500.0] {
            let rows = (0..2000).map(|row| if row % 9 == 0 { position(row) } else { value });
            let found = placeholder(&rows.collect::<Vec<_>>());
            assert_eq!(found, Some((value, 1777)));
        }
    }

    #[test]
    fn a_rare_value_far_aside_that_is_come_back_from_stands_for_none() {
        let with = |value: f64, is_it: &dyn Fn(usize) -> bool| {
            let rows = (0..2000).map(|row| {
                if is_it(row) {
                    value
                } else {
                    300.0 + position(row)
                }
            });
            nothing(&rows.collect::<Vec<_>>())
        };
        let now_and_then = |row: usize| row % 61 == 7;
        for value in [0.0, -1.0, 850.0, 65_535.0] {
            assert_eq!(with(value, &now_and_then), Some((value, 33)));
        }
        // Near the others, once alone, and for long.
        assert_eq!(with(280.0, &now_and_then), None);
        assert_eq!(with(0.0, &|row| row == 700), None);
        assert_eq!(with(0.0, &|row| row % 500 < 40), None);
        assert_eq!(with(0.0, &|_| false), None);
    }

    #[test]
    fn what_is_held_or_rests_or_repeats_itself_stands_for_something() {
        let of =
            |value: &dyn Fn(usize) -> f64| placeholder(&(0..2000).map(value).collect::<Vec<_>>());
        assert_eq!(of(&position), None);
        assert_eq!(of(&|row| position(row - row % 9)), None);
        assert_eq!(of(&|row| (position(row) / 40.0).round()), None);
        assert_eq!(
            of(&|row| if row < 1000 {
                0.0
            } else {
                position(row) + 900.0
            }),
            None
        );
        assert_eq!(of(&|row| if row % 9 == 0 { 5.0 } else { 7.0 }), None);
    }
}
