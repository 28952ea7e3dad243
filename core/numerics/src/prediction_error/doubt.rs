//! Decides how unsure a stepper is of the past that it goes by; what it takes that past for is decided by the stepper.

use serde::Serialize;

use super::Polynomials;
use super::stepper::product;
use crate::scratch::Scratch;

/// The covariance `P` of the past `z` that a model goes by, in the variance of an innovation: of past values, of past values of
/// the noise and of past innovations, the newest first in each. Inputs are taken for known.
///
/// With the next innovation `e` the next value is `H z + e` and the next of the noise is `H z + e`, `H` without its places for
/// past values; each goes before the others of its kind, of which the oldest is forgotten. What follows is the Kalman filter of
/// that (Harvey 1989, section 3.2; Jones 1980 for samples that are missing), in as many steps as `P` has places.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(into = "Vec<f64>")]
pub(super) struct Doubt {
    /// Row after row.
    covariance: Vec<f64>,
    /// Whether all of it is 0.
    sure: bool,
    blocks: Blocks,
    /// `H`.
    next: Vec<f64>,
    /// `P H`.
    shared: Scratch,
    /// The covariance of the next of the noise with the past.
    of_noise: Scratch,
}

/// How many of each kind the past consists of.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Blocks {
    values: usize,
    noise: usize,
    innovations: usize,
}

impl From<Doubt> for Vec<f64> {
    /// Nothing, where nothing is in doubt.
    fn from(doubt: Doubt) -> Self {
        if doubt.sure {
            Self::new()
        } else {
            doubt.covariance
        }
    }
}

impl Doubt {
    /// All of the past is known.
    pub(super) fn none(model: &Polynomials, whitening: &[f64]) -> Self {
        let Polynomials { a, c, .. } = model;
        let known = a.iter().chain(whitening).map(|p| -p);
        let next: Vec<f64> = known.chain(c.iter().copied()).collect();
        let count = next.len();
        Self {
            covariance: vec![0.0; count * count],
            sure: true,
            blocks: Blocks {
                values: a.len(),
                noise: whitening.len(),
                innovations: c.len(),
            },
            next,
            shared: Scratch(vec![0.0; count]),
            of_noise: Scratch(vec![0.0; count]),
        }
    }

    /// How long a covariance is, as it is written where something is in doubt.
    pub(super) fn places(&self) -> usize {
        self.covariance.len()
    }

    /// Takes over a covariance, as it was written.
    pub(super) fn read(&mut self, covariance: &[f64]) {
        self.sure = covariance.is_empty();
        if self.sure {
            self.covariance.fill(0.0);
        } else {
            self.covariance.copy_from_slice(covariance);
        }
    }

    /// Takes over that of another stepper of the same orders.
    pub(super) fn take(&mut self, other: &Self) {
        if !(self.sure && other.sure) {
            self.covariance.copy_from_slice(&other.covariance);
        }
        self.sure = other.sure;
    }

    /// Whether nothing is in doubt.
    pub(super) fn is_sure(&self) -> bool {
        self.sure
    }

    /// Of the innovations nothing is known but their variance; all else is known.
    pub(super) fn begin(&mut self) {
        let (count, first) = (self.next.len(), self.blocks.values + self.blocks.noise);
        self.covariance.fill(0.0);
        let own = self.covariance.iter_mut().step_by(count + 1);
        own.skip(first).for_each(|own| *own = 1.0);
        self.sure = self.blocks.innovations == 0;
    }

    /// Goes on by a sample that is missing.
    pub(super) fn miss(&mut self) {
        let count = self.next.len();
        if count == 0 {
            return;
        }
        let values = self.blocks.values;
        let (shared, of_noise) = (&mut self.shared.0, &mut self.of_noise.0);
        let rows = self.covariance.chunks_exact(count);
        for ((row, shared), of_noise) in rows.zip(&mut *shared).zip(&mut *of_noise) {
            *of_noise = product(&self.next[values..], &row[values..]);
            *shared = product(&self.next[..values], row) + *of_noise;
        }
        let value = 1.0 + product(&self.next, shared);
        let noise = 1.0 + product(&self.next[values..], &of_noise[values..]);
        let both = 1.0 + product(&self.next, of_noise);
        let newest = [[value, both, 1.0], [both, noise, 1.0], [1.0, 1.0, 1.0]];
        self.pass(newest, 1.0, 0.0);
        self.sure = false;
    }

