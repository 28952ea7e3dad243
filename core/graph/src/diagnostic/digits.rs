//! A number with as many digits as are shown, whatever its size.

/// A number to so many significant digits.
#[must_use]
pub fn digits(value: f64, count: usize) -> String {
    let after_first = count.saturating_sub(1);
    // Rounding may reach the next power of ten, which this has behind it.
    let scientific = format!("{value:.after_first$e}");
    let exponent = scientific.rsplit_once('e');
    match exponent.and_then(|(_, exponent)| exponent.parse::<i32>().ok()) {
        _ if value == 0.0 => "0".to_owned(),
        Some(exponent) if (-4..6).contains(&exponent) => {
            let after = usize::try_from(after_first as i32 - exponent).unwrap_or(0);
            format!("{value:.after$}")
        }
        _ => scientific,
    }
}

#[cfg(test)]
mod tests {
    use super::digits;

    #[test]
    fn digits_stay_as_many_where_rounding_passes_a_power_of_ten() {
        let texts =
            [0.0, 12.345_678, -0.000_123_456, 1_234_567.0, 98_765.4].map(|it| digits(it, 5));
        assert_eq!(texts, ["0", "12.346", "-0.00012346", "1.2346e6", "98765"]);
        let texts = [9.996, 99.96, 0.999_6, 999_999.6, 0.000_099_996].map(|it| digits(it, 3));
        assert_eq!(texts, ["10.0", "100", "1.00", "1.00e6", "0.000100"]);
        assert_eq!(digits(f64::NAN, 3), "NaN");
    }
}
