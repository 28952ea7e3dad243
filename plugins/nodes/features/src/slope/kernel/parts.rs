//! A window as the sum of its parts, and the slope of the line through it. It does not decide which rows the parts hold.

use std::array::from_fn;

use super::lanes::{LANES, Lanes};
use super::sums::{Common, Group, Times, TimesOfLanes, Values};

const NS_PER_S: f64 = 1e9;

/// Where Σ(t − t̄)² is a smaller part of Σt² than this, the samples lie closer together than they lie to the origin of time,
/// and too many digits are lost. Samples that span half of a window are above it up to thousands of samples.
const THIN: f64 = 1e-4;

/// Where Σ(y − ȳ)² is a smaller part of Σy² than this, it is computed from the samples.
const FLAT: f64 = 1e-6;

/// Windows whose weights are computed together, so that vector instructions do it.
pub(super) const ABREAST: usize = 4;

/// What the sums of windows that stand abreast are multiplied by where a channel is present in every row: the weights are
/// the same for all channels then, and there is but one division.
#[derive(Clone, Debug)]
pub(super) struct Weights {
    /// As in [`Parts`].
    by: [f64; ABREAST],
    /// Sums of the rows' times in the second parts, and in the windows.
    rest: Times<ABREAST>,
    times: Times<ABREAST>,
    of_ty: [f64; ABREAST],
    of_y: [f64; ABREAST],
    of_head_y: [f64; ABREAST],
}

impl Weights {
    pub(super) const NONE: Weights = Weights {
        by: [0.0; ABREAST],
        rest: Times::NONE,
        times: Times::NONE,
        of_ty: [0.0; ABREAST],
        of_y: [0.0; ABREAST],
        of_head_y: [0.0; ABREAST],
    };

    /// Sets what window `i` keeps as long as neither its block nor the current one changes.
    pub(super) fn set_rest(&mut self, i: usize, rest: &Common, by: f64) {
        self.by[i] = by;
        self.rest.set(i, &rest.rows);
    }

    /// Finds the weights of windows that end with the current block and whose first parts lie at these places of `heads`.
    #[inline(always)]
    pub(super) fn weigh(&mut self, places: [usize; ABREAST], heads: &[Common], now: &Common) {
        let heads = places.map(|place| &heads[place].rows);
        let head = Times {
            n: heads.map(|head| head.n[0]),
            t: heads.map(|head| head.t[0]),
            tt: heads.map(|head| head.tt[0]),
        };
        let head = head.shifted(&self.by);
        self.times = self.rest.plus(&now.rows.repeated()).plus(&head);
        [self.of_ty, self.of_y, self.of_head_y] = weights(&self.times, &self.by);
    }

    /// Finds the weights of window `i`, which begins within the current block.
    pub(super) fn weigh_whole(&mut self, i: usize, whole: &Common) {
        let [[of_ty], [of_y], [of_head_y]] = weights(&whole.rows, &[0.0]);
        self.times.set(i, &whole.rows);
        (self.of_ty[i], self.of_y[i], self.of_head_y[i]) = (of_ty, of_y, of_head_y);
    }

    /// Sums of the times of all rows of window `i`.
    pub(super) fn times(&self, i: usize) -> Times<LANES> {
        self.times.only(i).repeated()
    }

    /// Slopes per second in window `i` of channels that are present in every row of it.
    #[inline(always)]
    pub(super) fn slopes(&self, i: usize, [head, rest, now]: [&Values; 3]) -> Lanes {
        let (of_ty, of_y, of_head_y) = (self.of_ty[i], self.of_y[i], self.of_head_y[i]);
        let mut slopes = [0.0; LANES];
        // A closure of this length is not inlined.
        for (i, slope) in slopes.iter_mut().enumerate() {
            *slope = of_ty * (head.ty[i] + (rest.ty[i] + now.ty[i]))
                - of_y * (rest.y[i] + now.y[i])
                - of_head_y * head.y[i];
        }
        slopes
    }
}

/// `slope = (N·Σty − Σt·Σy) / (N·Σt² − (Σt)²)`
#[inline(always)]
fn weights<const L: usize>(Times { n, t, tt }: &Times<L>, by: &[f64; L]) -> [[f64; L]; 3] {
    let scale: [f64; L] = from_fn(|i| NS_PER_S / (n[i] * tt[i] - t[i] * t[i]));
    let of_ty: [f64; L] = from_fn(|i| n[i] * scale[i]);
    let of_y: [f64; L] = from_fn(|i| t[i] * scale[i]);
    let of_head_y = from_fn(|i| of_y[i] - of_ty[i] * by[i]);
    [of_ty, of_y, of_head_y]
}

