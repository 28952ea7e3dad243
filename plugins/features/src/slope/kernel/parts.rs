//! A window as the sum of its parts, and the slope of the line through it. It does not decide which rows the parts hold.

use std::array::from_fn;

use super::sums::{Common, Quad, Table, Times, Values};

const NS_PER_S: f64 = 1e9;

/// Where Σ(t − t̄)² is a smaller part of Σt² than this, the samples lie closer together than they lie to the origin of time,
/// and too many digits are lost. Samples that span half of a window are above it up to thousands of samples.
const THIN: f64 = 1e-4;

/// Where Σ(y − ȳ)² is a smaller part of Σy² than this, it is computed from the samples.
const FLAT: f64 = 1e-6;

/// The end of a closed block, the whole blocks after it and the current block: where their sums lie, and how they are weighed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    /// The first groups of the three runs in their tables.
    places: [usize; 3],
    /// What times are measured from.
    origin: i64,
    /// Origin of the first run's time less that of the other two, in nanoseconds.
    by: f64,
    /// Sums of the rows' times.
    times: Times<1>,
    of_ty: f64,
    of_y: f64,
    of_head_y: f64,
}

impl Parts {
    pub(super) const NONE: Parts = Parts {
        places: [0; 3],
        origin: 0,
        by: 0.0,
        times: Times::NONE,
        of_ty: 0.0,
        of_y: 0.0,
        of_head_y: 0.0,
    };

    /// For a complete window the weights of the sums are the same for all channels, and there is but one division:
    /// `slope = (N·Σty − Σt·Σy) / (N·Σt² − (Σt)²)`
    #[inline]
    pub(super) fn new([head, rest, now]: [&Common; 3], places: [usize; 3]) -> Parts {
        // Both lie within a window, or the first is empty and its origin is of no meaning.
        let by = head.origin.wrapping_sub(now.origin) as f64;
        let times = rest.rows.plus(&now.rows).plus(&head.rows.shifted(by));
        let [n, t, tt] = [times.n[0], times.t[0], times.tt[0]];
        let scale = NS_PER_S / (n * tt - t * t);
        let (of_ty, of_y) = (n * scale, t * scale);
        Parts {
            places,
            origin: now.origin,
            by,
            times,
            of_ty,
            of_y,
            of_head_y: of_y - of_ty * by,
        }
    }

    /// Rows in the window.
    pub(super) fn rows(&self) -> f64 {
        self.times.n[0]
    }

    /// Slopes per second of four channels that are present in every row of the window.
    #[inline(always)]
    pub(super) fn slopes(&self, [head, rest, now]: [&Table; 3], quad: usize) -> Quad {
        let head = &head.values[self.places[0] + quad];
        let rest = &rest.values[self.places[1] + quad];
        let now = &now.values[self.places[2] + quad];
        from_fn(|i| {
            self.of_ty * (head.ty[i] + (rest.ty[i] + now.ty[i]))
                - self.of_y * (rest.y[i] + now.y[i])
                - self.of_head_y * head.y[i]
        })
    }

    /// Slopes per second of four channels that may be absent from some rows: for each the very operations of
    /// [`slopes`](Self::slopes), so that a channel keeps its bits while another is absent.
    #[inline(always)]
    pub(super) fn slopes_with_gaps(&self, [head, rest, now]: [&Table; 3], quad: usize) -> Quad {
        let [h, r, w] = self.places.map(|place| place + quad);
        let (h, r, w) = (&head.times[h], &rest.times[r], &now.times[w]);
        let Times { n, t, tt } = r.plus(w).plus(&h.shifted(self.by));
        let head = &head.values[self.places[0] + quad];
        let rest = &rest.values[self.places[1] + quad];
        let now = &now.values[self.places[2] + quad];
        from_fn(|i| {
            let scale = NS_PER_S / (n[i] * tt[i] - t[i] * t[i]);
            let (of_ty, of_y) = (n[i] * scale, t[i] * scale);
            let of_head_y = of_y - of_ty * self.by;
            of_ty * (head.ty[i] + (rest.ty[i] + now.ty[i]))
                - of_y * (rest.y[i] + now.y[i])
                - of_head_y * head.y[i]
        })
    }

    /// Sums of four channels that may be absent from some rows.
    #[inline(always)]
    pub(super) fn moments(&self, [head, rest, now]: [&Table; 3], quad: usize) -> Moments {
        let places = self.places.map(|place| place + quad);
        let (h, r, w) = (
            &head.times[places[0]],
            &rest.times[places[1]],
            &now.times[places[2]],
        );
        let times = r.plus(w).plus(&h.shifted(self.by));
        self.moments_with([head, rest, now], quad, &times)
    }

    /// The same of channels that are present in every row.
    pub(super) fn moments_of_complete(&self, tables: [&Table; 3], quad: usize) -> Moments {
        let Times { n, t, tt } = self.times;
        let times = Times {
            n: [n[0]; 4],
            t: [t[0]; 4],
            tt: [tt[0]; 4],
        };
        self.moments_with(tables, quad, &times)
    }

