//! Recorded data on the command line: how files are named, and the warnings after reading them.

mod cards;
mod offset;

use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::OnceLock;

use athermal::core::compile::Plan;
use athermal::core::document::GraphFile;
use athermal::files::{Dataset, FileError, Format, Options, Report, is_in_memory, recordings_in};
use athermal::run::model::DataCard;
use athermal::run::recording::ThinnedChannels;
use athermal::serve::journal::JournalRecording;
use athermal::{Duration, Model};
use clap::Args;
use clap::builder::TypedValueParser;
use serde_json::json;

use super::refused;
use crate::invocation::{program, quoted};
use crate::meant::recording;
use crate::message::Message;
use crate::starter::WITHOUT_ZONE;
use crate::terminal::{Failure, outside};
use athermal_analysis::figures::{DATES_S, count, counted, instant};
use athermal_command::findings;
use athermal_fleet::RowsId;
use athermal_fleet::job::Times;
use offset::{offset, offsets};

/// Recorded data.
#[derive(Debug, Args, Deserialize, JsonSchema)]
pub struct Data {
    /// CSV or JSON lines, or a folder of them; several files of one clock are joined in the order of time; those whose times start again are segments, in the order given; files of different columns whose times overlap are merged by time; `journal:FOLDER` is what a service took, by its state folder, alone
    #[arg(long = "data", short = 'd', required = true, num_args = 1.., value_name = "FILE", value_parser = recording().map(Given::from))]
    #[serde(rename = "data")]
    #[schemars(with = "Vec<String>")]
    given: Vec<Given>,
    /// Take cells and rows that cannot be read as missing, and count them
    #[arg(long)]
    #[serde(default)]
    lenient: bool,
    #[command(flatten)]
    #[serde(flatten)]
    reading: Reading,
    #[command(flatten)]
    #[serde(flatten)]
    times: Times,
    #[arg(skip)]
    #[serde(skip)]
    thinned: OnceLock<Vec<ThinnedChannels>>,
}

/// A file, or the files of a folder, by the name that was given.
#[derive(Debug, Clone, Deserialize)]
#[serde(from = "PathBuf")]
struct Given {
    name: PathBuf,
    files: Vec<PathBuf>,
}

impl From<PathBuf> for Given {
    fn from(name: PathBuf) -> Self {
        let mut files = match is_in_memory(&name) {
            true => Vec::new(),
            false => recordings_in(&name),
        };
        if files.is_empty() {
            files.push(name.clone());
        }
        Self { name, files }
    }
}

/// How several files are read as one recording.
#[derive(Debug, Clone, Default, Args, Deserialize, JsonSchema)]
pub struct Reading {
    /// Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it
    #[arg(long)]
    #[serde(default)]
    segments: bool,
    /// Merge files of different columns by time although their times are no dates: all of them count from one instant
    #[arg(long, conflicts_with = "segments")]
    #[serde(default)]
    merge: bool,
    /// Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates it
    #[arg(long = "offset", value_name = "FILE=TIME", value_parser = offset)]
    #[serde(default, rename = "offset", deserialize_with = "offsets")]
    #[schemars(with = "Vec<String>")]
    offsets: Vec<(PathBuf, Duration)>,
}

/// The state folder of a service whose journal `journal:FOLDER` names.
fn journal_of(path: &Path) -> Option<PathBuf> {
    let folder = path.to_str()?.strip_prefix("journal:")?;
    Some(PathBuf::from(folder))
}

impl Data {
    /// These files.
    #[must_use]
    pub fn of(files: Vec<PathBuf>, reading: Reading) -> Self {
        Self {
            given: files.into_iter().map(Given::from).collect(),
            lenient: false,
            reading,
            times: Times::default(),
            thinned: OnceLock::new(),
        }
    }

    /// From now on it is thinned as a graph that was read from a file says.
    ///
    /// # Errors
    /// When that has mistakes.
    pub fn thin(&self, path: &Path, graph: &GraphFile) -> Result<(), Failure> {
        let _ = self.thinned.set(super::thinned::of(path, graph)?);
        Ok(())
    }

    /// The files that the name in an offset stands for: a path, or the name of files in any folder.
    fn named<'a>(&'a self, name: &'a Path) -> impl Iterator<Item = &'a Path> {
        let is_it = move |file: &&Path| {
            *file == name || file.file_name().is_some_and(|of| of == name.as_os_str())
        };
        self.paths().filter(is_it)
    }

