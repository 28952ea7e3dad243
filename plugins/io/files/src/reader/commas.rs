//! Where a comma is a decimal mark, by what is declared and what separates cells.

use athermal_core::document::{DecimalMark, TableFormat};

/// Where `1,5` is a number.
#[derive(Clone, Copy)]
pub(super) struct Commas {
    /// In times.
    pub(super) times: bool,
    /// In values.
    pub(super) values: bool,
}

impl Commas {
    pub(super) fn of(table: &TableFormat, separator: Option<u8>) -> Self {
        let found = separator.is_some_and(|separator| separator != b',');
        Self {
            times: found || table.decimal == Some(DecimalMark::Comma),
            values: match table.decimal {
                Some(mark) => mark == DecimalMark::Comma,
                None => found,
            },
        }
    }
}
