//! Coefficients of a filter whose past fades to a share of their fit. Decides what is left of what is known of them; level and trend
//! follow by what they have in common.

use super::Kalman;
use crate::rls::{add_product, invert_root, row_at};

/// A level, its trend, and what the mean has leapt by.
const MOST_LEVELS: usize = 3;

/// What coefficients go back to, the last states of a filter, and room for the step.
///
/// As for [`Rls`](crate::Rls): of the information about coefficients `b`, `R = P⁻¹`, is left `R ← λR + (1 − λ)βR₀`, and the mean is that of both parts.
/// What is known of level and trend given the coefficients stays.
#[derive(Debug, Clone)]
pub struct Resetting {
    start: Vec<f64>,
    /// `R₀`, the lower triangle row by row.
    information: Vec<f64>,
    share: f64,
    /// `R`, and the root of its inverse, likewise.
    now: Vec<f64>,
    root: Vec<f64>,
    /// By how much coefficients are away from the fit, and by how much they move.
    off: Vec<f64>,
    moved: Vec<f64>,
    /// Of each state before them what it has in common with them, now and later, and `R` times that.
    common: Vec<f64>,
    later: Vec<f64>,
    gain: Vec<f64>,
}

impl Resetting {
    /// Back to a share of what a filter knows of its last so many states; none where that is not positive.
    #[must_use]
    pub fn to(filter: &Kalman, coefficients: usize, share: f64) -> Option<Self> {
        let first = filter.state().len() - coefficients;
        let cells = || vec![0.0; row_at(coefficients)];
        let each = || vec![0.0; coefficients];
        let mut fading = Self {
            start: filter.state()[first..].to_vec(),
            information: Vec::new(),
            share,
            now: cells(),
            root: cells(),
            off: each(),
            moved: each(),
            common: Vec::with_capacity(MOST_LEVELS * coefficients),
            later: Vec::with_capacity(MOST_LEVELS * coefficients),
            gain: Vec::with_capacity(MOST_LEVELS * coefficients),
        };
        let known = coefficients > 0 && fading.take(filter.covariance());
        fading.information.clone_from(&fading.now);
        known.then_some(fading)
    }

    /// Finds `R` of a covariance.
    fn take(&mut self, covariance: &[f64]) -> bool {
        let width = self.start.len();
        let order = covariance.len().isqrt();
        let first = order - width;
        for i in 0..width {
            let row = &covariance[(first + i) * order + first..][..=i];
            self.root[row_at(i)..=row_at(i) + i].copy_from_slice(row);
        }
        let known = invert_root(&mut self.root, &mut self.off);
        self.now.fill(0.0);
        for k in 0..width {
            let row = &self.root[row_at(k)..=row_at(k) + k];
            for (i, of_row) in row.iter().enumerate() {
                let cells = self.now[row_at(i)..=row_at(i) + i].iter_mut();
                cells.zip(row).for_each(|(cell, of)| *cell += of_row * of);
            }
        }
        known
    }

    /// Lets what a filter knows of its coefficients fade for so many memories. Where that cannot be worked out, all is left.
    pub fn fade(&mut self, filter: &mut Kalman, memories: f64) {
        let left = libm::exp(-memories);
        let (state, covariance) = filter.parts_mut();
        if !(left < 1.0 && self.take(covariance)) {
            return;
        }
        let (order, width) = (state.len(), self.start.len());
        let first = order - width;
        let back = (1.0 - left) * self.share;
        let both = self.now.iter().zip(&self.information);
        for (cell, (now, start)) in self.root.iter_mut().zip(both) {
            *cell = left * now + back * start;
        }
        if !invert_root(&mut self.root, &mut self.off) {
            return;
        }
        for ((off, value), start) in self.off.iter_mut().zip(&state[first..]).zip(&self.start) {
            *off = value - start;
        }
        let room = first * width;
        self.common.resize(room, 0.0);
        self.later.resize(room, 0.0);
        self.gain.resize(room.max(width), 0.0);
        // What is left of the pull, and from there the coefficients.
        times(&self.now, &self.off, &mut self.gain[..width]);
        self.gain[..width].iter_mut().for_each(|pull| *pull *= left);
        self.moved.fill(0.0);
        add_product(&self.root, &self.gain[..width], &mut self.moved);
        for (moved, off) in self.moved.iter_mut().zip(&self.off) {
            *moved -= off;
        }
        self.later.fill(0.0);
        for level in 0..first {
            let part = level * width..(level + 1) * width;
            let common = &mut self.common[part.clone()];
            common.copy_from_slice(&covariance[level * order + first..][..width]);
            let gain = &mut self.gain[part.clone()];
            times(&self.now, common, gain);
            add_product(&self.root, gain, &mut self.later[part]);
            let moved = gain.iter().zip(&self.moved);
            state[level] += moved.map(|(gain, by)| gain * by).sum::<f64>();
        }
        for (value, by) in state[first..].iter_mut().zip(&self.moved) {
            *value += by;
        }
        let part = |of: usize| of * width..(of + 1) * width;
        for level in 0..first {
            for other in 0..=level {
                let change = self.later[part(level)]
                    .iter()
                    .zip(&self.common[part(level)]);
                let change = change.zip(&self.gain[part(other)]);
                let more: f64 = change.map(|((to, from), gain)| (to - from) * gain).sum();
                covariance[level * order + other] += more;
                covariance[other * order + level] = covariance[level * order + other];
            }
            for (nth, later) in self.later[part(level)].iter().enumerate() {
                covariance[level * order + first + nth] = *later;
                covariance[(first + nth) * order + level] = *later;
            }
        }
        for i in 0..width {
            for j in 0..=i {
                let rows = i..width;
                let cell: f64 = rows
                    .map(|k| self.root[row_at(k) + i] * self.root[row_at(k) + j])
                    .sum();
                covariance[(first + i) * order + first + j] = cell;
                covariance[(first + j) * order + first + i] = cell;
            }
        }
    }
}

