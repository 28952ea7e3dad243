//! Decides how unsure a stepper is of the past that it goes by; what it takes that past for is decided by the stepper.

use std::ops::Range;

use serde::Serialize;

use super::Polynomials;
use super::past::product;
use super::roots::alike;
use crate::scratch::Scratch;

/// The covariance `P` of the past `z` that a model goes by, in the variance of an innovation: of past values, of what the filter of
/// each input gave, of past values of the noise and of past innovations, the newest first in each. Inputs are taken for known.
///
/// With the next innovation `e` the next value is `H z + e`, the next of a filter is `H z` of its own places and the next of the
/// noise `H z + e` of those of noise and innovations; each goes before the others of its kind, of which the oldest is forgotten.
/// What follows is the Kalman filter of that (Harvey 1989, section 3.2; Jones 1980 for samples that are missing), in as many steps
/// as `P` has places. Nothing that is not known moves a filter, so that what is in doubt of it only ever becomes less.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(into = "Vec<f64>")]
pub(super) struct Doubt {
    /// Row after row.
    covariance: Vec<f64>,
    /// Whether all of it is 0.
    sure: bool,
    kinds: Vec<Kind>,
    /// `H`.
    next: Vec<f64>,
    /// How alike the newest that a filter gave and each of its others are taken to be where nothing is known of them.
    alike: Vec<f64>,
    /// `P H`.
    shared: Scratch,
    of_noise: Scratch,
    /// What the newest of each kind has in common with the past, kind after kind, and with the newest of the others.
    with_past: Scratch,
    newest: Scratch,
}