    /// Refuses an offset of a file that is neither among these nor among others, and ways of reading that exclude each other.
    ///
    /// # Errors
    /// When there is one.
    pub fn check_offsets(&self, others: &[PathBuf]) -> Result<(), Failure> {
        if self.reading.merge && self.reading.segments {
            let words = "--merge and --segments exclude each other";
            return Err(Failure::Request(words.to_owned()));
        }
        let others = self.others(others.to_vec());
        let unknown = |(file, _): &&(PathBuf, Duration)| {
            self.named(file).chain(others.named(file)).next().is_none()
        };
        match self.reading.offsets.iter().find(unknown) {
            Some((file, _)) => Err(Failure::Request(format!(
                "--offset {}: this is none of the files of the data, which are {}",
                file.display(),
                self.names().join(", ")
            ))),
            None => Ok(()),
        }
    }

    /// Refuses what can be read only once, for a command that reads its data again.
    ///
    /// # Errors
    /// When there is such a file.
    pub fn check_lasting(&self, option: &str) -> Result<(), Failure> {
        let is_stream = |path: &&Path| {
            let there = std::fs::metadata(path);
            path.as_os_str() == "-" || there.is_ok_and(|of| !of.is_file() && !of.is_dir())
        };
        match self.paths().find(is_stream) {
            Some(path) => Err(Failure::Request(format!(
                "{option} {}: this can be read only once, and the command reads its data again; save it to a file first",
                path.display()
            ))),
            None => Ok(()),
        }
    }

    /// Warns where they are of several machines, by folders `machine=…`: a fit takes them for one.
    pub fn warn_of_machines(&self, host: &dyn Watch) {
        let files: Vec<PathBuf> = self.paths().map(Path::to_owned).collect();
        let machines = athermal_fleet::found::names_in(&files, "machine");
        if machines.len() > 1 {
            host.warning(format_args!(
                "the data are of {} machines, by folders such as `machine={}`, and are fitted as one: `athermal fleet fit` fits each",
                machines.len(),
                machines.first().map_or("", String::as_str)
            ));
        }
    }

    /// Whether only rows of some time are read.
    pub fn is_a_stretch(&self) -> bool {
        self.times != Times::default()
    }

    /// The names of the files, as they were given.
    pub fn names(&self) -> Vec<String> {
        let names = self.paths().map(|path| path.display().to_string());
        names.collect()
    }

