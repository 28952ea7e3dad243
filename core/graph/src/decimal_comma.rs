//! Whether a text that cannot be read has a comma where a point belongs, and what to write instead.

/// The text with a point in the place of its one comma between digits.
pub fn with_point(text: &str) -> Option<String> {
    let (before, after) = text.trim().split_once(',')?;
    let is_number = before.ends_with(|c: char| c.is_ascii_digit())
        && after.starts_with(|c: char| c.is_ascii_digit());
    (is_number && !after.contains(',')).then(|| format!("{before}.{after}"))
}

/// What is wrong with such a text.
pub fn reason(found: &str) -> String {
    format!("\"{found}\" has a decimal comma")
}

/// What to write instead.
pub fn help(with_point: &str) -> String {
    let digits = |text: &str| text.chars().take_while(char::is_ascii_digit).count();
    let (whole, fraction) = with_point.rsplit_once('.').unwrap_or((with_point, ""));
    let is_zero = whole.trim_start_matches(['+', '-']).starts_with('0');
    if digits(fraction) == 3 && !is_zero {
        return format!(
            "a number has a decimal point and no mark between thousands: \"{with_point}\" or \"{whole}{fraction}\""
        );
    }
    format!("a number has a decimal point: \"{with_point}\"")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_between_digits_stands_where_a_point_belongs() {
        for (text, instead) in [
            ("-82,5 Cel", "-82.5 Cel"),
            ("0,25 um/min", "0.25 um/min"),
            ("1h2,5min", "1h2.5min"),
        ] {
            assert_eq!(with_point(text).as_deref(), Some(instead));
            let text = format!("a number has a decimal point: \"{instead}\"");
            assert_eq!(help(instead), text);
        }
        for text in ["5 nm, 6 nm", "1,2,3 nm", ",5 nm", "5, nm", "5 nm"] {
            assert_eq!(with_point(text), None, "{text}");
        }
    }

    #[test]
    fn a_comma_before_three_digits_may_stand_between_thousands() {
        assert!(help("1.000 nm").ends_with("thousands: \"1.000 nm\" or \"1000 nm\""));
        assert!(!help("0.001 nm").contains("thousands"));
    }
}
