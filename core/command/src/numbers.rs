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

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::read;

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
