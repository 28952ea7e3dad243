//! Recursive least squares against the oracles, and what keeps it sound over millions of rows.

use super::*;
use crate::oracle;

const SHARE: f64 = 0.1;

fn fit(width: usize, information: f64, memory_s: f64, share: f64) -> RlsFit {
    let cell = |i: usize, j: usize| if i == j { information } else { 0.0 };
    RlsFit {
        memory_s,
        share,
        coefficients: vec![0.0; width],
        information: (0..width)
            .flat_map(|i| (0..=i).map(move |j| cell(i, j)))
            .collect(),
        rows: 100.0,
        variance: 1.0,
    }
}

fn beginning(width: usize, information: f64, memory_s: f64) -> Rls {
    fit(width, information, memory_s, SHARE).try_into().unwrap()
}

/// Numbers between −1 and 1 (Marsaglia 2003, xorshift64).
fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn near(found: f64, wanted: f64, within: f64) {
    assert!((found - wanted).abs() < within, "{found}, not {wanted}");
}

#[test]
fn every_row_follows_the_textbook_where_nothing_goes_back() {
    let Some(input) = oracle::table("rls/input.csv") else {
        return;
    };
    let expected = oracle::table("rls/expected.csv").unwrap().numbers();
    let rows = input.numbers();
    for recursion in expected.chunks(rows.len()) {
        let memory_s = -recursion[0][0].ln().recip();
        let mut rls: Rls = fit(4, 1e-3, memory_s.abs(), 0.0).try_into().unwrap();
        for (row, expected) in rows.iter().zip(recursion) {
            near(rls.step(&row[..4], row[4], 1.0), expected[2], 1e-8);
            for (found, wanted) in rls.coefficients().iter().zip(&expected[3..7]) {
                near(*found, *wanted, 1e-8);
            }
        }
    }
    assert_eq!(expected.len(), 3 * rows.len());
}

#[test]
fn every_row_follows_the_formula_and_what_fades_goes_back_to_the_fit() {
    let start = oracle::own_table("rls_resetting/start.csv").numbers();
    let (information, coefficients) = start[0].split_at(10);
    let rows = oracle::own_table("rls_resetting/rows.csv").numbers();
    let expected = oracle::own_table("rls_resetting/expected.csv").numbers();
    let fit = RlsFit {
        coefficients: coefficients.to_vec(),
        information: information.to_vec(),
        ..fit(4, 1.0, 400.0, SHARE)
    };
    let mut rls = Rls::try_from(fit).unwrap();
    for (row, expected) in rows.iter().zip(&expected) {
        let x = &row[1..5];
        near(rls.spread(|i| x[i]), expected[1], 1e-9);
        assert!(rls.spread(|i| x[i]) <= rls.spread_of_fit(|i| x[i]) / SHARE * (1.0 + 1e-9));
        near(rls.step(x, row[5], row[0]), expected[0], 1e-9);
        for (found, wanted) in rls.coefficients().iter().zip(&expected[2..]) {
            near(*found, *wanted, 1e-9);
        }
    }
    assert_eq!(expected.len(), 300);
    let far = rls.coefficients().to_vec();
    // A month on, one row is all that is known beside the share of the fit, from which it hardly differs.
    let x = [0.1, 0.1, 0.1, 1.0];
    rls.step(&x, rls.predict(&x), 3e6);
    let off = |of: &[f64]| -> f64 {
        let both = of.iter().zip(coefficients);
        both.map(|(of, start)| (of - start).abs()).sum()
    };
    assert!(off(rls.coefficients()) < 0.2 * off(&far));
}

#[test]
fn a_step_gives_the_same_bits_with_and_without_the_vectors_of_this_processor() {
    let mut state = 7;
    for width in [1, 3, 4, 16, 19] {
        let mut with = beginning(width, 0.01, 100.0);
        let mut without = with.clone();
        for _ in 0..300 {
            let x: Vec<f64> = (0..width).map(|_| random(&mut state)).collect();
            let y = random(&mut state);
            let errors = [with.step(&x, y, 1.0), without.step_here(&x, y, 1.0)];
            assert_eq!(errors[0].to_bits(), errors[1].to_bits());
        }
        assert_eq!(with, without, "{width}");
    }
}

#[test]
fn a_hundred_thousand_rows_leave_it_as_sure_as_it_may_be_and_no_less_sure_than_a_tenth_of_the_fit()
{
    let width = 8;
    let mut rls = beginning(width, 0.01, 500.0);
    let mut state = 0x9e37_79b9_7f4a_7c15;
    let mut x = vec![0.0; width];
    for row in 0..100_000 {
        // Excited for a while, then hardly: what makes a careless recursion wind up.
        let scale = if row % 2000 < 1000 { 1.0 } else { 1e-6 };
        x.iter_mut().for_each(|x| *x = scale * random(&mut state));
        x[width - 1] = x[0];
        let y: f64 = x.iter().sum::<f64>() + 0.1 * scale * random(&mut state);
        rls.step(&x, y, 1.0);
        if row % 1000 == 0 {
            let one = |nth: usize| rls.spread(|i| f64::from(u8::from(i == nth)));
            assert!((0..width).all(|nth| one(nth) > 0.0 && one(nth) < 100.0 / SHARE * 1.001));
        }
    }
    // Two regressors are the same, so that only their sum is known; after 1,000 quiet rows a little of the fit has come back.
    let sum = rls.coefficients()[0] + rls.coefficients()[width - 1];
    near(sum, 2.0, 0.1);
}

