//! Training rows as Gram matrices of blocks, in their order. Decides how many rows make a block and when rows are no longer
//! kept; does not decide what is fitted on them.

use crate::folds::Edges;
use crate::gram::triangle;
use crate::{FoldRows, Folds, Gram, NumericsError, Split};
use std::ops::Range;

/// How many rows the smallest block has.
pub const BLOCK_ROWS: usize = 256;
/// How many bytes of rows are kept unless stated otherwise.
pub const DEFAULT_ROW_MEMORY: usize = 64 << 20;
const MOST_BLOCKS: usize = 1024;
/// So many blocks stay, and twice as many while they fill up, whatever they take.
const FEWEST_BLOCKS: usize = 8;
/// So many blocks per part of a cross-validation: once neighbours are merged there are two, and a gap beside a fold leaves one.
const BLOCKS_PER_PART: usize = 4;
/// How many blocks are never too few, however many the parts.
const ENOUGH_BLOCKS: usize = 64;
const BLOCK_MEMORY: usize = 8 << 20;

/// Rows of regressors and a target, streamed into blocks of 256 rows.
///
/// The rows themselves are kept while they fit a stated memory. Then fold edges are exact and a solver can go back to the
/// rows. Beyond it only the blocks stay: at most 1,024 of them, since neighbours are merged in pairs when there are more; fewer when
/// they would take more than 8 MB, but at least 8 and what [folds](GramBlocks::cut_into) need. So memory is bounded for any number
/// of rows, though by the square of the width. How many blocks there are does not depend on the memory for rows.
/// All blocks share the first row as their shift. The same rows in the same order give the same bits.
#[derive(Debug, Clone)]
pub struct GramBlocks {
    width: usize,
    row_memory: usize,
    most_blocks: usize,
    /// Rows per closed block: [`BLOCK_ROWS`] times a power of two. Not of stretches.
    block_rows: usize,
    closed: Vec<Gram>,
    /// Where each closed block ends, where blocks are [stretches](GramBlocks::in_stretches).
    ends: Option<Vec<u64>>,
    /// The block being filled, whole chunks only.
    open: Gram,
    /// The rows that do not make a whole chunk yet.
    pending: Chunk,
    /// Whole chunks of [`BLOCK_ROWS`] rows, while all rows are kept.
    kept: Option<Vec<Chunk>>,
    scratch: Vec<f64>,
    /// The rows at which segments begin, but for the first.
    starts: Vec<u64>,
}

/// Up to [`BLOCK_ROWS`] rows one after the other.
#[derive(Debug, Clone, Default)]
struct Chunk {
    values: Vec<f64>,
    /// Empty when all weights are 1.
    weights: Vec<f64>,
}

impl Chunk {
    fn part(&self, rows: Range<usize>, order: usize) -> (&[f64], Option<&[f64]>) {
        let weights = (!self.weights.is_empty()).then(|| &self.weights[rows.clone()]);
        (&self.values[rows.start * order..rows.end * order], weights)
    }
}

impl GramBlocks {
    /// No rows yet, of `width` regressors; keeps up to [`DEFAULT_ROW_MEMORY`] bytes of rows.
    pub fn new(width: usize) -> Self {
        Self::with_row_memory(width, DEFAULT_ROW_MEMORY)
    }

    /// No rows yet, of `width` regressors; keeps up to `row_memory` bytes of rows (0: none).
    pub fn with_row_memory(width: usize, row_memory: usize) -> Self {
        let block_bytes = triangle(width + 1) * size_of::<f64>();
        Self {
            width,
            row_memory,
            most_blocks: (BLOCK_MEMORY / block_bytes).clamp(FEWEST_BLOCKS, MOST_BLOCKS),
            block_rows: BLOCK_ROWS,
            closed: Vec::new(),
            ends: None,
            open: Gram::new(width),
            pending: Chunk::default(),
            kept: (row_memory > 0).then(Vec::new),
            scratch: Vec::new(),
            starts: Vec::new(),
        }
    }

