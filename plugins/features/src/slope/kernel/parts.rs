//! A window as the sum of its parts, and the slope of the line through it. It does not decide which rows the parts hold.

use std::array::from_fn;

use super::sums::{Common, Group, LANES, Lanes, Times, Values};

const NS_PER_S: f64 = 1e9;

const HALF: usize = LANES / 2;

/// Where Σ(t − t̄)² is a smaller part of Σt² than this, the samples lie closer together than they lie to the origin of time,
/// and too many digits are lost. Samples that span half of a window are above it up to thousands of samples.
const THIN: f64 = 1e-4;

/// Where Σ(y − ȳ)² is a smaller part of Σy² than this, it is computed from the samples.
const FLAT: f64 = 1e-6;

/// The end of a closed block, the whole blocks after it and the current block: where their sums lie, and how they are weighed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    /// The three runs in their tables.
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

    /// Slopes per second of channels that are present in every row of the window.
    #[inline(always)]
    pub(super) fn slopes(&self, [head, rest, now]: [&[Values]; 3], slopes: &mut Lanes) {
        let [h, r, w] = self.places;
        self.slopes_of(&head[h], &rest[r], &now[w], slopes);
    }

    /// Not inlined, so that the compiler keeps in mind how the sums are aligned.
    #[inline(never)]
    fn slopes_of(&self, head: &Values, rest: &Values, now: &Values, slopes: &mut Lanes) {
        *slopes = from_fn(|i| {
            self.of_ty * (head.ty[i] + (rest.ty[i] + now.ty[i]))
                - self.of_y * (rest.y[i] + now.y[i])
                - self.of_head_y * head.y[i]
        });
    }

    /// Slopes per second of channels that may be absent from some rows: for each the very operations of
    /// [`slopes`](Self::slopes), so that a channel keeps its bits while another is absent.
    /// What must not be too little is noted in `least`.
    #[inline(always)]
    pub(super) fn slopes_with_gaps(
        &self,
        [head, rest, now]: [&Group; 3],
        slopes: &mut Lanes,
        least: &mut Least,
    ) {
        let [h, r, w] = self.places;
        let times = [&head.times[h], &rest.times[r], &now.times[w]];
        let values = [&head.values[h], &rest.values[r], &now.values[w]];
        // In halves, which fit into the registers.
        for first in [0, HALF] {
            self.half_with_gaps(first, values, times, slopes, least);
        }
    }

    #[inline(always)]
    fn half_with_gaps(
        &self,
        first: usize,
        [head, rest, now]: [&Values; 3],
        times: [&Times<LANES>; 3],
        slopes: &mut Lanes,
        least: &mut Least,
    ) {
        let half = |of: &Lanes| -> [f64; HALF] { from_fn(|i| of[first + i]) };
        let [h, r, w] = times.map(|times| Times {
            n: half(&times.n),
            t: half(&times.t),
            tt: half(&times.tt),
        });
        let Times { n, t, tt } = r.plus(&w).plus(&h.shifted(self.by));
        let n_tt: [f64; HALF] = from_fn(|i| n[i] * tt[i]);
        let n_sxx: [f64; HALF] = from_fn(|i| n_tt[i] - t[i] * t[i]);
        for (i, lane) in (first..first + HALF).enumerate() {
            least.n[lane] = lesser(least.n[lane], n[i]);
        }
        for (i, lane) in (first..first + HALF).enumerate() {
            let above_thin = n_sxx[i] - THIN * n_tt[i];
            least.above_thin[lane] = lesser(least.above_thin[lane], above_thin);
        }
        for (i, lane) in (first..first + HALF).enumerate() {
            let scale = NS_PER_S / n_sxx[i];
            let (of_ty, of_y) = (n[i] * scale, t[i] * scale);
            let of_head_y = of_y - of_ty * self.by;
            slopes[lane] = of_ty * (head.ty[lane] + (rest.ty[lane] + now.ty[lane]))
                - of_y * (rest.y[lane] + now.y[lane])
                - of_head_y * head.y[lane];
        }
    }

    #[inline(always)]
    fn times_with_gaps(&self, [head, rest, now]: [&Group; 3]) -> Times<LANES> {
        let head = &head.times[self.places[0]];
        let rest = &rest.times[self.places[1]];
        let now = &now.times[self.places[2]];
        rest.plus(now).plus(&head.shifted(self.by))
    }

    /// How many samples there are of channels that may be absent from some rows, and whether so many digits were lost that the sums
    /// must be computed from them.
    #[inline(always)]
    pub(super) fn samples_and_thin(&self, groups: [&Group; 3]) -> (Lanes, [bool; LANES]) {
        let Times { n, t, tt } = self.times_with_gaps(groups);
        let thin = from_fn(|i| n[i] * tt[i] - t[i] * t[i] < THIN * (n[i] * tt[i]));
        (n, thin)
    }

    /// Sums of channels that may be absent from some rows.
    pub(super) fn moments(&self, groups: [&Group; 3]) -> Moments {
        self.moments_with(groups, &self.times_with_gaps(groups))
    }

    /// The same of channels that are present in every row.
    pub(super) fn moments_of_complete(&self, groups: [&Group; 3]) -> Moments {
        let Times { n, t, tt } = self.times;
        let times = Times {
            n: [n[0]; LANES],
            t: [t[0]; LANES],
            tt: [tt[0]; LANES],
        };
        self.moments_with(groups, &times)
    }

    #[inline(always)]
    fn moments_with(
        &self,
        [head, rest, now]: [&Group; 3],
        &Times { n, t, tt }: &Times<LANES>,
    ) -> Moments {
        let head = &head.values[self.places[0]];
        let rest = &rest.values[self.places[1]];
        let now = &now.values[self.places[2]];
        let Values { y, ty } = rest.plus(now).plus(&head.shifted(self.by));
        Moments {
            n,
            n_tt: from_fn(|i| n[i] * tt[i]),
            n_sxx: from_fn(|i| n[i] * tt[i] - t[i] * t[i]),
            n_sxy: from_fn(|i| n[i] * ty[i] - t[i] * y[i]),
            t,
            y,
        }
    }

    /// Centred sums of one channel of a group, from runs that keep squares; the window ends at `end_ns`.
    pub(super) fn line(
        &self,
        groups: [&Group; 3],
        i: usize,
        moments: &Moments,
        end_ns: i64,
    ) -> Line {
        let place = |part: usize| groups[part].squares[self.places[part]][i];
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

/// The least over windows, for each channel of a group.
pub(super) struct Least {
    /// Samples.
    n: Lanes,
    /// What N·Σ(t − t̄)² lies above the part of N·Σt² at which digits are lost.
    above_thin: Lanes,
    /// What the samples span beyond what they must, in nanoseconds.
    span: Lanes,
}

impl Least {
    pub(super) const NONE: Least = Least {
        n: [f64::INFINITY; LANES],
        above_thin: [f64::INFINITY; LANES],
        span: [f64::INFINITY; LANES],
    };

    #[inline(always)]
    pub(super) fn add_span(&mut self, beyond: &Lanes) {
        self.span = from_fn(|i| lesser(self.span[i], beyond[i]));
    }

    /// Whether each channel has at least `min_samples`, which span enough, and sums that have kept their digits, in every window.
    #[inline(always)]
    pub(super) fn suffices(&self, min_samples: f64) -> bool {
        let least = |of: Lanes| of.into_iter().fold(f64::INFINITY, lesser);
        least(self.n) >= min_samples && least(self.above_thin) >= 0.0 && least(self.span) >= 0.0
    }
}

/// One instruction, as opposed to [`f64::min`], which minds NaN.
#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Sums of products of deviations from the means, times the number of samples, of the channels of a group.
pub(super) struct Moments {
    pub(super) n: Lanes,
    /// N·Σt².
    n_tt: Lanes,
    n_sxx: Lanes,
    n_sxy: Lanes,
    /// Σt and Σy.
    t: Lanes,
    y: Lanes,
}

impl Moments {
    /// Whether so many digits were lost that the sums must be computed from the samples.
    #[inline(always)]
    pub(super) fn thin(&self, i: usize) -> bool {
        self.n_sxx[i] < THIN * self.n_tt[i]
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
