//! The sums of which every window is made: how the rows are cut into blocks, and what is summed within and over them.
//! It does not decide which rows a window holds, nor which blocks are still needed.

use std::array::from_fn;
use std::ops::Range;

use super::lanes::{LANES, Lanes, group_count};
use super::sums::{Common, Group, Table};
use super::{FEWEST_ROWS, MOST_ROWS, rows::Rows};

/// Blocks that restored ones have room for, beside as many again.
const SPARE_BLOCKS: usize = 16;

/// Rows between two choices of the channels' origins, at least; and how often the kept rows fit between them.
const REBASE_ROWS: u64 = 8192;
const REBASE_TIMES: u64 = 4;

/// Rows from a channel's first sample on at which its origin is chosen each time, so that it is soon a good one.
const SETTLING_ROWS: u64 = 5;

/// Of the closed block in which a window begins the sums from each row on are kept so many rows apart; those between are added anew, which
/// are fewer.
pub(super) const EACH: u64 = 8;

/// Sums over rows cut into blocks, the last of which is the current one.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// First rows of the blocks.
    starts: Vec<u64>,
    /// What is subtracted from the samples of each channel before they are summed.
    origins: Vec<Lanes>,
    /// Rows until these are chosen anew when a block closes, and rows still to come at which they are chosen anew at once.
    until_rebase: u64,
    settling: u64,
    /// By window, as many as [`most_tails`](Self::most_tails): of the block in which it begins, each eighth row from the end: the rows from it
    /// to the end of the block, about the time of the last.
    tails: Table,
    most_tails: usize,
    /// By window: the first row of the block that it has the tails of, or none.
    tails_of: Vec<u64>,
    /// By closed block: all of its rows, about the time of the last.
    wholes: Table,
    /// By window, for as many rows as lie between two of its tails: the rows from it to the end of its closed block, about the
    /// time of the last, the newest first; then an empty run.
    heads: Table,
    /// By block: the closed blocks from it on, about the time of the first row of the current one. That of the current one is empty.
    rest: Table,
    /// The current block, about the time of its first row; then the window with number `i` as a whole, at `i + 1`, where it
    /// begins within the current block.
    now: Table,
    /// Whether a sample is missing from a row that is still needed.
    gaps: bool,
}

impl Blocks {
    pub(super) fn new(channels: usize, windows: usize, squares: bool) -> Blocks {
        Blocks {
            starts: vec![0],
            origins: vec![[0.0; LANES]; group_count(channels)],
            until_rebase: 0,
            settling: 0,
            tails: Table::new(channels, squares, 0),
            most_tails: 0,
            tails_of: vec![u64::MAX; windows],
            wholes: Table::new(channels, squares, 1),
            heads: Table::new(channels, squares, windows * EACH as usize + 1),
            rest: Table::new(channels, squares, 1),
            now: Table::new(channels, squares, 1 + windows),
            gaps: false,
        }
    }

    pub(super) fn reset(&mut self) {
        self.starts.clear();
        self.starts.push(0);
        self.origins.fill([0.0; LANES]);
        self.until_rebase = 0;
        self.settling = 0;
        self.tails_of.fill(u64::MAX);
        self.gaps = false;
        self.keep_times();
        self.rest.clear(0, 0);
    }

    /// First rows of the blocks, without which the sums could not be computed again.
    pub(super) fn starts(&self) -> &[u64] {
        &self.starts
    }

    pub(super) fn origins(&self) -> &[Lanes] {
        &self.origins
    }

    /// Rows until origins are chosen anew, and rows at which they still are.
    pub(super) fn rebases(&self) -> [u64; 2] {
        [self.until_rebase, self.settling]
    }

    /// The first row that is still needed.
    pub(super) fn oldest(&self) -> u64 {
        self.starts[0]
    }

    /// First row of the current block.
    #[inline]
    pub(super) fn current_start(&self) -> u64 {
        self.starts[self.starts.len() - 1]
    }

    /// The block of a row, which is not before `block`.
    #[inline]
    pub(super) fn find(&self, row: u64, mut block: usize) -> usize {
        while self
            .starts
            .get(block + 1)
            .is_some_and(|&start| start <= row)
        {
            block += 1;
        }
        block
    }

    /// Whether the current block is to be closed before the next row: it is long, or some window begins within it.
    pub(super) fn is_full(&self, rows: &Rows, newest_head: u64) -> bool {
        let start = self.current_start();
        let length = rows.next() - start;
        length >= MOST_ROWS || (length >= FEWEST_ROWS && newest_head > start)
    }

