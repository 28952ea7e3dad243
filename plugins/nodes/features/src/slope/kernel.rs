//! The least-squares slope over trailing windows: exact sums for many channels and windows at once, row by row.
//! It decides when a window has a value; it does not decide which windows there are, nor what a caller does with absence.
//!
//! Rows are cut into blocks of at most 64, shared by all windows (`kernel/blocks.rs`). A window (`kernel/window.rs`) is the end of
//! one block, all blocks after it and the current one: three sums (`kernel/sums.rs`) that are kept for all windows at once, added up
//! for each (`kernel/parts.rs`). Nothing is ever subtracted from a sum, so that a sample of 1e9 leaves no trace when it leaves a window.
//! Times are measured from an instant within the window and values from one near them, so that no precision is lost to the
//! epoch or an offset. What is done with every row is compiled for the vectors of several processors (`kernel/vectors.rs`).

mod blocks;
mod keeps;
mod lanes;
mod layout;
mod line;
mod parts;
mod rows;
mod saved;
mod sums;
mod vectors;
mod window;

#[cfg(test)]
mod tests;

use std::array::from_fn;

use pulp::Simd;
use serde::{Deserialize, Serialize};

pub use keeps::keeps;

use blocks::{Blocks, EACH};
use lanes::{LANES, Lanes};
use parts::{ABREAST, Least, Line, Weights};
use rows::Rows;
use sums::Values;
use vectors::Vectors;
use window::{Kind, Window};

/// Rows of a block at most. Fewer cost more when a block closes, as all blocks are added up then; more make that step longer.
pub const MOST_ROWS: u64 = 64;

