//! One trailing window over the rows: the row where it begins, and the sums of the blocks that lie wholly inside it.
//! It does not decide what is computed from them.
//!
//! A window is the end of its first block, whole blocks, and the current block. The whole blocks are a queue made of two stacks:
//! sums from each older block up to a turning point, computed backwards when the turning point was set, and one sum of the blocks
//! since. A block that leaves takes its samples with it; nothing is subtracted.

use super::rows::Rows;
use super::sums::{Common, Run, Table};

#[derive(Clone, Debug)]
pub(super) struct Window {
    width_ns: i64,
    head: u64,
    head_block: u64,
    /// The first row after the head's block, beyond every row while that is the current one.
    head_block_end: u64,
    /// Blocks before this one, and after the head's, have sums in `front`, the later ones are summed in `back`.
    turn: u64,
    front: Table,
    back: Table,
    whole: Table,
}

impl Window {
    pub(super) fn new(width_ns: i64, channels: usize, squares: bool) -> Window {
        Window {
            width_ns,
            head: 0,
            head_block: 0,
            head_block_end: u64::MAX,
            turn: 0,
            front: Table::new(channels, squares, 8),
            back: Table::new(channels, squares, 1),
            whole: Table::new(channels, squares, 1),
        }
    }

    pub(super) fn reset(&mut self) {
        self.head = 0;
        self.head_block = 0;
        self.head_block_end = u64::MAX;
        self.turn = 0;
        self.back.clear(0);
        self.whole.clear(0);
        self.whole.spread(0);
    }

    pub(super) fn width_ns(&self) -> i64 {
        self.width_ns
    }

    /// The oldest row in the window.
    #[inline]
    pub(super) fn head(&self) -> u64 {
        self.head
    }

    /// The block of that row.
    #[inline]
    pub(super) fn head_block(&self) -> u64 {
        self.head_block
    }

    /// First of the blocks that are summed since the turning point.
    pub(super) fn turn(&self) -> u64 {
        self.turn
    }

    /// Sums of the blocks wholly inside, the head's and the current one excepted.
    #[inline]
    pub(super) fn whole(&self) -> Run<'_> {
        self.whole.run(0)
    }

    #[inline]
    pub(super) fn whole_common(&self) -> &Common {
        self.whole.common(0)
    }

    /// Drops the rows that are outside of the window that ends at `t_ns`.
    #[inline]
    pub(super) fn advance(&mut self, rows: &Rows, t_ns: i64) {
        let limit = t_ns.saturating_sub(self.width_ns);
        while self.head < rows.next() && rows.time(self.head) <= limit {
            self.head += 1;
        }
    }

    /// Takes up the block that was just closed.
    pub(super) fn close_block(&mut self, rows: &Rows, block: u64) {
        self.back.absorb(0, &rows.block(block));
        self.head_block_end = 0;
    }

    /// Follows the head into its block; to be called after every `advance`.
    #[inline]
    pub(super) fn settle(&mut self, rows: &Rows) {
        if self.head >= self.head_block_end {
            self.follow(rows);
        }
    }

    fn follow(&mut self, rows: &Rows) {
        let current = rows.current_block();
        self.head_block_end = loop {
            if self.head_block == current {
                break u64::MAX;
            }
            let end = rows.start(self.head_block + 1);
            if self.head < end {
                break end;
            }
            self.head_block += 1;
        };
        self.gather(rows);
    }

    fn gather(&mut self, rows: &Rows) {
        let current = rows.current_block();
        let first = self.head_block + 1;
        self.whole.clear(0);
        if first >= current {
            self.turn = current;
            self.back.clear(0);
        } else {
            if first >= self.turn {
                self.turn_over(rows, current);
            }
            let slot = self.front_slot(first);
            self.whole.copy_from(0, &self.front.run(slot));
            self.whole.absorb(0, &self.back.run(0));
        }
        self.whole.spread(0);
    }

    /// Sets the turning point before block `turn` and sums backwards from there.
    fn turn_over(&mut self, rows: &Rows, turn: u64) {
        let first = self.head_block + 1;
        let needed = (turn - first) as usize;
        if needed > self.front.slots() {
            self.front.resize(needed.next_power_of_two());
        }
        for block in (first..turn).rev() {
            let slot = self.front_slot(block);
            if block + 1 == turn {
                self.front.clear(slot);
            } else {
                let later = self.front_slot(block + 1);
                self.front.copy_within(later, slot);
            }
            self.front.absorb(slot, &rows.block(block));
        }
        self.turn = turn;
        self.back.clear(0);
    }

    /// Sets the state that rows cut into the same blocks, with the same turning point, had led to.
    pub(super) fn rebuild(&mut self, rows: &Rows, t_ns: i64, turn: u64) {
        self.reset();
        self.advance(rows, t_ns);
        self.head_block_end = 0;
        let current = rows.current_block();
        while self.head_block < current && rows.start(self.head_block + 1) <= self.head {
            self.head_block += 1;
        }
        let blocks = (current - self.head_block) as usize;
        if 2 * blocks > self.front.slots() {
            self.front.resize((2 * blocks).next_power_of_two());
        }
        if self.head_block + 1 < turn {
            self.turn_over(rows, turn.min(current));
            for block in self.turn..current {
                self.back.absorb(0, &rows.block(block));
            }
        }
        self.settle(rows);
    }

    fn front_slot(&self, block: u64) -> usize {
        block as usize & (self.front.slots() - 1)
    }
}