    /// The same for folds of up to so many parts, which need blocks to be cut into. Wide blocks are no more than these need, so that the
    /// edges of folds move farther. Only before the first row.
    #[must_use]
    pub fn cut_into(self, parts: usize) -> Self {
        let needed = parts.saturating_mul(BLOCKS_PER_PART).min(ENOUGH_BLOCKS);
        Self {
            most_blocks: self.most_blocks.max(needed),
            ..self
        }
    }

    /// The same with blocks that [`GramBlocks::end_stretch`] ends, and no rows kept. Only before the first row.
    #[must_use]
    pub fn in_stretches(self) -> Self {
        Self {
            ends: Some(Vec::new()),
            kept: None,
            row_memory: 0,
            ..self
        }
    }

    /// Whether blocks are stretches, which folds do not cut.
    pub fn is_in_stretches(&self) -> bool {
        self.ends.is_some()
    }

    /// Adds the rows of `gram` to the stretch that is open; those added one by one come before them.
    ///
    /// # Errors
    /// [`NumericsError::Width`] when the widths differ.
    pub fn merge(&mut self, gram: &Gram) -> Result<(), NumericsError> {
        self.add_pending();
        self.open.merge(gram)
    }

    /// Ends a stretch: the next row begins another, and a fold may begin with it. Does nothing without rows, nor where blocks are no
    /// stretches. Of more than 1,024 stretches, or fewer wide ones, neighbours are put together.
    pub fn end_stretch(&mut self) {
        if self.ends.is_none() || self.open.count() + self.pending_rows() as u64 == 0 {
            return;
        }
        self.add_pending();
        let end = self.pending_start();
        let next = self.open.emptied();
        self.closed.push(std::mem::replace(&mut self.open, next));
        self.ends.iter_mut().for_each(|ends| ends.push(end));
        if self.closed.len() > self.most_blocks {
            self.halve_blocks();
        }
    }

    /// Adds the rows that do not make a whole chunk to the open block.
    fn add_pending(&mut self) {
        let (values, weights) = self.pending.part(0..self.pending_rows(), self.width + 1);
        self.open.add_rows(values, weights, &mut self.scratch);
        self.pending.values.clear();
        self.pending.weights.clear();
    }

    /// The number of regressors.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows so far.
    pub fn count(&self) -> u64 {
        self.pending_start() + self.pending_rows() as u64
    }

    /// How many blocks there are now, the one being filled among them.
    pub fn blocks(&self) -> usize {
        self.closed.len() + usize::from(self.open.count() > 0 || self.pending_rows() > 0)
    }

    /// How many rows a whole block has now: 256 times a power of two.
    pub fn block_rows(&self) -> usize {
        self.block_rows
    }

    /// The next row begins another segment of the data.
    pub fn segment(&mut self) {
        let row = self.count();
        if row > self.starts.last().copied().unwrap_or(0) {
            self.starts.push(row);
        }
    }

    /// Adds one row.
    ///
    /// # Panics
    /// When `x` has not `width` values.
    pub fn push(&mut self, x: &[f64], y: f64) {
        self.push_weighted(x, y, 1.0);
    }

    /// Adds one row of the given weight (not negative).
    ///
    /// # Panics
    /// When `x` has not `width` values.
    pub fn push_weighted(&mut self, x: &[f64], y: f64, weight: f64) {
        assert_eq!(x.len(), self.width, "a row has the width of its blocks");
        let pending = &mut self.pending;
        if pending.values.capacity() == 0 {
            pending.values.reserve_exact(BLOCK_ROWS * (self.width + 1));
        }
        if weight != 1.0 && pending.weights.is_empty() {
            let before = pending.values.len() / (self.width + 1);
            pending.weights.resize(before, 1.0);
            pending.weights.push(weight);
        } else if !pending.weights.is_empty() {
            pending.weights.push(weight);
        }
        pending.values.extend_from_slice(x);
        pending.values.push(y);
        if pending.values.len() == BLOCK_ROWS * (self.width + 1) {
            self.close_chunk();
        }
    }