    /// Begins a block with the next row.
    pub(super) fn cut(&mut self, rows: &Rows) {
        self.starts.push(rows.next());
    }

    /// Forgets the first `forgotten` blocks and sums the one that was closed; the next row, the first of the current one, is at `t_ns`.
    #[inline(always)]
    pub(super) fn close(&mut self, rows: &Rows, t_ns: i64, forgotten: usize) {
        self.starts.drain(..forgotten);
        self.wholes.forget(forgotten);
        self.gaps &= rows.complete_from() > self.oldest();
        self.keep_times();
        if self.until_rebase == 0 {
            self.until_rebase = REBASE_ROWS.max(REBASE_TIMES * (rows.next() - self.oldest()));
            self.choose_origins(rows);
            self.rebuild(rows, t_ns);
        } else {
            if let Some(closed) = self.starts.len().checked_sub(2) {
                self.sum_whole(rows, closed);
            }
            self.sum_rest(t_ns);
        }
    }

    fn keep_times(&mut self) {
        let tables = [
            &mut self.tails,
            &mut self.wholes,
            &mut self.heads,
            &mut self.rest,
            &mut self.now,
        ];
        for table in tables {
            table.keep_times(self.gaps);
        }
    }

    /// Adds the row that was just appended to the current block; `begun` if it holds a channel's first sample. Says whether all sums were
    /// computed anew.
    #[inline(always)]
    pub(super) fn add_newest(&mut self, rows: &Rows, begun: bool) -> bool {
        let row = rows.next() - 1;
        self.until_rebase = self.until_rebase.saturating_sub(1);
        if begun {
            self.until_rebase = MOST_ROWS;
            self.settling = SETTLING_ROWS;
        }
        let settles = self.settling > 0;
        if settles {
            self.settling -= 1;
            self.choose_origins(rows);
        }
        let first_gap = !self.gaps && rows.complete_from() > row;
        if first_gap {
            self.gaps = true;
            self.keep_times();
        }
        if settles || first_gap {
            self.rebuild(rows, 0);
            return true;
        }
        if row == self.current_start() {
            self.now.clear(0, rows.time(row));
        }
        self.now.add(0, rows, row..row + 1, &self.origins);
        false
    }

    /// Sums the rows of a closed block from each on that a window may soon begin with, `head` the first of them; says which one ends them,
    /// where sums are kept. A row that lies `n` before it has its sums at `n − 1` behind the first slot of the window.
    #[inline(always)]
    pub(super) fn sum_heads(&mut self, rows: &Rows, window: usize, head: u64, block: usize) -> u64 {
        let (start, end) = (self.starts[block], self.starts[block + 1]);
        if self.tails_of[window] != start {
            self.tails_of[window] = start;
            self.sum_tails(rows, window, head..end);
        }
        let behind = (end - head - 1) / EACH;
        let kept = end - behind * EACH;
        let last = (window * self.most_tails + behind as usize).checked_sub(1);
        let before = last.filter(|_| kept < end).map(|last| (&self.tails, last));
        let slot = window * EACH as usize;
        let about = (rows.time(end - 1), &*self.origins);
        self.heads.sum_each(slot, before, rows, head..kept, about);
        kept
    }

    /// Sums each eighth row of a closed block that a window may come to begin with.
    #[inline(always)]
    fn sum_tails(&mut self, rows: &Rows, window: usize, numbers: Range<u64>) {
        let (first, mut end) = (window * self.most_tails, numbers.end);
        let count = (end - numbers.start - 1) / EACH;
        for slot in first..first + count as usize {
            match slot == first {
                true => self.tails.clear(slot, rows.time(end - 1)),
                false => self.tails.copy(slot - 1, slot),
            }
            self.tails.add(slot, rows, end - EACH..end, &self.origins);
            end -= EACH;
        }
    }

    /// Sums all rows of a window that begins within the current block: at most [`FEWEST_ROWS`]. Says where the sums are.
    pub(super) fn sum_short(&mut self, rows: &Rows, window: usize, head: u64) -> usize {
        self.sum_now(rows, window + 1, head);
        window + 1
    }

    fn sum_now(&mut self, rows: &Rows, slot: usize, first: u64) {
        self.now.clear(slot, rows.time(first));
        for row in first..rows.next() {
            self.now.add(slot, rows, row..row + 1, &self.origins);
        }
    }

