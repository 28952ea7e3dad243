//! Sums of rows in blocks beside sums of the rows themselves.

use super::*;

fn row(i: u64) -> ([f64; 2], f64) {
    let t = i as f64;
    (
        [20.0 + (0.37 * t).sin(), (0.11 * t).cos()],
        (0.05 * t).sin(),
    )
}

fn filled(rows: u64, row_memory: usize) -> GramBlocks {
    let mut blocks = GramBlocks::with_row_memory(2, row_memory);
    for i in 0..rows {
        let (x, y) = row(i);
        blocks.push(&x, y);
    }
    blocks
}

fn direct(rows: Range<u64>) -> Gram {
    let (x, y) = row(0);
    let mut gram = Gram::with_shift(vec![x[0], x[1], y]).unwrap();
    for i in rows {
        let (x, y) = row(i);
        gram.push(&x, y);
    }
    gram
}

fn assert_near(a: &Gram, b: &Gram) {
    assert_eq!(a.count(), b.count());
    let (left, right) = (a.moments(), b.moments());
    for j in 0..=a.width() {
        assert!((a.means()[j] - b.means()[j]).abs() < 1e-12);
        for i in 0..=a.width() {
            let size = (left[(i, i)] * left[(j, j)]).sqrt();
            assert!((left[(i, j)] - right[(i, j)]).abs() < 1e-12 * size);
        }
    }
}

#[test]
fn kept_rows_give_the_folds_to_the_row() {
    let blocks = filled(1000, DEFAULT_ROW_MEMORY);
    assert!(blocks.exact_folds());
    let splits = blocks.splits(&Folds::contiguous(3)).unwrap();
    for (split, rows) in splits.iter().zip([0..334, 334..667, 667..1000]) {
        assert_near(&split.test, &direct(rows));
    }
    assert_near(&splits[2].train, &direct(0..667));
    assert_near(&blocks.total(), &direct(0..1000));
}

#[test]
fn without_kept_rows_fold_edges_snap_to_blocks() {
    let blocks = filled(2000, 0);
    assert!(!blocks.exact_folds());
    assert!(blocks.rows().is_none());
    let splits = blocks.splits(&Folds::contiguous(3)).unwrap();
    for (split, rows) in splits.iter().zip([0..768, 768..1280, 1280..2000]) {
        assert_near(&split.test, &direct(rows));
    }
    assert_near(&splits[0].train, &direct(768..2000));
}

#[test]
fn rows_are_dropped_beyond_the_stated_memory_only() {
    let bytes_per_row = 3 * size_of::<f64>();
    assert!(filled(512, 512 * bytes_per_row + 511).exact_folds());
    assert!(!filled(512, 512 * bytes_per_row - 1).exact_folds());
}

#[test]
fn blocks_stay_bounded_and_keep_every_row() {
    let rows = 256 * 1024 * 2 + 300;
    let blocks = filled(rows, 0);
    assert!(blocks.blocks() <= 1025);
    assert_eq!(blocks.block_rows(), 512);
    assert_near(&blocks.total(), &direct(0..rows));
    let splits = blocks.splits(&Folds::contiguous(7)).unwrap();
    let counted: u64 = splits.iter().map(|split| split.test.count()).sum();
    assert_eq!(counted, rows);
}

#[test]
fn the_same_rows_give_the_same_bits_whether_they_are_kept_or_not() {
    assert_eq!(
        filled(5000, 0).total(),
        filled(5000, DEFAULT_ROW_MEMORY).total()
    );
    assert_ne!(filled(5000, 0).total(), filled(5001, 0).total());
}

#[test]
fn wide_rows_are_summed_in_no_more_blocks_than_their_folds_need() {
    let width = 500;
    let filled = |blocks: GramBlocks| {
        let mut blocks = blocks;
        let x = vec![1.0; width];
        for i in 0..30 * BLOCK_ROWS {
            blocks.push(&x, i as f64);
        }
        blocks
    };
    let without = || GramBlocks::with_row_memory(width, 0);
    assert!(filled(without()).blocks() <= 9);
    let blocks = filled(without().cut_into(4));
    assert!(blocks.blocks() <= 17);
    let gap = Folds::Blocked {
        folds: 4,
        gap: 1,
        embargo: 0,
    };
    assert_eq!(blocks.splits(&gap).unwrap().len(), 4);
}

#[test]
fn too_few_blocks_for_the_folds_are_refused_rather_than_empty() {
    let thirds = Folds::contiguous(3);
    assert!(filled(300, 0).splits(&thirds).is_err());
    assert!(filled(300, DEFAULT_ROW_MEMORY).splits(&thirds).is_ok());
}

#[test]
fn a_gap_is_in_neither_part_of_a_split() {
    let folds = Folds::Blocked {
        folds: 2,
        gap: 10,
        embargo: 20,
    };
    let exact = filled(1500, DEFAULT_ROW_MEMORY).splits(&folds).unwrap();
    assert_near(&exact[0].train, &direct(780..1500));
    assert_near(&exact[1].train, &direct(0..740));
    let in_blocks = filled(1500, 0).splits(&folds).unwrap();
    assert_near(&in_blocks[0].test, &direct(0..768));
    assert_near(&in_blocks[0].train, &direct(1024..1500));
    assert_near(&in_blocks[1].train, &direct(0..512));
}

#[test]
fn weights_are_kept_with_the_rows() {
    let mut blocks = GramBlocks::new(1);
    blocks.push(&[1.0], 2.0);
    blocks.push_weighted(&[3.0], 4.0, 0.5);
    let rows: Vec<_> = blocks.rows().unwrap().iter().collect();
    assert_eq!(rows, [(&[1.0][..], 2.0, 1.0), (&[3.0][..], 4.0, 0.5)]);
    assert_eq!(blocks.total().weight(), 1.5);
}

#[test]
fn stretches_of_sums_are_those_of_their_rows_and_are_not_cut() {
    let mut stretches = GramBlocks::new(2).in_stretches();
    let ends = [0, 300, 420, 900, 1000];
    for pair in ends.windows(2) {
        let middle = pair[0] + 7;
        for i in pair[0]..middle {
            let (x, y) = row(i);
            stretches.push(&x, y);
        }
        let (x, y) = row(pair[1]);
        // About a shift of its own.
        let mut sums = Gram::with_shift(vec![x[0], x[1], y]).unwrap();
        for i in middle..pair[1] {
            let (x, y) = row(i);
            sums.push(&x, y);
        }
        stretches.merge(&sums).unwrap();
        stretches.end_stretch();
        stretches.end_stretch();
    }
    assert_eq!((stretches.count(), stretches.blocks()), (1000, 4));
    assert!(stretches.rows().is_none() && !stretches.exact_folds());
    assert_near(&stretches.total(), &direct(0..1000));
    let splits = stretches.splits(&Folds::contiguous(2)).unwrap();
    assert_near(&splits[0].test, &direct(0..420));
    assert_near(&splits[0].train, &direct(420..1000));
}

#[test]
fn of_more_stretches_than_are_kept_neighbours_are_one() {
    let mut stretches = GramBlocks::new(1).in_stretches();
    for i in 0..3000_u32 {
        stretches.push(&[f64::from(i % 7)], f64::from(i % 3));
        stretches.end_stretch();
    }
    assert!(stretches.blocks() <= MOST_BLOCKS + 1);
    assert_eq!(stretches.count(), 3000);
    assert_eq!(stretches.total().count(), 3000);
    let thirds = stretches.splits(&Folds::contiguous(3)).unwrap();
    assert!(
        thirds
            .iter()
            .all(|split| split.test.count().abs_diff(1000) <= 8)
    );
}