    /// The paths of the files.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        let files = self.given.iter().flat_map(|given| &given.files);
        files.map(PathBuf::as_path)
    }

    /// Other files, read in the same way.
    #[must_use]
    pub fn others(&self, files: Vec<PathBuf>) -> Self {
        Self {
            lenient: self.lenient,
            thinned: self.thinned.clone(),
            ..Self::of(files, self.reading.clone())
        }
    }

    /// The data set.
    #[must_use]
    pub fn dataset(&self) -> Dataset {
        let first = self.paths().next();
        if let Some((name, journal)) = first.and_then(|path| Some((path, journal_of(path)?))) {
            let recording = Rc::new(JournalRecording::in_state(&journal));
            return Dataset::of(name.to_owned(), recording).of_stretch(self.times.stretch());
        }
        self.dataset_of(self.paths().map(Path::to_owned).collect(), None)
    }

    /// The files; none where a journal or a table in memory is read.
    #[must_use]
    pub fn files(&self) -> Option<Vec<PathBuf>> {
        let files = self.paths().map(|path| {
            (journal_of(path).is_none() && !is_in_memory(path)).then(|| path.to_owned())
        });
        files.collect()
    }

    /// How files are read, in words that differ where rows may.
    #[must_use]
    pub fn reading_words(&self) -> String {
        format!("{:?}, lenient: {}", self.reading, self.lenient)
    }

    /// A data set of some of the files, of which no rows outside of a stretch of time are needed.
    #[must_use]
    pub fn dataset_of(&self, files: Vec<PathBuf>, within: Option<(i64, i64)>) -> Dataset {
        let offsets = self.reading.offsets.iter().flat_map(|(name, by)| {
            let files = self.named(name);
            files.map(|file| (file.to_owned(), by.as_ns()))
        });
        let dataset = Dataset::new(
            files,
            Options {
                lenient: self.lenient,
                segments: self.reading.segments,
                merge: self.reading.merge,
                offsets: offsets.collect(),
                within,
                stretch: self.times.stretch(),
                ..Options::default()
            },
        );
        dataset.thinned(self.thinned.get().cloned().unwrap_or_default())
    }

    /// These files as a command for a shell names them; more of them may follow.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let options = [
            (self.lenient, "--lenient"),
            (self.reading.segments, "--segments"),
            (self.reading.merge, "--merge"),
        ];
        let options = options.into_iter().filter(|(given, _)| *given);
        let options = options.map(|(_, option)| option.to_owned());
        let offsets = self.reading.offsets.iter().flat_map(|(file, by)| {
            let offset = format!("{}={by}", file.display());
            ["--offset".to_owned(), quoted(&offset)]
        });
        let times = [("--from", &self.times.from), ("--to", &self.times.to)].into_iter();
        let times = times.filter_map(|(option, time)| Some((option, time.as_ref()?)));
        let times = times.flat_map(|(option, time)| [option.to_owned(), quoted(time)]);
        let options = options.chain(offsets).chain(times);
        let files = self.given.iter();
        let files = files.map(|given| quoted(&given.name.display().to_string()));
        let words = options.chain(["--data".to_owned()]);
        words.chain(files).collect()
    }

    /// The words of a command that takes a model and these data; more of them may follow.
    #[must_use]
    pub fn words_with(&self, command: &str, model: &Path) -> Vec<String> {
        let model = quoted(&model.display().to_string());
        let mut words = vec![program(), command.to_owned(), model];
        words.extend(self.words());
        words
    }

    /// A name for other data, with the ending of these.
    #[must_use]
    pub fn unseen(&self) -> String {
        let kind = self.paths().next().and_then(Path::extension);
        let kind = kind.map_or("csv".into(), |kind| kind.to_string_lossy());
        format!("OTHER.{kind}")
    }

    /// Warns of files on which the model was fitted, and of data from the time of its fit: scores on them say little. `period` is that
    /// of the data, in s.
    pub fn warn_fitted_on(&self, host: &dyn Watch, model: &Model, period: Option<(f64, f64)>) {
        let cards = model.card.iter().flat_map(|card| &card.data);
        let seen = |path: &&Path| cards.clone().any(|card| card.is_of(path));
        let mut again = false;
        for path in self.paths().filter(seen) {
            again = true;
            host.warning(format_args!(
                "{}: the model was fitted on this file, so {FITS}",
                path.display()
            ));
        }
        let of_fit = model.card.as_ref().and_then(|card| card.period);
        if !again && let Some((fit, data)) = of_fit.zip(period) {
            let is_one_clock = cards.clone().any(|card| self.has_rest_of(card));
            warn_overlap(host, (fit.from_s, fit.to_s), data, is_one_clock);
        }
    }

    /// The files for a model's card; of tables in memory their rows, as a graph reads them.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn cards(&self, plan: &Plan, dataset: &Dataset) -> Result<Vec<DataCard>, Failure> {
        if self.is_a_stretch() {
            return self.cards_of_rows(plan, dataset);
        }
        let reports = dataset.reports();
        let card = |path: &Path| {
            let name = path.display().to_string();
            if is_in_memory(path) {
                let rows = self.others(vec![path.to_owned()]).dataset();
                let rows = RowsId::of(&rows, plan).map_err(outside)?;
                return Ok(rows.card());
            }
            let report = reports.iter().find(|(file, _)| *file == name);
            let rows = report.map_or(0, |(_, report)| report.rows);
            let card = match journal_of(path) {
                None => DataCard::of(path, rows),
                Some(folder) => {
                    JournalRecording::in_state(&folder)
                        .content()
                        .map(|(bytes, hash)| DataCard {
                            path: name.clone(),
                            rows,
                            bytes,
                            hash,
                            ..DataCard::default()
                        })
                }
            };
            card.map_err(|error| Failure::Outside(format!("cannot read {name}: {error}")))
        };
        self.paths().map(card).collect()
    }
}

/// What scores on the data of a fit show.
pub const FITS: &str = "the scores show how well it fits, not how well it predicts";

