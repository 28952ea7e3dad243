//! Decides what a starter graph for a log looks like: what each column is, which windows fit, and why; not how a graph runs.

mod clock;
mod column;
mod dates;
mod dropped;
mod follows;
mod group;
mod layout;
mod machines;
mod name;
mod own_times;
mod placeholder;
mod range;
mod sensors;
mod spacing;
mod survey;
mod text;
mod texts;
mod time_form;
mod undecided;
mod weighed;
mod window;

pub use dates::WITHOUT_ZONE;

use std::collections::BTreeSet;
use std::path::Path;

use athermal_core::document::{Arrangement, Pattern, TableBase, TableFormat};
use athermal_core::time::TimeFormat;
use athermal_files::{
    Dataset, Description, FileError, Format, LongFormat, Tables, TimeForm, apart,
};

use clock::Clock;
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
    /// The columns that are inputs although they seem to repeat what drifts, or to count.
    pub keep: Vec<String>,
    /// The columns of what a correction applied, beside those that are called so.
    pub applied: Vec<String>,
    /// How the text of the log is laid out, as far as it is declared.
    pub table: TableFormat,
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
    /// What the graph puts out, for people.
    pub outputs: String,
    /// When the last fifth of the log begins, as `--from` and `--to` take it; none where its times start again.
    pub last_fifth: Option<String>,
}

/// Why there is no starter graph for a log.
#[derive(Debug)]
pub enum NoStarter {
    /// The file cannot be read.
    File(FileError),
    /// They do not hold what a graph needs; the text says which and what, and what to do.
    Unfit(String),
}

impl NoStarter {
    fn of(data: &Dataset, why: impl std::fmt::Display) -> Self {
        let names = data.paths().iter().map(|path| path.display().to_string());
        Self::Unfit(format!("{}: {why}", names.collect::<Vec<_>>().join(", ")))
    }
}

impl From<FileError> for NoStarter {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

/// A file, as far as its first rows say what it is.
struct Log {
    name: String,
    /// The names of the files that are laid out as this one.
    pattern: String,
    described: Description,
    clock: Clock,
    /// Columns beside the time that say of rows what they are, and measure nothing.
    aside: Vec<String>,
}

impl Log {
    fn of(
        path: &Path,
        tables: &Tables,
        request: &Request,
        remarks: &mut Vec<String>,
    ) -> Result<Self, NoStarter> {
        let name = path.display().to_string();
        let unfit = |why: String| NoStarter::Unfit(format!("{name}: {why}"));
        let mut described = Description::laid_out(path, 500, &request.table, tables)?;
        let long = match &request.table {
            TableFormat {
                layout: Arrangement::Long,
                name: Some(names),
                value: Some(values),
                ..
            } => Some(LongFormat {
                time: request.time.clone().unwrap_or_default(),
                names: names.clone(),
                values: values.clone(),
            }),
            _ => described.long_format(),
        };
        if let (Some(long), Format::JsonLines) = (&long, described.format) {
            return Err(unfit(long.to_string()));
        }
        if let Some(why) = no_table(&described) {
            return Err(unfit(why));
        }
        let (time, format) = (request.time.as_deref(), request.format.as_ref());
        let of_one = long.as_ref().map(|long| of_one_name(&described, long));
        let of_one = of_one.as_ref().filter(|of| of.rows.len() > 2);
        let clock = clock::find(of_one.unwrap_or(&described), time, format).map_err(unfit)?;
        let clock = undecided::decided(path, tables, clock)?;
        let times = clock.columns.names();
        let decimal = request.table.decimal.or_else(|| described.decimal(times));
        described.table.decimal = decimal;
        if let Some(long) = &long {
            described = described.of_long(path, long, times)?;
            remarks.push(format!(
                "a long layout: `{}` says of each row what its `{}` is; there are {} names",
                long.names,
                long.values,
                described.columns.len() - times.len()
            ));
        }
        let own_times = || own_times::refusal(&described, &clock);
        let own_times = (time.is_none() && long.is_none()).then(own_times).flatten();
        if let Some(why) = dropped::newest_first(&described, &clock).or(own_times) {
            return Err(unfit(why));
        }
        let table = &request.table;
        let is_declared = table.machine.is_some() || table.segment.is_some() || long.is_some();
        let machines = || machines::column(path, tables, &described, &clock);
        if let Some((column, remark)) = (!is_declared).then(machines).flatten() {
            remarks.push(remark);
            described.table.machine = Some(column);
        }
        let file = path.file_name().unwrap_or_default();
        Ok(Self {
            pattern: file.to_string_lossy().into_owned(),
            aside: described.table.machine.iter().cloned().collect(),
            name,
            described,
            clock,
        })
    }

