//! Whether a row below the names says the units of the columns. Not what follows from a unit.

use athermal_core::unit::Unit;

use crate::cell::is_number;
use crate::instant::has_clock;

/// Whether a row holds units, and nothing that could be a value: no number, nothing with a digit that is no unit, and at most one other
/// text, as how times are written, or how dates are beside it.
pub(crate) fn are_units(row: &[String]) -> bool {
    let cells = row.iter().map(|cell| bare(cell));
    let texts = cells.filter(|text| !matches!(*text, "" | "-"));
    if texts.clone().any(is_number) {
        return false;
    }
    let (units, others): (Vec<&str>, Vec<&str>) = texts.partition(|text| is_unit(text));
    let has_digit = |text: &&str| text.contains(|c: char| c.is_ascii_digit());
    let of_day = others.iter().any(|text| text.contains(':'));
    let few = others.len() <= 1 + usize::from(of_day) && !others.iter().any(has_digit);
    // Loggers write marks of their own below what is no quantity: `TS`, `RN`, `NO.`, `A1234`.
    let is_mark = |text: &&str| {
        let begins = text.starts_with(|c: char| c.is_alphabetic());
        begins && !has_clock(text) && !text.contains(char::is_whitespace)
    };
    let many = units.len() >= 2 && units.len() >= others.len() && others.iter().all(is_mark);
    !units.is_empty() && (few || many)
}

/// What a logger did with the samples of a column, in small letters: the row of TOA5 below the units.
const PROCESSING: &str = "avg smp max min std tot sum samp mean average sample maximum minimum total med wvc cov mom hst fft last inst txy";

/// Whether a row says what was done with the samples of each column, and nothing else.
pub(crate) fn is_of_processing(row: &[String]) -> bool {
    let known = |cell: &str| {
        PROCESSING
            .split(' ')
            .any(|of| cell.eq_ignore_ascii_case(of))
    };
    let mut cells = row
        .iter()
        .map(|cell| cell.trim())
        .filter(|cell| !cell.is_empty());
    cells.clone().next().is_some() && cells.all(known)
}

/// A unit as a cell says it, without brackets around it, save those that are its own, as of `[m_H2O]`.
pub(crate) fn bare(cell: &str) -> &str {
    let without = |open, close| cell.strip_prefix(open)?.strip_suffix(close);
    match without('[', ']').or_else(|| without('(', ')')) {
        Some(inner) if is_unit(inner) || !is_unit(cell) => inner.trim(),
        _ => cell,
    }
}

/// The unit that a cell says.
pub(crate) fn unit(cell: &str) -> Option<Unit> {
    Unit::in_words(bare(cell))
}

/// Numbers are none, though 1 is the unit of what has no dimension; nor are dates, which read as a product of such.
fn is_unit(text: &str) -> bool {
    let is_of_value = |c: char| c.is_ascii_digit() || "., :/+-".contains(c);
    !is_number(text) && !text.chars().all(is_of_value) && Unit::in_words(text).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_units_is_told_from_one_of_values_and_one_of_names() {
        let are = |row: &str| {
            let row: Vec<String> = row.split(';').map(str::to_owned).collect();
            are_units(&row)
        };
        for row in [
            ";°C;°C;nm",
            "s;degC;degC;mm",
            "[s];[°C];[µm];[-]",
            "hh:mm:ss;(°C);%;",
            "DD.MM.YYYY;[degF];W/m2;-",
            "TT.MM.JJJJ;hh:mm:ss;°C;nm",
            "TS;RN;Deg C;Deg C;um",
            "NO.;Time;ms;degC;degC;um;A1234567890;A1234",
        ] {
            assert!(are(row), "{row}");
        }
        for row in [
            ";;;",
            ";21;nm",
            "0;;A;",
            "2026-03-01 12:00;;A;",
            "01.03.2026;;A;",
            "01.03.2026;;;",
            "Time;Plate;Room;Z",
            ";NaN;nm",
            ";true;nm",
            "2026-03-01T12:00:00Z;on;A;V",
            "Time;Plate;V;A;Room",
        ] {
            assert!(!are(row), "{row}");
        }
    }
}