/// Warns of data from the time of a fit, both in s, where they are dated or known to count from one instant.
pub fn warn_overlap(host: &dyn Watch, fit: (f64, f64), data: (f64, f64), is_one_clock: bool) {
    let shared = (fit.0.max(data.0), fit.1.min(data.1));
    let length = |(from, to): (f64, f64)| to - from;
    // Other times begin anew with each recording.
    let dated = shared.0 >= DATES_S;
    if (dated || is_one_clock) && length(shared) > 0.01 * length(data) {
        host.warning(format_args!(
            "the data of the fit are of the time from {} to {} too: there {FITS}",
            instant(shared.0),
            instant(shared.1)
        ));
    }
}

/// Whether two paths lead to files of one content. Only files of the same length are read for their checksums.
pub fn is_same_content(one: &Path, other: &Path) -> bool {
    let length = |path: &Path| {
        let of = std::fs::metadata(path).ok().filter(Metadata::is_file)?;
        Some(of.len())
    };
    let same_length = length(one).is_some_and(|of_one| length(other) == Some(of_one));
    one == other || same_length && DataCard::of(one, 0).is_ok_and(|card| card.is_of(other))
}

/// Checks that the ending of a file that is to be written names a format; one without an ending is CSV.
///
/// # Errors
/// When there is an ending that names none.
pub fn check_ending(output: &Path) -> Result<(), Failure> {
    match output.extension() {
        Some(ending) if Format::from_path(output).is_none() => Err(Failure::Request(format!(
            "{}: the ending `.{}` names no format; `.csv`, `.tsv` and `.txt` are CSV, `.jsonl`, `.ndjson` and `.json` are \
             JSON lines, and `.parquet` is Parquet of a program built with `--features parquet`",
            output.display(),
            ending.display()
        ))),
        _ => Ok(()),
    }
}

/// Files that are given more than once, whose rows count as often.
fn repeated(files: impl Iterator<Item = impl AsRef<str>>) -> Vec<String> {
    let mut known: BTreeMap<PathBuf, u64> = BTreeMap::new();
    let mut messages = Vec::new();
    for file in files {
        if let Ok(path) = std::fs::canonicalize(file.as_ref()) {
            let times = known.entry(path).or_default();
            *times += 1;
            if *times == 2 {
                messages.push(format!(
                    "{}: this file is given more than once, and so often its rows count",
                    file.as_ref()
                ));
            }
        }
    }
    messages
}

/// The note that times have no zone, once for all files.
#[must_use]
pub fn without_zone(reports: &[(String, Report)]) -> Option<String> {
    let mut places = reports
        .iter()
        .filter_map(|(_, report)| report.without_zone.as_ref());
    let place = places.next()?;
    Some(format!("{place}: dates and times {WITHOUT_ZONE}"))
}

/// Warns of rows and cells that were not taken, of rejected samples, of units that differ from those of the graph, of files that
/// count more than once, and of dates without a zone.
pub fn warn(
    host: &dyn Watch,
    plan: &Plan,
    reports: &[(String, Report)],
    refused: u64,
    rejected: &[(String, u64)],
) {
    warn_of(host, doubts(plan, reports, refused, rejected), reports);
}

/// The same with doubts that are known already.
pub fn warn_of(host: &dyn Watch, doubts: Vec<Message>, reports: &[(String, Report)]) {
    for message in doubts {
        host.warning(message);
    }
    if let Some(note) = without_zone(reports) {
        host.note(note);
    }
}

/// The warnings about data, but for dates without a zone.
#[must_use]
pub fn doubts(
    plan: &Plan,
    reports: &[(String, Report)],
    refused: u64,
    rejected: &[(String, u64)],
) -> Vec<Message> {
    let mut messages = of_files(reports);
    messages.extend(other_units(plan, reports).into_iter().map(Message::from));
    if refused > 0 {
        let were = if refused == 1 { "was" } else { "were" };
        let words = format!(
            "{} {were} refused for a time that is not after the one before",
            counted(refused, "row")
        );
        let facts = json!({ "reason": "time_before", "count": refused });
        messages.push(Message::new(refused::ROWS, facts, words));
    }
    let rows: u64 = reports.iter().map(|(_, report)| report.rows).sum();
    let rejected = rejected.iter();
    messages.extend(rejected.map(|(channel, n)| findings::rejected(channel, *n, rows)));
    messages
}

