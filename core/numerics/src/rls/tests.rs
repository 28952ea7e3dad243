//! Recursive least squares against the oracles, and what keeps it sound over millions of rows.

use super::*;
use crate::oracle;

const TEXTBOOK: RlsOptions = options(1.0);

const fn options(factor: f64) -> RlsOptions {
    RlsOptions {
        forgetting: Forgetting::Constant { factor },
        most_trace: f64::INFINITY,
    }
}

fn trace(rls: &Rls) -> f64 {
    let width = rls.coefficients().len();
    rls.covariance().iter().step_by(width + 1).sum()
}

/// Numbers between −1 and 1 (Marsaglia 2003, xorshift64).
fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

#[test]
fn every_row_follows_the_oracle() {
    let Some(input) = oracle::table("rls/input.csv") else {
        return;
    };
    let expected = oracle::table("rls/expected.csv").unwrap().numbers();
    let rows = input.numbers();
    for recursion in expected.chunks(rows.len()) {
        let mut rls = Rls::new(4, 1e3, options(recursion[0][0])).unwrap();
        for (row, expected) in rows.iter().zip(recursion) {
            let error = rls.step(&row[..4], row[4]);
            assert!((error - expected[2]).abs() < 1e-8);
            for (found, wanted) in rls.coefficients().iter().zip(&expected[3..7]) {
                assert!((found - wanted).abs() < 1e-8, "{found} {wanted}");
            }
            assert!((trace(&rls) - expected[7]).abs() < 1e-7 * expected[7]);
        }
    }
    assert_eq!(expected.len(), 3 * rows.len());
}

#[test]
fn variable_forgetting_follows_the_oracle() {
    let rows = oracle::own_table("rls_variable/rows.csv").numbers();
    let expected = oracle::own_table("rls_variable/expected.csv").numbers();
    let variable = RlsOptions {
        forgetting: Forgetting::Variable {
            memory: 200.0,
            noise: 0.1,
            lowest: 0.8,
        },
        most_trace: f64::INFINITY,
    };
    let mut rls = Rls::new(3, 100.0, variable).unwrap();
    for (row, expected) in rows.iter().zip(&expected) {
        let error = rls.step(&row[..3], row[3]);
        assert!(
            (error - expected[1]).abs() < 1e-8,
            "{error} {}",
            expected[1]
        );
        for (found, wanted) in rls.coefficients().iter().zip(&expected[2..5]) {
            assert!((found - wanted).abs() < 1e-8, "{found} {wanted}");
        }
    }
    assert_eq!(expected.len(), 250);
}

#[test]
fn a_step_gives_the_same_bits_with_and_without_the_vectors_of_this_processor() {
    let mut state = 7;
    for width in [1, 3, 4, 16, 19] {
        let mut with = Rls::new(width, 100.0, options(0.99)).unwrap();
        let mut without = with.clone();
        for _ in 0..300 {
            let x: Vec<f64> = (0..width).map(|_| random(&mut state)).collect();
            let y = random(&mut state);
            let errors = [with.step(&x, y), without.step_here(&x, y)];
            assert_eq!(errors[0].to_bits(), errors[1].to_bits());
        }
        let bits = |rls: &Rls| -> Vec<u64> {
            let all = rls.coefficients().iter().chain(rls.covariance());
            all.map(|value| value.to_bits()).collect()
        };
        assert_eq!(bits(&with), bits(&without), "{width}");
    }
}

#[test]
fn a_million_rows_leave_the_covariance_symmetric_and_positive() {
    for factor in [1.0, 0.999, 0.9] {
        let width = 8;
        let bounded = RlsOptions {
            most_trace: 1e3,
            ..options(factor)
        };
        let mut rls = Rls::new(width, 100.0, bounded).unwrap();
        let mut state = 0x9e37_79b9_7f4a_7c15;
        let mut x = vec![0.0; width];
        for row in 0..1_000_000 {
            // Excited for a while, then hardly: what makes a careless recursion wind up.
            let scale = if row % 2000 < 1000 { 1.0 } else { 1e-6 };
            x.iter_mut().for_each(|x| *x = scale * random(&mut state));
            x[width - 1] = x[0];
            let y: f64 = x.iter().sum::<f64>() + 0.1 * scale * random(&mut state);
            rls.step(&x, y);
        }
        let p = rls.covariance();
        for i in 0..width {
            assert!(p[i * width + i] > 0.0, "{factor}: {p:?}");
            assert!((0..i).all(|j| p[i * width + j] == p[j * width + i]));
        }
        assert!(trace(&rls) <= 1e3 / 0.9);
        // Two regressors are the same, so that only their sum is known.
        let sum = rls.coefficients()[0] + rls.coefficients()[width - 1];
        assert!(
            (sum - 2.0).abs() < 0.1,
            "{factor}: {:?}",
            rls.coefficients()
        );
        assert!(rls.seen() > 900_000);
    }
}

#[test]
fn a_start_from_rows_is_where_the_recursion_over_them_ends() {
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
    let started = covariance_of(&gram, &[2, 0], &scales, 1.0, 200.0).unwrap();
    // A prior of variance 1 is a penalty of 1; the intercept is as good as free.
    let mut prior = vec![0.0; 9];
    (prior[0], prior[4], prior[8]) = (1.0, 1.0, 1e6);
    let mut rls = Rls::starting_at(vec![0.0; 3], prior, TEXTBOOK).unwrap();
    for row in &rows {
        let z = |column: usize| (row[column] - means[column]) / scales[column];
        rls.step(&[z(2), z(0), 1.0], row[3]);
    }
    for (found, wanted) in started.iter().zip(rls.covariance()) {
        assert!(
            (found - wanted).abs() < 1e-9,
            "{started:?} {:?}",
            rls.covariance()
        );
    }
    let by_hand: f64 = rls.covariance().iter().sum();
    assert!((rls.spread(|_| 1.0) - by_hand).abs() < 1e-12);
}

