//! The noise of a series that drifts.

/// The size that four of five values do not exceed, over that of a normal distribution of variance 1; 0 without values.
#[must_use]
pub fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let at = sizes.len() * 4 / 5;
    *sizes.select_nth_unstable_by(at, f64::total_cmp).1 / 1.281_551_565_544_6
}

/// The standard deviation of white noise by second differences, whose variance is six times as large and which a drift hardly has.
#[must_use]
pub fn of_second_differences(second: impl Iterator<Item = f64>) -> f64 {
    spread(second) / 6_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_of_a_course_is_that_which_lies_upon_it() {
        // Even between -1 and 1, of which the standard deviation is 1/√3.
        let noise = |row: f64| {
            let wild = (row * 12.9898).sin() * 43_758.545_3;
            2.0 * (wild - wild.floor()) - 1.0
        };
        let course = |row: f64| 1e-4 * row * row + 40.0 * (row / 900.0).sin();
        let values: Vec<f64> = (0..20_000_i32)
            .map(|row| course(row.into()) + 0.3 * noise(row.into()))
            .collect();
        let second = values.windows(3).map(|of| of[0] - 2.0 * of[1] + of[2]);
        let found = of_second_differences(second) / (0.3 / 3_f64.sqrt());
        assert!((0.9..1.1).contains(&found), "{found}");
        assert_eq!(spread(std::iter::empty()), 0.0);
    }
}
