//! Rows and cells that a reader does not take, as events for programs.

use athermal_files::{CellFault, FileError};
use serde_json::{Value, json};

use athermal_core::message::Message;

/// What is not taken as it stands: one that has just been read, or the first of so many.
#[must_use]
pub fn message(error: &FileError, count: Option<u64>, words: impl std::fmt::Display) -> Message {
    let (name, mut facts) = facts(error);
    if let Some(place) = error.place() {
        facts["file"] = json!(&*place.file);
        facts["line"] = json!(place.line);
    }
    if let Some(count) = count {
        facts["count"] = json!(count);
    }
    Message::new(name, facts, words)
}

/// Rows that are left out.
pub const ROWS: &str = "refused_rows";
/// Cells that are taken as missing.
const CELLS: &str = "unreadable_cells";

fn facts(error: &FileError) -> (&'static str, Value) {
    match error {
        FileError::TimeNotAfter { time, .. } => {
            (ROWS, json!({ "reason": "time_before", "time": time }))
        }
        FileError::TimeAgain { time, .. } => {
            (ROWS, json!({ "reason": "time_again", "time": time }))
        }
        FileError::TimeLeaps { time, .. } => {
            (ROWS, json!({ "reason": "time_leaps", "time": time }))
        }
        FileError::BadCell {
            column,
            found,
            fault,
            ..
        } => match fault {
            CellFault::NoNumber | CellFault::OtherMark { .. } => {
                (CELLS, json!({ "column": column, "found": found }))
            }
            _ => (
                ROWS,
                json!({ "reason": "time_unreadable", "column": column, "found": found }),
            ),
        },
        FileError::StillRefused { newest, .. } => facts(newest),
        FileError::CellsLacking { .. } => ("short_rows", json!({})),
        FileError::CellBeyond { .. } => ("row_notes", json!({})),
        FileError::HeaderAgain { .. } => ("header_again", json!({})),
        FileError::MissingColumns { missing, .. } => {
            let columns: Vec<_> = missing.iter().map(|of| &of.name).collect();
            ("missing_columns", json!({ "columns": columns }))
        }
        _ => (ROWS, json!({ "reason": "unreadable" })),
    }
}
