//! Blocks of a fit that are kept in a folder beside the data, a file for each UTC day or other stretch of time: which of them files of data leave as they are,
//! and which are made anew. Not how rows become blocks, nor a fit on them.

#![cfg_attr(test, allow(clippy::unwrap_used))]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use athermal_core::compile::Plan;
use athermal_core::time::Duration;
use athermal_files::{Dataset, Report};
use athermal_run::fit::{Block, Blocks, FitError, rows_identity};
use athermal_run::live::store::write_whole;
use athermal_run::model::{DataCard, content_of};
use athermal_run::recording::{Recording as _, Samples, SourceError};
use serde::{Deserialize, Serialize};

/// The form that this version writes.
const FORMAT: u64 = 1;
const INDEX: &str = "index.json";
/// The folder in which blocks are made, beside those that are there.
const NEW: &str = ".new";
const DAY_NS: i64 = 86_400_000_000_000;

/// What the blocks of a folder were made of.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Index {
    athermal_blocks: u64,
    /// The checksum of what makes examples of rows.
    graph: String,
    /// How the files were read.
    reading: String,
    files: Vec<File>,
}

/// A file whose rows are in the blocks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    path: String,
    bytes: u64,
    /// When it was last written, in ns since 1970. A file of the same length that was not written since is not read for its checksum.
    modified_ns: u64,
    hash: String,
    /// What is read into it beside its content: `key=value` in its path, which of the patterns of `[[table.files]]` matches its name, and
    /// what is added to its times, in ns.
    place: String,
    rows: u64,
    /// The first instant and the last, in ns since 1970; none without rows.
    period: Option<(i64, i64)>,
}

impl File {
    /// What a file is now, with its rows where it is a known one.
    fn of(path: &Path, place: String, known: &[Self]) -> io::Result<Self> {
        let of = fs::metadata(path)?;
        let modified = of.modified()?.duration_since(UNIX_EPOCH);
        let modified = modified.map_or(0, |since| since.as_nanos());
        let modified_ns = u64::try_from(modified).unwrap_or(u64::MAX);
        let name = path.display().to_string();
        let is_same = |known: &&Self| {
            let written = (known.bytes, known.modified_ns);
            known.path == name && written == (of.len(), modified_ns) && known.place == place
        };
        if let Some(known) = known.iter().find(is_same) {
            return Ok(known.clone());
        }
        let (bytes, hash) = content_of(path)?;
        let own = (bytes, &*hash, &*place);
        let known = known.iter().find(|known| known.content() == own);
        Ok(Self {
            rows: known.map_or(0, |known| known.rows),
            period: known.and_then(|known| known.period),
            path: name,
            bytes,
            modified_ns,
            hash,
            place,
        })
    }

    /// What its rows depend on, wherever it is and whenever it was written.
    fn content(&self) -> (u64, &str, &str) {
        (self.bytes, &self.hash, &self.place)
    }

    /// The days whose blocks depend on its rows: its own, and the one after, which knows the day before.
    fn days(&self, length: Duration) -> impl Iterator<Item = i64> + use<> {
        self.own(length).flat_map(|day| [day, day + 1])
    }

    /// The days of its rows.
    fn own(&self, length: Duration) -> impl Iterator<Item = i64> + use<> {
        let number = move |ns: i64| ns.div_euclid(length.as_ns());
        let days = self.period.map(|(from, to)| number(from)..=number(to));
        days.into_iter().flatten()
    }

    /// Whether it is there no more, and none of the others has all of its period.
    fn is_lost(&self, others: &[Self]) -> bool {
        let has_all = |other: &Self| match (self.period, other.period) {
            _ if (other.bytes, &other.hash) == (self.bytes, &self.hash) => true,
            (Some((from, to)), Some((first, last))) => first <= from && to <= last,
            (None, _) => true,
            _ => false,
        };
        !Path::new(&self.path).exists() && !others.iter().any(has_all)
    }

    fn take(&mut self, reports: &[(String, Report)]) {
        if let Some((_, report)) = reports.iter().find(|(file, _)| *file == self.path) {
            (self.rows, self.period) = (report.rows, report.period);
        }
    }
}