/// Columns under whose names another unit stands than that of their signal.
fn other_units(plan: &Plan, reports: &[(String, Report)]) -> Vec<String> {
    let mut messages = Vec::new();
    for (file, report) in reports {
        for (column, unit) in &report.units {
            let sources = plan.sources.iter().zip(&plan.channels);
            let mut others = sources
                .filter(|(source, _)| source.column == *column)
                .map(|(source, planned)| (&source.name, &planned.channel.unit))
                .filter(|(_, own)| !unit.measures_same(own) || unit.is_another_than(own));
            if let Some((channel, own)) = others.next() {
                messages.push(format!(
                    "{file}: `{unit}` stands below the name of the column `{column}`, and {channel} takes its numbers for {own}: \
                     correct `unit` of the signal"
                ));
            }
        }
    }
    messages
}

/// The warnings about files after reading: rows and cells that were not taken, and files that count more than once.
#[must_use]
pub fn of_files(reports: &[(String, Report)]) -> Vec<Message> {
    let repeated = repeated(reports.iter().map(|(file, _)| file));
    let mut messages: Vec<Message> = repeated.into_iter().map(Message::from).collect();
    for (file, report) in reports {
        for (other, rows) in &report.overlaps {
            let all = counted(report.rows, "row");
            let some = match *rows == report.rows {
                true => "all".to_owned(),
                false => count(*rows),
            };
            let lie = if *rows == 1 { "lies" } else { "lie" };
            let words = format!(
                "{file}: {some} of its {all} {lie} in the period of {other}; files are not merged, so windows begin afresh in it and what both have counts twice"
            );
            messages.push(Message::from(words));
        }
        let unreadable = format!("unreadable cell{}", of_columns(report));
        let counted = [
            (&report.bad_cells, &*unreadable, "taken as missing"),
            (&report.refused_rows, "unreadable row", "left out"),
            (
                &report.refused_time,
                "row whose time is out of order",
                "left out",
            ),
            (
                &report.repeated_time,
                "row whose time is that of the row before",
                "left out",
            ),
        ];
        for headers in [&report.headers_moved, &report.headers] {
            if let Some(first) = &headers.first {
                let words = match headers.count {
                    more @ 2.. => format!("{first}; {} in all", count(more)),
                    _ => first.to_string(),
                };
                messages.push(refused::message(first, Some(headers.count), words));
            }
        }
        for (found, what, then) in counted {
            if let Some(first) = &found.first {
                let (n, taken) = (count(found.count), first.without_advice());
                let words = format!("{file}: {n} × {what}, {then}; the first: {taken}");
                messages.push(refused::message(first, Some(found.count), words));
            }
        }
        let kept = [
            (&report.short_rows, "row without its last cells"),
            (&report.notes, "row with a note behind it"),
        ];
        for (found, what) in kept {
            // Where nearly all rows are such, that is how the log is.
            let is_usual = found.count > 20 && report.rows.saturating_sub(found.count) <= 3;
            if let Some(first) = found.first.as_ref().filter(|_| !is_usual) {
                let n = count(found.count);
                let words = format!("{file}: {n} × {what}; the first: {first}");
                messages.push(refused::message(first, Some(found.count), words));
            }
        }
        if let Some(place) = &report.truncated {
            let words = format!(
                "{place}: the last line has no end and was left out, since it was cut off or is still being written"
            );
            let facts = json!({ "reason": "cut_off", "count": 1, "file": &*place.file, "line": place.line });
            messages.push(Message::new(refused::ROWS, facts, words));
        }
    }
    messages
}

/// How many columns with cells that cannot be read are named.
const NAMED: usize = 8;

/// In which columns cells cannot be read, where these are several.
fn of_columns(report: &Report) -> String {
    let mut columns: BTreeMap<&str, u64> = BTreeMap::new();
    for found in &report.bad_cells_of {
        if let Some(column) = found.first.as_ref().and_then(FileError::column) {
            *columns.entry(column).or_default() += found.count;
        }
    }
    if columns.len() < 2 {
        return String::new();
    }
    let named = columns.iter().take(NAMED);
    let mut named: Vec<_> = named
        .map(|(column, n)| format!("{} in `{column}`", count(*n)))
        .collect();
    if columns.len() > NAMED {
        named.push(format!("others in {} more", columns.len() - NAMED));
    }
    format!(" ({})", named.join(", "))
}
