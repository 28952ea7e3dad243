//! Decides which values of what drifts say how often it is measured: of a register that is read oftener than it is written only the
//! changes, and of axes with very different rates those of most. Not which windows follow.

use super::Request;
use super::clock::Clock;
use super::column::{Column, Kind};
use super::survey::{Series, Survey};

/// A value stands at least so many times, where a register holds it.
const HELD: usize = 3;
/// Fewer runs of equal values say nothing.
const FEWEST_RUNS: usize = 20;
/// An axis whose values are so many times as far apart as those of the others would widen their windows.
const SLOW: f64 = 5.0;

/// The first values of the runs of equal ones, by place, where a register holds what was measured: most runs are about as long, and
/// the steps between them are of any size. Those of a scale that is too coarse differ in length, and by one step of the scale.
fn held(values: &[f64]) -> Option<Vec<usize>> {
    let changes = (1..values.len()).filter(|&at| values[at] != values[at - 1]);
    let starts: Vec<usize> = std::iter::once(0).chain(changes).collect();
    let mut runs: Vec<usize> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if runs.len() < FEWEST_RUNS {
        return None;
    }
    runs.sort_unstable();
    let usual = runs[runs.len() / 2];
    let about = runs
        .iter()
        .filter(|&&run| run * 2 >= usual && run <= usual * 2);
    let is_even = usual >= HELD && about.count() * 10 >= runs.len() * 8;
    let step = |pair: &[usize]| (values[pair[1]] - values[pair[0]]).abs();
    let least = starts.windows(2).map(step).fold(f64::INFINITY, f64::min);
    let large = starts.windows(2).filter(|pair| step(pair) > 1.5 * least);
    (is_even && large.count() * 2 >= runs.len()).then_some(starts)
}

impl Survey {
    /// Takes of what drifts only the changes where a register holds it, and warns of it.
    pub fn take_changes(&mut self, columns: &mut [Column], clock: &Clock) {
        for (series, column) in self.series.iter_mut().zip(columns) {
            if column.kind != Kind::Drifting {
                continue;
            }
            let Some(starts) = held(&series.values) else {
                continue;
            };
            let times = series.values.len() as f64 / starts.len() as f64;
            let changes = starts.iter();
            let changes = changes.map(|&at| (series.time_s[at], series.values[at]));
            series.replace(changes.collect::<Vec<_>>().into_iter());
            series.changes = true;
            let every = clock.about(series.interval_s().unwrap_or(0.0));
            column.warn(format!(
                "each value stands {:.0} times, as in a register that is read oftener than it is written; windows are chosen for its \
                 changes, one every {every}",
                times
            ));
        }
    }

    /// Takes temperatures that are measured far more rarely than most others, and than what drifts, for inputs of which the last value
    /// is held: windows wide enough for their slopes would be far too wide for the others.
    pub fn hold_rare(&self, columns: &mut [Column]) {
        let gap = |series: &Series| series.gap(0.9).unwrap_or(0.0);
        let of_kind = |columns: &[Column], kind| -> Vec<f64> {
            let of = self
                .series
                .iter()
                .zip(columns)
                .filter(|(_, column)| column.kind == kind);
            let mut gaps: Vec<f64> = of.map(|(series, _)| gap(series)).collect();
            gaps.sort_by(f64::total_cmp);
            gaps
        };
        let temperatures = of_kind(columns, Kind::Temperature);
        let Some(&usual) = temperatures.get(temperatures.len().saturating_sub(1) / 2) else {
            return;
        };
        let drifting = of_kind(columns, Kind::Drifting)
            .into_iter()
            .fold(0.0, f64::max);
        for (series, column) in self.series.iter().zip(columns) {
            if column.kind == Kind::Temperature && gap(series) > SLOW * usual.max(drifting) {
                column.hold();
            }
        }
    }

    /// Leaves out what drifts and is measured so rarely that windows for it would be far too wide for most others, unless the user named it.
    pub fn leave_out_slow(&self, columns: &mut [Column], clock: &Clock, request: &Request) {
        if !request.drifting.is_empty() {
            return;
        }
        let of = |series: &Series| series.interval_s().unwrap_or(0.0);
        let drifting = self.series.iter().zip(&*columns);
        let drifting = drifting.filter(|(_, column)| column.kind == Kind::Drifting);
        let mut intervals: Vec<f64> = drifting.map(|(series, _)| of(series)).collect();
        intervals.sort_by(f64::total_cmp);
        let Some(&usual) = intervals.get(intervals.len().saturating_sub(1) / 2) else {
            return;
        };
        for (series, column) in self.series.iter().zip(columns) {
            let interval = of(series);
            if column.kind == Kind::Drifting && usual > 0.0 && interval > SLOW * usual {
                column.leave_out(format!(
                    "it has a value every {}, most others that drift one every {}, and a window wide enough for it would be too wide \
                     for these; for a graph of its own give --drifts \"{}\"",
                    clock.about(interval),
                    clock.about(usual),
                    column.name
                ));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_a_register_holds_are_no_values_of_a_coarse_scale() {
        let wild = |at: usize| ((at as f64 * 12.9898).sin() * 43_758.545_3).fract().abs();
        let register: Vec<f64> = (0..900).map(|at| wild(at / 9)).collect();
        assert_eq!(held(&register).unwrap().len(), 100);
        let coarse: Vec<f64> = (0..900).map(|at| (at as f64 / 9.0).round()).collect();
        assert_eq!(held(&coarse), None);
        let noisy: Vec<f64> = (0..900).map(|at| (4.0 * wild(at)).round()).collect();
        assert_eq!(held(&noisy), None);
        let plain: Vec<f64> = (0..900).map(wild).collect();
        assert_eq!(held(&plain), None);
    }
}
