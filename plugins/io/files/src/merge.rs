//! Files of several loggers as one recording: which of them are one log, and their rows in the order of time. Not how a log is read.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use crate::columns;
use crate::error::quoted;
use crate::joined;
use crate::recording::is_dated;
use crate::{
    ChannelColumn, Event, FileError, Layout, MissingColumn, Options, Reader, Recording, Report,
    Row, other_time,
};

/// Why files are not one recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MergeError {
    /// No file has a column that must be there.
    InNoFile {
        /// The files.
        files: Vec<String>,
        /// The columns, with what they may be called.
        missing: Vec<MissingColumn>,
        /// The pattern of the files in which a column is renamed to one of them, that column, and that one.
        renamed: Option<(String, String, String)>,
    },
    /// No file has all columns, and some stand in two.
    InTwoFiles {
        /// The column.
        column: String,
        /// Two files that have it.
        files: [String; 2],
    },
    /// Files have different columns, and times that are no dates.
    Undated {
        /// A file of each log; the first has no dates.
        files: [String; 2],
        /// Whether the second has.
        is_dated: bool,
    },
    /// `--merge` was given for files of the same columns.
    SameColumns {
        /// A column that two of them have.
        column: String,
        /// These files.
        files: [String; 2],
    },
    /// A log begins after the others have ended.
    Apart {
        /// Its first file.
        file: String,
        /// Its first time.
        begins: String,
        /// The last file before.
        before: String,
        /// The last time of that.
        ends: String,
    },
    /// The times of a log start again, and so cannot be set beside those of another.
    StartsAgain {
        /// The first file of the log.
        file: String,
        /// The time of the row.
        time: String,
        /// The time before.
        previous: String,
    },
    /// Logs have different numbers of segments.
    Segments {
        /// The first file of each of two logs, and how many segments it has.
        of: [(String, u64); 2],
    },
}

impl fmt::Display for MergeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InNoFile {
                files,
                missing,
                renamed,
            } => {
                let names = quoted(missing.iter().map(|of| of.name.as_str()));
                write!(f, "{}: no file has a column {names}", files.join(", "))?;
                for of in missing {
                    if let Some(nearest) = &of.nearest {
                        write!(f, "; did you mean `{nearest}` for `{}`?", of.name)?;
                    }
                }
                renamed.iter().try_for_each(|(named, from, to)| {
                    write!(f, "; `{to}` is `{from}` of files named `{named}` by `[[table.files]]`: is a file or its column called otherwise?")
                })
            }
            Self::InTwoFiles {
                column,
                files: [one, other],
            } => write!(
                f,
                "the column `{column}` stands in {one} and in {other}, of which neither has all columns that the graph reads; logs are merged by \
                 time where each column stands in one of them: rename it in one log"
            ),
            Self::Undated {
                files: [one, other],
                is_dated: true,
            } => write!(
                f,
                "{one} counts its times and {other} has dates; add the instant at which the one began, in seconds since 1970: \
                 `--offset {one}=1772409600s`"
            ),
            Self::Undated {
                files: [one, other],
                is_dated: false,
            } => write!(
                f,
                "{one} and {other} have different columns, and their times are no dates; give `--merge` if both count from the same instant"
            ),
            Self::SameColumns {
                column,
                files: [one, other],
            } => write!(
                f,
                "`--merge` joins logs of different columns, and `{column}` stands in {one} and in {other}; leave it out to read one after the other"
            ),
            Self::Apart {
                file,
                begins,
                before,
                ends,
            } => write!(
                f,
                "{file} begins at `{begins}`, after {before} ends at `{ends}`; logs of different columns are merged where their times overlap: \
                 do their clocks differ (`--offset {file}=-1h` sets its times back by an hour)?"
            ),
            Self::StartsAgain {
                file,
                time,
                previous,
            } => write!(
                f,
                "{file}: its times start again, `{time}` after `{previous}`, so they cannot be set beside those of another log; give the files \
                 whose times overlap in calls of their own"
            ),
            Self::Segments {
                of: [(one, n), (other, of_other)],
            } => write!(
                f,
                "{one} has {n} segments and {other} has {of_other}; logs are merged segment by segment, so both need as many"
            ),
        }
    }
}

impl From<MergeError> for FileError {
    fn from(error: MergeError) -> Self {
        Self::Merge(Box::new(error))
    }
}

/// Files as the graph reads them: one log, or several beside each other.
pub enum Joint {
    /// One file after the other.
    One(Box<Recording>),
    /// Logs of different columns.
    Several(Merge),
}