    fn close_chunk(&mut self) {
        let order = self.width + 1;
        let (values, weights) = self.pending.part(0..BLOCK_ROWS, order);
        self.open.add_rows(values, weights, &mut self.scratch);
        if self.ends.is_none() && self.open.count() == self.block_rows as u64 {
            let next = self.open.emptied();
            self.closed.push(std::mem::replace(&mut self.open, next));
            if self.closed.len() > self.most_blocks {
                self.halve_blocks();
            }
        }
        let bytes = self.pending_start() as usize * order * size_of::<f64>();
        if bytes > self.row_memory {
            self.kept = None;
        }
        match &mut self.kept {
            Some(kept) => kept.push(std::mem::take(&mut self.pending)),
            None => {
                self.pending.values.clear();
                self.pending.weights.clear();
            }
        }
    }

    fn halve_blocks(&mut self) {
        if let Some(ends) = &mut self.ends {
            let (mut nth, last) = (0, ends.len() - 1);
            ends.retain(|_| {
                nth += 1;
                nth % 2 == 0 || nth - 1 == last
            });
        }
        let mut blocks = std::mem::take(&mut self.closed).into_iter();
        while let Some(mut first) = blocks.next() {
            match blocks.next() {
                Some(second) => {
                    first.add_same_shift(&second);
                    self.closed.push(first);
                }
                None if self.ends.is_some() => self.closed.push(first),
                None => self.open = first,
            }
        }
        self.block_rows *= 2;
    }

    fn closed_rows(&self) -> u64 {
        match &self.ends {
            Some(ends) => ends.last().copied().unwrap_or(0),
            None => (self.closed.len() * self.block_rows) as u64,
        }
    }

    fn pending_start(&self) -> u64 {
        self.closed_rows() + self.open.count()
    }

    fn pending_rows(&self) -> usize {
        self.pending.values.len() / (self.width + 1)
    }

    /// The statistics of all rows, summed in their order.
    pub fn total(&self) -> Gram {
        let mut total = self.open.emptied();
        for block in &self.closed {
            total.add_same_shift(block);
        }
        self.add_tail(&mut total);
        total
    }

    /// Adds the block being filled and the rows that wait for it.
    fn add_tail(&self, gram: &mut Gram) {
        gram.add_same_shift(&self.open);
        let (values, weights) = self.pending.part(0..self.pending_rows(), self.width + 1);
        gram.add_rows(values, weights, &mut Vec::new());
    }

    /// Whether fold edges fall on exact rows: all rows are still kept. If not, they snap to the nearest block.
    pub fn exact_folds(&self) -> bool {
        self.kept.is_some()
    }

    /// The statistics of the rows that train and test each fold: to the row while rows are kept (see
    /// [`GramBlocks::exact_folds`]), else with edges moved to those of blocks.
    ///
    /// # Errors
    /// [`NumericsError::Folds`] for fewer than two folds or too few rows or blocks to fill them.
    pub fn splits(&self, folds: &Folds) -> Result<Vec<Split>, NumericsError> {
        let count = folds.count();
        let edges = match &self.ends {
            Some(ends) => Edges::At(ends),
            None if self.exact_folds() => Edges::Every(1),
            None => Edges::Every(self.block_rows as u64),
        };
        let folds = folds.of_blocks(self.count(), edges, &self.starts)?;
        if folds.iter().any(|fold| fold.test.end - fold.test.start < 2) {
            let rows = self.count();
            return Err(NumericsError::FoldOfOneRow { folds: count, rows });
        }
        let pieces = self.pieces(&folds);
        // Training rows are summed, not subtracted from a total, so that a fold of large values leaves no rounding in
        // the others.
        let sum = |ranges: &[Range<u64>]| {
            let mut gram = self.open.emptied();
            for (piece, part) in &pieces {
                if ranges.iter().any(|range| range.contains(&piece.start)) {
                    // Pieces before the first whole chunk may have a shift each.
                    gram.merge(part).expect("pieces have one width");
                }
            }
            gram
        };
        let split = |fold: &FoldRows| Split {
            train: sum(&fold.train),
            test: sum(std::slice::from_ref(&fold.test)),
        };
        Ok(folds.iter().map(split).collect())
    }