/// Rows of a block at least, where windows are shorter than the longest block.
pub const FEWEST_ROWS: u64 = 8;

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
    /// Of the windows, [`ABREAST`] at a time.
    weights: Vec<Weights>,
    rows: Rows,
    blocks: Blocks,
    /// Numbers of the shortest and the longest window, if there is one.
    shortest: usize,
    longest: usize,
    /// Whether in all windows every channel has a value and is present in every row.
    all_complete: bool,
    /// Whether all windows have enough rows, but each has gaps.
    all_gaps: bool,
    longest_needed_open: i64,
    /// Whether some channel may have begun within a window that must have been open for longer.
    maybe_cold: bool,
    /// By window: the results of the channels of a group.
    results: Vec<Lanes>,
    vectors: Vectors,
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
        let windows: Vec<Window> = windows_ns
            .iter()
            .map(|&width_ns| Window::new(width_ns.max(1), &coverage))
            .collect();
        let spare = windows.iter().map(|w| w.width_ns - w.needed_span).min();
        let rows = Rows::new(channels, spare.unwrap_or(0));
        let mut blocks = Blocks::new(channels, windows_ns.len(), squares);
        blocks.rebuild(&rows, 0);
        let shortest = (0..windows.len()).min_by_key(|&index| windows[index].width_ns);
        let longest = (0..windows.len()).max_by_key(|&index| windows[index].width_ns);
        RollingSlope {
            channels,
            coverage,
            no_value,
            squares,
            rows,
            blocks,
            shortest: shortest.unwrap_or(0),
            longest: longest.unwrap_or(0),
            all_complete: false,
            all_gaps: false,
            weights: vec![Weights::NONE; windows.len().div_ceil(ABREAST)],
            longest_needed_open: windows.iter().map(|w| w.needed_open).max().unwrap_or(0),
            maybe_cold: true,
            results: vec![[0.0; LANES]; windows.len()],
            vectors: Vectors::new(),
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
        self.vectors.push(self, t_ns, y)
    }

    #[inline(always)]
    fn push_here(&mut self, t_ns: i64, y: &[f64]) -> bool {
        match self.last_time() {
            Some(last) if t_ns <= last => return false,
            Some(_) => {}
            None => self
                .windows
                .iter_mut()
                .for_each(|window| window.begin(t_ns)),
        }
        let newest_head = self.windows.get_mut(self.shortest).map_or(0, |window| {
            window.advance_to_next(&self.rows, t_ns);
            window.head
        });
        if self.blocks.is_full(&self.rows, newest_head) {
            self.close_block(t_ns);
        }
        let oldest = self.blocks.oldest();
        if self.rows.reserve(oldest) {
            self.blocks.rebuild(&self.rows, t_ns);
            self.windows.iter_mut().for_each(Window::seek);
        }
        let begun = self.rows.append(t_ns, y, LIMIT, oldest);
        self.maybe_cold |= begun;
        if self.blocks.add_newest(&self.rows, begun) {
            self.windows.iter_mut().for_each(Window::seek);
        }
        self.advance(t_ns);
        true
    }

    /// Closes the current block and forgets those that no window needs any more when the next row, at `t_ns`, has come.
    #[inline(always)]
    fn close_block(&mut self, t_ns: i64) {
        self.blocks.cut(&self.rows);
        let mut oldest_block = self.blocks.starts().len() - 1;
        for window in &mut self.windows {
            window.advance_to_next(&self.rows, t_ns);
            window.block = self.blocks.find(window.head, window.block);
            oldest_block = oldest_block.min(window.block);
        }
        self.blocks.close(&self.rows, t_ns, oldest_block);
        for window in &mut self.windows {
            window.block -= oldest_block;
            window.seek();
        }
    }

    /// Lets the windows end with the last row, which is at `t_ns`, and finds their parts and weights.
    #[inline(always)]
    fn advance(&mut self, t_ns: i64) {
        let (rows, blocks) = (&self.rows, &mut self.blocks);
        for (index, window) in self.windows.iter_mut().enumerate() {
            window.advance_to_last(rows, t_ns);
            if window.head >= window.parts_until {
                let weights = &mut self.weights[index / ABREAST];
                window.find_parts(index, rows, blocks, weights);
            }
            if window.begins_closed {
                if window.head >= window.summed_until {
                    window.summed_until = blocks.sum_heads(rows, index, window.head, window.block);
                }
                let before = (window.summed_until - 1 - window.head) as usize;
                window.parts.places[0] = index * EACH as usize + before;
            }
        }
        let rows = &self.rows;
        let head_of = |index: usize| self.windows.get(index).map_or(0, |window| window.head);
        let (oldest, newest) = (head_of(self.longest), head_of(self.shortest));
        // A window that has lost a row and has no wide gap spans enough.
        let long_enough = oldest > rows.even_from() || self.windows.iter().all(|w| w.is_long(t_ns));
        let enough = long_enough && rows.next() - newest >= self.coverage.min_samples as u64;
        let complete = enough && oldest >= rows.complete_from();
        // Where each window has gaps the weights are those of no channel.
        self.all_gaps = enough && newest < rows.complete_from();
        if !self.all_gaps {
            self.weigh();
        }
        if !complete || !self.all_complete {
            self.judge(t_ns);
        }
        self.all_complete = complete;
    }

    /// Finds the weights of all windows, whose parts are known.
    #[inline(always)]
    fn weigh(&mut self) {
        let (windows, blocks) = (&self.windows, &self.blocks);
        let (abreast, others) = windows.as_chunks::<ABREAST>();
        for (windows, weights) in abreast.iter().zip(&mut self.weights) {
            let heads = from_fn(|i| windows[i].parts.places[0]);
            weights.weigh(heads, blocks.heads(), blocks.now(0));
        }
        if let Some(weights) = self.weights.get_mut(abreast.len()) {
            let heads = from_fn(|i| others.get(i).map_or(0, |window| window.parts.places[0]));
            weights.weigh(heads, blocks.heads(), blocks.now(0));
        }
        let newest = windows.get(self.shortest);
        if newest.is_some_and(|window| window.head > blocks.current_start()) {
            let places = windows.iter().map(|window| window.parts.places[2]);
            for (index, place) in places.enumerate().filter(|(_, place)| *place > 0) {
                self.weights[index / ABREAST].weigh_whole(index % ABREAST, blocks.now(place));
            }
        }
    }

    /// Says of each window what is known of all channels at once.
    fn judge(&mut self, t_ns: i64) {
        let rows = &self.rows;
        for window in &mut self.windows {
            let few = rows.next() - window.head < self.coverage.min_samples as u64;
            window.kind = if few || !window.is_long(t_ns) {
                Kind::Absent
            } else if window.head < rows.complete_from() {
                Kind::Gaps
            } else {
                Kind::Complete
            };
        }
    }

    /// Slopes at the last row, per second: `out[channel * W + window]`, with one of the two NaNs where there is no value.
    /// An `out` of any other length than `C * W` is filled with absence.
    pub fn slopes(&mut self, out: &mut [f64]) {
        self.vectors.slopes(self, out);
    }

    /// Written out beside [`tell`](Self::tell), since so long a closure would not be inlined, nor compiled for wide vectors.
    #[inline(always)]
    fn slopes_here<S: Simd>(&mut self, simd: S, out: &mut [f64]) {
        let Some(mut results) = self.room(out) else {
            return;
        };
        for (group, out) in out.chunks_mut(LANES * results.len()).enumerate() {
            self.slopes_of(group, &mut results);
            layout::put(simd, &results, out);
        }
        self.results = results;
        self.mark_cold(out);
    }

    /// Room for the results of a group of channels, where there are rows and `out` has as much as is given; else it is filled with
    /// absence.
    #[inline(always)]
    fn room(&mut self, out: &mut [f64]) -> Option<Vec<Lanes>> {
        let wide = self.windows.len();
        if self.last_time().is_some() && wide > 0 && out.len() == self.channels * wide {
            return Some(std::mem::take(&mut self.results));
        }
        out.fill(self.no_value.absent);
        None
    }

    /// Slopes of the channels of a group in each window.
    #[inline(always)]
    fn slopes_of(&self, group: usize, slopes: &mut [Lanes]) {
        if !self.all_gaps {
            let [head, rest, now] = self.blocks.groups(group).map(|group| &*group.values);
            slopes_of_complete(&self.windows, &self.weights, head, rest, now, slopes);
        }
        if !self.all_complete {
            self.slopes_of_incomplete(group, slopes);
        }
    }

    /// The same in the windows that have gaps or too few rows.
    #[inline(always)]
    fn slopes_of_incomplete(&self, group: usize, slopes: &mut [Lanes]) {
        let groups = self.blocks.groups(group);
        let silent = &self.rows.silent()[group];
        let t_ns = self.last_time().unwrap_or(0);
        let mut least = Least::NONE;
        for (window, slopes) in self.windows.iter().zip(&mut *slopes) {
            match window.kind {
                Kind::Complete => {}
                Kind::Gaps => {
                    let wait = self.rows.wait(window.head, group);
                    let beyond = window.span(t_ns) as f64 - window.needed_span as f64;
                    least.add_span(beyond, silent, &wait);
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
        let whole = window.span(self.last_time().unwrap_or(0)) as f64;
        let span: Lanes = from_fn(|i| whole - silent[i] - wait[i]);
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
    fn mark_cold(&mut self, out: &mut [f64]) {
        if !self.maybe_cold {
            return;
        }
        let Some(t_ns) = self.last_time() else {
            return;
        };
        let open = |first: i64| t_ns.saturating_sub(first);
        let latest = self.rows.latest_first().map(open);
        if latest.is_none_or(|open| open >= self.longest_needed_open) {
            self.maybe_cold = false;
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
            (t, self.rows.samples(row)[channel] - origin)
        });
        let end = self.rows.time(self.rows.next() - 1).saturating_sub(head_ns) as f64;
        Line::through(samples.filter(|(_, y)| !y.is_nan()), end)
    }
}

/// Slopes of the channels of a group in the windows in which each is present in every row. The tables are given one by one, so that
/// the compiler knows how the sums are aligned.
#[inline(always)]
fn slopes_of_complete(
    windows: &[Window],
    weights: &[Weights],
    head: &[Values],
    rest: &[Values],
    now: &[Values],
    slopes: &mut [Lanes],
) {
    let tables = [head, rest, now];
    let (abreast, others) = windows.as_chunks::<ABREAST>();
    let (of_abreast, of_others) = slopes.as_chunks_mut::<ABREAST>();
    for ((windows, weights), slopes) in abreast.iter().zip(weights).zip(of_abreast) {
        slopes_abreast(windows, weights, tables, slopes);
    }
    if let Some(weights) = weights.get(abreast.len()) {
        slopes_abreast(others, weights, tables, of_others);
    }
}

/// The same in windows that have their weights in common, at most [`ABREAST`].
#[inline(always)]
fn slopes_abreast(
    windows: &[Window],
    weights: &Weights,
    [head, rest, now]: [&[Values]; 3],
    slopes: &mut [Lanes],
) {
    for (i, (window, slopes)) in windows.iter().zip(slopes).enumerate() {
        if window.kind == Kind::Complete {
            let [h, r, w] = window.parts.places;
            *slopes = weights.slopes(i, [&head[h], &rest[r], &now[w]]);
        }
    }
}