impl Joint {
    /// Opens each file once to see its columns, and joins or merges them.
    ///
    /// # Errors
    /// As for [`Recording::join`], and where logs of different columns are not one recording.
    pub fn open(paths: &[PathBuf], layout: Layout, options: Options) -> Result<Self, FileError> {
        let options = with_times(paths, &layout, options);
        let logs = match paths {
            [_] | [] => Vec::new(),
            _ if paths.iter().any(|path| path == Path::new("-")) => {
                return Err(FileError::StandardInputInList);
            }
            _ => logs(paths, &layout, &options)?,
        };
        if logs.len() < 2 {
            let joined = Recording::join(paths, layout, options)?;
            return Ok(Self::One(Box::new(joined)));
        }
        Merge::open(paths, logs, &layout, &options).map(Self::Several)
    }

    /// Goes on to what comes next, with `row` filled if it is a row.
    ///
    /// # Errors
    /// As for [`Recording::next_into`], and where logs are not beside each other.
    pub fn next_into(&mut self, row: &mut Row) -> Result<Event, FileError> {
        match self {
            Self::One(recording) => recording.next_into(row),
            Self::Several(merge) => merge.next_into(row),
        }
    }

    /// The files read to their end so far, and what was met in each.
    pub fn reports(&self) -> Vec<(String, Report)> {
        match self {
            Self::One(recording) => recording.reports().to_vec(),
            Self::Several(merge) => merge.reports(),
        }
    }
}

/// The same with the times of those files that have another than the layout says.
fn with_times(paths: &[PathBuf], layout: &Layout, mut options: Options) -> Options {
    let of_several = paths.iter().filter(|_| paths.len() > 1);
    let times = of_several.filter_map(|path| {
        Some((
            path.clone(),
            other_time(path, &layout.time, &options.tables)?,
        ))
    });
    options.times = times.collect();
    options
}

/// What a file has of what is wanted.
struct Content {
    name: String,
    columns: BTreeSet<String>,
    /// Whether it has a column that is declared for segments or machines.
    has_segments: bool,
    /// All its names, for messages.
    names: Vec<String>,
}

impl Content {
    /// Reads as far as is needed to know: of a table the names, of other forms until all columns were there.
    fn of(path: &Path, layout: &Layout, options: &Options) -> Result<Self, FileError> {
        let mut wanted = layout.clone();
        wanted.channels.iter_mut().for_each(|of| of.optional = true);
        let table = layout.table_of(path);
        let apart = [table.segment.clone(), table.machine.clone()];
        wanted.without_segments();
        let apart = apart.into_iter().flatten();
        wanted.channels.extend(apart.map(|column| ChannelColumn {
            column,
            optional: true,
            is_instant: false,
        }));
        let mut reader = Reader::open(path, wanted, options.clone())?;
        let mut row = Row::default();
        while !reader.has_names() && !reader.present().iter().all(|of| *of) {
            if !reader.next_into(&mut row)? {
                break;
            }
        }
        let mut present = reader.present();
        let has_segments = present.split_off(layout.channels.len()).contains(&true);
        let columns = layout.channels.iter().zip(present);
        let columns = columns.filter(|(_, is_there)| *is_there);
        Ok(Self {
            name: path.display().to_string(),
            columns: columns.map(|(of, _)| of.column.clone()).collect(),
            has_segments,
            names: reader.names(),
        })
    }
}

/// Files that have a column in common, and what all of them have.
struct Log {
    paths: Vec<PathBuf>,
    columns: BTreeSet<String>,
    has_segments: bool,
}

