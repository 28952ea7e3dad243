//! What a format gives of each row; not what becomes of it.

use crate::ledger::Ledger;
use crate::{FileError, Place};

/// The values of the channels of a row, and the texts that are no numbers, by their channels.
pub(crate) type Numbers<'a> = (&'a [f64], &'a [(usize, String)]);

/// Cells of the current row, whatever the format.
pub(crate) trait Cells {
    /// Goes to the next whole row; false at the end.
    fn advance(&mut self, ledger: &mut Ledger) -> Result<bool, FileError>;
    /// The cell of a column of the time.
    fn time(&self, column: usize) -> &[u8];
    /// The cell of a channel of the layout; empty if there is none.
    fn channel(&self, index: usize) -> &[u8];
    fn place(&self) -> Place;
    /// The instant in ns since 1970, whether it is one of UTC, and its text, where the format has instants.
    fn instant(&self) -> Option<(i64, bool, &str)> {
        None
    }
    /// The values of the channels, where the format has numbers.
    fn numbers(&self) -> Option<Numbers<'_>> {
        None
    }
    /// Takes the columns from here on as the current row names them, if that is what it does.
    fn take_header(&mut self, _ledger: &mut Ledger) -> Result<bool, FileError> {
        Ok(false)
    }
}