/// A symmetric matrix, given as its lower triangle, times a vector.
fn times(matrix: &[f64], x: &[f64], to: &mut [f64]) {
    for (i, sum) in to.iter_mut().enumerate() {
        let row = &matrix[row_at(i)..=row_at(i) + i];
        *sum = row.iter().zip(x).map(|(cell, x)| cell * x).sum();
        *sum += (i + 1..x.len())
            .map(|j| matrix[row_at(j) + i] * x[j])
            .sum::<f64>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kalman::{Passage, Structural};

    fn model() -> Structural {
        Structural {
            observation: 1.0,
            level: 0.0,
            trend: None,
            returning: 0.0,
            passage: Passage::Continuous,
        }
    }

    fn diagonal([a, b, c]: [f64; 3]) -> [f64; 9] {
        [a, 0.0, 0.0, 0.0, b, 0.0, 0.0, 0.0, c]
    }

    fn near(found: f64, wanted: f64) {
        assert!((found - wanted).abs() < 1e-9, "{found}, not {wanted}");
    }

    #[test]
    fn information_fades_to_a_share_of_the_fit_and_the_mean_to_the_fit() {
        // A level that all is known of, two coefficients and rows that tell of both: as the formula has it.
        let begun =
            Kalman::starting_at(model(), vec![0.0, 3.0, -1.0], &diagonal([0.0, 0.1, 0.2])).unwrap();
        let mut fading = Resetting::to(&begun, 2, 0.1).unwrap();
        let mut filter = begun.clone();
        let (mut r, mut c) = ([[10.0, 0.0], [0.0, 5.0]], [0.0, 0.0]);
        for (nth, x) in [[1.0, 2.0], [0.5, -1.0], [2.0, 0.1], [1.0, 1.0]]
            .into_iter()
            .enumerate()
        {
            let left: f64 = 0.7;
            fading.fade(&mut filter, -left.ln());
            let y = 1.0 + nth as f64;
            filter.observe(&x, y);
            for i in 0..2 {
                for j in 0..2 {
                    let start = if i == j { [10.0, 5.0][i] } else { 0.0 };
                    r[i][j] = left * r[i][j] + (1.0 - left) * 0.1 * start + x[i] * x[j];
                }
                c[i] = left * c[i] + x[i] * (y - 3.0 * x[0] + x[1]);
            }
            let det = r[0][0] * r[1][1] - r[0][1] * r[1][0];
            near(
                filter.state()[1],
                3.0 + (r[1][1] * c[0] - r[0][1] * c[1]) / det,
            );
            near(
                filter.state()[2],
                -1.0 + (r[0][0] * c[1] - r[1][0] * c[0]) / det,
            );
            near(filter.covariance()[4], r[1][1] / det);
            near(filter.covariance()[5], -r[0][1] / det);
        }
    }

    #[test]
    fn what_is_known_of_the_level_given_the_coefficients_stays() {
        let mut filter =
            Kalman::starting_at(model(), vec![0.0, 1.0, 2.0], &diagonal([4.0, 0.1, 0.2])).unwrap();
        let mut fading = Resetting::to(&filter, 2, 0.1).unwrap();
        for (x, y) in [([1.0, 2.0], 7.0), ([0.5, -1.0], 1.0), ([2.0, 1.0], 3.0)] {
            filter.observe(&x, y);
        }
        let before = filter.clone();
        fading.fade(&mut filter, 0.7);
        assert!(filter.is_sound());
        // The level given the coefficients: its mean at the same ones, and its variance.
        let given = |of: &Kalman, at: [f64; 2]| {
            let p = of.covariance();
            let det = p[4] * p[8] - p[5] * p[7];
            let gain = [
                (p[1] * p[8] - p[2] * p[7]) / det,
                (p[2] * p[4] - p[1] * p[5]) / det,
            ];
            let off = [at[0] - of.state()[1], at[1] - of.state()[2]];
            let mean = of.state()[0] + gain[0] * off[0] + gain[1] * off[1];
            [mean, p[0] - gain[0] * p[1] - gain[1] * p[2]]
        };
        for at in [[1.0, 2.0], [0.0, -3.0]] {
            let (was, is) = (given(&before, at), given(&filter, at));
            near(is[0], was[0]);
            near(is[1], was[1]);
        }
        assert!(filter.covariance()[4] > before.covariance()[4]);
        let unchanged = filter.clone();
        fading.fade(&mut filter, 0.0);
        assert_eq!(filter, unchanged);
    }
}