/// The logs that files are of; fewer than two where they are read one after the other.
fn logs(paths: &[PathBuf], layout: &Layout, options: &Options) -> Result<Vec<Log>, FileError> {
    let files = paths.iter().map(|path| Content::of(path, layout, options));
    let files: Vec<Content> = files.collect::<Result<_, _>>()?;
    let mut logs: Vec<Log> = Vec::new();
    for (path, file) in paths.iter().zip(&files) {
        let mut log = Log {
            paths: Vec::new(),
            columns: file.columns.clone(),
            has_segments: file.has_segments,
        };
        let shares = |of: &mut Log| !of.columns.is_disjoint(&file.columns);
        for mut of in logs.extract_if(.., shares) {
            log.columns.append(&mut of.columns);
            log.paths.append(&mut of.paths);
            log.has_segments |= of.has_segments;
        }
        log.paths.push(path.clone());
        logs.push(log);
    }
    let needed = |of: &BTreeSet<String>| {
        let mut required = layout.channels.iter().filter(|channel| !channel.optional);
        required.all(|channel| of.contains(&channel.column))
    };
    let some_complete = files.iter().any(|file| needed(&file.columns));
    let pair = |column: &String| {
        let mut with = files.iter().filter(|file| file.columns.contains(column));
        Some([with.next()?.name.clone(), with.next()?.name.clone()])
    };
    let mut columns = logs.iter().flat_map(|log| &log.columns);
    let in_two = columns.find_map(|column| Some((column.clone(), pair(column)?)));
    let all: BTreeSet<String> = logs.iter().flat_map(|log| log.columns.clone()).collect();
    let differ = files.iter().any(|file| file.columns != files[0].columns);
    if !some_complete && differ {
        let missing = layout.channels.iter();
        let missing = missing.filter(|of| !of.optional && !all.contains(&of.column));
        let missing: Vec<&str> = missing.map(|of| of.column.as_str()).collect();
        if !missing.is_empty() {
            let names: Vec<String> = files.iter().flat_map(|file| file.names.clone()).collect();
            let renamed = layout.table.files.iter().find_map(|(named, table)| {
                let (from, to) = table
                    .rename
                    .iter()
                    .find(|(_, to)| missing.contains(&to.as_str()))?;
                Some((named.to_string(), from.clone(), to.clone()))
            });
            return Err(MergeError::InNoFile {
                renamed,
                files: files.into_iter().map(|file| file.name).collect(),
                missing: columns::nearest(missing, &names),
            }
            .into());
        }
        if let ([_], Some((column, files))) = (&*logs, &in_two) {
            let (column, files) = (column.clone(), files.clone());
            return Err(MergeError::InTwoFiles { column, files }.into());
        }
    }
    if let ([_], true, Some((column, files))) = (&*logs, options.merge, in_two) {
        return Err(MergeError::SameColumns { column, files }.into());
    }
    // A file without any column that is read is refused, or passed over, as where it stands alone.
    let apart = options.segments || logs.iter().any(|log| log.columns.is_empty());
    Ok(if apart { Vec::new() } else { logs })
}

/// The files of each log, where there are several; else none.
pub(crate) fn logs_of(
    paths: &[PathBuf],
    layout: &Layout,
    options: &Options,
) -> Result<Vec<Vec<PathBuf>>, FileError> {
    let logs = match paths {
        [] | [_] => Vec::new(),
        _ => logs(paths, layout, &with_times(paths, layout, options.clone()))?,
    };
    let several = (logs.len() > 1).then_some(logs);
    let files = several.into_iter().flatten().map(|log| log.paths);
    Ok(files.collect())
}

/// The rows of several logs in the order of time, each file open once, with one row of each log in memory.
///
/// Rows of one time are one. Where times are dates, a segment of one log is one of all. Where they are not, or logs are of several machines, segments are set beside
/// each other in their order.
pub struct Merge {
    logs: Vec<OpenLog>,
    order: Vec<String>,
    dated: bool,
    section: u64,
    last: Option<(i64, String)>,
    /// The log of the last row, for messages.
    last_of: usize,
    /// Whether the break before the next row was given.
    broke: bool,
}

/// One of the logs.
struct OpenLog {
    name: String,
    recording: Recording,
    /// Its next row; nothing before it was read and after the end.
    row: Option<Row>,
    spare: Row,
    /// How many segments of it have begun after the first.
    section: u64,
    /// Whether the next row is the first of its segment.
    begins: bool,
    has_ended: bool,
    has_begun: bool,
}

impl OpenLog {
    fn fill(&mut self) -> Result<(), FileError> {
        while self.row.is_none() && !self.has_ended {
            match self.recording.next_into(&mut self.spare)? {
                Event::Row => self.row = Some(std::mem::take(&mut self.spare)),
                Event::Segment => {
                    self.section += 1;
                    self.begins = true;
                }
                Event::End => self.has_ended = true,
            }
        }
        Ok(())
    }
}

