//! The least-squares slope over trailing windows: exact sums for many channels and windows at once, row by row.
//! It decides when a window has a value; it does not decide which windows there are, nor what a caller does with absence.
//!
//! Rows are cut into blocks of at most 32, shared by all windows (`kernel/blocks.rs`). A window is the end of one block, all
//! blocks after it and the current one: three sums (`kernel/sums.rs`) that are kept for all windows at once, added up for each
//! (`kernel/parts.rs`). Nothing is ever subtracted from a sum, so that a sample of 1e9 leaves no trace when it leaves a window.
//! Times are measured from an instant within the window and values from one near them, so that no precision is lost to the
//! epoch or an offset.

mod blocks;
mod parts;
mod rows;
mod saved;
mod sums;

#[cfg(test)]
mod tests;

use std::array::from_fn;

use serde::{Deserialize, Serialize};

use blocks::Blocks;
use parts::{Line, Moments, Parts};
use rows::Rows;
use sums::{Quad, quads};

/// Samples of this size or above count as absent, like infinities: their squares would overflow.
pub(crate) const LIMIT: f64 = 1e100;

/// What a window must hold before it has a value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Fewest samples of the channel in the window; below 2 there is no slope anyway.
    pub min_samples: usize,
    /// Part of the width, 0 to 1, that lies at least between the channel's oldest and newest sample in the window.
    pub min_coverage: f64,
    /// A value may exist before the window has been open for its whole width since the channel's first sample.
    pub cold_partial: bool,
}

/// The two NaNs written where there is no value.
#[derive(Clone, Copy, Debug)]
pub struct NoValue {
    /// Too few samples in the window, or too close together.
    pub absent: f64,
    /// The channel has begun, but the window reaches back before its first sample.
    pub cold: f64,
}

/// Slopes of `C` channels sampled at common instants, over `W` trailing windows.
///
/// A window of width `T` at time `t` holds the samples with time in `(t − T, t]`; NaN, infinite and absurd (1e100) samples are absent.
/// `slope = Σ(x − x̄)(y − ȳ) / Σ(x − x̄)²` per second, over the samples of the channel.
///
/// The state is serialised as samples and the places where they were cut; what is read back continues with the same bits.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(into = "saved::Saved", try_from = "saved::Saved")]
pub struct RollingSlope {
    channels: usize,
    coverage: Coverage,
    no_value: NoValue,
    squares: bool,
    windows: Vec<Window>,
    rows: Rows,
    blocks: Blocks,
}

/// One trailing window over the rows.
#[derive(Clone, Debug)]
struct Window {
    width_ns: i64,
    /// What its samples must span, and how long ago a channel must have begun, in nanoseconds.
    needed_span: f64,
    needed_open: f64,
    /// The oldest row in it, and the block of that row.
    head: u64,
    block: usize,
    parts: Parts,
    /// Nanoseconds from the oldest row to the newest.
    span: f64,
    kind: Kind,
}

/// What is known of all channels of a window at once.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// No channel has a value.
    Absent,
    /// Every channel has one, and is present in every row.
    Complete,
    /// Each is to be looked at.
    Gaps,
}

impl Window {
    fn new(width_ns: i64, coverage: &Coverage) -> Window {
        let width = width_ns as f64;
        Window {
            width_ns,
            needed_span: (coverage.min_coverage * width).max(1.0),
            needed_open: if coverage.cold_partial { 0.0 } else { width },
            head: 0,
            block: 0,
            parts: Parts::NONE,
            span: 0.0,
            kind: Kind::Absent,
        }
    }

    /// Drops the rows that are outside of the window that ends at `t_ns`.
    #[inline]
    fn advance(&mut self, rows: &Rows, t_ns: i64) {
        let limit = t_ns.saturating_sub(self.width_ns);
        while self.head < rows.next() && rows.time(self.head) <= limit {
            self.head += 1;
        }
    }
}

impl RollingSlope {
    /// A kernel for windows of the given widths in nanoseconds (at least 1 is assumed) and `channels` channels per row.
    /// `squares` keeps Σ(y − ȳ)² too, which [`stderr`](Self::stderr) needs.
    pub fn new(
        windows_ns: &[i64],
        channels: usize,
        coverage: Coverage,
        no_value: NoValue,
        squares: bool,
    ) -> RollingSlope {
        let rows = Rows::new(channels);
        let mut blocks = Blocks::new(channels, windows_ns.len(), squares);
        blocks.rebuild(&rows, 0);
        RollingSlope {
            channels,
            coverage,
            no_value,
            squares,
            windows: windows_ns
                .iter()
                .map(|&width_ns| Window::new(width_ns.max(1), &coverage))
                .collect(),
            rows,
            blocks,
        }
    }