/// The end of a closed block, the whole blocks after it and the current block: where their sums lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    /// The three runs in their tables.
    pub(super) places: [usize; 3],
    /// Origin of the first run's time less that of the other two, in nanoseconds.
    pub(super) by: f64,
}

impl Parts {
    pub(super) const NONE: Parts = Parts {
        places: [0; 3],
        by: 0.0,
    };

    /// Slopes per second of channels that may be absent from some rows: for each the very operations of
    /// [`Weights`], so that a channel keeps its bits while another is absent.
    /// What must not be too little is noted in `least`.
    #[inline(always)]
    pub(super) fn slopes_with_gaps(
        &self,
        [head, rest, now]: [&Group; 3],
        slopes: &mut Lanes,
        least: &mut Least,
    ) {
        let [h, r, w] = self.places;
        let head = (&head.times[h], &head.values[h]);
        let rest = (&rest.times[r], &rest.values[r]);
        let now = (&now.times[w], &now.values[w]);
        slopes_with_gaps(self.by, head, rest, now, slopes, least);
    }

    #[inline(always)]
    fn times_with_gaps(&self, [head, rest, now]: [&Group; 3]) -> Times<LANES> {
        let head = &head.times[self.places[0]].0;
        let rest = &rest.times[self.places[1]].0;
        let now = &now.times[self.places[2]].0;
        rest.plus(now).plus(&head.shifted(&[self.by; LANES]))
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

    /// The same where the sums of times are known.
    #[inline(always)]
    pub(super) fn moments_with(
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

    /// Centred sums of one channel of a group, from runs that keep squares; the window ends `end` after the origin of its times.
    pub(super) fn line(&self, groups: [&Group; 3], i: usize, moments: &Moments, end: f64) -> Line {
        let place = |part: usize| groups[part].squares[self.places[part]][i];
        let (n, t, y) = (moments.n[i], moments.t[i], moments.y[i]);
        Line {
            n,
            mean: y / n,
            since_mean: end - t / n,
            sxx: moments.n_sxx[i] / n,
            sxy: moments.n_sxy[i] / n,
            syy: place(0) + (place(1) + place(2)) - y * y / n,
        }
    }
}

/// Of each number all channels before the next, so that the compiler takes several channels at once.
#[inline(always)]
fn slopes_with_gaps(
    by: f64,
    (head_times, head): (&TimesOfLanes, &Values),
    (rest_times, rest): (&TimesOfLanes, &Values),
    (now_times, now): (&TimesOfLanes, &Values),
    slopes: &mut Lanes,
    least: &mut Least,
) {
    let times = (rest_times.0.plus(&now_times.0)).plus(&head_times.0.shifted(&[by; LANES]));
    let Times { n, t, tt } = &times;
    least.n = from_fn(|i| lesser(least.n[i], n[i]));
    least.above_thin = from_fn(|i| {
        let n_tt = n[i] * tt[i];
        lesser(least.above_thin[i], (n_tt - t[i] * t[i]) - THIN * n_tt)
    });
    let [of_ty, of_y, of_head_y] = weights(&times, &[by; LANES]);
    *slopes = from_fn(|i| {
        of_ty[i] * (head.ty[i] + (rest.ty[i] + now.ty[i]))
            - of_y[i] * (rest.y[i] + now.y[i])
            - of_head_y[i] * head.y[i]
    });
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

    /// Notes what the samples span where the window spans `beyond` what it must, its last samples have been silent for so long and its
    /// first ones awaited.
    #[inline(always)]
    pub(super) fn add_span(&mut self, beyond: f64, silent: &Lanes, wait: &Lanes) {
        self.span = from_fn(|i| lesser(self.span[i], beyond - silent[i] - wait[i]));
    }

    /// Whether each channel has at least `min_samples`, which span enough, and sums that have kept their digits, in every window.
    pub(super) fn suffices(&self, min_samples: f64) -> bool {
        (0..LANES).fold(true, |suffices, i| {
            let enough = (self.n[i] >= min_samples) & (self.span[i] >= 0.0);
            suffices & enough & (self.above_thin[i] >= 0.0)
        })
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