    /// The columns that measure nothing: those of the time, and others beside it.
    fn beside(&self) -> Vec<String> {
        [self.clock.columns.names(), &self.aside].concat()
    }

    /// Whether its time is read by a graph that declares this one.
    fn is_found_by(&self, clock: &Clock, tables: &Tables) -> bool {
        let own = &self.clock;
        let is_form = match &clock.form {
            TimeForm::Format(form) if own.others.contains(form) => true,
            form => own.form == *form,
        };
        let found = || athermal_files::other_time(Path::new(&self.name), &clock.column(), tables);
        own.zone == clock.zone && own.columns == clock.columns && is_form
            || own.zone.is_none()
                && found().is_some_and(|of| of.columns == own.columns && of.form == own.form)
    }
}

/// The rows of the first name in a long layout: of these the times advance, where those of many names stand still.
fn of_one_name(described: &Description, long: &LongFormat) -> Description {
    let at = described.columns.iter().position(|of| *of == long.names);
    let name = |row: &Vec<String>| at.and_then(|at| row.get(at).cloned());
    let first = described.rows.first().and_then(name);
    let rows = described.rows.iter().filter(|row| name(row) == first);
    Description {
        rows: rows.cloned().collect(),
        ..described.clone()
    }
}

/// The clock of the graph: one of which rows have decided the form, where some have, and by which the others are found.
fn one_clock(logs: &[Log], tables: &Tables) -> Result<Clock, NoStarter> {
    let misfit = |by: &&Log| logs.iter().find(|of| !of.is_found_by(&by.clock, tables));
    let mut decided: Vec<&Log> = logs.iter().collect();
    decided.sort_by_key(|log| !log.clock.others.is_empty());
    if let Some(log) = decided.iter().find(|log| misfit(log).is_none()) {
        return Ok(Clock {
            lacks_zone: logs.iter().any(|log| log.clock.lacks_zone),
            ..log.clock.clone()
        });
    }
    let two = decided.iter().take(1).copied().chain(misfit(&decided[0]));
    let two = two.map(|log| format!("{} has {}", log.name, log.clock.remark()));
    Err(NoStarter::Unfit(format!(
        "a graph has one time, and in other files one column of dates that rise is found as it writes them, as RFC 3339 does, or in \
         numbers since 1970: {}; write them alike",
        two.collect::<Vec<_>>().join("; ")
    )))
}

/// The layout of each file.
fn tables(logs: &[Log]) -> TableBase {
    let base = &logs[0].described.table;
    if logs.iter().all(|log| log.described.table == *base) {
        return TableBase {
            base: base.clone(),
            files: Vec::new(),
        };
    }
    let mut known = BTreeSet::new();
    let logs = logs.iter().filter(|log| known.insert(&log.pattern));
    let file = |log: &Log| (Pattern::new(&log.pattern), log.described.table.clone());
    TableBase {
        base: TableFormat::default(),
        files: logs.map(file).collect(),
    }
}

/// Looks at logs and writes a graph for them.
///
/// # Errors
/// When a file cannot be read, they are not one recording, or nothing in them drifts with something that could explain it.
pub fn starter(data: &Dataset, request: &Request) -> Result<Starter, NoStarter> {
    let mut remarks = Vec::new();
    let logs = data.paths().iter();
    let logs = logs.map(|path| Log::of(path, data.tables(), request, &mut remarks));
    let mut logs: Vec<Log> = logs.collect::<Result<_, _>>()?;
    remarks.extend(sensors::named_apart(&mut logs, data)?);
    let clock = one_clock(&logs, data.tables())?;
    remarks.insert(0, clock.remark());
    let is_other =
        |of: &Clock| of.columns != clock.columns || of.form != clock.form && of.others.is_empty();
    for log in logs.iter().filter(|log| is_other(&log.clock)) {
        remarks.push(format!("{}: its {}", log.name, log.clock.remark()));
    }
    let times: Vec<String> = logs.iter().flat_map(Log::beside).collect();
    let columns_of = |log: &Log| (log.name.clone(), log.described.columns.clone());
    let apart = apart(&logs.iter().map(columns_of).collect::<Vec<_>>(), &times);
    let mut known: BTreeSet<String> = apart.keys().cloned().collect();
    let columns = |log: &Log| column::columns(&log.described, &log.beside());
    let columns = logs.iter().flat_map(columns);
    let is_new = |of: &Column| of.name.is_empty() || known.insert(of.name.clone());
    let mut columns: Vec<Column> = columns.filter(is_new).collect();
    let mut tables = tables(&logs);
    let survey = Survey::of(data, &clock, &tables, &columns);
    let mut survey = survey.map_err(|error| match error {
        NoStarter::File(FileError::Merge(apart)) => {
            let logs = logs.iter().zip(data.paths());
            let logs: Vec<_> = logs.map(|(log, path)| (&**path, &log.clock)).collect();
            match undecided::exchanged(&logs, data.tables()) {
                Some((path, format)) => NoStarter::Unfit(format!(
                    "{apart} With day and month exchanged the times of {} overlap those of the others: as `--time-format \"{format}\"` reads \
                     them. A graph has one form of time: write the dates of both alike",
                    path.display()
                )),
                None => NoStarter::File(FileError::Merge(apart)),
            }
        }
        other => other,
    })?;
    let mut again = None;
    for (log, path) in logs.iter().zip(data.paths()) {
        let is_long = log.described.table.layout == Arrangement::Long;
        let is_table = log.described.format == Format::Csv && !is_long;
        if is_table && again.is_none() && !survey.dropped.is_empty() {
            again = log.described.next_names(path, log.clock.columns.names())?;
        }
    }
    let names = columns
        .iter()
        .map(|column| &column.name)
        .chain(apart.keys());
    let names: Vec<&String> = names.collect();
    if again.is_none()
        && let Some((in_segments, by_segments, column)) =
            survey.by_segments(data, &clock, &tables, (&names, &columns))
    {
        let how = match clock.columns.names().contains(&column) {
            true => "by themselves, as after a reboot".to_owned(),
            false => format!("where `{column}` changes"),
        };
        remarks.push(format!(
            "segments: the times start again {how}, {} in all",
            in_segments.segments
        ));
        (survey, tables) = (in_segments, by_segments);
        let of_segments = columns.iter_mut().find(|of| of.name == column);
        if let Some(column) = of_segments {
            column.leave_out("it says which segment a row is of");
        }
    }
    remarks.extend(survey.dropped.iter().cloned());
    survey.judge(&mut columns, &request.keep);
    let mut dropped = survey.dropped.clone();
    dropped.extend(again.map(|(line, names)| {
        format!(
            "at line {line} another table begins, with the columns {}: give each table as a file of its own",
            names.join(", ")
        )
    }));
    let apart = apart
        .iter()
        .map(|(name, why)| format!("{name}: left out, {why}"));
    let apart: Vec<String> = apart.collect();
    dropped.extend(apart.iter().cloned());
    let unfit = |why| NoStarter::of(data, [vec![why], dropped.clone()].concat().join("; "));
    column::assign(&mut columns, request).map_err(&unfit)?;
    survey.leave_out_placeholders(&mut columns);
    survey.take_back(&columns);
    survey.take_changes(&mut columns, &clock);
    survey.leave_out_slow(&mut columns, &clock, request);
    survey.leave_out_faults(&mut columns);
    survey.hold_rare(&mut columns);
    follows::leave_out(&survey, &mut columns, &request.keep);
    remarks.extend(columns.iter().filter_map(|column| column.remark()));
    remarks.extend(apart);
    let choice = Choice::of(&survey, &columns);
    let choice = choice.map_err(|why| match clock.form {
        TimeForm::Numbers { .. } => unfit(format!("{why}; {}", clock.remark())),
        _ => unfit(why),
    })?;
    remarks.extend(choice.remarks(&clock, &columns));
    let columns_taken = columns.iter().map(Column::facts).collect();
    tables.base.lenient |= survey.needs_lenience(&columns);
    Ok(Starter {
        text: text::graph(data.paths(), (&clock, &tables), &columns, &survey, &choice),
        remarks,
        outputs: choice.outputs(&clock),
        last_fifth: survey.period_ns.and_then(|of| clock.last_fifth(of)),
        windows: choice.facts(&columns),
        columns: columns_taken,
    })
}

/// What to do with an export of TwinCAT Scope and the like.
const TIME_BESIDE_EACH: &str = "each column has a time of its own beside it, under the name of an attribute, as TwinCAT Scope exports \
     them; export it with one time for all columns";

/// Why a log is no table of many rows with one time.
fn no_table(described: &Description) -> Option<String> {
    let mut names = described.columns.iter();
    if names.any(|name| name == "Name[2]" || name == "SymbolName[2]") {
        return Some(TIME_BESIDE_EACH.to_owned());
    }
    if described.lacks_names() {
        return Some(format!(
            "its first line holds numbers, such as `{}`, and no names: write a line with the names of the columns above it, such as \
             time_s,plate_degC,Z_nm",
            described.columns[0]
        ));
    }
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
