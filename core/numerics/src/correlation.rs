//! Correlations of series with themselves and with each other. Decides the estimates and their bounds under independence; does
//! not decide at which instants series are sampled. NaN in a series is a missing value: pairs with one are left out.

/// The factor of a standard error that covers 95 % of a normal distribution.
pub const NORMAL_95: f64 = 1.959_963_984_540_054;

/// The autocorrelation at lags 0 to `lags`: `Σ (x_i − x̄)(x_{i+k} − x̄) / Σ (x_i − x̄)²` (Box and Jenkins 1976, section 2.1.5). A
/// constant series has none: NaN throughout.
#[must_use]
pub fn autocorrelation(x: &[f64], lags: usize) -> Vec<f64> {
    let about = about_mean(x);
    let spread: f64 = about.iter().map(|d| d * d).sum();
    (0..=lags)
        .map(|lag| {
            let products = about.iter().zip(after(&about, lag)).map(|(a, b)| a * b);
            products.sum::<f64>() / spread
        })
        .collect()
}

/// The standard error of the autocorrelation at each lag from 1 on, were it zero from that lag on, of `count` values
/// (Bartlett 1946): `√((1 + 2 Σ_{j<k} r_j²) / n)`. `correlation` begins with lag 0.
#[must_use]
pub fn autocorrelation_errors(correlation: &[f64], count: usize) -> Vec<f64> {
    let mut inflation = 1.0;
    let tail = correlation.get(1..).unwrap_or_default();
    tail.iter()
        .map(|r| {
            let error = (inflation / count as f64).sqrt();
            inflation += 2.0 * r * r;
            error
        })
        .collect()
}

/// The statistic of Ljung and Box (1978) over the lags up to one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LjungBox {
    /// `Q = n (n + 2) Σ_{k ≤ lag} r_k² / (n − k)`.
    pub statistic: f64,
    /// How likely a white series has a `Q` as large: the upper tail of `χ²` with as many degrees of freedom as lags.
    pub p_value: f64,
}

/// The statistic of Ljung and Box for each lag from 1 on, of `count` values. `correlation` begins with lag 0.
#[must_use]
pub fn ljung_box(correlation: &[f64], count: usize) -> Vec<LjungBox> {
    let n = count as f64;
    let mut sum = 0.0;
    let lags = correlation.iter().enumerate().skip(1);
    lags.map(|(lag, r)| {
        sum += r * r / (n - lag as f64);
        let statistic = n * (n + 2.0) * sum;
        LjungBox {
            statistic,
            p_value: chi_squared_tail(statistic, lag),
        }
    })
    .collect()
}

/// The probability that `χ²` with so many degrees of freedom exceeds a value, by its finite series (Abramowitz and Stegun 1964,
/// 26.4.4 and 26.4.5).
fn chi_squared_tail(value: f64, degrees: usize) -> f64 {
    if value.is_nan() || degrees == 0 {
        return f64::NAN;
    }
    let half = value.max(0.0) / 2.0;
    let odd = !degrees.is_multiple_of(2);
    let (mut term, mut divisor, mut tail) = if odd {
        let first = libm::exp(-half) * (half / std::f64::consts::PI).sqrt() * 2.0;
        (first, 1.5, libm::erfc(half.sqrt()))
    } else {
        (libm::exp(-half), 1.0, 0.0)
    };
    for _ in 0..degrees / 2 {
        tail += term;
        term *= half / divisor;
        divisor += 1.0;
    }
    tail.min(1.0)
}

/// The correlation of the pairs `x_i`, `y_{i+lag}` (Pearson 1896, means and spreads of the overlap) for each lag from `-lags` to
/// `lags`: at a positive one `y` follows `x`. NaN where fewer than three pairs overlap or one side is constant.
#[must_use]
pub fn cross_correlation(x: &[f64], y: &[f64], lags: usize) -> Vec<f64> {
    let (x, y) = (about_mean_or_nan(x), about_mean_or_nan(y));
    let lead = (1..=lags).rev().map(|lag| pearson(after(&x, lag), &y));
    let follow = (0..=lags).map(|lag| pearson(&x, after(&y, lag)));
    lead.chain(follow).collect()
}

fn after(x: &[f64], lag: usize) -> &[f64] {
    x.get(lag..).unwrap_or_default()
}