/// What the rows of a file depend on beside its content.
fn place_of(path: &Path, plan: &Plan, added_ns: i64) -> String {
    let folders = path.parent().into_iter().flat_map(Path::components);
    let folders = folders.filter_map(|of| of.as_os_str().to_str());
    let keys: Vec<&str> = folders.filter(|of| of.contains('=')).collect();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut patterns = plan.table.files.iter();
    let pattern = patterns.position(|(pattern, _)| pattern.matches(&name));
    format!("{} {pattern:?} {added_ns}", keys.join("/"))
}

/// How many files have each content.
fn counts(files: &[File]) -> BTreeMap<(u64, &str, &str), usize> {
    let mut counts = BTreeMap::new();
    for file in files {
        *counts.entry(file.content()).or_default() += 1;
    }
    counts
}

/// The blocks of a folder, as they are now.
#[derive(Debug)]
pub struct KeptBlocks {
    folder: PathBuf,
    days: Vec<String>,
    /// The files that their rows are of.
    pub cards: Vec<DataCard>,
    /// How many of the blocks were made just now.
    pub made: u64,
    /// The blocks of which the rows, or some of them, are gone: they stay as they were.
    pub lost: Vec<String>,
}

/// A folder for blocks that holds something else: it is left as it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OtherFolder {
    /// The folder.
    pub folder: PathBuf,
    /// A file in it that would be taken for a block.
    pub found: String,
}

impl fmt::Display for OtherFolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (folder, found) = (self.folder.display(), &self.found);
        write!(
            f,
            "{folder}: it holds {found} and no {INDEX}; name a folder for blocks alone"
        )
    }
}

impl std::error::Error for OtherFolder {}

/// Why blocks could not be brought up to date.
fn failed(path: &Path, what: impl std::fmt::Display) -> FitError {
    FitError::Recording(format!("{}: {what}", path.display()).into())
}

/// The file of a block: its day, or its minute where blocks are no days.
fn name_of(nth: i64, length: Duration) -> Option<String> {
    let begin = nth.checked_mul(length.as_ns())?;
    let at = jiff::Timestamp::from_nanosecond(begin.into()).ok()?;
    let form = match length.as_ns() % DAY_NS {
        0 => "%Y-%m-%d.json",
        _ => "%Y-%m-%dT%H%M.json",
    };
    Some(at.strftime(form).to_string())
}

fn is_name(name: &str) -> bool {
    let begin = name.strip_suffix(".json").unwrap_or_default();
    let (date, minute) = begin.split_once('T').unwrap_or((begin, "0000"));
    date.parse::<jiff::civil::Date>().is_ok() && minute.parse::<u32>().is_ok()
}

/// The files of a folder that are named as blocks, in the order of their days.
fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    let entries = fs::read_dir(folder)?.flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| is_name(name)).collect();
    names.sort();
    Ok(names)
}

/// Writes a file so that it is there whole or not at all.
fn write(path: &Path, text: &str) -> Result<(), FitError> {
    write_whole(path, text.as_bytes()).map_err(|error| failed(path, error))
}

/// The first and last instant of rows that are needed, in ns since 1970; all where there is none.
pub type Within = Option<(i64, i64)>;

/// Makes the blocks of the wanted days of some files, in order: [`blocks_of`](athermal_run::fit::blocks_of).
pub type Make<'a> = &'a mut dyn FnMut(
    &Dataset,
    &dyn Fn(i64) -> bool,
    &mut dyn FnMut(Block) -> Result<(), FitError>,
) -> Result<(), FitError>;