#[test]
fn a_start_from_rows_is_their_information() {
    let mut state = 11;
    let rows: Vec<[f64; 4]> = (0..200)
        .map(|_| [(); 4].map(|()| random(&mut state)))
        .collect();
    let mut gram = Gram::new(3);
    for row in &rows {
        gram.push(&row[..3], row[3]);
    }
    let means = gram.means();
    let scales = crate::Standardization::of(&gram).scales;
    let started = information_of(&gram, &[2, 0], &scales, 1.0, 100.0);
    // A penalty is a row of its own; the intercept has none. Two hundred rows that count as a hundred.
    let mut rls: Rls = RlsFit {
        information: vec![1.0, 0.0, 1.0, 0.0, 0.0, 1e-9],
        ..fit(3, 1.0, f64::INFINITY, SHARE)
    }
    .try_into()
    .unwrap();
    for row in &rows {
        let z = |column: usize| (row[column] - means[column]) / scales[column] * 0.5_f64.sqrt();
        rls.step(&[z(2), z(0), 0.5_f64.sqrt()], row[3], 1.0);
    }
    for (found, wanted) in started.iter().zip(&rls.learned().information) {
        near(*found, *wanted, 1e-7);
    }
}

#[test]
fn a_row_that_is_not_finite_changes_nothing_and_one_that_nothing_can_be_made_of_begins_again() {
    let mut rls = beginning(2, 0.1, 100.0);
    rls.step(&[1.0, 2.0], 3.0, 1.0);
    let before = rls.clone();
    for (x, y) in [
        ([f64::NAN, 0.0], 1.0),
        ([1.0, 0.0], f64::INFINITY),
        ([f64::MAX, f64::MAX], 1.0),
        ([1.0, 0.0], 1e200),
    ] {
        rls.step(&x, y, 1.0);
        assert_eq!(rls, before);
    }
    for _ in 0..2 {
        rls.step(&[1.3e154, 0.0], 0.0, 0.0);
    }
    assert_eq!(rls, beginning(2, 0.1, 100.0));
}

#[test]
fn a_constant_that_has_leapt_is_known_as_by_one_row_and_the_next_rows_find_it() {
    let mut rls = beginning(3, 50.0, 1e4);
    let mut state = 5;
    let mut row = || [random(&mut state), random(&mut state), 1.0];
    for _ in 0..200 {
        let x = row();
        rls.step(&x, x[0] - x[1], 1.0);
    }
    let before = rls.clone();
    rls.shift(2, 1e4);
    let by = |nth: usize| rls.coefficients()[nth] - before.coefficients()[nth];
    near(by(0), 0.0, 1e-6);
    near(by(2), 1e4, 1e-6);
    assert_eq!(rls.learned().information[5], 1.0);
    for _ in 0..100 {
        let x = row();
        rls.step(&x, x[0] - x[1] + 1e4 + 3.0, 1.0);
    }
    near(rls.coefficients()[2], 1e4 + 3.0, 0.5);
}

#[test]
fn the_variance_is_that_of_the_rows_remembered() {
    let mut rls = beginning(1, 100.0, 200.0);
    near(rls.variance(), 1.0, 1e-12);
    let mut state = 9;
    for _ in 0..2000 {
        rls.step(&[1.0], 6.0 * random(&mut state), 1.0);
    }
    // 36 / 3, of which a tenth of the fit's weight of 100 is 1.
    near(rls.variance(), 12.0, 2.0);
}

#[test]
fn fits_out_of_range_are_refused() {
    let of = |change: fn(&mut RlsFit)| {
        let mut fit = fit(2, 1.0, 100.0, SHARE);
        change(&mut fit);
        Rls::try_from(fit)
    };
    assert!(of(|_| ()).is_ok() && of(|fit| fit.memory_s = f64::INFINITY).is_ok());
    for change in [
        (|fit| fit.memory_s = 0.0) as fn(&mut RlsFit),
        |fit| fit.memory_s = f64::NAN,
        |fit| fit.share = 1.1,
        |fit| fit.rows = 0.0,
        |fit| fit.variance = -1.0,
        |fit| fit.coefficients = vec![0.0; 3],
        |fit| fit.coefficients[0] = f64::NAN,
        |fit| fit.information[0] = -1.0,
        |fit| fit.information[1] = 2.0,
    ] {
        assert!(of(change).is_err());
    }
}

#[test]
fn what_was_learned_goes_on_with_the_same_bits_from_the_same_fit() {
    let mut rls = beginning(3, 0.1, 50.0);
    let mut state = 3;
    let mut row = || [(); 4].map(|()| random(&mut state));
    for _ in 0..20 {
        let [a, b, c, y] = row();
        rls.step(&[a, b, c], y, 1.0);
    }
    let (fit, learned) = (
        serde_json::to_string(&rls).unwrap(),
        serde_json::to_value(rls.learned()).unwrap(),
    );
    let mut back: Rls = serde_json::from_str(&fit).unwrap();
    assert_ne!(back, rls);
    let mut cut = learned.clone();
    cut["pull"] = serde_json::json!([1.0]);
    assert!(!back.resume(&serde_json::from_value(cut).unwrap()));
    let mut negative = learned.clone();
    negative["information"][0] = serde_json::json!(-1.0);
    assert!(!back.resume(&serde_json::from_value(negative).unwrap()));
    assert!(back.resume(&serde_json::from_value(learned).unwrap()));
    assert_eq!(back, rls);
    for _ in 0..20 {
        let [a, b, c, y] = row();
        let x = [a, b, c];
        assert_eq!(
            rls.step(&x, y, 1.0).to_bits(),
            back.step(&x, y, 1.0).to_bits()
        );
    }
}