#[test]
fn surprises_make_variable_forgetting_forget_and_nothing_else_does() {
    let run = |forgetting| {
        let variable = RlsOptions {
            forgetting,
            most_trace: f64::INFINITY,
        };
        let mut rls = Rls::new(2, 1e3, variable).unwrap();
        let mut state = 7;
        let mut late = 0.0;
        for row in 0..2000 {
            let x = [random(&mut state), 1.0];
            let slope = if row < 1000 { 2.0 } else { -1.0 };
            let error = rls.step(&x, slope * x[0] + 0.5 + 0.1 * random(&mut state));
            if (1050..1200).contains(&row) {
                late += error * error;
            }
        }
        (late, trace(&rls))
    };
    let noise = 0.1 / 3_f64.sqrt();
    let (variable, _) = run(Forgetting::Variable {
        memory: 500.0,
        noise,
        lowest: 0.5,
    });
    let (constant, _) = run(Forgetting::Constant {
        factor: 1.0 - 1.0 / 500.0,
    });
    assert!(variable < 0.2 * constant, "{variable} {constant}");
    let never = run(Forgetting::Variable {
        memory: 1e12,
        noise,
        lowest: 0.5,
    });
    let (endless, trace) = run(Forgetting::Constant { factor: 1.0 });
    assert!((never.0 - endless).abs() < 1e-6 * endless);
    assert!((never.1 - trace).abs() < 1e-6 * trace);
}

#[test]
fn a_row_that_is_not_finite_changes_nothing() {
    let mut rls = Rls::new(2, 10.0, TEXTBOOK).unwrap();
    rls.step(&[1.0, 2.0], 3.0);
    let before = rls.clone();
    for (x, y) in [
        ([f64::NAN, 0.0], 1.0),
        ([1.0, 0.0], f64::INFINITY),
        ([f64::MAX, f64::MAX], 1.0),
    ] {
        rls.step(&x, y);
        assert_eq!(rls.coefficients(), before.coefficients());
        assert_eq!(rls.covariance(), before.covariance());
    }
    rls.step(&[1.0, 0.0], 1.0);
    assert_ne!(rls.coefficients(), before.coefficients());
}

#[test]
fn options_and_starts_out_of_range_are_refused() {
    let with = |forgetting, most_trace| {
        Rls::new(
            1,
            1.0,
            RlsOptions {
                forgetting,
                most_trace,
            },
        )
    };
    let constant = |factor| Forgetting::Constant { factor };
    assert!(with(constant(0.99), 1.0).is_ok());
    for factor in [0.0, -0.1, 1.1, f64::NAN] {
        assert!(with(constant(factor), 1.0).is_err());
    }
    assert!(with(constant(0.99), 0.0).is_err() && with(constant(0.99), f64::NAN).is_err());
    let variable = |memory, noise, lowest| {
        with(
            Forgetting::Variable {
                memory,
                noise,
                lowest,
            },
            1.0,
        )
    };
    assert!(variable(100.0, 1.0, 0.5).is_ok());
    assert!(variable(1.0, 1.0, 0.5).is_err() && variable(f64::NAN, 1.0, 0.5).is_err());
    assert!(variable(100.0, 0.0, 0.5).is_err() && variable(100.0, 1.0, 0.0).is_err());
    let start =
        |covariance: [f64; 4]| Rls::starting_at(vec![0.0; 2], covariance.to_vec(), TEXTBOOK);
    assert!(start([1.0, 0.5, 0.5, 1.0]).is_ok());
    assert!(start([1.0, 0.5, 0.4, 1.0]).is_err() && start([1.0, 0.5, 0.5, 0.0]).is_err());
}

#[test]
fn a_recursion_that_was_written_and_read_goes_on_with_the_same_bits_if_its_parts_fit() {
    let bounded = RlsOptions {
        most_trace: 1e6,
        ..options(0.98)
    };
    let mut rls = Rls::new(3, 10.0, bounded).unwrap();
    let mut state = 3;
    let mut row = || [(); 4].map(|()| random(&mut state));
    for _ in 0..20 {
        let [a, b, c, y] = row();
        rls.step(&[a, b, c], y);
    }
    let saved = serde_json::to_value(&rls).unwrap();
    for part in ["coefficients", "covariance"] {
        let mut other = saved.clone();
        other[part] = serde_json::json!([1.0]);
        let error = serde_json::from_value::<Rls>(other).unwrap_err();
        let told = "the length of covariance is";
        assert!(error.to_string().starts_with(told), "{error}");
    }
    let mut lopsided = saved.clone();
    lopsided["covariance"][1] = serde_json::json!(7.0);
    serde_json::from_value::<Rls>(lopsided).unwrap_err();
    let mut back: Rls = serde_json::from_value(saved).unwrap();
    assert_eq!(back, rls);
    for _ in 0..20 {
        let [a, b, c, y] = row();
        assert_eq!(
            rls.step(&[a, b, c], y).to_bits(),
            back.step(&[a, b, c], y).to_bits()
        );
    }
}