impl KeptBlocks {
    /// Brings the blocks of a folder, each of that length, up to date with files of data. Where these, the version of this crate, the graph as far as it makes
    /// examples of rows, and `reading` (how files are read, in any words) are those of the last time, nothing but the folder is read. Days of files that are
    /// new, changed or not among the files any more, and the days after them, are made anew by `make`, from the files that have rows of these
    /// days. Blocks of a file that is there no more stay as they are, unless another has all of its
    /// period. `data` is a data set of some of the files, of which no rows outside of a stretch of time are needed.
    ///
    /// # Errors
    /// When files cannot be read or written, the folder holds something else ([`OtherFolder`]), or `make` fails. The folder is then
    /// as it was.
    pub fn refresh(
        folder: &Path,
        plan: &Plan,
        length: Duration,
        files: &[PathBuf],
        reading: &str,
        data: &dyn Fn(Vec<PathBuf>, Within) -> Dataset,
        make: Make<'_>,
    ) -> Result<Self, FitError> {
        fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
        let identity = rows_identity(plan);
        let version = env!("CARGO_PKG_VERSION");
        let mut reading = format!("athermal {version}, {reading}, {:?}", plan.table);
        if length.as_ns() != DAY_NS {
            reading += &format!(", blocks of {length}");
        }
        let mut index = index_of(folder, &identity, &reading)?;
        let whole = data(files.to_vec(), None);
        let now = files.iter().map(|path| {
            let place = place_of(path, plan, whole.added_to(path));
            File::of(path, place, &index.files).map_err(|error| failed(path, error))
        });
        let mut now: Vec<File> = now.collect::<Result<_, _>>()?;
        let (known, given) = (counts(&index.files), counts(&now));
        let is_other = |file: &&File| known.get(&file.content()) != given.get(&file.content());
        let gone: Vec<File> = index.files.iter().filter(is_other).cloned().collect();
        let new: BTreeSet<String> = now
            .iter()
            .filter(is_other)
            .map(|of| of.path.clone())
            .collect();
        let (mut made, mut lost) = (0, Vec::new());
        if !gone.is_empty() || !new.is_empty() {
            let is_first = index.files.is_empty();
            if !is_first && !new.is_empty() {
                // Which days they have is known once they have been read; one log of several that are merged is not read alone.
                let alone = data(new.iter().map(PathBuf::from).collect(), None);
                let reports = reports_of(plan, &alone).or_else(|_| reports_of(plan, &whole))?;
                let changed = now.iter_mut().filter(|file| new.contains(&file.path));
                changed.for_each(|file| file.take(&reports));
            }
            let (without_rows, gone): (Vec<File>, Vec<File>) =
                gone.into_iter().partition(|file| file.is_lost(&now));
            lost = without_rows;
            // The day after one that is lost can be made again: it knows less of the one before.
            let kept: BTreeSet<i64> = lost.iter().flat_map(|file| file.own(length)).collect();
            let changed = now.iter().filter(|file| new.contains(&file.path));
            let days = changed.chain(&gone).flat_map(|file| file.days(length));
            let stale: BTreeSet<i64> = days.filter(|day| !kept.contains(day)).collect();
            let names: Vec<String> = match is_first {
                true => names_in(folder).map_err(|error| failed(folder, error))?,
                false => stale
                    .iter()
                    .filter_map(|&day| name_of(day, length))
                    .collect(),
            };
            let beside = folder.join(NEW);
            let _ = fs::remove_dir_all(&beside);
            // A block knows the day before.
            let is_stale = |day: i64| stale.contains(&day) || stale.contains(&(day + 1));
            let near = now
                .iter()
                .filter(|of| is_first || of.days(length).any(is_stale))
                .map(|of| PathBuf::from(&of.path));
            let near: Vec<PathBuf> = near.collect();
            if !near.is_empty() {
                let first = stale.first().map(|day| (day - 1) * length.as_ns());
                let last = stale.last().map(|day| (day + 1) * length.as_ns());
                let dataset = data(near, first.zip(last).filter(|_| !is_first));
                fs::create_dir_all(&beside).map_err(|error| failed(&beside, error))?;
                let wanted = |day: i64| is_first || stale.contains(&day);
                let made_all = make(&dataset, &wanted, &mut |block| {
                    let name = name_of(block.day, length);
                    let name =
                        name.ok_or_else(|| failed(folder, "a day is beyond all calendars"))?;
                    let path = beside.join(name);
                    let text = block.to_json().map_err(|error| failed(&path, error))?;
                    made += 1;
                    write(&path, &text)
                });
                if let Err(error) = made_all {
                    let _ = fs::remove_dir_all(&beside);
                    return Err(error);
                }
                if is_first {
                    let reports = dataset.reports();
                    now.iter_mut().for_each(|file| file.take(&reports));
                }
            }
            // A program that is killed from here on leaves nothing that is taken for up to date.
            index
                .files
                .retain(|file| !file.days(length).any(|day| stale.contains(&day)));
            index.write(folder)?;
            for path in names.iter().map(|name| folder.join(name)) {
                if path.exists() {
                    fs::remove_file(&path).map_err(|error| failed(&path, error))?;
                }
            }
            if beside.exists() {
                let moved = names_in(&beside).and_then(|names| {
                    let mut names = names.iter();
                    names.try_for_each(|name| fs::rename(beside.join(name), folder.join(name)))
                });
                moved.map_err(|error| failed(&beside, error))?;
                let _ = fs::remove_dir_all(&beside);
            }
        }
        let without_rows: BTreeSet<i64> = lost.iter().flat_map(|file| file.own(length)).collect();
        let without_rows = without_rows.iter().filter_map(|day| name_of(*day, length));
        let without_rows = without_rows
            .filter(|name| folder.join(name).exists())
            .collect();
        index.files = now;
        index.files.extend(lost);
        index.write(folder)?;
        let cards = index.files.into_iter().map(|file| DataCard {
            path: file.path,
            rows: file.rows,
            bytes: file.bytes,
            hash: file.hash,
            ..DataCard::default()
        });
        Ok(Self {
            days: names_in(folder).map_err(|error| failed(folder, error))?,
            folder: folder.to_owned(),
            cards: cards.collect(),
            made,
            lost: without_rows,
        })
    }
}

