//! What fitting costs: forward selection, least squares, whole fits and scores, and reading a table.

mod die_tester;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal::Model;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Recording, Samples};
use athermal::run::score::{ScoreOptions, score};
use athermal_numerics::{Direction, Folds, GramBlocks, LeastSquares, Search, Standardization};
use divan::Bencher;
use divan::counter::BytesCount;

fn main() {
    divan::main();
}

const CANDIDATES: usize = 64;

/// Rows of 64 candidates that hang together in pairs, and a truth of which 20 of them know something.
fn each_row(rows: usize, mut take: impl FnMut(&[f64], f64)) {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut row = [0.0; CANDIDATES];
    for _ in 0..rows {
        let mut before = 0.0;
        for value in &mut row {
            before = uniform() + 0.7 * before;
            *value = before;
        }
        let known = row.iter().step_by(3).enumerate();
        let truth = known.fold(uniform(), |sum, (i, value)| sum + value / (i + 1) as f64);
        take(&row, truth);
    }
}

fn blocks(rows: usize) -> GramBlocks {
    let mut blocks = GramBlocks::new(CANDIDATES);
    each_row(rows, |row, truth| blocks.push(row, truth));
    blocks
}

fn select(bencher: Bencher, rows: usize, direction: Direction) {
    let blocks = blocks(rows);
    let scales = Standardization::of(&blocks.total()).scales;
    let search = Search {
        direction,
        alpha: 1.0,
        tolerance: Some(1e-3),
        ..Search::forward()
    };
    let folds = Folds::contiguous(3);
    bencher.bench_local(|| search.run(&blocks, &folds, &scales));
}

#[divan::bench(args = [8_000, 603_000], sample_count = 10)]
fn forward_selection(bencher: Bencher, rows: usize) {
    select(bencher, rows, Direction::Forward);
}

#[divan::bench(args = [8_000, 603_000], sample_count = 10)]
fn backward_selection(bencher: Bencher, rows: usize) {
    select(bencher, rows, Direction::Backward);
}

#[divan::bench(args = [8_000, 603_000], sample_count = 10)]
fn floating_selection(bencher: Bencher, rows: usize) {
    select(bencher, rows, Direction::Floating);
}

/// Rows one after the other, each with its truth.
fn rows_in_memory(count: usize) -> Vec<f64> {
    let mut rows = Vec::with_capacity(count * (CANDIDATES + 1));
    each_row(count, |row, truth| {
        rows.extend_from_slice(row);
        rows.push(truth);
    });
    rows
}

fn push_all(mut blocks: GramBlocks, rows: &[f64]) -> GramBlocks {
    for row in rows.chunks_exact(CANDIDATES + 1) {
        blocks.push(&row[..CANDIDATES], row[CANDIDATES]);
    }
    blocks
}

/// All of a forward selection: rows in memory become Gram blocks, and these a choice.
#[divan::bench(args = [8_000, 603_000], sample_count = 10)]
fn forward_selection_from_rows(bencher: Bencher, rows: usize) {
    let rows = rows_in_memory(rows);
    bencher.bench_local(|| {
        let blocks = push_all(GramBlocks::new(CANDIDATES), &rows);
        let scales = Standardization::of(&blocks.total()).scales;
        let search = Search {
            alpha: 1.0,
            tolerance: Some(1e-3),
            ..Search::forward()
        };
        search.run(&blocks, &Folds::contiguous(3), &scales)
    });
}

/// All of a least squares: rows in memory become Gram blocks, and these coefficients.
#[divan::bench(sample_count = 10)]
fn least_squares_from_rows(bencher: Bencher) {
    let rows = rows_in_memory(603_458);
    let columns: Vec<_> = (0..CANDIDATES).collect();
    bencher.bench_local(|| {
        let blocks = push_all(GramBlocks::with_row_memory(CANDIDATES, 0), &rows);
        let gram = blocks.total();
        let scales = Standardization::of(&gram).scales;
        LeastSquares::ordinary().solve(&gram, &columns, &scales, blocks.rows())
    });
}

#[divan::bench(args = [8_000, 80_000], sample_count = 10)]
fn least_squares(bencher: Bencher, rows: usize) {
    let blocks = blocks(rows);
    let columns: Vec<_> = (0..CANDIDATES).collect();
    bencher.bench_local(|| {
        let gram = blocks.total();
        let scales = Standardization::of(&gram).scales;
        LeastSquares::ridge(1.0).solve(&gram, &columns, &scales, blocks.rows())
    });
}

fn log(name: &str, days: f64, seed: u64) -> (PathBuf, u64) {
    let path = std::env::temp_dir().join(format!("athermal-{name}-{}.csv", std::process::id()));
    let bytes = die_tester::write(&path, days, seed);
    (path, bytes)
}

fn dataset(path: &Path) -> Dataset {
    Dataset::new(vec![path.to_path_buf()], Options::default())
}

#[divan::bench(sample_count = 10)]
fn fit_a_week(bencher: Bencher) {
    let (path, _) = log("fit", 7.0, 1);
    let plan = Arc::clone(&Model::load(die_tester::graph()).expect("no mistakes").plan);
    bencher.bench_local(|| {
        let fitted = fit(&plan, &dataset(&path), &FitOptions::default(), &mut |_| ());
        fitted.expect("the file can be read")
    });
    std::fs::remove_file(path).expect("the file was written above");
}

#[divan::bench(sample_count = 10)]
fn evaluate_two_days(bencher: Bencher) {
    let (path, _) = log("evaluate", 2.0, 2);
    let model = die_tester::model();
    bencher.bench_local(|| {
        let options = ScoreOptions::default();
        let scores = score(
            &model.plan,
            &model.fitted,
            &dataset(&path),
            &options,
            &mut |_| (),
        );
        scores.expect("the file can be read")
    });
    std::fs::remove_file(path).expect("the file was written above");
}

#[divan::bench(sample_count = 10)]
fn read_csv(bencher: Bencher) {
    let (path, bytes) = log("read", 7.0, 1);
    let plan = Arc::clone(&Model::load(die_tester::graph()).expect("no mistakes").plan);
    bencher.counter(BytesCount::new(bytes)).bench_local(|| {
        let data = dataset(&path);
        let mut rows = data.open(&plan).expect("the file can be read");
        let mut samples = Samples::default();
        let mut count = 0_u64;
        while rows
            .next(&mut samples)
            .expect("the file can be read")
            .is_some()
        {
            count += 1;
        }
        count
    });
    std::fs::remove_file(path).expect("the file was written above");
}
