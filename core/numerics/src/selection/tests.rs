//! Selections against scikit-learn, mlxtend and statsmodels, and against fits made one by one.

use super::*;
use crate::{Folds, GramBlocks, LeastSquares, NumericsError, Standardization, oracle};
use serde_json::Value;

fn oracle_blocks(row_memory: usize) -> Option<GramBlocks> {
    let input = oracle::table("sfs/input.csv")?;
    let mut blocks = GramBlocks::with_row_memory(12, row_memory);
    for row in input.numbers() {
        blocks.push(&row[..12], row[12]);
    }
    Some(blocks)
}

fn thirds() -> Folds {
    Folds::contiguous(3)
}

fn named(config: &str) -> Search {
    let mut how = Search::forward();
    if config == "ols_negrmse" {
        how.score = SelectionScore::NegativeRmse;
    }
    if config == "ridge10_r2" {
        how.alpha = 10.0;
    }
    how
}

fn sorted(mut columns: Vec<usize>) -> Vec<usize> {
    columns.sort_unstable();
    columns
}

fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().unwrap().iter();
    values.map(|value| value.as_f64().unwrap()).collect()
}

fn columns(value: &Value) -> Vec<usize> {
    numbers(value).iter().map(|&c| c as usize).collect()
}

#[test]
fn every_score_of_every_step_is_that_of_the_oracle() {
    let Some(blocks) = oracle_blocks(1 << 20) else {
        return;
    };
    let steps = oracle::table("sfs/steps.csv").unwrap();
    assert_eq!(steps.header[3..6], ["fold0", "fold1", "fold2"]);
    let mut compared = 0;
    for config in ["ols_r2", "ols_negrmse", "ridge10_r2"] {
        let found = named(config).run(&blocks, &thirds(), &[1.0; 12]).unwrap();
        assert_eq!(found.steps.len(), 12);
        for (record, numbers) in steps.records.iter().zip(steps.numbers()) {
            if record[0] != config {
                continue;
            }
            let step = &found.steps[numbers[1] as usize];
            let column = numbers[2] as usize;
            let mut candidates = step.candidates.iter();
            let candidate = candidates.find(|c| c.candidate == column).unwrap();
            assert!((candidate.mean - numbers[6]).abs() < 1e-10);
            assert_eq!(step.candidate == column, numbers[7] == 1.0);
            if step.candidate == column {
                for (score, wanted) in step.folds.iter().zip(&numbers[3..6]) {
                    assert!((score - wanted).abs() < 1e-10);
                }
            }
            compared += 1;
        }
    }
    assert_eq!(compared, 3 * 12 * 13 / 2);
}

#[test]
fn a_tolerance_stops_where_the_oracle_stops() {
    let Some(blocks) = oracle_blocks(1 << 20) else {
        return;
    };
    let selected: Value =
        serde_json::from_str(&oracle::text("sfs/selected.json").unwrap()).unwrap();
    for config in ["ols_r2", "ols_negrmse", "ridge10_r2"] {
        for (tolerance, expected) in selected[config]["auto"].as_object().unwrap() {
            let tolerance = tolerance.parse().unwrap();
            let how = Search {
                tolerance: Some(tolerance),
                most: Some(11),
                ..named(config)
            };
            let found = how.run(&blocks, &thirds(), &[1.0; 12]).unwrap();
            let reached = found.steps.last().unwrap().mean;
            assert!(found.refused.unwrap().mean - reached < tolerance);
            assert_eq!(
                sorted(found.columns),
                columns(expected),
                "{config} {tolerance}"
            );
        }
    }
}

#[test]
fn backwards_the_sets_of_both_oracles_are_met() {
    let Some(blocks) = oracle_blocks(1 << 20) else {
        return;
    };
    let selected: Value =
        serde_json::from_str(&oracle::text("sfs/selected.json").unwrap()).unwrap();
    for config in ["ols_r2", "ols_negrmse", "ridge10_r2"] {
        let how = Search {
            direction: Direction::Backward,
            tolerance: Some(f64::NEG_INFINITY),
            most: Some(4),
            ..named(config)
        };
        let found = how.run(&blocks, &thirds(), &[1.0; 12]).unwrap();
        let expected = columns(&selected[config]["backward_to_4"]);
        assert_eq!(sorted(found.columns), expected, "{config}");
    }
}