/// What the blocks of a folder were made of; nothing where that was something else, so that all are made anew.
fn index_of(folder: &Path, identity: &str, reading: &str) -> Result<Index, FitError> {
    let path = folder.join(INDEX);
    let names = names_in(folder).map_err(|error| failed(folder, error))?;
    let index = match fs::read_to_string(&path) {
        Ok(text) => serde_json::from_str::<Index>(&text).map_err(|error| {
            failed(
                &path,
                format_args!(
                    "it is no index of blocks ({error}); name another folder, or delete this one"
                ),
            )
        })?,
        Err(error) if error.kind() == io::ErrorKind::NotFound && names.is_empty() => {
            Index::default()
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let (folder, found) = (folder.to_owned(), names[0].clone());
            return Err(FitError::Recording(OtherFolder { folder, found }.into()));
        }
        Err(error) => return Err(failed(&path, error)),
    };
    if (index.athermal_blocks, &*index.graph, &*index.reading) == (FORMAT, identity, reading) {
        return Ok(index);
    }
    Ok(Index {
        athermal_blocks: FORMAT,
        graph: identity.to_owned(),
        reading: reading.to_owned(),
        files: Vec::new(),
    })
}

impl Index {
    fn write(&self, folder: &Path) -> Result<(), FitError> {
        let path = folder.join(INDEX);
        let text = serde_json::to_string_pretty(self).map_err(|error| failed(&path, error))?;
        write(&path, &text)
    }
}

/// Reads files to their end for what is in them.
fn reports_of(plan: &Plan, dataset: &Dataset) -> Result<Vec<(String, Report)>, FitError> {
    let (mut samples, mut source) = (Samples::default(), dataset.open(plan)?);
    while source.next(&mut samples)?.is_some() {}
    drop(source);
    Ok(dataset.reports())
}

impl Blocks for KeptBlocks {
    fn count(&self) -> usize {
        self.days.len()
    }

    fn read(&self, nth: usize, take: &mut dyn FnMut(&Block)) -> Result<(), SourceError> {
        let Some(name) = self.days.get(nth) else {
            return Ok(());
        };
        let path = self.folder.join(name);
        let wrong = |error: &dyn std::fmt::Display| {
            let folder = self.folder.display();
            format!(
                "{}: {error}; delete {folder}, and its blocks are made anew",
                path.display()
            )
        };
        let text = fs::read_to_string(&path).map_err(|error| wrong(&error))?;
        take(&Block::from_json(&text).map_err(|error| wrong(&error))?);
        Ok(())
    }
}
