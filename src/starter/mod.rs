//! Decides what a starter graph for a log looks like: what each column is, which windows fit, and why; not how a graph runs.

mod clock;
mod column;
mod dates;
mod dropped;
mod group;
mod name;
mod own_times;
mod placeholder;
mod range;
mod spacing;
mod survey;
mod text;
mod texts;
mod undecided;
mod window;

pub use dates::WITHOUT_ZONE;

use std::path::Path;

use athermal::core::document::TableFormat;
use athermal::core::time::TimeFormat;
use athermal::files::{Description, FileError, Format, TimeForm};

use column::Column;
use serde_json::Value;
use survey::Survey;
use window::Choice;

/// What the user asks for, so that it need not be guessed.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// The column that gives the time.
    pub time: Option<String>,
    /// How it is written.
    pub format: Option<TimeFormat>,
    /// The columns that drift.
    pub drifting: Vec<String>,
}

/// A starter graph, and what was found and guessed on the way to it.
#[derive(Debug)]
pub struct Starter {
    /// The graph file.
    pub text: String,
    /// What was found and guessed, a line each.
    pub remarks: Vec<String>,
    /// What each column was taken for, for programs.
    pub columns: Value,
    /// The signal to noise of each drift against its window, for programs.
    pub windows: Value,
}

/// Why there is no starter graph for a log.
#[derive(Debug)]
pub enum NoStarter {
    /// The file cannot be read.
    File(FileError),
    /// It does not hold what a graph needs; the text says what, and what to do.
    Unfit(String),
}

impl From<FileError> for NoStarter {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

/// Looks at a log and writes a graph for it.
///
/// # Errors
/// When the file cannot be read, or nothing in it drifts with something that could explain it.
pub fn starter(path: &Path, request: &Request) -> Result<Starter, NoStarter> {
    let mut described = Description::of(path, 500)?;
    let long = described.long_format();
    if long.is_some() && described.format != Format::Csv {
        return Err(NoStarter::Unfit(
            long.map_or_else(String::new, |long| long.to_string()),
        ));
    }
    if described
        .columns
        .iter()
        .any(|name| name == "Name[2]" || name == "SymbolName[2]")
    {
        return Err(NoStarter::Unfit(TIME_BESIDE_EACH.to_owned()));
    }
    if described.lacks_names() {
        return Err(NoStarter::Unfit(format!(
            "its first line holds numbers, such as `{}`, and no names: write a line with the names of the columns above it, such as \
             time_s,plate_degC,Z_nm",
            described.columns[0]
        )));
    }
    if let Some(why) = too_few(&described) {
        return Err(NoStarter::Unfit(why));
    }
    let mut remarks = Vec::new();
    let clock = clock::find(&described, request.time.as_deref(), request.format.as_ref())
        .map_err(NoStarter::Unfit)?;
    let clock = undecided::decided(path, clock)?;
    remarks.push(clock.remark());
    let decimal = described.decimal(clock.columns.names());
    let is_long = long.is_some();
    if let Some(long) = long {
        described = described.of_long(path, &long, clock.columns.names())?;
        remarks.push(format!(
            "a long layout: `{}` says of each row what its `{}` is; there are {} names",
            long.names,
            long.values,
            described.columns.len() - clock.columns.names().len()
        ));
    }
    let mut columns = column::columns(&described, clock.columns.names());
    if let Some(why) = dropped::newest_first(&described, &clock) {
        return Err(NoStarter::Unfit(why));
    }
    let own_times =
        own_times::refusal(&described, &clock).filter(|_| request.time.is_none() && !is_long);
    if let Some(why) = own_times {
        return Err(NoStarter::Unfit(why));
    }
    let mut table = TableFormat {
        decimal,
        ..described.table.clone()
    };
    let mut survey = Survey::of(path, &clock, &table, &columns)?;
    let names = (&*described.columns, &*columns);
    if let Some((in_segments, column)) = survey.by_segments(path, &clock, &table, names) {
        remarks.push(format!(
            "segments: the times start again where `{column}` changes, {} in all",
            in_segments.segments()
        ));
        (survey, table.segment) = (in_segments, Some(column));
    }
    remarks.extend(survey.dropped.iter().cloned());
    survey.judge(&mut columns);
    let mut dropped = survey.dropped.clone();
    if !dropped.is_empty() && described.format == Format::Csv && !is_long {
        let again = described.next_names(path, clock.columns.names())?;
        dropped.extend(again.map(|(line, names)| {
            format!(
                "at line {line} another table begins, with the columns {}: give each table as a file of its own",
                names.join(", ")
            )
        }));
    }
    let unfit = |why| NoStarter::Unfit([vec![why], dropped.clone()].concat().join("; "));
    column::assign(&mut columns, request).map_err(&unfit)?;
    survey.leave_out_placeholders(&mut columns);
    survey.take_changes(&mut columns, &clock);
    survey.leave_out_slow(&mut columns, &clock, request);
    survey.leave_out_faults(&mut columns);
    remarks.extend(columns.iter().filter_map(|column| column.remark()));
    let choice = Choice::of(&survey, &columns);
    let choice = choice.map_err(|why| match clock.form {
        TimeForm::Numbers { .. } => unfit(format!("{why}; {}", clock.remark())),
        _ => unfit(why),
    })?;
    remarks.extend(choice.remarks(&clock, &columns));
    let columns_taken = columns.iter().map(Column::facts).collect();
    table.lenient = survey.needs_lenience(&columns);
    Ok(Starter {
        text: text::graph(path, (&clock, &table), &columns, &survey, &choice),
        remarks,
        windows: choice.facts(&columns),
        columns: columns_taken,
    })
}

/// What to do with an export of TwinCAT Scope and the like.
const TIME_BESIDE_EACH: &str = "each column has a time of its own beside it, under the name of an attribute, as TwinCAT Scope exports \
     them; export it with one time for all columns";

/// Why a log has too few rows.
fn too_few(described: &Description) -> Option<String> {
    let rows = match described.rows.len() {
        0 => "no row",
        1 => "a single row",
        _ => return None,
    };
    Some(format!(
        "it has {rows} that can be read below the names of its columns ({}); a starter graph is made by what many rows, of hours or \
         days, have in common",
        described.columns.join(", ")
    ))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