/// The own table of selections, see `tests/oracles/selection/generate.py`.
fn own() -> (GramBlocks, Value) {
    let mut blocks = GramBlocks::new(12);
    for row in oracle::own_table("selection/input.csv").numbers() {
        blocks.push(&row[..12], row[12]);
    }
    let expected = oracle::own_text("selection/expected.json");
    (blocks, serde_json::from_str(&expected).unwrap())
}

fn assert_steps(found: &Selection, expected: &Value, name: &str) {
    let expected = expected[name].as_array().unwrap();
    assert_eq!(found.steps.len(), expected.len(), "{name}");
    for (step, wanted) in found.steps.iter().zip(expected) {
        assert_eq!(step.candidate as u64, wanted["candidate"], "{name}");
        let added = wanted["change"] == "added";
        assert_eq!(step.change == Change::Added, added, "{name}");
        for (score, wanted) in step.folds.iter().zip(numbers(&wanted["folds"])) {
            assert!((score - wanted).abs() < 1e-10, "{name}: {score} {wanted}");
        }
        let tried = wanted["candidates"].as_object().unwrap();
        assert_eq!(step.candidates.len(), tried.len());
        for candidate in &step.candidates {
            let wanted = tried[&candidate.candidate.to_string()].as_f64().unwrap();
            assert!((candidate.mean - wanted).abs() < 1e-10, "{name}");
        }
    }
}

#[test]
fn every_search_takes_the_steps_of_the_own_oracle() {
    let (blocks, expected) = own();
    let fifths = Folds::contiguous(5);
    let blocked = Folds::Blocked {
        folds: 4,
        gap: 6,
        embargo: 10,
    };
    let expanding = Folds::Expanding { folds: 4, gap: 7 };
    let how = |direction, alpha, most| Search {
        direction,
        alpha,
        most,
        ..Search::forward()
    };
    let (forward, backward) = (Direction::Forward, Direction::Backward);
    for (name, how, folds) in [
        ("forward_ols", how(forward, 0.0, None), fifths),
        ("backward_ols", how(backward, 0.0, None), fifths),
        ("backward_ridge_5", how(backward, 5.0, None), fifths),
        (
            "floating_ols",
            how(Direction::Floating, 0.0, Some(7)),
            fifths,
        ),
        (
            "forward_ols_blocked_4_gap_6_embargo_10",
            how(forward, 0.0, None),
            blocked,
        ),
        (
            "forward_ols_expanding_4_gap_7",
            how(forward, 0.0, None),
            expanding,
        ),
    ] {
        let found = how.run(&blocks, &folds, &[1.0; 12]).unwrap();
        assert_steps(&found, &expected, name);
    }
}

#[test]
fn sensors_are_taken_in_the_order_of_the_own_oracle() {
    let (blocks, expected) = own();
    let sensors = Candidates::of_units((0..12).map(|column| vec![column / 3]).collect());
    let splits = blocks.splits(&Folds::contiguous(5)).unwrap();
    let how = Search {
        alpha: 5.0,
        ..Search::forward()
    };
    let found = how.over(&splits, &[1.0; 12], &sensors).unwrap();
    assert_steps(&found, &expected, "forward_ridge_5_by_sensor");
    let two = Search {
        most: Some(2),
        ..how
    };
    let found = two.over(&splits, &[1.0; 12], &sensors).unwrap();
    assert_eq!((found.steps.len(), found.columns.len()), (2, 6));
    let back = Search {
        direction: Direction::Backward,
        ..how
    };
    let back = back.over(&splits, &[1.0; 12], &sensors).unwrap();
    for (steps, columns) in back.steps.iter().zip(&back.path[1..]) {
        for (fold, split) in splits.iter().enumerate() {
            let fit = LeastSquares::ridge(5.0);
            let fit = fit.solve(&split.train, columns, &[1.0; 12], None).unwrap();
            let errors = squared_errors(&split.test, &fit);
            let spread = split.test.variances()[12] * split.test.weight();
            assert!((steps.folds[fold] - (1.0 - errors / spread)).abs() < 1e-10);
        }
    }
    assert_eq!(back.steps.len(), 3);
}