    /// The rows between all neighbouring edges, each looked at once however many folds they are in.
    fn pieces(&self, folds: &[FoldRows]) -> Vec<(Range<u64>, Gram)> {
        let ranges = folds
            .iter()
            .flat_map(|fold| fold.train.iter().chain([&fold.test]));
        let mut edges: Vec<u64> = ranges.flat_map(|range| [range.start, range.end]).collect();
        edges.sort_unstable();
        edges.dedup();
        let pieces = edges.windows(2).map(|edge| edge[0]..edge[1]);
        pieces
            .map(|piece| {
                let gram = match &self.kept {
                    Some(kept) => self.exact_span(kept, piece.clone()),
                    None => self.block_span(piece.clone()),
                };
                (piece, gram)
            })
            .collect()
    }

    fn exact_span(&self, kept: &[Chunk], rows: Range<u64>) -> Gram {
        let order = self.width + 1;
        let mut gram = self.open.emptied();
        let mut scratch = Vec::new();
        let (mut at, end) = (rows.start as usize, rows.end as usize);
        while at < end {
            let block = at / self.block_rows;
            let whole = at.is_multiple_of(self.block_rows) && at + self.block_rows <= end;
            if whole && let Some(closed) = self.closed.get(block) {
                gram.add_same_shift(closed);
                at += self.block_rows;
                continue;
            }
            let chunk = at / BLOCK_ROWS;
            let start = chunk * BLOCK_ROWS;
            let stop = end.min(start + BLOCK_ROWS);
            let source = kept.get(chunk).unwrap_or(&self.pending);
            let (values, weights) = source.part(at - start..stop - start, order);
            gram.add_rows(values, weights, &mut scratch);
            at = stop;
        }
        gram
    }

    fn block_span(&self, rows: Range<u64>) -> Gram {
        let mut gram = self.open.emptied();
        // How many blocks end at a row or before it.
        let until = |row: u64| match &self.ends {
            Some(ends) => ends.partition_point(|end| *end <= row),
            None => (row / self.block_rows as u64) as usize,
        };
        let whole = until(rows.start)..until(rows.end.min(self.closed_rows()));
        for block in &self.closed[whole] {
            gram.add_same_shift(block);
        }
        if rows.end == self.count() {
            self.add_tail(&mut gram);
        }
        gram
    }

    /// All rows, in order, while they are kept.
    pub fn rows(&self) -> Option<Rows<'_>> {
        self.kept.as_deref().map(|kept| Rows {
            order: self.width + 1,
            kept,
            pending: &self.pending,
        })
    }
}

/// The rows that [`GramBlocks`] keeps.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    order: usize,
    kept: &'a [Chunk],
    pending: &'a Chunk,
}

impl<'a> Rows<'a> {
    /// The number of rows.
    pub fn count(&self) -> u64 {
        (self.kept.len() * BLOCK_ROWS + self.pending.values.len() / self.order) as u64
    }

    /// The number of regressors in a row.
    pub fn width(&self) -> usize {
        self.order - 1
    }

    /// Each row as its regressors, its target and its weight.
    pub fn iter(&self) -> impl Iterator<Item = (&'a [f64], f64, f64)> {
        let order = self.order;
        self.kept
            .iter()
            .chain([self.pending])
            .flat_map(move |chunk| {
                chunk
                    .values
                    .chunks_exact(order)
                    .enumerate()
                    .map(move |(index, row)| {
                        let weight = chunk.weights.get(index).copied().unwrap_or(1.0);
                        (&row[..order - 1], row[order - 1], weight)
                    })
            })
    }
}

#[cfg(test)]
mod tests;