/// Of the pairs at the beginning of both.
fn pearson(x: &[f64], y: &[f64]) -> f64 {
    let (mut n, mut sx, mut sy, mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (&a, &b) in x.iter().zip(y) {
        if (a + b).is_nan() {
            continue;
        }
        n += 1.0;
        sx += a;
        sy += b;
        xx += a * a;
        yy += b * b;
        xy += a * b;
    }
    let (xx, yy, xy) = (xx - sx * sx / n, yy - sy * sy / n, xy - sx * sy / n);
    if n < 3.0 || xx <= 0.0 || yy <= 0.0 {
        return f64::NAN;
    }
    (xy / (xx.sqrt() * yy.sqrt())).clamp(-1.0, 1.0)
}

/// The standard error of the cross-correlation of two series that have nothing to do with each other, from the autocorrelation
/// of both (from lag 0 on) and the number of pairs: `√(Σ_k r_x(k) r_y(k) / n)` over all lags (Bartlett 1946; Ljung 1999,
/// section 16.6). It is `1/√n` where one is white, and more where both are smooth.
#[must_use]
pub fn cross_correlation_error(x: &[f64], y: &[f64], pairs: usize) -> f64 {
    let products = x.iter().zip(y).skip(1).map(|(a, b)| a * b);
    let inflation = 1.0 + 2.0 * products.sum::<f64>();
    (inflation.max(1.0) / pairs as f64).sqrt()
}

/// Distances from the mean of what is there; nothing, so no product, where a value is missing.
fn about_mean(x: &[f64]) -> Vec<f64> {
    let about = about_mean_or_nan(x);
    about
        .into_iter()
        .map(|d| if d.is_nan() { 0.0 } else { d })
        .collect()
}

/// The same with missing values kept.
fn about_mean_or_nan(x: &[f64]) -> Vec<f64> {
    let present = || x.iter().copied().filter(|value| !value.is_nan());
    let mean = match present().next() {
        // Rounding would make their mean another, and the series one that varies.
        Some(first) if present().all(|value| value == first) => first,
        _ => present().sum::<f64>() / present().count() as f64,
    };
    x.iter().map(|value| value - mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;

    fn column(file: &str, name: &str) -> Option<Vec<f64>> {
        let table = oracle::table(file)?;
        let at = table
            .header
            .iter()
            .position(|column| column == name)
            .unwrap();
        Some(table.numbers().iter().map(|row| row[at]).collect())
    }

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "{found} {expected}");
    }

    #[test]
    fn autocorrelation_bounds_and_whiteness_are_those_of_the_oracle() {
        let Some(expected) = oracle::table("acf_ljungbox/expected.csv") else {
            return;
        };
        let at = |name: &str| expected.header.iter().position(|h| h == name).unwrap();
        let numbers = expected.numbers();
        for series in ["ar2", "white"] {
            let x = column("acf_ljungbox/input.csv", series).unwrap();
            let found = autocorrelation(&x, 30);
            let errors = autocorrelation_errors(&found, x.len());
            let whiteness = ljung_box(&found, x.len());
            let rows = expected.records.iter().zip(&numbers);
            let mut compared = 0;
            for (_, row) in rows.filter(|(record, _)| record[0] == series) {
                let lag = row[at("lag")] as usize;
                close(found[lag], row[at("acf")], 1e-10);
                if lag > 0 {
                    let high = found[lag] + NORMAL_95 * errors[lag - 1];
                    close(high, row[at("acf_ci_hi")], 1e-10);
                    let LjungBox { statistic, p_value } = whiteness[lag - 1];
                    close(statistic, row[at("ljungbox_q")], 1e-10 * statistic.max(1.0));
                    close(p_value, row[at("ljungbox_p")], 1e-9);
                }
                compared += 1;
            }
            assert_eq!(compared, 31);
        }
    }

    #[test]
    fn cross_correlation_is_that_of_the_oracle() {
        let Some(expected) = column("cross_correlation/expected.csv", "r_pearson_overlap") else {
            return;
        };
        let [x, y] = ["x", "y"].map(|name| column("cross_correlation/input.csv", name).unwrap());
        let found = cross_correlation(&x, &y, 60);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            close(*found, *expected, 1e-12);
        }
        let best = (0..found.len()).max_by(|&a, &b| found[a].abs().total_cmp(&found[b].abs()));
        assert_eq!(best.unwrap() as i64 - 60, 17);
    }

    #[test]
    fn a_chi_squared_tail_is_that_of_the_tables() {
        // The 95 % quantiles of Abramowitz and Stegun, table 26.8.
        for (degrees, quantile) in [(1, 3.841_459), (2, 5.991_465), (5, 11.0705), (30, 43.7730)] {
            close(chi_squared_tail(quantile, degrees), 0.05, 1e-6);
        }
        assert_eq!(chi_squared_tail(0.0, 4), 1.0);
    }

    #[test]
    fn autocorrelation_is_that_of_the_definition_and_gaps_do_not_count() {
        // Mean 0: squares add up to 10, neighbours to 1·2 + 2·(−2) + (−2)·(−1) = 0, next but one to −2 − 2 = −4.
        let found = autocorrelation(&[1.0, 2.0, -2.0, -1.0], 3);
        assert_eq!(found, [1.0, 0.0, -0.4, -0.1]);
        let with_gap = autocorrelation(&[1.0, 2.0, f64::NAN, -2.0, -1.0], 2);
        assert_eq!(with_gap, [1.0, 0.4, -0.4]);
    }

    #[test]
    fn missing_values_are_left_out_and_not_taken_for_zero() {
        let x: Vec<f64> = (0..200).map(|i| 5.0 + f64::from(i % 7)).collect();
        let mut gappy = x.clone();
        for i in (0..200).step_by(9) {
            gappy[i] = f64::NAN;
        }
        let found = cross_correlation(&x, &gappy, 7);
        close(found[7], 1.0, 1e-12);
        close(found[14], 1.0, 1e-12);
        assert!(autocorrelation(&gappy, 7)[7] > 0.7);
    }

    #[test]
    fn two_smooth_series_need_a_wider_bound_than_a_white_one() {
        let smooth: Vec<f64> = (0..20).map(|k| 0.9_f64.powi(k)).collect();
        let white: Vec<f64> = (0..20).map(|k| f64::from(u8::from(k == 0))).collect();
        close(cross_correlation_error(&smooth, &white, 400), 0.05, 1e-15);
        let wide = cross_correlation_error(&smooth, &smooth, 400);
        let geometric = (1.0 - 0.81_f64.powi(20)) / (1.0 - 0.81);
        close(wide, ((2.0 * geometric - 1.0) / 400.0).sqrt(), 1e-12);
    }

    #[test]
    fn a_constant_series_has_no_correlation() {
        assert!(autocorrelation(&[1.0; 5], 2)[1].is_nan());
        assert!(autocorrelation(&[0.1; 10], 2)[1].is_nan());
        assert!(cross_correlation(&[1.0; 5], &[1.0, 2.0, 3.0, 4.0, 5.0], 1)[1].is_nan());
    }
}