#[test]
fn two_sensors_are_not_taken_for_what_one_alone_gives_but_for_less_than_the_tolerance() {
    // The last column is made from both sensors, and says a little of the target.
    let sensors = Candidates::of_units(vec![vec![0], vec![1], vec![0, 1]]);
    let chosen = |share: f64, tolerance: f64| {
        let mut blocks = GramBlocks::with_row_memory(3, 1 << 20);
        for i in 0..600 {
            let (a, b, both) = (sine(i, 0.37), sine(i, 0.71), sine(i, 1.13));
            blocks.push(&[a, b, both], a + share * both + 0.1 * sine(i, 1.7));
        }
        let how = Search {
            tolerance: Some(tolerance),
            ..Search::forward()
        };
        let splits = blocks.splits(&Folds::contiguous(3)).unwrap();
        how.over(&splits, &[1.0; 3], &sensors).unwrap()
    };
    // Of the variance of the target the share explains about its square.
    let little = chosen(0.05, 0.01);
    assert_eq!(little.columns, [0]);
    let refused = little.refused.unwrap();
    assert!(refused.mean - little.steps[0].mean < 0.01);
    assert_eq!(chosen(0.05, 1e-4).columns, [0, 1, 2]);
    assert_eq!(chosen(0.5, 0.01).columns, [0, 1, 2]);
    // Together they gain less than the tolerance for each.
    assert_eq!(chosen(0.5, 0.6).columns, [0]);
}

#[test]
fn floating_by_sensor_ends_with_no_set_that_is_larger_and_worse_than_one_on_its_way() {
    // Beside each of six sensors there are products of some, which no sensor alone brings.
    let needs: Vec<Vec<usize>> = [vec![2, 3, 4, 5], vec![0, 4], vec![0, 1, 2, 4]].into();
    let single = (0..6).map(|unit| vec![unit]);
    let sensors = Candidates::of_units(single.chain(needs.clone()).collect());
    let units = |columns: &[usize]| {
        let mut units: Vec<usize> = columns
            .iter()
            .flat_map(|&column| match column.checked_sub(6) {
                Some(product) => needs[product].clone(),
                None => vec![column],
            })
            .collect();
        units.sort_unstable();
        units.dedup();
        units.len()
    };
    for seed in 0..2000_u32 {
        let mut blocks = GramBlocks::with_row_memory(9, 1 << 20);
        for i in 0..150 {
            // Numbers that hang together in no way.
            let noise = |k: u32| {
                let x = f64::from(1 + i + 150 * seed) * 12.9898 + f64::from(k) * 78.233;
                3.0 * (x.sin() * 43_758.545_3).rem_euclid(1.0) - 1.5
            };
            let mut row: Vec<f64> = (0..6).map(noise).collect();
            let products = needs
                .iter()
                .map(|units| units.iter().map(|&unit| row[unit]));
            let products: Vec<f64> = products.map(Iterator::product).collect();
            let share = |k: usize| sine(seed, 0.7 + k as f64);
            let target: f64 = (0..3).map(|k| share(k) * products[k]).sum();
            let target = target
                + 0.3 * share(4) * row[0]
                + 0.3 * share(5) * row[3]
                + (noise(11) + noise(12)) * f64::from(seed % 4) * 0.3;
            row.extend(products);
            blocks.push(&row, target);
        }
        let how = Search {
            direction: Direction::Floating,
            tolerance: Some(1e-3),
            ..Search::forward()
        };
        let splits = blocks.splits(&Folds::contiguous(3)).unwrap();
        let found = how.over(&splits, &[1.0; 9], &sensors).unwrap();
        let last = found.steps.last().unwrap().mean;
        let size = units(&found.columns);
        for (step, columns) in found.steps.iter().zip(&found.path) {
            let is_smaller = units(columns) < size;
            assert!(!is_smaller || step.mean < last, "{seed}: {found:?}");
        }
    }
}