    #[inline(always)]
    fn moments_with(
        &self,
        [head, rest, now]: [&Table; 3],
        quad: usize,
        &Times { n, t, tt }: &Times<4>,
    ) -> Moments {
        let places = self.places.map(|place| place + quad);
        let (h, r, w) = (
            &head.values[places[0]],
            &rest.values[places[1]],
            &now.values[places[2]],
        );
        let Values { y, ty } = r.plus(w).plus(&h.shifted(self.by));
        Moments {
            n,
            n_tt: from_fn(|i| n[i] * tt[i]),
            n_sxx: from_fn(|i| n[i] * tt[i] - t[i] * t[i]),
            n_sxy: from_fn(|i| n[i] * ty[i] - t[i] * y[i]),
            t,
            y,
        }
    }

    /// Centred sums of one of four channels, from tables that keep squares; the window ends at `end_ns`.
    pub(super) fn line(
        &self,
        tables: [&Table; 3],
        (quad, i): (usize, usize),
        moments: &Moments,
        end_ns: i64,
    ) -> Line {
        let place = |part: usize| tables[part].squares[self.places[part] + quad][i];
        let (n, t, y) = (moments.n[i], moments.t[i], moments.y[i]);
        Line {
            n,
            mean: y / n,
            since_mean: end_ns.wrapping_sub(self.origin) as f64 - t / n,
            sxx: moments.n_sxx[i] / n,
            sxy: moments.n_sxy[i] / n,
            syy: place(0) + (place(1) + place(2)) - y * y / n,
        }
    }
}

/// Sums of products of deviations from the means, times the number of samples, of four channels.
pub(super) struct Moments {
    pub(super) n: Quad,
    /// N·Σt².
    n_tt: Quad,
    n_sxx: Quad,
    n_sxy: Quad,
    /// Σt and Σy.
    t: Quad,
    y: Quad,
}

impl Moments {
    /// Whether so many digits were lost that the sums must be computed from the samples.
    #[inline(always)]
    pub(super) fn thin(&self, i: usize) -> bool {
        self.n_sxx[i] < THIN * self.n_tt[i]
    }

    #[inline(always)]
    pub(super) fn any_thin(&self) -> bool {
        self.thin(0) | self.thin(1) | self.thin(2) | self.thin(3)
    }
}

/// Centred sums of one channel: the samples, Σ(t − t̄)², Σ(t − t̄)(y − ȳ), Σ(y − ȳ)².
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    n: f64,
    /// ȳ, about the channel's origin.
    mean: f64,
    /// From t̄ to the end of the window.
    since_mean: f64,
    sxx: f64,
    sxy: f64,
    syy: f64,
}

impl Line {
    /// From the samples themselves, times in nanoseconds, those of a window that ends at `end`.
    pub(super) fn through(samples: impl Iterator<Item = (f64, f64)> + Clone, end: f64) -> Line {
        let n = samples.clone().count() as f64;
        let mean_t = samples.clone().map(|(t, _)| t).sum::<f64>() / n;
        let mean_y = samples.clone().map(|(_, y)| y).sum::<f64>() / n;
        let mut line = Line {
            n,
            mean: mean_y,
            since_mean: end - mean_t,
            sxx: 0.0,
            sxy: 0.0,
            syy: 0.0,
        };
        for (t, y) in samples {
            let (t, y) = (t - mean_t, y - mean_y);
            line.sxx += t * t;
            line.sxy += t * y;
            line.syy += y * y;
        }
        line
    }

    /// Slope per second.
    pub(super) fn slope(&self) -> f64 {
        self.sxy / self.sxx * NS_PER_S
    }

    /// Standard error of the slope per second; nothing for fewer than three samples.
    pub(super) fn stderr(&self) -> Option<f64> {
        let residual = (self.syy - self.sxy / self.sxx * self.sxy).max(0.0);
        (self.n > 2.0).then(|| (residual / (self.n - 2.0) / self.sxx).sqrt() * NS_PER_S)
    }

    /// The value of the line at the end of the window, about the channel's origin.
    pub(super) fn end(&self) -> f64 {
        self.mean + self.sxy / self.sxx * self.since_mean
    }

    /// Whether the samples differ so little from each other, for their distance to the origin, that Σ(y − ȳ)² has lost too many digits.
    pub(super) fn is_flat(&self) -> bool {
        self.syy < FLAT * self.n * self.mean * self.mean
    }

    /// The share of Σ(y − ȳ)² that the line explains; nothing where all samples are the same.
    pub(super) fn r_squared(&self) -> Option<f64> {
        let r_squared = self.sxy / self.sxx * (self.sxy / self.syy);
        let rounding = 4.0 * f64::EPSILON * self.mean;
        (self.syy > self.n * rounding * rounding).then(|| r_squared.min(1.0))
    }
}
