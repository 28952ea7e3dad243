//! Reading a number on the command line.

use std::str::FromStr;

/// Reads a number. The error of any other text names it and what the argument expects: "a whole number from 1 on".
pub fn read<N: FromStr>(
    expected: &'static str,
) -> impl Fn(&str) -> Result<N, String> + Clone + Send + Sync + 'static {
    move |text| {
        let unlike = |_| format!("expected {expected}, found {text:?}");
        text.trim().parse().map_err(unlike)
    }
}

/// Reads a percentage of 0 or more as a part of one: 0.05 for "5%".
///
/// # Errors
/// As of [`read`].
pub fn percent(text: &str) -> Result<f64, String> {
    let digits = text.trim().strip_suffix('%').map(str::trim);
    let percent = digits.and_then(|digits| digits.parse::<f64>().ok());
    let percent = percent.filter(|percent| (0.0..1e5).contains(percent));
    let unlike = || format!("expected a percentage such as \"5%\", found {text:?}");
    percent.map(|of| of / 100.0).ok_or_else(unlike)
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::{percent, read};

    #[test]
    fn a_percentage_is_a_part_of_one_and_never_negative_or_nan() {
        for (text, part) in [("0%", 0.0), (" 5 % ", 0.05), ("0.07e2%", 0.07)] {
            assert_eq!(percent(text), Ok(part));
        }
        for text in ["5", "0.05", "-1%", "NaN%", "nan", "inf%", "%", ""] {
            let words = format!("expected a percentage such as \"5%\", found {text:?}");
            assert_eq!(percent(text), Err(words));
        }
    }

    #[test]
    fn a_text_that_is_no_such_number_is_told_with_what_is_expected() {
        let steps = read::<NonZeroU32>("a whole number from 1 on");
        assert_eq!(steps("3").map(NonZeroU32::get), Ok(3));
        for text in ["0", "x", "-1", "1.5", "", "4294967296"] {
            let words = format!("expected a whole number from 1 on, found {text:?}");
            assert_eq!(steps(text), Err(words));
        }
    }
}