    /// Goes on by a sample that is there. Gives the variance `f` of what it was off by: of that, `1/f` is the innovation, and
    /// [`shared`](Self::shared) over `f` is what the past was off by.
    pub(super) fn observe(&mut self) -> f64 {
        let count = self.next.len();
        if self.sure {
            return 1.0;
        }
        let shared = &mut self.shared.0;
        let rows = self.covariance.chunks_exact(count);
        for (row, shared) in rows.zip(&mut *shared) {
            *shared = product(&self.next, row);
        }
        let of_past = product(&self.next, shared);
        if !of_past.is_finite() {
            // A model that grows without end, after a gap in which it did: nothing of before can be told from it.
            shared.fill(0.0);
            self.forget();
            return 1.0;
        }
        // Rounding could bring it below.
        let variance = 1.0 + of_past.max(0.0);
        for (row, own) in self.covariance.chunks_exact_mut(count).zip(&*shared) {
            for (doubt, with) in row.iter_mut().zip(&*shared) {
                *doubt -= own * with / variance;
            }
        }
        // The noise is what the value leaves once past values are allowed for, and the value is known.
        let (a, of_noise) = (&self.next[..self.blocks.values], &mut self.of_noise.0);
        of_noise.fill(0.0);
        for (a, row) in a.iter().zip(self.covariance.chunks_exact(count)) {
            for (of_noise, with) in of_noise.iter_mut().zip(row) {
                *of_noise -= a * with;
            }
        }
        let noise = -product(a, of_noise);
        let both = product(a, shared) / variance;
        let innovation = 1.0 - 1.0 / variance;
        let newest = [[0.0, 0.0, 0.0], [0.0, noise, both], [0.0, both, innovation]];
        self.pass(newest, 0.0, -1.0 / variance);
        let mut own = self.covariance.iter().step_by(count + 1);
        if own.all(|&own| own < 4.0 * f64::EPSILON) {
            self.forget();
        }
        variance
    }

    /// What the past has in common with the sample that was observed last.
    pub(super) fn shared(&self) -> &[f64] {
        &self.shared.0
    }

    /// By how much the variance of what is predicted so many samples ahead is larger than that with all of the past known:
    /// `w P w`, where `w` says what the past leads to in that sample: `H` in the next one, and one later what it leads to in
    /// the next one by what that makes of the past. There must be room for `w`.
    pub(super) fn ahead(&self, steps: usize, w: &mut [f64]) -> f64 {
        if self.sure {
            return 0.0;
        }
        let Blocks { values, noise, .. } = self.blocks;
        w.copy_from_slice(&self.next);
        for _ in 1..steps {
            let by_value = if values > 0 { w[0] } else { 0.0 };
            let by_noise = if noise > 0 { w[values] } else { 0.0 };
            let ends = [values, values + noise, w.len()];
            let mut from = 0;
            for (end, newest) in
                ends.into_iter()
                    .zip([by_value, by_value + by_noise, by_value + by_noise])
            {
                for nth in from..end {
                    let later = if nth + 1 < end { w[nth + 1] } else { 0.0 };
                    w[nth] = newest * self.next[nth] + later;
                }
                from = end;
            }
        }
        let rows = self.covariance.chunks_exact(w.len().max(1));
        let each = rows.zip(&*w);
        each.map(|(row, own)| own * product(w, row)).sum()
    }

    /// Nothing is in doubt any more.
    fn forget(&mut self) {
        self.covariance.fill(0.0);
        self.sure = true;
    }

    /// Puts the newest value, noise and innovation before the others of their kind: how unsure they are, each with each; with the
    /// past the value and the innovation have so many times [`shared`](Self::shared) in common, the noise what was worked out.
    fn pass(&mut self, newest: [[f64; 3]; 3], of_value: f64, of_innovation: f64) {
        let count = self.next.len();
        let (shared, of_noise) = (&self.shared.0, &self.of_noise.0);
        let Blocks {
            values,
            noise,
            innovations,
        } = self.blocks;
        // One row and one column further; what stands in the first of each kind is written anew.
        if let Some(rest) = self.covariance.len().checked_sub(count + 1) {
            self.covariance.copy_within(..rest, count + 1);
        }
        let kinds = [
            (0, values, of_value, shared),
            (values, noise, 1.0, of_noise),
            (values + noise, innovations, of_innovation, shared),
        ];
        for (first, length, times, with) in kinds {
            for nth in 1..if length > 0 { count } else { 0 } {
                let doubt = times * with[nth - 1];
                self.covariance[first * count + nth] = doubt;
                self.covariance[nth * count + first] = doubt;
            }
        }
        for (row, (first, length, ..)) in newest.iter().zip(kinds) {
            for (&doubt, (other, other_length, ..)) in row.iter().zip(kinds) {
                if length > 0 && other_length > 0 {
                    self.covariance[first * count + other] = doubt;
                }
            }
        }
    }
}