#[test]
fn a_fold_in_which_the_target_stays_the_same_has_no_part_in_the_mean() {
    let chosen = |still: &dyn Fn(u32) -> bool| {
        let mut blocks = GramBlocks::with_row_memory(2, 1 << 20);
        for i in 0..300 {
            let (a, b) = (sine(i, 0.37), 1e-3 * sine(i, 0.71));
            let target = if still(i) { 7.0 + 1e-9 * b } else { a };
            blocks.push(&[a, b], target);
        }
        let folds = Folds::contiguous(3);
        Search::forward().run(&blocks, &folds, &[1.0; 2]).unwrap()
    };
    let found = chosen(&|i| i < 100);
    assert_eq!((found.columns[0], &found.quiet[..]), (0, &[0][..]));
    let [first, second] = found.steps[0].folds[..] else {
        panic!("{found:?}");
    };
    assert!((found.steps[0].mean - f64::midpoint(first, second)).abs() < 1e-12);
    assert!(chosen(&|_| false).quiet.is_empty());
    assert!(chosen(&|_| true).quiet.is_empty());
}

/// The sum of the squared errors of a fit over the rows of a Gram matrix.
fn squared_errors(gram: &crate::Gram, fit: &crate::LinearFit) -> f64 {
    let mut at = vec![0.0; gram.width() + 1];
    at[gram.width()] = fit.intercept;
    let moments = gram.moments_about(&at);
    let target = gram.width();
    let weighted = fit
        .columns
        .iter()
        .copied()
        .zip(fit.coefficients.iter().copied());
    let terms: Vec<(usize, f64)> = weighted
        .map(|(j, b)| (j, -b))
        .chain([(target, 1.0)])
        .collect();
    let pairs = terms.iter().flat_map(|a| terms.iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| a.1 * b.1 * moments[(a.0, b.0)]).sum()
}

#[test]
fn the_smallest_set_within_one_standard_error_is_that_of_the_own_oracle() {
    let (blocks, expected) = own();
    let how = Search::forward();
    let found = how.run(&blocks, &Folds::contiguous(5), &[1.0; 12]).unwrap();
    let smallest = found.within_one_standard_error().unwrap();
    assert!(smallest.columns.len() < 12 && smallest.steps == smallest.columns.len());
    let expected = columns(&expected["parsimonious"]["columns"]);
    assert_eq!(sorted(smallest.columns), expected);
}

#[test]
fn the_smallest_set_on_the_way_back_has_no_smaller_one_as_good_and_is_not_too_large() {
    let (blocks, _) = own();
    let scales = Standardization::of(&blocks.total()).scales;
    let search = |most| {
        let how = Search {
            direction: Direction::Backward,
            most,
            ..Search::forward()
        };
        how.run(&blocks, &thirds(), &scales).unwrap()
    };
    let found = search(None);
    let smallest = found.within_one_standard_error().unwrap();
    assert!(found.steps.len() > smallest.steps, "the way ends there");
    let least = smallest.best - smallest.standard_error;
    assert!(found.steps[smallest.steps - 1].mean >= least);
    assert!(
        found.steps[smallest.steps..]
            .iter()
            .all(|step| step.mean < least)
    );
    let most = smallest.columns.len() - 1;
    let fewer = search(Some(most)).within_one_standard_error().unwrap();
    assert!(fewer.columns.len() <= most, "{fewer:?}");
}

