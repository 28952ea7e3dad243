//! A cell as a text, or as a value: a number, no value, or neither; a value as a cell. Not what follows from a cell that is neither.

use std::borrow::Cow;

use encoding_rs::WINDOWS_1252;

/// Longest number with a decimal comma that is looked at; the longest exact double in decimal stays below it.
const COMMA_CELL: usize = 1100;

/// The text of a cell: what is not UTF-8 is taken for Windows-1252, which is what Windows programs write in Western countries.
pub(crate) fn text(cell: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(cell) {
        Ok(text) => text.into(),
        Err(_) => WINDOWS_1252.decode_without_bom_handling(cell).0,
    }
}

/// The value of a cell, `NaN` for "no value" (empty, `NaN`, `null` in any case), 1 for `true` and 0 for `false` (in any case);
/// `None` when it is neither.
///
/// Infinities stay: what they mean is the engine's to say.
#[inline]
pub(crate) fn value(cell: &[u8], decimal_comma: bool) -> Option<f64> {
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    match fast_float2::parse(cell) {
        Ok(value) => Some(value),
        Err(_) => unusual(trim(cell), decimal_comma),
    }
}

/// The value of a text, as the cell of a table has it: `NaN` where it says that there is none; nothing where it is no number.
#[must_use]
pub fn number(text: &[u8]) -> Option<f64> {
    value(text, false)
}

#[cold]
fn unusual(cell: &[u8], decimal_comma: bool) -> Option<f64> {
    if cell.is_empty() || cell.eq_ignore_ascii_case(b"null") {
        return Some(f64::NAN);
    }
    // Some recorders write signs where a value is beyond the range, and one apart from its number.
    if let [sign @ (b'+' | b'-'), rest @ ..] = cell {
        if rest.len() >= 2 && rest.iter().all(|byte| byte == sign) {
            return Some(f64::NAN);
        }
        let number = rest.trim_ascii_start();
        let is_apart = number.len() < rest.len();
        let begins = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
        if is_apart && number.first().is_some_and(begins) {
            let size = value(number, decimal_comma)?;
            return Some(if *sign == b'-' { -size } else { size });
        }
    }
    if cell.eq_ignore_ascii_case(b"true") {
        return Some(1.0);
    }
    if cell.eq_ignore_ascii_case(b"false") {
        return Some(0.0);
    }
    if decimal_comma && let Some(comma) = single_comma(cell) {
        let mut point = [0; COMMA_CELL];
        let copy = point.get_mut(..cell.len())?;
        copy.copy_from_slice(cell);
        copy[comma] = b'.';
        return fast_float2::parse(copy).ok();
    }
    fast_float2::parse(cell).ok()
}

/// Whether a cell holds a value, whichever its decimal mark: neither text nor nothing.
pub(crate) fn is_number(cell: &str) -> bool {
    cell.contains(char::is_alphanumeric) && value(cell.as_bytes(), true).is_some()
}

/// A time with a point for a decimal comma, as a reader takes it where something else than a comma separates cells.
#[must_use]
pub fn with_decimal_point(time: &str) -> Cow<'_, str> {
    match comma_of_time(time.as_bytes()) {
        Some(comma) => format!("{}.{}", &time[..comma], &time[comma + 1..]).into(),
        None => time.into(),
    }
}

/// The decimal mark of a number; none in one that has none.
pub(crate) fn decimal_mark(number: &[u8]) -> Option<u8> {
    let mut marks = number.iter().filter(|b| matches!(b, b',' | b'.'));
    marks.next().copied()
}

/// Where the only comma stands, if there is one and no point.
pub(crate) fn single_comma(cell: &[u8]) -> Option<usize> {
    let mut marks = cell
        .iter()
        .enumerate()
        .filter(|(_, b)| matches!(b, b',' | b'.'));
    match (marks.next(), marks.next()) {
        (Some((at, b',')), None) => Some(at),
        _ => None,
    }
}

