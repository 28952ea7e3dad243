//! The least-squares slope over trailing windows: exact sums for many channels and windows at once, row by row.
//! It decides when a window has a value; it does not decide which windows there are, nor what a caller does with absence.
//!
//! Rows are cut into blocks of at most 32, shared by all windows. A window is the end of one block, some whole blocks and the
//! current block (`kernel/window.rs`), each with centred sums (`kernel/sums.rs`); a slope merges the three (`kernel/parts.rs`). Nothing is ever
//! subtracted from a sum, so that a sample of 1e9 leaves no trace when it leaves a window, and times are measured from
//! the block's own origin, so that no precision is lost to the epoch. The longest single step is the turn of a window's stack of
//! blocks, one merge per block: 42 for 1,343 rows.

mod parts;
mod rows;
mod saved;
mod sums;
mod window;

#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

use parts::{Parts, shift};
use rows::{Rows, all_present};
use sums::{Quad, Table, quads};
use window::Window;

/// Rows of a block at most: a longer block saves merges of blocks and costs a longer step when it closes.
const BLOCK_ROWS: u64 = 32;

/// Samples of this size or above count as absent, like infinities: their squares would overflow.
const LIMIT: f64 = 1e100;

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
    /// Sums of the current block, and an empty run.
    current: Table,
    /// Times of each channel's first and newest sample since the reset.
    first: Vec<Option<i64>>,
    newest: Vec<Option<i64>>,
    /// Time of the last row in which all were present; `newest` is left as it is there.
    all_present_at: Option<i64>,
    /// Latest of the first samples and oldest of the newest ones, once every channel has one.
    all_begun: Option<i64>,
    all_seen: Option<i64>,
    /// Slopes by window, before they are laid out by channel.
    slopes: Vec<Quad>,
}