#[test]
fn stepwise_regression_takes_the_steps_of_the_own_oracle() {
    let (blocks, expected) = own();
    let how = Stepwise {
        enter: 4.0,
        remove: 3.9,
        most: None,
    };
    let found = how.run(&blocks.total(), &[1.0; 12]).unwrap();
    let expected = expected["stepwise"].as_array().unwrap();
    assert_eq!(found.steps.len(), expected.len());
    assert!(
        found
            .steps
            .iter()
            .any(|step| step.change == Change::Removed)
    );
    for (step, wanted) in found.steps.iter().zip(expected) {
        assert_eq!(step.column as u64, wanted["candidate"]);
        assert_eq!(step.change == Change::Added, wanted["change"] == "added");
        assert!((step.f / wanted["f"].as_f64().unwrap() - 1.0).abs() < 1e-9);
        assert!((step.r2 - wanted["r2"].as_f64().unwrap()).abs() < 1e-12);
        for candidate in &step.candidates {
            let wanted = &wanted["candidates"][candidate.candidate.to_string()];
            let wanted = wanted.as_f64().unwrap();
            assert!((candidate.mean - wanted).abs() < 1e-8 * wanted.max(1.0));
        }
    }
}

#[test]
fn nothing_more_is_taken_once_only_rounding_is_left() {
    let mut gram = crate::Gram::new(4);
    for i in 0..200 {
        let row = [0.1, 0.7, 1.3, 2.9].map(|rate| sine(i, rate));
        gram.push(&row, 2.0 * row[2] + 1.0);
    }
    let how = Stepwise {
        enter: 4.0,
        remove: 3.9,
        most: None,
    };
    let chosen = how.run(&gram, &[1.0; 4]).unwrap();
    assert_eq!(chosen.columns, [2]);
}

fn sine(i: u32, rate: f64) -> f64 {
    (rate * f64::from(i) * (1.0 + 1e-3 * f64::from(i))).sin()
}

#[test]
fn each_step_scores_what_a_fit_of_the_training_folds_predicts() {
    let scales = [0.5, 2.0, 1.5];
    let mut blocks = GramBlocks::new(3);
    for i in 0..900 {
        let x = [
            sine(i, 0.37),
            sine(i, 0.11) + 3.0,
            sine(i, 0.023) - 0.5 * sine(i, 0.37),
        ];
        blocks.push(&x, x[0] - 2.0 * x[2] + 0.3 * sine(i, 1.7));
    }
    let how = Search {
        alpha: 40.0,
        score: SelectionScore::NegativeRmse,
        ..Search::forward()
    };
    let found = how.run(&blocks, &thirds(), &scales).unwrap();
    let splits = blocks.splits(&thirds()).unwrap();
    for (taken, step) in found.steps.iter().enumerate() {
        let columns = &found.columns[..=taken];
        for (fold, split) in splits.iter().enumerate() {
            let fit = LeastSquares::ridge(40.0);
            let fit = fit.solve(&split.train, columns, &scales, None).unwrap();
            let squares = squared_errors(&split.test, &fit);
            assert!((step.folds[fold] + (squares / 300.0).sqrt()).abs() < 1e-12);
        }
    }
}

#[test]
fn many_steps_back_and_forth_leave_no_rounding_behind() {
    let width = 48;
    let mut blocks = GramBlocks::new(width);
    for i in 0..2000 {
        // Neighbours hang together, as the slopes over growing windows do.
        let mut x = vec![sine(i, 0.01)];
        for j in 1..width {
            x.push(0.98 * x[j - 1] + 0.2 * sine(i, 0.37 + 0.11 * j as f64));
        }
        let y = x[3] - x[20] + 0.5 * x[40] + 0.2 * sine(i, 1.9);
        blocks.push(&x, y);
    }
    let scales = Standardization::of(&blocks.total()).scales;
    let how = Search {
        direction: Direction::Backward,
        ..Search::forward()
    };
    let found = how.run(&blocks, &thirds(), &scales).unwrap();
    let splits = blocks.splits(&thirds()).unwrap();
    for at in [0, 20, 40, 46] {
        for (fold, split) in splits.iter().enumerate() {
            let fit = LeastSquares::ordinary();
            let fit = fit
                .solve(&split.train, &found.path[at + 1], &scales, None)
                .unwrap();
            let spread = split.test.variances()[width] * split.test.weight();
            let score = 1.0 - squared_errors(&split.test, &fit) / spread;
            let told = found.steps[at].folds[fold];
            assert!((told - score).abs() < 1e-9, "{at}: {told} {score}");
        }
    }
}