/// Where the decimal comma of a time stands: the only comma from its hours and minutes on, so that a date before may have points.
pub(crate) fn comma_of_time(cell: &[u8]) -> Option<usize> {
    let clock = cell.iter().position(|&b| b == b':').unwrap_or(0);
    let comma = clock + single_comma(&cell[clock..])?;
    let is_decimal = cell.get(comma + 1).is_some_and(u8::is_ascii_digit);
    is_decimal.then_some(comma)
}

/// Without the spaces around it, and without quotes that stand inside such spaces (` "a" `).
#[inline]
pub(crate) fn trim(cell: &[u8]) -> &[u8] {
    let cell = cell.trim_ascii();
    match cell {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => cell,
    }
}

/// The text of a number, as the cell of a table has it; empty for no value.
#[must_use]
pub fn text_of(value: f64, number: &mut zmij::Buffer) -> &str {
    if value.is_finite() {
        number.format_finite(value)
    } else if value.is_nan() {
        ""
    } else if value > 0.0 {
        "inf"
    } else {
        "-inf"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_nan_and_null_are_no_value() {
        for text in [
            "", "  ", "NaN", "nan", "NAN", "-nan", "null", "NULL", " null ",
        ] {
            assert!(
                value(text.as_bytes(), false).is_some_and(f64::is_nan),
                "{text:?}"
            );
        }
    }

    #[test]
    fn infinities_stay_infinite() {
        for text in ["inf", "Infinity", "+inf", "1e999"] {
            assert_eq!(
                value(text.as_bytes(), false),
                Some(f64::INFINITY),
                "{text:?}"
            );
        }
        assert_eq!(value(b"-inf", false), Some(f64::NEG_INFINITY));
    }

    #[test]
    fn numbers_may_have_spaces_or_a_sign() {
        assert_eq!(value(b" 21.5\t", false), Some(21.5));
        assert_eq!(value(b"+3", false), Some(3.0));
        assert_eq!(value(b" \"4\" ", false), Some(4.0));
    }

    #[test]
    fn a_sign_may_stand_apart_and_signs_alone_are_no_value() {
        assert_eq!(value(b"+   21.20", false), Some(21.2));
        assert_eq!(value(b" -  0,5", true), Some(-0.5));
        assert_eq!(value(b"- .5", false), Some(-0.5));
        for text in ["+++++++", "-------"] {
            assert!(value(text.as_bytes(), false).is_some_and(f64::is_nan));
        }
        for text in ["- -5", "+-5", "-", "--", "+ x", "5 -"] {
            assert_eq!(value(text.as_bytes(), false), None, "{text}");
        }
    }

    #[test]
    fn a_flag_is_one_or_zero() {
        for text in ["true", "True", " TRUE ", "\"true\""] {
            assert_eq!(value(text.as_bytes(), false), Some(1.0), "{text:?}");
        }
        for text in ["false", "False", " FALSE ", "\"false\""] {
            assert_eq!(value(text.as_bytes(), true), Some(0.0), "{text:?}");
        }
    }

    #[test]
    fn other_text_is_neither_number_nor_absence() {
        for text in [
            "NA", "-", "off", "yes", "no", "truer", "1,5", "1 2", "0x10", "21.5C",
        ] {
            assert_eq!(value(text.as_bytes(), false), None, "{text:?}");
        }
    }

    #[test]
    fn a_comma_is_a_decimal_point_only_where_it_may_be() {
        assert_eq!(value(b"1,5", true), Some(1.5));
        assert_eq!(value(b" -0,25e2 ", true), Some(-25.0));
        assert_eq!(value(b"1.234,5", true), None);
        assert_eq!(value(b"1,234,5", true), None);
    }

    #[test]
    fn every_double_is_read_to_the_last_bit() {
        for number in [
            0.1,
            1.0 / 3.0,
            f64::MIN_POSITIVE,
            5e-324,
            f64::MAX,
            -73.967_322_07,
        ] {
            let text = format!("{number:?}");
            assert_eq!(
                value(text.as_bytes(), false).map(f64::to_bits),
                Some(number.to_bits())
            );
        }
    }
}
