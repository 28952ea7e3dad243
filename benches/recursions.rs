//! What it costs to learn from one row: recursive least squares, stochastic gradients and the Kalman filter of a local linear
//! trend, each a thousand rows at a time.

use athermal_numerics::{Kalman, LearningRate, Passage, Rls, RlsFit, Sgd, SgdOptions, Structural};
use divan::Bencher;
use divan::counter::ItemsCount;

fn main() {
    divan::main();
}

const ROWS: usize = 1000;

/// Rows of so many regressors, the last one 1, and a target of their sum and noise.
fn rows(width: usize) -> Vec<(Vec<f64>, f64)> {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let row = |_| {
        let mut x: Vec<f64> = (0..width).map(|_| uniform()).collect();
        x[width - 1] = 1.0;
        let y = x.iter().sum::<f64>() + 0.1 * uniform();
        (x, y)
    };
    (0..ROWS).map(row).collect()
}

#[divan::bench(args = [4, 16, 47])]
fn recursive_least_squares(bencher: Bencher, width: usize) {
    let rows = rows(width);
    let cells = (0..width).flat_map(|i| (0..=i).map(move |j| (i, j)));
    let fit = RlsFit {
        memory_s: 1000.0,
        share: 0.1,
        coefficients: vec![0.0; width],
        information: cells.map(|(i, j)| f64::from(u8::from(i == j))).collect(),
        rows: 1000.0,
        variance: 1.0,
    };
    let mut rls = Rls::try_from(fit).expect("the fit is in range");
    bencher.counter(ItemsCount::new(ROWS)).bench_local(|| {
        for (x, y) in &rows {
            divan::black_box(rls.step(x, *y, 1.0));
        }
    });
}

#[divan::bench(args = [4, 16, 47])]
fn stochastic_gradients(bencher: Bencher, width: usize) {
    let rows = rows(width);
    let options = SgdOptions {
        alpha: 1e-4,
        rate: LearningRate::Constant { eta0: 1e-3 },
    };
    let mut sgd = Sgd::new(width, options).expect("the options are in range");
    bencher.counter(ItemsCount::new(ROWS)).bench_local(|| {
        for (x, y) in &rows {
            divan::black_box(sgd.step(x, *y));
        }
    });
}

#[divan::bench(args = [0, 16, 46])]
fn local_linear_trend(bencher: Bencher, regressors: usize) {
    let rows = rows(regressors + 1);
    let model = Structural {
        observation: 1.0,
        level: 0.01,
        trend: Some(1e-4),
        returning: 0.0,
        passage: Passage::Continuous,
    };
    let mut filter = Kalman::diffuse(model, regressors).expect("the variances are in range");
    bencher.counter(ItemsCount::new(ROWS)).bench_local(|| {
        for (x, y) in &rows {
            filter.advance(1.0);
            divan::black_box(filter.observe(&x[..regressors], *y));
        }
    });
}