    /// Computes all sums anew, with the same bits; `t_ns` is the time of the next row, if the current block is still empty.
    pub(super) fn rebuild(&mut self, rows: &Rows, t_ns: i64) {
        self.tails_of.fill(u64::MAX);
        self.heads.clear(self.heads.slots() - 1, 0);
        for block in 0..self.starts.len() - 1 {
            self.sum_whole(rows, block);
        }
        let start = self.current_start();
        if start < rows.next() {
            self.sum_rest(rows.time(start));
            self.sum_now(rows, 0, start);
        } else {
            self.sum_rest(t_ns);
        }
    }

    /// Sets the state that a kernel had, and computes its sums from its rows.
    pub(super) fn restore(
        &mut self,
        rows: &Rows,
        starts: &[u64],
        origins: &[f64],
        rebases: [u64; 2],
    ) {
        self.starts.extend_from_slice(starts);
        // Whoever appends from here on must not have to make room.
        self.starts.reserve(self.starts.len() + SPARE_BLOCKS);
        for table in [&mut self.rest, &mut self.wholes] {
            table.resize(self.starts.len() + SPARE_BLOCKS);
        }
        self.origins.as_flattened_mut()[..origins.len()].copy_from_slice(origins);
        self.gaps = rows.complete_from() > self.oldest();
        self.keep_times();
        self.rebuild(rows, 0);
        [self.until_rebase, self.settling] = rebases;
    }

    /// Newest row first: whatever an older row of the block holds is not in the sums of the later ones.
    #[inline(always)]
    fn sum_whole(&mut self, rows: &Rows, block: usize) {
        if block >= self.wholes.slots() {
            self.wholes.resize(block + block / 4 + 1);
        }
        let (start, end) = (self.starts[block], self.starts[block + 1]);
        let tails = ((end - start - 1) / EACH) as usize;
        if tails > self.most_tails {
            self.most_tails = tails;
            self.tails.resize(self.tails_of.len() * tails);
            self.tails_of.fill(u64::MAX);
        }
        self.wholes.clear(block, rows.time(end - 1));
        self.wholes.add(block, rows, start..end, &self.origins);
    }

    #[inline(always)]
    fn sum_rest(&mut self, origin: i64) {
        let current = self.starts.len() - 1;
        if current >= self.rest.slots() {
            self.rest.resize(current + current / 4 + 1);
        }
        self.rest.sum_from_end(origin, &self.wholes, current);
    }

    /// The origin of a channel is the median of its newest samples, up to five in the last block's worth of rows, so that it is near them and
    /// no spike.
    fn choose_origins(&mut self, rows: &Rows) {
        let oldest = self.oldest().max(rows.next().saturating_sub(MOST_ROWS));
        for (group, origins) in self.origins.iter_mut().enumerate() {
            *origins = from_fn(|i| {
                let mut newest = [0.0; 5];
                let mut found = 0;
                let samples = (oldest..rows.next())
                    .rev()
                    .map(|row| rows.sample(row, group)[i]);
                for (kept, y) in newest.iter_mut().zip(samples.filter(|y| !y.is_nan())) {
                    *kept = y;
                    found += 1;
                }
                newest[..found].sort_unstable_by(f64::total_cmp);
                newest[..found]
                    .get(found / 2)
                    .copied()
                    .unwrap_or(origins[i])
            });
        }
    }

    /// Of a window that begins in block `block`: where the sums over the closed blocks after that one are, what all
    /// channels have in common of them, and [`by`](super::parts::Parts::by).
    pub(super) fn rest_of(&self, block: usize) -> (usize, &Common, f64) {
        let current = self.starts.len() - 1;
        let place = current.min(block + 1);
        let rest = &self.rest.common[place];
        let by = match block < current {
            true => self.wholes.common[block].origin.wrapping_sub(rest.origin),
            false => 0,
        };
        // Both lie within a window.
        (place, rest, by as f64)
    }

    /// What all channels have in common of the rows with which windows begin.
    #[inline]
    pub(super) fn heads(&self) -> &[Common] {
        &self.heads.common
    }

    /// What all channels have in common of the current block, or of a window within it.
    #[inline]
    pub(super) fn now(&self, slot: usize) -> &Common {
        &self.now.common[slot]
    }

    /// The sums of a group of channels within closed blocks, over them and of the current one.
    #[inline]
    pub(super) fn groups(&self, group: usize) -> [&Group; 3] {
        [&self.heads, &self.rest, &self.now].map(|table| &table.groups[group])
    }
}
