//! The rows that some window still holds: their times, their samples, and how they are cut into blocks.
//! It does not decide when a block ends, nor which rows a window holds.
//!
//! For every row of a closed block the sums of that row and all later ones of the block are kept, computed newest first from
//! the samples: whatever an older row of the block held has never been in them.

use std::collections::VecDeque;

use super::sums::{Common, Quad, Run, Table, quads};

/// Rows in a ring, counted from the last reset; the newest ones form the current block, all others closed ones.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    channels: usize,
    quads: usize,
    time: Vec<i64>,
    samples: Vec<Quad>,
    /// For each row of a closed block, the sums from it to the end of its block.
    suffix: Table,
    next: u64,
    current_start: u64,
    /// First rows of the blocks from number `first_block` on; the last is the current block's.
    starts: VecDeque<u64>,
    first_block: u64,
}

const INITIAL_CAPACITY: usize = 64;

impl Rows {
    pub(super) fn new(channels: usize, squares: bool) -> Rows {
        Rows {
            channels,
            quads: quads(channels),
            time: vec![0; INITIAL_CAPACITY],
            samples: vec![[0.0; 4]; INITIAL_CAPACITY * quads(channels)],
            suffix: Table::new(channels, squares, INITIAL_CAPACITY),
            next: 0,
            current_start: 0,
            starts: VecDeque::from([0]),
            first_block: 0,
        }
    }

    pub(super) fn reset(&mut self) {
        self.next = 0;
        self.current_start = 0;
        self.first_block = 0;
        self.starts.clear();
        self.starts.push_back(0);
    }

    /// The number that the next row will have.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    pub(super) fn current_block(&self) -> u64 {
        self.first_block + self.starts.len() as u64 - 1
    }

    /// First row of a block that is not yet forgotten.
    #[inline]
    pub(super) fn start(&self, block: u64) -> u64 {
        self.starts[(block - self.first_block) as usize]
    }

    #[inline]
    pub(super) fn slot(&self, row: u64) -> usize {
        row as usize & (self.time.len() - 1)
    }

    #[inline]
    pub(super) fn time(&self, row: u64) -> i64 {
        self.time[self.slot(row)]
    }

    /// The samples of a row in groups of four channels, NaN where absent.
    pub(super) fn samples(&self, row: u64) -> &[Quad] {
        let slot = self.slot(row);
        &self.samples[slot * self.quads..(slot + 1) * self.quads]
    }

    /// First row of the current block.
    #[inline]
    pub(super) fn current_start(&self) -> u64 {
        self.current_start
    }

    /// Sums from `row`, of a closed block, to the end of its block.
    #[inline]
    pub(super) fn tail(&self, row: u64) -> Run<'_> {
        self.suffix.run(self.slot(row))
    }

    #[inline]
    pub(super) fn tail_common(&self, row: u64) -> &Common {
        self.suffix.common(self.slot(row))
    }

    /// Sums of a closed block of which no row is forgotten.
    pub(super) fn block(&self, block: u64) -> Run<'_> {
        self.tail(self.start(block))
    }

    pub(super) fn spread(&mut self, row: u64) {
        let slot = self.slot(row);
        self.suffix.spread(slot);
    }

    /// Appends a row to the current block. Rows before `oldest` are forgotten.
    /// The samples are one per channel, absent where they end early.
    pub(super) fn append(&mut self, t_ns: i64, samples: impl Iterator<Item = f64>, oldest: u64) {
        if self.next - oldest >= self.time.len() as u64 {
            self.grow(oldest);
        }
        let slot = self.slot(self.next);
        self.time[slot] = t_ns;
        let row = &mut self.samples[slot * self.quads..(slot + 1) * self.quads];
        let row = &mut row.as_flattened_mut()[..self.channels];
        let samples = samples.chain(std::iter::repeat(f64::NAN));
        row.iter_mut().zip(samples).for_each(|(kept, y)| *kept = y);
        self.next += 1;
    }

    /// Makes room for as many rows and blocks again as there are from `oldest` on.
    pub(super) fn make_room(&mut self, oldest: u64) {
        if 2 * (self.next - oldest) >= self.time.len() as u64 {
            self.grow(oldest);
        }
        self.starts.reserve(self.starts.len() + 16);
    }

    fn grow(&mut self, oldest: u64) {
        let (c, old) = (self.quads, self.time.len());
        self.time.resize(2 * old, 0);
        self.samples.resize(2 * old * c, [0.0; 4]);
        self.suffix.resize(2 * old);
        for row in oldest..self.next {
            let (from, to) = (row as usize & (old - 1), self.slot(row));
            if from != to {
                self.time[to] = self.time[from];
                self.samples.copy_within(from * c..(from + 1) * c, to * c);
                self.suffix.copy_within(from, to);
            }
        }
    }

    /// Closes the current block and begins one with the next row.
    pub(super) fn close_block(&mut self) {
        for row in (self.current_start..self.next).rev() {
            let slot = self.slot(row);
            if row + 1 == self.next {
                self.suffix.clear(slot);
            } else {
                let later = self.slot(row + 1);
                self.suffix.copy_within(later, slot);
            }
            let samples = &self.samples[slot * self.quads..(slot + 1) * self.quads];
            let all_present = all_present(samples);
            self.suffix.add(slot, self.time[slot], samples, all_present);
        }
        self.current_start = self.next;
        self.starts.push_back(self.next);
    }

    /// Forgets the blocks before number `block`.
    pub(super) fn forget_blocks(&mut self, block: u64) {
        while self.first_block < block && self.starts.len() > 1 {
            self.starts.pop_front();
            self.first_block += 1;
        }
    }
}

/// Whether every channel of a row has a sample.
#[inline]
pub(super) fn all_present(row: &[Quad]) -> bool {
    // No short cut within four: one branch per group is cheaper than one per channel.
    row.iter()
        .all(|y| !(y[0].is_nan() | y[1].is_nan() | y[2].is_nan() | y[3].is_nan()))
}