/// What a part of the past consists of.
#[derive(Debug, Clone, PartialEq)]
struct Kind {
    of: Of,
    places: Range<usize>,
    /// The places of the past that lead to the next one.
    leads: Range<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Of {
    Values,
    Filter,
    Noise,
    Innovations,
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

impl Kind {
    /// Whether the next innovation is in the next of its kind.
    fn innovates(&self) -> bool {
        self.of != Of::Filter
    }
}

impl Doubt {
    /// All of the past is known.
    pub(super) fn none(model: &Polynomials, whitening: &[f64]) -> Self {
        let filters: Vec<&[f64]> = model.inputs.iter().map(|of| &of.f[..]).collect();
        Self::among(model, whitening, &filters)
    }

    /// The same of a model the filters of whose inputs are known at all times.
    pub(super) fn of_noise(model: &Polynomials, whitening: &[f64]) -> Self {
        Self::among(model, whitening, &[])
    }

    fn among(model: &Polynomials, whitening: &[f64], filters: &[&[f64]]) -> Self {
        let Polynomials { a, c, .. } = model;
        let of_filters = || filters.iter().flat_map(|f| f.iter());
        let known = a.iter().chain(of_filters()).chain(whitening).map(|p| -p);
        let next: Vec<f64> = known.chain(c.iter().copied()).collect();
        let count = next.len();
        let mut kinds = Vec::with_capacity(3 + filters.len());
        let mut from = 0;
        let mut put = |of: Of, length: usize, leads: Option<Range<usize>>| {
            let places = from..from + length;
            from = places.end;
            kinds.push(Kind {
                of,
                leads: leads.unwrap_or(places.clone()),
                places,
            });
        };
        let noise = count - c.len() - whitening.len();
        put(Of::Values, a.len(), Some(0..count));
        filters.iter().for_each(|f| put(Of::Filter, f.len(), None));
        put(Of::Noise, whitening.len(), Some(noise..count));
        put(Of::Innovations, c.len(), Some(0..0));
        Self {
            covariance: vec![0.0; count * count],
            sure: true,
            next,
            alike: filters.iter().flat_map(|f| alike(f)).collect(),
            shared: Scratch(vec![0.0; count]),
            of_noise: Scratch(vec![0.0; count]),
            with_past: Scratch(vec![0.0; count * kinds.len()]),
            newest: Scratch(vec![0.0; kinds.len() * kinds.len()]),
            kinds,
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

    /// Of the innovations nothing is known but their variance, and what each filter gave has the variance that `filter` says, as
    /// alike as if innovations had driven it; all else is known.
    pub(super) fn begin(&mut self, filter: impl Fn(usize) -> f64) {
        let count = self.next.len();
        self.covariance.fill(0.0);
        let filters = self.kinds.iter().filter(|kind| kind.of == Of::Filter);
        let first = self.kinds[0].places.end;
        for (nth, Kind { places, .. }) in filters.enumerate() {
            let variance = filter(nth);
            for i in places.clone() {
                for j in places.clone() {
                    let alike = self.alike[places.start - first + i.abs_diff(j)];
                    self.covariance[i * count + j] = variance * alike;
                }
            }
        }
        self.begin_innovations();
    }

    /// Of the innovations nothing is known but their variance.
    fn begin_innovations(&mut self) {
        let count = self.next.len();
        let innovations = self.kinds.last().map_or(0..0, |kind| kind.places.clone());
        for i in innovations {
            self.covariance[i * count..][..count].fill(0.0);
            for j in 0..count {
                self.covariance[j * count + i] = 0.0;
            }
            self.covariance[i * count + i] = 1.0;
        }
        self.sure = false;
        if self.all_below(0.0) {
            self.forget();
        }
    }

    /// A value was there, which is what the filters gave and noise of such a variance, infinite where that may be anywhere; the
    /// past of values and noise is taken to have always been like it. [`shared`](Self::shared) is then by how much each place of
    /// the filters is to be put right, as a share of what the value is off by: the noise is what they leave of it.
    pub(super) fn settle(&mut self, variance_of_noise: f64) {
        let count = self.next.len();
        let Self {
            kinds,
            covariance,
            shared: Scratch(shared),
            of_noise: Scratch(of_noise),
            ..
        } = self;
        let filters = || kinds.iter().filter(|kind| kind.of == Of::Filter);
        let places = || filters().flat_map(|kind| kind.places.clone());
        let newest = || filters().filter_map(|kind| kind.places.clone().next());
        shared.fill(0.0);
        for i in places() {
            shared[i] = newest().map(|j| covariance[i * count + j]).sum();
        }
        let all = newest().map(|i| shared[i]).sum::<f64>() + variance_of_noise;
        let share = if all > 0.0 { 1.0 / all } else { 0.0 };
        for i in places() {
            for j in places() {
                covariance[i * count + j] -= share * shared[i] * shared[j];
            }
        }
        shared.iter_mut().for_each(|shared| *shared *= share);
        let is_filter = |place: usize| filters().any(|kind| kind.places.contains(&place));
        for i in 0..count {
            for j in 0..count {
                if !(is_filter(i) && is_filter(j)) {
                    covariance[i * count + j] = 0.0;
                }
            }
        }
        of_noise.fill(0.0);
        for i in places() {
            let sum: f64 = newest().map(|j| covariance[i * count + j]).sum();
            of_noise[i] = -sum;
        }
        let own = -newest().map(|i| of_noise[i]).sum::<f64>();
        for noise in kinds.iter().filter(|kind| kind.of == Of::Noise) {
            for i in noise.places.clone() {
                for j in places() {
                    covariance[i * count + j] = of_noise[j];
                    covariance[j * count + i] = of_noise[j];
                }
                for j in noise.places.clone() {
                    covariance[i * count + j] = own;
                }
            }
        }
        self.begin_innovations();
    }

    /// Goes on by a sample that is missing.
    pub(super) fn miss(&mut self) {
        let count = self.next.len();
        let innovates = |kind: &Kind| kind.innovates() && !kind.places.is_empty();
        if self.sure && !self.kinds.iter().any(innovates) {
            return;
        }
        for (kind, with) in self
            .kinds
            .iter()
            .zip(self.with_past.0.chunks_exact_mut(count))
        {
            let leads = kind.leads.clone();
            let rows = self.covariance.chunks_exact(count);
            for (row, with) in rows.zip(with) {
                *with = product(&self.next[leads.clone()], &row[leads.clone()]);
            }
        }
        self.among_newest(|kind| (kind.leads.clone(), 1.0), |_, _| 1.0);
        self.pass();
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
            // A model that grows without end, after a gap in which it did: nothing of before can be found from it.
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
        // The value is known, and the noise is what it leaves once past values and filters are allowed for.
        let leading = |kind: &Kind| match kind.of {
            Of::Values | Of::Innovations => (0..0, 0.0),
            Of::Filter => (kind.leads.clone(), 1.0),
            Of::Noise => (0..kind.places.start, -1.0),
        };
        for (kind, with) in self
            .kinds
            .iter()
            .zip(self.with_past.0.chunks_exact_mut(count))
        {
            if kind.of == Of::Innovations {
                let both = with.iter_mut().zip(&self.shared.0);
                both.for_each(|(with, shared)| *with = -shared / variance);
                continue;
            }
            let (leads, sign) = leading(kind);
            let rows = self.covariance.chunks_exact(count);
            for (row, with) in rows.zip(with) {
                *with = sign * product(&self.next[leads.clone()], &row[leads.clone()]);
            }
        }
        let innovation = 1.0 - 1.0 / variance;
        self.among_newest(leading, |of, other| {
            let both = [of, other].map(|kind| kind.of == Of::Innovations);
            if both == [true, true] {
                innovation
            } else {
                0.0
            }
        });
        self.pass();
        if self.all_below(4.0 * f64::EPSILON) {
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
        w.copy_from_slice(&self.next);
        let first = |w: &[f64], of: Of| -> f64 {
            let mut kinds = self.kinds.iter().filter(|kind| kind.of == of);
            let places = kinds.next().map_or(0..0, |kind| kind.places.clone());
            places.clone().next().map_or(0.0, |first| w[first])
        };
        for _ in 1..steps {
            let (by_value, by_noise) = (first(w, Of::Values), first(w, Of::Noise));
            for Kind { of, places, .. } in &self.kinds {
                let newest = match of {
                    Of::Values => by_value,
                    Of::Filter => by_value + places.clone().next().map_or(0.0, |first| w[first]),
                    Of::Noise | Of::Innovations => by_value + by_noise,
                };
                for nth in places.clone() {
                    let later = if nth + 1 < places.end {
                        w[nth + 1]
                    } else {
                        0.0
                    };
                    w[nth] = newest * self.next[nth] + later;
                }
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

    /// Whether no variance is above this.
    fn all_below(&self, most: f64) -> bool {
        let mut own = self.covariance.iter().step_by(self.next.len() + 1);
        own.all(|&own| own <= most)
    }

    /// Works out what the newest of each kind have in common with each other, of which it is known what they have in common with
    /// the past: `leading` says which places lead to that of a kind and with which sign, and `beside` what is common beside the past.
    fn among_newest(
        &mut self,
        leading: impl Fn(&Kind) -> (Range<usize>, f64),
        beside: impl Fn(&Kind, &Kind) -> f64,
    ) {
        let (count, kinds) = (self.next.len(), &self.kinds);
        for (i, kind) in kinds.iter().enumerate() {
            // An innovation comes last, and nothing leads to it.
            for (j, other) in kinds.iter().enumerate().skip(i) {
                let (leads, sign) = leading(kind);
                let with = &self.with_past.0[j * count..][..count];
                let by_past = sign * product(&self.next[leads.clone()], &with[leads]);
                let beside = if kind.innovates() && other.innovates() {
                    beside(kind, other)
                } else {
                    0.0
                };
                self.newest.0[i * kinds.len() + j] = by_past + beside;
                self.newest.0[j * kinds.len() + i] = by_past + beside;
            }
        }
    }

    /// Puts the newest of each kind before the others of its kind.
    fn pass(&mut self) {
        let count = self.next.len();
        // One row and one column further; what stands in the first of each kind is written anew.
        if let Some(rest) = self.covariance.len().checked_sub(count + 1) {
            self.covariance.copy_within(..rest, count + 1);
        }
        let firsts = || {
            let kinds = self.kinds.iter().enumerate();
            kinds.filter_map(|(nth, kind)| Some((nth, kind.places.clone().next()?)))
        };
        for (kind, first) in firsts() {
            let with = &self.with_past.0[kind * count..][..count];
            for nth in 1..count {
                self.covariance[first * count + nth] = with[nth - 1];
                self.covariance[nth * count + first] = with[nth - 1];
            }
        }
        for (kind, first) in firsts() {
            for (other, at) in firsts() {
                self.covariance[first * count + at] =
                    self.newest.0[kind * self.kinds.len() + other];
            }
        }
    }
}

#[cfg(test)]
mod tests;
