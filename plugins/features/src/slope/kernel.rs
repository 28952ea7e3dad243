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
use parts::{Least, Line, Parts};
use rows::Rows;
use sums::{LANES, Lanes};

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
    /// Number of the shortest window, if there is one.
    shortest: usize,
    /// Whether in all windows every channel has a value and is present in every row.
    all_complete: bool,
    longest_needed_open: i64,
    /// By window: the results of the channels of a group.
    results: Vec<Lanes>,
}

/// One trailing window over the rows.
#[derive(Clone, Debug)]
struct Window {
    width_ns: i64,
    /// What its samples must span, in nanoseconds.
    needed_span: i64,
    /// How long ago a channel must have begun, in nanoseconds.
    needed_open: i64,
    /// The oldest row in it, when that was, and the block of that row.
    head: u64,
    head_ns: i64,
    block: usize,
    /// The first row of the next block.
    block_end: u64,
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
        Window {
            width_ns,
            needed_span: (coverage.min_coverage * width_ns as f64).ceil().max(1.0) as i64,
            needed_open: if coverage.cold_partial { 0 } else { width_ns },
            head: 0,
            head_ns: 0,
            block: 0,
            block_end: u64::MAX,
            parts: Parts::NONE,
            span: 0.0,
            kind: Kind::Absent,
        }
    }

    /// Begins with the first row of all.
    fn begin(&mut self, t_ns: i64) {
        (self.head, self.head_ns) = (0, t_ns);
        (self.block, self.block_end) = (0, 0);
    }

    /// Drops the rows that are outside of the window that ends with the row at `t_ns`, the last one or the next.
    #[inline]
    fn advance(&mut self, rows: &Rows, t_ns: i64) {
        // Without a sign no two instants are too far apart.
        let leaves = |t: i64| t_ns.wrapping_sub(t) as u64 >= self.width_ns as u64;
        while self.head < rows.next() && leaves(self.head_ns) {
            self.head += 1;
            self.head_ns = match self.head < rows.next() {
                true => rows.time(self.head),
                false => t_ns,
            };
        }
    }

    /// Finds the block of the oldest row, which is not before the one that it had.
    fn find_block(&mut self, blocks: &Blocks) {
        self.block = blocks.find(self.head, self.block);
        self.block_end = blocks
            .starts()
            .get(self.block + 1)
            .copied()
            .unwrap_or(u64::MAX);
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
        let windows: Vec<Window> = windows_ns
            .iter()
            .map(|&width_ns| Window::new(width_ns.max(1), &coverage))
            .collect();
        let shortest = (0..windows.len()).min_by_key(|&index| windows[index].width_ns);
        RollingSlope {
            channels,
            coverage,
            no_value,
            squares,
            rows,
            blocks,
            shortest: shortest.unwrap_or(0),
            all_complete: false,
            longest_needed_open: windows.iter().map(|w| w.needed_open).max().unwrap_or(0),
            results: vec![[0.0; LANES]; windows.len()],
            windows,
        }
    }

    /// Forgets all samples, as at a segment break. Memory is kept.
    pub fn reset(&mut self) {
        self.rows.reset();
        self.blocks.reset();
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
        self.rows.newest(channel)
    }

    /// Adds a row: one sample per channel at time `t_ns`, NaN where absent (missing ones at the end are absent too).
    /// A time that is not later than the last one is refused: the answer is false and nothing has changed.
    pub fn push(&mut self, t_ns: i64, y: &[f64]) -> bool {
        match self.last_time() {
            Some(last) if t_ns <= last => return false,
            Some(_) => {}
            None => self
                .windows
                .iter_mut()
                .for_each(|window| window.begin(t_ns)),
        }
        let newest_head = self.windows.get_mut(self.shortest).map_or(0, |window| {
            window.advance(&self.rows, t_ns);
            window.head
        });
        if self.blocks.is_full(&self.rows, newest_head) {
            self.close_block(t_ns);
        }
        let oldest = self.blocks.oldest();
        if self.rows.reserve(oldest) {
            self.blocks.rebuild(&self.rows, t_ns);
        }
        let begun = self.rows.append(t_ns, y, LIMIT, oldest);
        self.blocks.add_newest(&self.rows, begun);
        self.advance(t_ns);
        true
    }

    /// Closes the current block and forgets those that no window needs any more when the next row, at `t_ns`, has come.
    fn close_block(&mut self, t_ns: i64) {
        self.blocks.cut(&self.rows);
        let mut oldest_block = self.blocks.starts().len() - 1;
        for window in &mut self.windows {
            window.advance(&self.rows, t_ns);
            window.find_block(&self.blocks);
            oldest_block = oldest_block.min(window.block);
        }
        self.blocks.close(&self.rows, t_ns, oldest_block);
        let windows = self.windows.iter_mut();
        windows.for_each(|window| window.block -= oldest_block);
    }

    /// Lets the windows end with the last row, which is at `t_ns`, and finds their parts.
    fn advance(&mut self, t_ns: i64) {
        let (rows, blocks) = (&self.rows, &mut self.blocks);
        let (current, complete_from) = (blocks.current_start(), rows.complete_from());
        let mut all_complete = true;
        for (index, window) in self.windows.iter_mut().enumerate() {
            window.advance(rows, t_ns);
            if window.head >= window.block_end {
                window.find_block(blocks);
            }
            let head = window.head;
            if head > current {
                blocks.sum_short(rows, index, head);
            }
            window.parts = blocks.parts(rows, index, head, window.block);
            // No more than the width of the window.
            let span = t_ns.wrapping_sub(window.head_ns);
            window.span = span as f64;
            let few = rows.next() - head < self.coverage.min_samples as u64;
            window.kind = if few || span < window.needed_span {
                Kind::Absent
            } else if head < complete_from {
                Kind::Gaps
            } else {
                Kind::Complete
            };
            all_complete &= window.kind == Kind::Complete;
        }
        self.all_complete = all_complete;
    }

    /// Slopes at the last row, per second: `out[channel * W + window]`, with one of the two NaNs where there is no value.
    /// An `out` of any other length than `C * W` is filled with absence.
    pub fn slopes(&mut self, out: &mut [f64]) {
        self.give(out, Self::slopes_of);
    }

    /// Gives what `of` finds in each window at the last row for each group of channels.
    #[inline(always)]
    fn give(&mut self, out: &mut [f64], of: impl Fn(&Self, usize, &mut [Lanes])) {
        let wide = self.windows.len();
        let fits = out.len() == self.channels * wide;
        let Some(t_ns) = self.last_time().filter(|_| fits) else {
            out.fill(self.no_value.absent);
            return;
        };
        let mut results = std::mem::take(&mut self.results);
        for (group, out) in out.chunks_mut((LANES * wide).max(1)).enumerate() {
            of(self, group, &mut results);
            transpose(&results, out);
        }
        self.results = results;
        self.mark_cold(t_ns, out);
    }

    /// Slopes of the channels of a group in each window.
    #[inline]
    fn slopes_of(&self, group: usize, slopes: &mut [Lanes]) {
        let groups = self.blocks.groups(group);
        let values = groups.map(|group| &*group.values);
        for (window, slopes) in self.windows.iter().zip(&mut *slopes) {
            if window.kind == Kind::Complete {
                window.parts.slopes(values, slopes);
            }
        }
        if !self.all_complete {
            self.slopes_of_incomplete(group, slopes);
        }
    }

    /// The same in the windows that have gaps or too few rows.
    fn slopes_of_incomplete(&self, group: usize, slopes: &mut [Lanes]) {
        let groups = self.blocks.groups(group);
        let silent = &self.rows.silent()[group];
        let mut least = Least::NONE;
        for (window, slopes) in self.windows.iter().zip(&mut *slopes) {
            match window.kind {
                Kind::Complete => {}
                Kind::Gaps => {
                    let wait = self.rows.wait(window.head, group);
                    let beyond = window.span - window.needed_span as f64;
                    least.add_span(&from_fn(|i| beyond - silent[i] - wait[i]));
                    window.parts.slopes_with_gaps(groups, slopes, &mut least);
                }
                Kind::Absent => *slopes = [self.no_value.absent; LANES],
            }
        }
        if !least.suffices(self.coverage.min_samples as f64) {
            self.mend(group, slopes);
        }
    }

    /// Where some of a group's channels lack samples: computes anew, from the samples, the slopes whose sums have lost too many
    /// digits, and marks the channels with too few samples or too close together.
    #[cold]
    fn mend(&self, group: usize, slopes: &mut [Lanes]) {
        let groups = self.blocks.groups(group);
        let windows = self.windows.iter().zip(slopes);
        for (window, slopes) in windows.filter(|(window, _)| window.kind == Kind::Gaps) {
            let (n, thin) = window.parts.samples_and_thin(groups);
            for (i, slope) in slopes.iter_mut().enumerate() {
                if thin[i] {
                    *slope = self.line(window, LANES * group + i).slope();
                }
            }
            self.mark_absent(window, group, &n, slopes);
        }
    }

    /// Of the channels of a group, with `n` samples in a window, marks those with too few or too close together.
    #[inline(always)]
    fn mark_absent(&self, window: &Window, group: usize, n: &Lanes, values: &mut Lanes) {
        let (wait, silent) = (
            self.rows.wait(window.head, group),
            &self.rows.silent()[group],
        );
        let (min_samples, absent) = (self.coverage.min_samples as f64, self.no_value.absent);
        let span: Lanes = from_fn(|i| window.span - silent[i] - wait[i]);
        let far: Lanes = from_fn(|i| {
            if span[i] >= window.needed_span as f64 {
                values[i]
            } else {
                absent
            }
        });
        *values = from_fn(|i| if n[i] >= min_samples { far[i] } else { absent });
    }

    /// Marks the windows within which their channel began.
    #[inline]
    fn mark_cold(&self, t_ns: i64, out: &mut [f64]) {
        let open = |first: i64| t_ns.saturating_sub(first);
        let latest = self.rows.latest_first().map(open);
        if latest.is_none_or(|open| open >= self.longest_needed_open) {
            return;
        }
        let channels = out.chunks_mut(self.windows.len().max(1));
        for (values, first) in channels.zip(self.rows.first()) {
            let Some(open) = first.map(open) else {
                continue;
            };
            for (value, window) in values.iter_mut().zip(&self.windows) {
                if open < window.needed_open {
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
    pub fn stderr(&mut self, out: &mut [f64]) {
        self.tell(out, |line, _| line.stderr());
    }

    /// The values of the lines at the last row's time, laid out as in [`slopes`](Self::slopes). Absent unless the kernel keeps squares.
    pub fn ends(&mut self, out: &mut [f64]) {
        self.tell(out, |line, origin| Some(origin + line.end()));
    }

    /// The coefficients of determination `1 − SSR / Σ(y − ȳ)²` of the lines, laid out as in [`slopes`](Self::slopes). Absent where
    /// all samples are the same and unless the kernel keeps squares.
    pub fn r_squared(&mut self, out: &mut [f64]) {
        self.tell(out, |line, _| line.r_squared());
    }

    /// Something about the line of each channel and window, given with the origin of the channel's values.
    fn tell(&mut self, out: &mut [f64], of: impl Fn(&Line, f64) -> Option<f64>) {
        if !self.squares {
            out.fill(self.no_value.absent);
            return;
        }
        self.give(out, |kernel, group, values| {
            let (groups, origins) = (kernel.blocks.groups(group), &kernel.blocks.origins()[group]);
            let end_ns = kernel.last_time().unwrap_or(0);
            for (window, values) in kernel.windows.iter().zip(values) {
                let moments = match window.kind {
                    Kind::Gaps => window.parts.moments(groups),
                    _ => window.parts.moments_of_complete(groups),
                };
                *values = from_fn(|i| {
                    let line = window.parts.line(groups, i, &moments, end_ns);
                    let line = match moments.thin(i) || line.is_flat() {
                        true => kernel.line(window, LANES * group + i),
                        false => line,
                    };
                    of(&line, origins[i]).unwrap_or(kernel.no_value.absent)
                });
                kernel.mark_absent(window, group, &moments.n, values);
            }
        });
    }
}

/// Puts results of the channels of a group by window into those of windows by channel. Not inlined, so that the compiler knows that
/// the two do not overlap.
#[inline(never)]
fn transpose(results: &[Lanes], out: &mut [f64]) {
    let wide = results.len();
    if out.len() != LANES * wide {
        for (i, out) in out.chunks_mut(wide.max(1)).enumerate() {
            for (out, result) in out.iter_mut().zip(results) {
                *out = result[i];
            }
        }
        return;
    }
    let mut rest = out;
    let channels: [&mut [f64]; LANES] = from_fn(|_| {
        let (channel, others) = std::mem::take(&mut rest).split_at_mut(wide);
        rest = others;
        channel
    });
    for (index, result) in results.iter().enumerate() {
        for i in 0..LANES {
            channels[i][index] = result[i];
        }
    }
}