#[test]
fn a_copy_of_a_chosen_column_is_never_chosen_and_the_lower_index_wins_the_tie() {
    let mut blocks = GramBlocks::new(4);
    for i in 0..600 {
        let (a, b) = (sine(i, 0.37), sine(i, 0.11));
        blocks.push(&[b, a, a, 5.0], 3.0 * a + b + 0.1 * sine(i, 1.9));
    }
    let found = Search::forward()
        .run(&blocks, &thirds(), &[1.0; 4])
        .unwrap();
    assert_eq!(found.columns, [1, 0]);
    let copy = found.steps[1].candidates.iter().find(|c| c.candidate == 2);
    assert!(copy.unwrap().mean.is_nan());
    let back = Search {
        direction: Direction::Backward,
        tolerance: Some(1e-3),
        ..Search::forward()
    };
    let found = back.run(&blocks, &thirds(), &[1.0; 4]).unwrap();
    assert_eq!(found.start.as_ref().unwrap().left_out, [2]);
    assert_eq!(found.columns, [0, 1]);
}

#[test]
fn the_first_unit_too_must_add_to_the_columns_that_need_none() {
    let mut blocks = GramBlocks::new(2);
    for i in 0..600 {
        let (own, useless) = (sine(i, 0.37), sine(i, 0.11));
        blocks.push(&[own, useless], own + 0.1 * sine(i, 1.9));
    }
    let splits = blocks.splits(&thirds()).unwrap();
    let of_units = Candidates::of_units(vec![vec![], vec![0]]);
    for direction in [Direction::Forward, Direction::Floating] {
        let search = Search {
            direction,
            tolerance: Some(1e-3),
            ..Search::forward()
        };
        let found = search.over(&splits, &[1.0; 2], &of_units).unwrap();
        assert_eq!(found.columns, [0], "{direction:?}");
        assert!(found.start.as_ref().unwrap().mean > 0.98);
        assert!(found.refused.is_some());
        let smallest = found.within_one_standard_error().unwrap();
        assert_eq!((smallest.columns, smallest.steps), (vec![0], 0));
    }
}

#[test]
fn a_column_that_is_constant_in_one_training_set_counts_nothing_there() {
    let mut blocks = GramBlocks::new(2);
    for i in 0..600 {
        let step = if i < 200 { sine(i, 0.37) } else { 0.25 };
        blocks.push(&[step, sine(i, 0.11)], 2.0 * step + sine(i, 0.11));
    }
    let found = Search::forward()
        .run(&blocks, &thirds(), &[1.0; 2])
        .unwrap();
    assert_eq!(found.columns, [1, 0]);
    assert_eq!(found.steps[1].folds[0], found.steps[0].folds[0]);
    assert!(found.steps[1].folds[1] > found.steps[0].folds[1]);
}

#[test]
fn wrong_requests_are_refused() {
    let mut blocks = GramBlocks::new(1);
    for i in 0..10 {
        blocks.push(&[sine(i, 0.37)], sine(i, 0.11));
    }
    let how = Search::forward();
    let halves = Folds::contiguous(2);
    assert!(how.run(&blocks, &Folds::contiguous(11), &[1.0]).is_err());
    assert!(how.run(&blocks, &halves, &[1.0, 1.0]).is_err());
    assert!(how.run(&blocks, &halves, &[0.0]).is_err());
    let bad = Search {
        alpha: f64::NAN,
        ..how
    };
    assert!(bad.run(&blocks, &halves, &[1.0]).is_err());
    let never = Stepwise {
        enter: 3.0,
        remove: 4.0,
        most: None,
    };
    assert!(never.run(&blocks.total(), &[1.0]).is_err());
    blocks.push(&[f64::NAN], 1.0);
    assert_eq!(
        how.run(&blocks, &halves, &[1.0]),
        Err(NumericsError::NotFinite)
    );
}
