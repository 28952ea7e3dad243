//! Decides whether a point in whole numbers may be a mark between thousands: `67`, `-990`, `-1.032`. Not what such numbers are.

use std::path::Path;

use athermal::files::{Description, FileError};

use super::column::{Column, Kind};
use super::survey::{Series, Survey};

/// What a column's texts are.
#[derive(Default)]
struct Texts {
    whole: u64,
    first: Option<String>,
    otherwise: bool,
}

impl Texts {
    fn push(&mut self, text: &str) {
        let digits = text.trim_start_matches(['-', '+']);
        let are_digits = |digits: &str| digits.bytes().all(|b| b.is_ascii_digit());
        match digits.split_once('.') {
            _ if text.is_empty() => {}
            None if are_digits(digits) => self.whole += 1,
            Some((whole, fraction))
                if fraction.len() == 3
                    && (1..=3).contains(&whole.len())
                    && !whole.starts_with('0')
                    && are_digits(whole)
                    && are_digits(fraction) =>
            {
                self.first.get_or_insert_with(|| text.to_owned());
            }
            _ => self.otherwise = true,
        }
    }
}

/// Whether the numbers could be such as a mark between thousands leaves: three digits behind a point, or none and below 1000.
fn could_be(series: &Series) -> bool {
    let is_whole = |value: f64| value.fract() == 0.0;
    let wholes = series
        .values
        .iter()
        .filter(|value| is_whole(**value))
        .count();
    let fits = |&value: &f64| {
        let thousands = value * 1000.0;
        value.abs() < 1000.0
            && (is_whole(value)
                || value.abs() > 1.0 && (thousands - thousands.round()).abs() < 1e-6)
    };
    wholes > 0 && wholes < series.values.len() && series.values.iter().all(fits)
}

impl Survey {
    /// Tells of columns of whole numbers in which points stand as marks between thousands do.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn tell_of_thousands(
        &self,
        path: &Path,
        described: &Description,
        columns: &mut [Column],
    ) -> Result<(), FileError> {
        if described.delimiter.is_none_or(|between| between == b',') {
            return Ok(());
        }
        let pairs = self.series.iter().zip(columns);
        let pairs =
            pairs.filter(|(series, column)| column.kind != Kind::Unused && could_be(series));
        let mut doubtful: Vec<(usize, &mut Column, Texts)> = pairs
            .filter_map(|(_, column)| {
                let mut names = described.columns.iter();
                let at = names.position(|name| *name == column.name)?;
                Some((at, column, Texts::default()))
            })
            .collect();
        if doubtful.is_empty() {
            return Ok(());
        }
        Description::each_row(path, |row| {
            for (at, _, texts) in &mut doubtful {
                row.get(*at).into_iter().for_each(|text| texts.push(text));
            }
        })?;
        for (_, column, texts) in doubtful {
            if let Some(first) = texts.first.filter(|_| !texts.otherwise && texts.whole > 0) {
                column.warn(format!(
                    "it has whole numbers and such as `{first}`, all with three digits behind the point: if that is a mark between \
                     thousands, write the numbers without it, since `{first}` is read as a fraction"
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_before_three_digits_beside_whole_numbers_may_stand_between_thousands() {
        for (texts, may) in [
            (&["67", "-990", "-1.032", ""][..], true),
            (&["67", "1.032", "1.5"], false),
            (&["67", "0.032"], false),
            (&["67", "1"], false),
            (&["1.032", "2.100"], false),
        ] {
            let mut of = Texts::default();
            texts.iter().for_each(|text| of.push(text));
            assert_eq!(
                of.first.is_some() && of.whole > 0 && !of.otherwise,
                may,
                "{texts:?}"
            );
        }
    }
}
