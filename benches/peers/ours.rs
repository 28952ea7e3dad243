//! Our side of the comparison with peers: one task on rows that `peers.py` has written, timed here, written as JSON.
//!
//! `ours TASK FILE WIDTH`: the file holds 64-bit floats, row by row, `WIDTH` regressors and a target.

use std::error::Error;
use std::time::Instant;

use athermal::core::channel::{ABSENT, COLD};
use athermal_features::slope::kernel::{Coverage, NoValue, RollingSlope};
use athermal_numerics::{
    Folds, GramBlocks, Kalman, LeastSquares, Passage, Rls, RlsFit, Search, Standardization,
    Structural, cross_validated_penalties, logarithmic_grid,
};

type Found = Result<Vec<f64>, Box<dyn Error>>;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [task, file, width] = &arguments[..] else {
        return Err("usage: ours TASK FILE WIDTH".into());
    };
    let width: usize = width.parse()?;
    let bytes = std::fs::read(file)?;
    let value = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
    let values: Vec<f64> = bytes.as_chunks().0.iter().map(value).collect();
    let rows: Vec<(&[f64], f64)> = values
        .chunks_exact(width + 1)
        .map(|row| (&row[..width], row[width]))
        .collect();
    let run = match task.as_str() {
        "forward_selection" => forward_selection,
        "ridge_penalty" => ridge_penalty,
        "least_squares" => least_squares,
        "recursive_least_squares" => recursive_least_squares,
        "local_linear_trend" => local_linear_trend,
        "slopes" => slopes,
        other => return Err(format!("there is no task `{other}`").into()),
    };
    // Peers are timed in a process that has done the work before.
    run(&rows, width)?;
    let start = Instant::now();
    let found = run(&rows, width)?;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{}",
        serde_json::json!({ "seconds": seconds, "found": found })
    );
    Ok(())
}

fn filled(mut blocks: GramBlocks, rows: &[(&[f64], f64)]) -> GramBlocks {
    for (x, y) in rows {
        blocks.push(x, *y);
    }
    blocks
}

/// The columns chosen, in order.
fn forward_selection(rows: &[(&[f64], f64)], width: usize) -> Found {
    let blocks = filled(GramBlocks::new(width), rows);
    let scales = Standardization::of(&blocks.total()).scales;
    let search = Search {
        alpha: 1.0,
        tolerance: Some(1e-3),
        ..Search::forward()
    };
    let selection = search.run(&blocks, &Folds::contiguous(3), &scales)?;
    Ok(selection
        .columns
        .iter()
        .map(|&column| column as f64)
        .collect())
}

/// The best penalty of 37, and the coefficients with it.
fn ridge_penalty(rows: &[(&[f64], f64)], width: usize) -> Found {
    let blocks = filled(GramBlocks::new(width), rows);
    let total = blocks.total();
    let scales = Standardization::of(&total).scales;
    let columns: Vec<_> = (0..width).collect();
    let alphas = logarithmic_grid(1e-3, 1e6, 4);
    let splits = blocks.splits(&Folds::contiguous(3))?;
    let scores = cross_validated_penalties(&splits, &columns, &scales, &alphas)?;
    let means = scores.iter().map(|folds| folds.iter().sum::<f64>());
    let (best, _) = alphas
        .iter()
        .zip(means)
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
        .ok_or("there is a penalty")?;
    let fit = LeastSquares::ridge(*best).solve(&total, &columns, &scales, blocks.rows())?;
    Ok(std::iter::once(*best).chain(fit.coefficients).collect())
}

/// The coefficients.
fn least_squares(rows: &[(&[f64], f64)], width: usize) -> Found {
    let blocks = filled(GramBlocks::with_row_memory(width, 0), rows);
    let total = blocks.total();
    let scales = Standardization::of(&total).scales;
    let columns: Vec<_> = (0..width).collect();
    let fit = LeastSquares::ordinary().solve(&total, &columns, &scales, blocks.rows())?;
    Ok(fit.coefficients)
}

/// The coefficients after all rows, forgetting by 0.999.
fn recursive_least_squares(rows: &[(&[f64], f64)], width: usize) -> Found {
    let cells = (0..width).flat_map(|i| (0..=i).map(move |j| (i, j)));
    // Nothing of a fit that it could go back to, as the peers have none.
    let mut rls = Rls::try_from(RlsFit {
        memory_s: -0.999_f64.ln().recip(),
        share: 0.0,
        coefficients: vec![0.0; width],
        information: cells.map(|(i, j)| f64::from(u8::from(i == j))).collect(),
        rows: 1.0,
        variance: 1.0,
    })?;
    for (x, y) in rows {
        rls.step(x, *y, 1.0);
    }
    Ok(rls.coefficients().to_vec())
}

/// Level and trend after all rows, by known variances.
fn local_linear_trend(rows: &[(&[f64], f64)], _width: usize) -> Found {
    let model = Structural {
        observation: 1.0,
        level: 0.01,
        trend: Some(1e-4),
        returning: 0.0,
        passage: Passage::Steps,
    };
    let mut filter = Kalman::diffuse(model, 0)?;
    for (_, y) in rows {
        filter.advance(1.0);
        filter.observe(&[], *y);
    }
    Ok(filter.state().to_vec())
}

/// The slopes of each regressor over eight windows at the last of rows one second apart; those of all rows are worked out.
fn slopes(rows: &[(&[f64], f64)], width: usize) -> Found {
    let coverage = Coverage {
        min_samples: 3,
        min_coverage: 0.5,
        cold_partial: false,
    };
    let no_value = NoValue {
        absent: ABSENT,
        cold: COLD,
    };
    let second = 1_000_000_000;
    let windows = [30, 60, 120, 240, 480, 600, 900, 1200].map(|s| s * second);
    let mut kernel = RollingSlope::new(&windows, width, coverage, no_value, false);
    let mut slopes = vec![0.0; width * windows.len()];
    for (row, (x, _)) in (0..).zip(rows) {
        kernel.push(row * second, x);
        kernel.slopes(&mut slopes);
    }
    Ok(slopes)
}
