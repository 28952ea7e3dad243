//! A filter beside the same filter with the coefficients of its fit: which of them speaks.

use athermal::core::engine::Engine;
use athermal::core::prng::Prng;

use super::world::{fitted_on, run, same};
use crate::workbench::Graph;

fn graph(more: &str) -> String {
    let node = format!("type = \"kalman\"\nmemory = \"2h\"\n{more}");
    Graph::new()
        .signal("temperature", "K", "a b", "10s")
        .signal("shift", "nm", "Z", "10s")
        .section("nodes.model", &node)
        .with("inputs.features = 'temperature'; inputs.truth = 'shift'; ahead = '0s'")
        .outputs("out = 'model'; deviation = 'model:std_dev'; learning = 'model:learning'")
        .to_string()
}

/// A tick every 10 s: two temperatures, and so much of the first beside half of the second, from 40 on, with noise of 1.
fn rows(seed: u64, count: usize, of_first: impl Fn(usize) -> f64) -> Vec<[f64; 3]> {
    let mut random = Prng::stream(seed, "yields");
    let mut a = 0.0;
    let row = |nth| {
        a = 0.9 * a + 0.4 * random.normal();
        let b = random.normal();
        let shift = 40.0 + of_first(nth) * a + 0.5 * b + random.normal();
        [a, b, shift]
    };
    (0..count).map(row).collect()
}

/// Who spoke at a tick: 0 what has learned, else why the fit did; −1 where that was not said anew.
fn who(outputs: &[Vec<f64>]) -> Vec<i32> {
    let said = outputs.iter().map(|of| (of[2] / 10.0).floor());
    said.map(|of| if of.is_nan() { -1 } else { of as i32 })
        .collect()
}

fn rmse(rows: &[[f64; 3]], outputs: &[Vec<f64>], within: std::ops::Range<usize>) -> f64 {
    let squares = within
        .clone()
        .map(|nth| (rows[nth][2] - outputs[nth][0]).powi(2));
    (squares.sum::<f64>() / within.len() as f64).sqrt()
}

#[test]
fn a_filter_speaks_with_the_coefficients_of_its_fit_until_what_it_learned_errs_no_more() {
    let (plan, fitted) = fitted_on(&graph(""), &rows(1, 1500, |_| 3.0));
    let engine = || Engine::new(plan.clone(), &fitted).unwrap();
    // 6 of the first for a while, then 3 as in the fit, and 5 nm more that the level has to follow.
    let mut rows = rows(2, 2000, |nth| if nth < 1000 { 6.0 } else { 3.0 });
    rows.iter_mut().for_each(|row| row[2] += 5.0);
    let found = run(&mut engine(), 0, &rows);
    let speaks = who(&found);
    let of_begin = &speaks[1..20];
    assert!(of_begin.iter().all(|&of| of == 1), "{of_begin:?}");
    let learned = speaks[100..1000].iter().filter(|&&of| of == 0).count();
    assert!(learned > 850, "{learned} of 900");
    let (early, late) = (rmse(&rows, &found, 5..20), rmse(&rows, &found, 500..1000));
    assert!(late < 0.6 * early, "{late} after {early}");
    assert!(speaks[1000..1100].contains(&2), "{:?}", &speaks[1000..1100]);
    let back = rmse(&rows, &found, 1050..1200);
    assert!(
        back < 1.25,
        "{back}, as the fit's coefficients are right again"
    );
}

#[test]
fn while_no_truth_comes_for_a_memory_the_coefficients_are_those_of_the_fit() {
    let (plan, fitted) = fitted_on(&graph(""), &rows(1, 1500, |_| 3.0));
    let mut engine = Engine::new(plan, &fitted).unwrap();
    let mut rows = rows(3, 2000, |_| 6.0);
    rows[500..].iter_mut().for_each(|row| row[2] = f64::NAN);
    let found = run(&mut engine, 0, &rows);
    let speaks = who(&found);
    // The last truth is of 4,990 s, and a memory is 7,200 s; between truths the port says what changes.
    let said: Vec<_> = (501..2000).filter(|&nth| speaks[nth] >= 0).collect();
    assert_eq!(said, [1220]);
    assert_eq!((speaks[500], speaks[1220]), (0, 3));
    let per = |from: usize| {
        // How what is predicted moves with the first temperature.
        let pairs = || rows[from..from + 600].iter().zip(&found[from..]);
        let mean = |of: &dyn Fn(&[f64; 3], &Vec<f64>) -> f64| {
            pairs().map(|(row, out)| of(row, out)).sum::<f64>() / 600.0
        };
        let (x, y) = (mean(&|row, _| row[0]), mean(&|_, out| out[0]));
        mean(&|row, out| (row[0] - x) * (out[0] - y)) / mean(&|row, _| (row[0] - x).powi(2))
    };
    let (learned, of_fit) = (per(600), per(1300));
    // As many rows again as the fit had would bring it half of the way.
    assert!(learned > 3.5, "{learned}");
    assert!((of_fit - 3.0).abs() < 0.2, "{of_fit}");
}

#[test]
fn both_filters_go_on_from_a_snapshot_to_the_last_bit() {
    let (plan, fitted) = fitted_on(&graph(""), &rows(1, 1500, |_| 3.0));
    let engine = || Engine::new(plan.clone(), &fitted).unwrap();
    let rows = rows(4, 400, |nth| if nth < 200 { 6.0 } else { 3.0 });
    let mut whole = engine();
    let wanted = run(&mut whole, 0, &rows);
    for cut in [15, 190, 230] {
        let mut first = engine();
        run(&mut first, 0, &rows[..cut]);
        let mut second = engine();
        second.restore(&first.snapshot()).unwrap();
        let found = run(&mut second, cut, &rows[cut..]);
        assert!(same(&found, &wanted[cut..]), "cut at {cut}");
    }
}