impl Merge {
    fn open(
        paths: &[PathBuf],
        logs: Vec<Log>,
        layout: &Layout,
        options: &Options,
    ) -> Result<Self, FileError> {
        let some_segments = logs.iter().any(|log| log.has_segments);
        let mut open = Vec::with_capacity(logs.len());
        for log in logs {
            let mut own = layout.clone();
            let others = own.channels.iter_mut();
            let others = others.filter(|of| !log.columns.contains(&of.column));
            others.for_each(|of| of.optional = true);
            if some_segments && !log.has_segments {
                own.without_segments();
            }
            let mut log = OpenLog {
                name: log.paths[0].display().to_string(),
                recording: Recording::join(&log.paths, own, options.clone())?,
                row: None,
                spare: Row::default(),
                section: 0,
                begins: false,
                has_ended: false,
                has_begun: false,
            };
            log.fill()?;
            open.push(log);
        }
        let is_dated = |log: &OpenLog| {
            let row = log.row.as_ref();
            row.is_none_or(|row| is_dated(log.recording.form(), row.time_ns))
        };
        let (dates, counts): (Vec<_>, Vec<_>) = open.iter().partition(|log| is_dated(log));
        let of_machines = |log: &OpenLog| log.recording.is_of_several();
        let dated = counts.is_empty() && !open.iter().any(of_machines);
        if !counts.is_empty() && !options.merge {
            let is_dated = !dates.is_empty();
            let files = [
                counts[0],
                dates.first().unwrap_or(&counts[counts.len() - 1]),
            ]
            .map(|log| log.name.clone());
            return Err(MergeError::Undated { files, is_dated }.into());
        }
        Ok(Self {
            logs: open,
            order: paths
                .iter()
                .map(|path| path.display().to_string())
                .collect(),
            dated,
            section: 0,
            last: None,
            last_of: 0,
            broke: false,
        })
    }

    fn next_into(&mut self, row: &mut Row) -> Result<Event, FileError> {
        let dated = self.dated;
        let key = |log: &OpenLog| {
            let section = if dated { 0 } else { log.section };
            Some((section, log.row.as_ref()?.time_ns))
        };
        let next = self.logs.iter().enumerate();
        let next = next.filter_map(|(nth, log)| Some((key(log)?, nth))).min();
        let Some((at, nth)) = next else {
            return self.end();
        };
        let log = &self.logs[nth];
        if log.section > self.section && !self.broke {
            self.broke = true;
            return Ok(Event::Segment);
        }
        self.check(nth)?;
        self.broke = false;
        let mut is_first = true;
        for log in &mut self.logs {
            if key(log) != Some(at) {
                continue;
            }
            self.section = self.section.max(log.section);
            (log.has_begun, log.begins) = (true, false);
            if let Some(read) = log.row.take() {
                match std::mem::take(&mut is_first) {
                    true => {
                        let old = std::mem::replace(row, read);
                        log.spare = old;
                    }
                    false => {
                        // Each column stands in one log.
                        joined::join(&mut row.values, &read.values);
                        log.spare = read;
                    }
                }
            }
            log.fill()?;
        }
        row.begins_segment = false;
        let (last_ns, text) = self.last.get_or_insert_default();
        *last_ns = row.time_ns;
        text.clone_from(&row.time_text);
        self.last_of = nth;
        Ok(Event::Row)
    }

    /// Refuses a log that begins after the others, or whose times start again.
    fn check(&self, nth: usize) -> Result<(), FileError> {
        let (log, Some((last_ns, previous))) = (&self.logs[nth], &self.last) else {
            return Ok(());
        };
        let Some(row) = &log.row else {
            return Ok(());
        };
        let goes_on = |log: &OpenLog| log.has_begun && log.row.is_some();
        if !log.has_begun && !self.logs.iter().any(goes_on) {
            return Err(MergeError::Apart {
                file: log.name.clone(),
                begins: row.time_text.clone(),
                before: self.logs[self.last_of].name.clone(),
                ends: previous.clone(),
            }
            .into());
        }
        if self.dated && log.begins && row.time_ns <= *last_ns {
            return Err(MergeError::StartsAgain {
                file: log.name.clone(),
                time: row.time_text.clone(),
                previous: previous.clone(),
            }
            .into());
        }
        Ok(())
    }

    fn end(&self) -> Result<Event, FileError> {
        let counted = |log: &&OpenLog| !self.dated || log.section > 0;
        let mut logs = self.logs.iter().filter(counted);
        let Some(first) = logs.next() else {
            return Ok(Event::End);
        };
        match logs.find(|log| log.section != first.section) {
            Some(other) => {
                let of = [first, other].map(|log| (log.name.clone(), log.section + 1));
                Err(MergeError::Segments { of }.into())
            }
            None => Ok(Event::End),
        }
    }

    fn reports(&self) -> Vec<(String, Report)> {
        let all = self.logs.iter().flat_map(|log| log.recording.reports());
        let mut all: Vec<(String, Report)> = all.cloned().collect();
        let places = self.order.iter().enumerate();
        let places: BTreeMap<&String, usize> = places.map(|(at, name)| (name, at)).collect();
        all.sort_by_key(|(name, _)| places.get(name).copied());
        all
    }
}

#[cfg(test)]
mod tests;