    /// Forgets all samples, as at a segment break. Memory is kept.
    pub fn reset(&mut self) {
        self.rows.reset();
        self.blocks.reset();
        for window in &mut self.windows {
            window.head = 0;
            window.block = 0;
        }
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Number of windows.
    pub fn windows(&self) -> usize {
        self.windows.len()
    }

    /// Time of the last row since the reset.
    pub fn last_time(&self) -> Option<i64> {
        self.rows.last_time()
    }

    /// Time of the newest sample of a channel since the reset: the stamp of its slopes.
    pub fn newest_ns(&self, channel: usize) -> Option<i64> {
        let [_, newest] = self.rows.first_and_newest(channel);
        newest
    }

    /// Adds a row: one sample per channel at time `t_ns`, NaN where absent (missing ones at the end are absent too).
    /// A time that is not later than the last one is refused: the answer is false and nothing has changed.
    pub fn push(&mut self, t_ns: i64, y: &[f64]) -> bool {
        if self.last_time().is_some_and(|last| t_ns <= last) {
            return false;
        }
        let mut newest_head = 0;
        for window in &mut self.windows {
            window.advance(&self.rows, t_ns);
            newest_head = newest_head.max(window.head);
        }
        let full = self.blocks.is_full(&self.rows, newest_head);
        if full {
            self.blocks.cut(&self.rows);
        }
        let mut oldest_block = self.blocks.starts().len() - 1;
        for window in &mut self.windows {
            window.block = self.blocks.find(window.head, window.block);
            oldest_block = oldest_block.min(window.block);
        }
        if full {
            self.blocks.close(&self.rows, t_ns, oldest_block);
            let windows = self.windows.iter_mut();
            windows.for_each(|window| window.block -= oldest_block);
        }
        let oldest = self.blocks.oldest();
        if self.rows.reserve(oldest) {
            self.blocks.rebuild(&self.rows, t_ns);
        }
        let begun = self.rows.append(t_ns, y, LIMIT, oldest);
        self.blocks.add_newest(&self.rows, begun);
        self.find_parts(t_ns);
        true
    }

    /// Finds the parts of each window, of which the last row, at `t_ns`, is the newest.
    fn find_parts(&mut self, t_ns: i64) {
        let min_samples = self.coverage.min_samples as f64;
        let (current, complete_from) = (self.blocks.current_start(), self.rows.complete_from());
        for (index, window) in self.windows.iter_mut().enumerate() {
            if window.head > current {
                self.blocks.sum_short(&self.rows, index, window.head);
            }
            let (head, block) = (window.head, window.block);
            window.parts = self.blocks.parts(&self.rows, index, head, block);
            // No more than the width of the window.
            window.span = t_ns.wrapping_sub(self.rows.time(head)) as f64;
            let enough = window.span >= window.needed_span && window.parts.rows() >= min_samples;
            window.kind = match enough {
                false => Kind::Absent,
                true if head < complete_from => Kind::Gaps,
                true => Kind::Complete,
            };
        }
    }

    /// Slopes at the last row, per second: `out[channel * W + window]`, with one of the two NaNs where there is no value.
    /// An `out` of any other length than `C * W` is filled with absence.
    pub fn slopes(&self, out: &mut [f64]) {
        let wide = self.windows.len();
        if out.len() != self.channels * wide || self.last_time().is_none() {
            out.fill(self.no_value.absent);
            return;
        }
        let tables = self.blocks.tables();
        for (quad, out) in out.chunks_mut((4 * wide).max(1)).enumerate() {
            let mut out = channels(out, wide);
            for (index, window) in self.windows.iter().enumerate() {
                let mut slopes = match window.kind {
                    Kind::Complete => window.parts.slopes(tables, quad),
                    Kind::Gaps => self.slopes_with_gaps(window, quad),
                    Kind::Absent => [self.no_value.absent; 4],
                };
                self.mark_cold(window, quad, &mut slopes);
                for (out, slope) in out.iter_mut().zip(slopes) {
                    if let Some(out) = out.get_mut(index) {
                        *out = slope;
                    }
                }
            }
        }
    }

    /// Slopes of four channels in a window with rows from which some channel is absent.
    #[inline(always)]
    fn slopes_with_gaps(&self, window: &Window, quad: usize) -> Quad {
        let moments = window.parts.moments(self.blocks.tables(), quad);
        let mut slopes = window.parts.slopes_with_gaps(self.blocks.tables(), quad);
        if moments.any_thin() {
            self.mend(window, quad, &moments, &mut slopes);
        }
        self.mark_absent(window, quad, &moments.n, &mut slopes);
        slopes
    }

    /// Computes anew, from the samples, the slopes whose sums have lost too many digits.
    #[cold]
    fn mend(&self, window: &Window, quad: usize, moments: &Moments, slopes: &mut Quad) {
        for (i, slope) in slopes.iter_mut().enumerate() {
            if moments.thin(i) {
                *slope = self.line(window, 4 * quad + i).slope();
            }
        }
    }

    /// Of four channels with `n` samples in a window, marks those with too few or too close together.
    #[inline(always)]
    fn mark_absent(&self, window: &Window, quad: usize, n: &Quad, values: &mut Quad) {
        let (wait, silent) = (self.rows.wait(window.head), self.rows.silent());
        let (wait, silent) = (&wait[quad], &silent[quad]);
        let (min_samples, absent) = (self.coverage.min_samples as f64, self.no_value.absent);
        let span: Quad = from_fn(|i| window.span - silent[i] - wait[i]);
        let far: Quad = from_fn(|i| {
            if span[i] >= window.needed_span {
                values[i]
            } else {
                absent
            }
        });
        *values = from_fn(|i| if n[i] >= min_samples { far[i] } else { absent });
    }

    /// Marks the channels that began within a window.
    #[inline(always)]
    fn mark_cold(&self, window: &Window, quad: usize, values: &mut Quad) {
        if self.rows.least_open() < window.needed_open {
            for (value, &open) in values.iter_mut().zip(&self.rows.open()[quad]) {
                if open >= 0.0 && open < window.needed_open {
                    *value = self.no_value.cold;
                }
            }
        }
    }

    /// Computed from the samples of a channel in a window.
    #[cold]
    fn line(&self, window: &Window, channel: usize) -> Line {
        let origin = self.blocks.origins().as_flattened()[channel];
        let head_ns = self.rows.time(window.head);
        let samples = (window.head..self.rows.next()).map(|row| {
            let t = self.rows.time(row).saturating_sub(head_ns) as f64;
            (t, self.rows.samples(row).as_flattened()[channel] - origin)
        });
        let end = self.rows.time(self.rows.next() - 1).saturating_sub(head_ns) as f64;
        Line::through(samples.filter(|(_, y)| !y.is_nan()), end)
    }

    /// Standard errors of the slopes at the last row, per second, laid out as in [`slopes`](Self::slopes): `sqrt(SSR / (n − 2) / Σ(x − x̄)²)`,
    /// SSR the residual sum of squares of the same fit. Absent for fewer than three samples and unless the kernel keeps squares.
    ///
    /// `SSR = Σ(y − ȳ)² − slope·Σ(x − x̄)(y − ȳ)` loses digits as `r²` approaches 1: its relative error is about 1e-15 / (1 − r²).
    pub fn stderr(&self, out: &mut [f64]) {
        self.tell(out, |line, _| line.stderr());
    }

    /// The values of the lines at the last row's time, laid out as in [`slopes`](Self::slopes). Absent unless the kernel keeps squares.
    pub fn ends(&self, out: &mut [f64]) {
        self.tell(out, |line, origin| Some(origin + line.end()));
    }

    /// The coefficients of determination `1 − SSR / Σ(y − ȳ)²` of the lines, laid out as in [`slopes`](Self::slopes). Absent where
    /// all samples are the same and unless the kernel keeps squares.
    pub fn r_squared(&self, out: &mut [f64]) {
        self.tell(out, |line, _| line.r_squared());
    }

    /// Something about the line of each channel and window, given with the origin of the channel's values.
    fn tell(&self, out: &mut [f64], of: impl Fn(&Line, f64) -> Option<f64>) {
        let wide = self.windows.len();
        let fits = self.squares && out.len() == self.channels * wide;
        let Some(end_ns) = self.last_time().filter(|_| fits) else {
            out.fill(self.no_value.absent);
            return;
        };
        let tables = self.blocks.tables();
        for (index, window) in self.windows.iter().enumerate() {
            for quad in 0..quads(self.channels) {
                let moments = match window.kind {
                    Kind::Gaps => window.parts.moments(tables, quad),
                    _ => window.parts.moments_of_complete(tables, quad),
                };
                let origins = &self.blocks.origins()[quad];
                let mut values = from_fn(|i| {
                    let line = window.parts.line(tables, (quad, i), &moments, end_ns);
                    let line = match moments.thin(i) || line.is_flat() {
                        true => self.line(window, 4 * quad + i),
                        false => line,
                    };
                    of(&line, origins[i]).unwrap_or(self.no_value.absent)
                });
                self.mark_absent(window, quad, &moments.n, &mut values);
                self.mark_cold(window, quad, &mut values);
                for (out, value) in channels(&mut out[4 * quad * wide..], wide)
                    .into_iter()
                    .zip(values)
                {
                    if let Some(out) = out.get_mut(index) {
                        *out = value;
                    }
                }
            }
        }
    }
}

/// The results of four channels, or of those that there are, `wide` each.
#[inline(always)]
fn channels(mut out: &mut [f64], wide: usize) -> [&mut [f64]; 4] {
    from_fn(|_| {
        let length = wide.min(out.len());
        let (channel, others) = std::mem::take(&mut out).split_at_mut(length);
        out = others;
        channel
    })
}