const CURRENT: usize = 0;
const EMPTY: usize = 1;

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
        let mut kernel = RollingSlope {
            channels,
            coverage,
            no_value,
            squares,
            windows: windows_ns
                .iter()
                .map(|&width| Window::new(width.max(1), channels, squares))
                .collect(),
            rows: Rows::new(channels, squares),
            current: Table::new(channels, squares, 2),
            first: vec![None; channels],
            newest: vec![None; channels],
            all_present_at: None,
            all_begun: None,
            all_seen: None,
            slopes: vec![[0.0; 4]; windows_ns.len() * quads(channels)],
        };
        kernel.reset();
        kernel
    }

    /// Forgets all samples, as at a segment break. Memory is kept.
    pub fn reset(&mut self) {
        self.rows.reset();
        self.windows.iter_mut().for_each(Window::reset);
        self.current.clear(CURRENT);
        self.first.fill(None);
        self.newest.fill(None);
        self.all_present_at = None;
        self.all_begun = None;
        self.all_seen = None;
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
        let rows = self.rows.next();
        (rows > 0).then(|| self.rows.time(rows - 1))
    }

    /// Time of the newest sample of a channel since the reset: the stamp of its slopes.
    pub fn newest_ns(&self, channel: usize) -> Option<i64> {
        let newest = self.newest.get(channel)?;
        (*newest).max(self.all_present_at)
    }

    /// Adds a row: one sample per channel at time `t_ns`, NaN where absent (missing ones at the end are absent too).
    /// A time that is not later than the last one is refused: the answer is false and nothing has changed.
    pub fn push(&mut self, t_ns: i64, y: &[f64]) -> bool {
        if self.last_time().is_some_and(|last| t_ns <= last) {
            return false;
        }
        let block = self.rows.current_block();
        let start = self.rows.current_start();
        let mut oldest = self.rows.next();
        let mut close = self.rows.next() - start >= BLOCK_ROWS;
        for window in &mut self.windows {
            window.advance(&self.rows, t_ns);
            close |= window.head() > start;
            oldest = oldest.min(window.head());
        }
        if close {
            self.close_block();
        }
        self.append(t_ns, y, oldest);
        for window in &mut self.windows {
            window.settle(&self.rows);
        }
        if close {
            let kept = self.windows.iter().map(Window::head_block).min();
            self.rows.forget_blocks(kept.unwrap_or(block));
        }
        self.spread();
        true
    }

    fn close_block(&mut self) {
        let block = self.rows.current_block();
        self.rows.close_block();
        for window in &mut self.windows {
            window.close_block(&self.rows, block);
        }
        self.current.clear(CURRENT);
    }

    fn append(&mut self, t_ns: i64, y: &[f64], oldest: u64) {
        let present = |&y: &f64| if y.abs() < LIMIT { y } else { f64::NAN };
        self.rows.append(t_ns, y.iter().map(present), oldest);
        let row = self.rows.samples(self.rows.next() - 1);
        let all_present = all_present(row);
        self.current.add(CURRENT, t_ns, row, all_present);
        if all_present && self.all_begun.is_some() {
            self.all_present_at = Some(t_ns);
            self.all_seen = Some(t_ns);
        } else {
            let row = &row.as_flattened()[..self.channels];
            for (channel, y) in row.iter().enumerate() {
                if !y.is_nan() {
                    self.first[channel].get_or_insert(t_ns);
                    self.newest[channel] = Some(t_ns);
                }
            }
            self.summarise_times();
        }
    }

    fn summarise_times(&mut self) {
        if self.all_begun.is_none() && self.first.iter().all(Option::is_some) {
            self.all_begun = self.first.iter().copied().flatten().max();
        }
        if self.all_begun.is_some() {
            let newest = self.newest.iter().copied().flatten().min();
            self.all_seen = newest.max(self.all_present_at);
        }
    }

    /// In windows with gaps all three parts are read per channel.
    fn spread(&mut self) {
        for window in &self.windows {
            let head = self.head_row(window);
            let complete = self.current.common(CURRENT).complete
                && window.whole_common().complete
                && head.is_none_or(|row| self.rows.tail_common(row).complete);
            if !complete {
                self.current.spread(CURRENT);
                if let Some(row) = head {
                    self.rows.spread(row);
                }
            }
        }
    }

    /// The row from which the window takes the end of a closed block, if it reaches back beyond the current one.
    #[inline]
    fn head_row(&self, window: &Window) -> Option<u64> {
        (window.head() < self.rows.current_start()).then(|| window.head())
    }

    /// The three parts of a window, oldest first.
    #[inline(always)]
    fn parts<'a>(&'a self, window: &'a Window) -> Parts<'a> {
        let head = match self.head_row(window) {
            Some(row) => self.rows.tail(row),
            None => self.current.run(EMPTY),
        };
        let (whole, now) = (window.whole(), self.current.run(CURRENT));
        Parts {
            head_shift: shift(head.common(), now.common()),
            whole_shift: shift(whole.common(), now.common()),
            head,
            whole,
            now,
        }
    }

    /// Slopes at the last row, per second: `out[channel * W + window]`, with one of the two NaNs where there is no value.
    /// An `out` of any other length than `C * W` is filled with absence.
    pub fn slopes(&mut self, out: &mut [f64]) {
        let wide = self.windows.len();
        if out.len() != self.channels * wide || self.last_time().is_none() {
            out.fill(self.no_value.absent);
            return;
        }
        let mut slopes = std::mem::take(&mut self.slopes);
        let quads = quads(self.channels);
        for (index, window) in self.windows.iter().enumerate() {
            let slopes = &mut slopes[index * quads..(index + 1) * quads];
            let parts = self.parts(window);
            if parts.complete() {
                parts.slopes(slopes);
            } else {
                parts.slopes_with_gaps(slopes);
            }
            if !self.all_have_values(window, &parts) {
                for (channel, slope) in slopes.as_flattened_mut()[..self.channels]
                    .iter_mut()
                    .enumerate()
                {
                    if let Err(nan) = self.has_value(window, &parts, channel) {
                        *slope = nan;
                    }
                }
            }
        }
        let by_window = slopes.as_flattened();
        for channel in 0..self.channels {
            let out = &mut out[channel * wide..(channel + 1) * wide];
            let mut place = channel;
            for out in out {
                *out = by_window[place];
                place += 4 * quads;
            }
        }
        self.slopes = slopes;
    }

    /// Whether every channel surely has a value; if not, each is looked at.
    #[inline]
    fn all_have_values(&self, window: &Window, parts: &Parts<'_>) -> bool {
        let (Some(begun), Some(seen), Some(t)) = (self.all_begun, self.all_seen, self.last_time())
        else {
            return false;
        };
        let (head, whole, now) = (
            parts.head.common(),
            parts.whole.common(),
            parts.now.common(),
        );
        let oldest = if head.rows > 0.0 { head } else { now };
        let span = seen.saturating_sub(oldest.origin) as f64 - oldest.latest_first;
        oldest.fewest > 0.0
            && head.fewest + whole.fewest + now.fewest >= self.coverage.min_samples as f64
            && span >= self.needed_span(window)
            && (self.coverage.cold_partial || begun <= t.saturating_sub(window.width_ns()))
    }

    /// Whether a channel has a value, or the NaN that says why not.
    fn has_value(&self, window: &Window, parts: &Parts<'_>, channel: usize) -> Result<(), f64> {
        let (begun, newest) = (self.first[channel], self.newest_ns(channel));
        let (Some(begun), Some(newest), Some(t)) = (begun, newest, self.last_time()) else {
            return Err(self.no_value.absent);
        };
        if !self.coverage.cold_partial && begun > t.saturating_sub(window.width_ns()) {
            return Err(self.no_value.cold);
        }
        let span = newest.saturating_sub(parts.now.common().origin) as f64 - parts.first(channel);
        if parts.n(channel) >= self.coverage.min_samples as f64 && span >= self.needed_span(window)
        {
            Ok(())
        } else {
            Err(self.no_value.absent)
        }
    }

    fn needed_span(&self, window: &Window) -> f64 {
        (self.coverage.min_coverage * window.width_ns() as f64).max(1.0)
    }

    /// Standard errors of the slopes at the last row, per second, laid out as in [`slopes`](Self::slopes): `sqrt(SSR / (n − 2) / Σ(x − x̄)²)`,
    /// SSR the residual sum of squares of the same fit. Absent for fewer than three samples and unless the kernel keeps squares.
    ///
    /// `SSR = Σ(y − ȳ)² − slope·Σ(x − x̄)(y − ȳ)` loses digits as `r²` approaches 1: its relative error is about 1e-15 / (1 − r²).
    pub fn stderr(&self, out: &mut [f64]) {
        let wide = self.windows.len();
        if !self.squares || out.len() != self.channels * wide {
            out.fill(self.no_value.absent);
            return;
        }
        for (index, window) in self.windows.iter().enumerate() {
            let parts = self.parts(window);
            for channel in 0..self.channels {
                out[channel * wide + index] = match self.has_value(window, &parts, channel) {
                    Ok(()) => parts
                        .moments(channel)
                        .stderr()
                        .unwrap_or(self.no_value.absent),
                    Err(nan) => nan,
                };
            }
        }
    }
}
