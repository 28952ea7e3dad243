//! A trailing window: which rows it holds, and where the sums over them lie. It does not decide what is made of them.

use std::cmp::Ordering;

use super::Coverage;
use super::blocks::Blocks;
use super::parts::{ABREAST, Parts, Weights};
use super::rows::Rows;

/// One trailing window over the rows.
#[derive(Clone, Debug)]
pub(super) struct Window {
    pub(super) width_ns: i64,
    /// What its samples must span, in nanoseconds.
    pub(super) needed_span: i64,
    /// How long ago a channel must have begun, in nanoseconds.
    pub(super) needed_open: i64,
    /// The oldest row in it, when that was, and the block of that row or one before it.
    pub(super) head: u64,
    head_ns: i64,
    pub(super) block: usize,
    pub(super) parts: Parts,
    /// From this oldest row on the parts are to be found anew.
    pub(super) parts_until: u64,
    /// Whether it begins in a closed block, the sums of which are then its first part.
    pub(super) begins_closed: bool,
    /// Up to this oldest row its first parts are summed.
    pub(super) summed_until: u64,
    pub(super) kind: Kind,
}

/// What is known of all channels of a window at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// No channel has a value.
    Absent,
    /// Every channel has one, and is present in every row.
    Complete,
    /// Each is to be looked at.
    Gaps,
}

impl Window {
    pub(super) fn new(width_ns: i64, coverage: &Coverage) -> Window {
        Window {
            width_ns,
            needed_span: (coverage.min_coverage * width_ns as f64).ceil().max(1.0) as i64,
            needed_open: if coverage.cold_partial { 0 } else { width_ns },
            head: 0,
            head_ns: 0,
            block: 0,
            parts: Parts::NONE,
            parts_until: 0,
            begins_closed: false,
            summed_until: 0,
            kind: Kind::Absent,
        }
    }

    /// Begins with the first row of all.
    pub(super) fn begin(&mut self, t_ns: i64) {
        (self.head, self.head_ns) = (0, t_ns);
        self.block = 0;
        self.seek();
    }

    /// Lets the parts be found anew, which may lie elsewhere.
    pub(super) fn seek(&mut self) {
        self.parts_until = 0;
    }

    /// Drops the rows that are outside of the window that ends with the next row, at `t_ns`.
    #[inline]
    pub(super) fn advance_to_next(&mut self, rows: &Rows, t_ns: i64) {
        let next = rows.next();
        let time = |row: u64| if row < next { rows.time(row) } else { t_ns };
        self.advance(t_ns, time);
    }

    /// The same where the row at `t_ns` is the last one.
    #[inline(always)]
    pub(super) fn advance_to_last(&mut self, rows: &Rows, t_ns: i64) {
        self.advance(t_ns, |row| rows.time(row));
    }

    /// Drops the rows that are outside at `t_ns`, given the times of rows. Where the oldest leaves, the new one is taken to lie in
    /// the same block; if it does not, the parts are to be found anew.
    #[inline(always)]
    fn advance(&mut self, t_ns: i64, time: impl Fn(u64) -> i64) {
        // Without a sign no two instants are too far apart.
        let width = self.width_ns as u64;
        let leaves = |t: i64| t_ns.wrapping_sub(t) as u64 >= width;
        while leaves(self.head_ns) {
            self.head += 1;
            self.head_ns = time(self.head);
        }
    }

    /// Finds the parts of the window with number `index`, and tells its weights what they do not learn with every row.
    /// Not inlined, as this is seldom needed and takes registers.
    #[inline(never)]
    pub(super) fn find_parts(
        &mut self,
        index: usize,
        rows: &Rows,
        blocks: &mut Blocks,
        weights: &mut Weights,
    ) {
        self.block = blocks.find(self.head, self.block);
        let current = blocks.current_start();
        let (place, rest, by) = blocks.rest_of(self.block);
        weights.set_rest(index % ABREAST, rest, by);
        self.parts = Parts {
            places: [blocks.heads().len() - 1, place, 0],
            by,
        };
        (self.begins_closed, self.summed_until) = (false, 0);
        self.parts_until = match self.head.cmp(&current) {
            Ordering::Less => {
                self.begins_closed = true;
                blocks.starts()[self.block + 1]
            }
            Ordering::Equal => current + 1,
            Ordering::Greater => {
                self.parts.places[2] = blocks.sum_short(rows, index, self.head);
                0
            }
        };
    }

    /// Nanoseconds from its oldest row to the newest, which is at `t_ns`; no more than its width.
    #[inline(always)]
    pub(super) fn span(&self, t_ns: i64) -> i64 {
        t_ns.wrapping_sub(self.head_ns)
    }

    /// Whether its rows span what a channel's samples must.
    pub(super) fn is_long(&self, t_ns: i64) -> bool {
        self.span(t_ns) >= self.needed_span
    }
}
