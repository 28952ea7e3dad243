//! Files as a recording of a graph: its columns looked up, and read from the beginning as often as fitting asks for it.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use athermal_core::compile::Plan;
use athermal_core::document::{TimeBase, TimeForm as Declared};
use athermal_core::time::Duration;
use athermal_run::recording::{self, Samples, Source, SourceError, ThinnedChannels, thin};

use crate::merge::{self, Joint};
use crate::recording::offset_of;
use crate::stream::next_of;
use crate::{
    ChannelColumn, FileError, Format, Layout, Options, Report, Stretch, Tables, TimeColumn,
    TimeForm,
};

/// How a sample number is carried where the graph gives no step.
const ONE_SECOND: Duration = Duration::from_ns(1_000_000_000);

impl From<&Declared> for TimeForm {
    fn from(form: &Declared) -> Self {
        match form {
            Declared::Numbers { unit } => Self::Numbers {
                ns_per_unit: unit.as_ns(),
            },
            Declared::Rfc3339 => Self::Rfc3339,
            Declared::Elapsed => Self::Elapsed,
            Declared::Since { unit, origin_ns } => Self::Since {
                ns_per_unit: unit.as_ns(),
                origin_ns: *origin_ns,
            },
            Declared::Format(format) => Self::Format(format.clone()),
            Declared::Samples { step } => Self::Samples {
                step_ns: step.unwrap_or(ONE_SECOND).as_ns(),
            },
        }
    }
}

impl From<&TimeBase> for TimeColumn {
    fn from(base: &TimeBase) -> Self {
        let TimeBase::Column { column, form, zone } = base;
        Self {
            columns: column.clone(),
            form: form.into(),
            zone: zone.clone(),
        }
    }
}

/// What a graph expects of a table: how time is given, and a column for each measured channel.
#[must_use]
pub fn layout(plan: &Plan) -> Layout {
    Layout {
        time: (&plan.time).into(),
        channels: plan
            .sources
            .iter()
            .map(|source| ChannelColumn {
                column: source.column.clone(),
                optional: source.optional,
                is_instant: source.is_instant,
            })
            .collect(),
        table: plan.table.clone(),
    }
}

/// The recordings in a folder and in the folders inside it, in the order of their paths: what has a name that promises a format, and
/// begins neither with a dot nor with `_`. Links to folders are not followed. None where there is no such folder.
#[must_use]
pub fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let is_hidden = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(['.', '_'])
    };
    paths.retain(|path| !(is_hidden(path) || path.is_symlink() && path.is_dir()));
    let found = paths.into_iter().flat_map(|path| match path.is_dir() {
        true => recordings_in(&path),
        false => Format::of_file(&path).map(|_| path).into_iter().collect(),
    });
    found.collect()
}

/// One or more files as a data set, or a recording of another kind.
pub struct Dataset {
    paths: Vec<PathBuf>,
    /// What is read instead of the paths, which then name it.
    other: Option<Rc<dyn recording::Recording>>,
    thinned: Box<[ThinnedChannels]>,
    options: Options,
    reports: RefCell<Vec<(String, Report)>>,
}

impl Dataset {
    /// A data set of these files.
    #[must_use]
    pub fn new(paths: Vec<PathBuf>, options: Options) -> Self {
        Self {
            paths,
            other: None,
            thinned: Box::default(),
            options,
            reports: RefCell::new(Vec::new()),
        }
    }

    /// A recording that is no file, by the name that it is given by.
    #[must_use]
    pub fn of(name: PathBuf, recording: Rc<dyn recording::Recording>) -> Self {
        Self {
            other: Some(recording),
            ..Self::new(vec![name], Options::default())
        }
    }

    /// The same rows, of a stretch of time alone.
    #[must_use]
    pub fn of_stretch(mut self, stretch: Stretch) -> Self {
        self.options.stretch = stretch;
        self
    }

    /// The same, of which channels are thinned; a recording that is no file has been already.
    #[must_use]
    pub fn thinned(mut self, rules: Vec<ThinnedChannels>) -> Self {
        self.thinned = rules.into();
        self
    }

    /// What stands for files in memory.
    #[must_use]
    pub fn tables(&self) -> &Tables {
        &self.options.tables
    }

    /// The files.
    #[must_use]
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// The rows of all files by a layout that no graph declares; what cannot be read is passed over.
    ///
    /// # Errors
    /// As for [`Joint::open`].
    pub fn skim(&self, layout: Layout) -> Result<Joint, FileError> {
        let options = Options {
            lenient: true,
            ..self.options.clone()
        };
        Joint::open(&self.paths, layout, options)
    }

    /// The files of each log, where these are several that are merged; else none.
    ///
    /// # Errors
    /// As for reading them.
    pub fn loggers(&self, plan: &Plan) -> Result<Vec<Vec<PathBuf>>, FileError> {
        if self.other.is_some() {
            return Ok(Vec::new());
        }
        let mut logs = merge::logs_of(&self.paths, &layout(plan), &self.options)?;
        let place = |files: &Vec<PathBuf>| self.paths.iter().position(|path| files.contains(path));
        logs.sort_by_key(place);
        Ok(logs)
    }

    /// The same files, with a time added to those of some of them.
    #[must_use]
    pub fn shifted(&self, files: &[PathBuf], by: Duration) -> Self {
        let mut options = self.options.clone();
        let paths = self.paths.iter().map(|path| {
            let more = if files.contains(path) { by.as_ns() } else { 0 };
            (path.clone(), self.added_to(path).saturating_add(more))
        });
        options.offsets = paths.collect();
        Self::new(self.paths.clone(), options)
    }

    /// What is added to the times of a file, in ns.
    #[must_use]
    pub fn added_to(&self, path: &Path) -> i64 {
        offset_of(path, &self.options)
    }

    /// What was met in each file, as of the last time that all were read to their end.
    #[must_use]
    pub fn reports(&self) -> Vec<(String, Report)> {
        self.reports.borrow().clone()
    }

    /// Keeps what was met in each file, once all were read to their end. Of a stretch of time there must be a row.
    fn ended(&self, reports: Vec<(String, Report)>, time: &TimeColumn) -> Result<(), FileError> {
        let stretch = &self.options.stretch;
        if stretch.is_part() && reports.iter().all(|(_, report)| report.rows == 0) {
            let outside = reports.iter().filter_map(|(_, report)| report.outside);
            let outside = outside.reduce(|one, other| (one.0.min(other.0), one.1.max(other.1)));
            let files: Vec<&str> = reports.iter().map(|(name, _)| name.as_str()).collect();
            return Err(stretch.without_rows(&files.join(", "), time, outside));
        }
        *self.reports.borrow_mut() = reports;
        Ok(())
    }
}

impl recording::Recording for Dataset {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let time = TimeColumn::from(&plan.time);
        if let Some(other) = &self.other {
            return Ok(Box::new(Other {
                source: other.open(plan)?,
                taken: self.options.stretch.of(&time)?.ends(),
                waiting: None,
                report: Report::default(),
                dataset: self,
                time,
            }));
        }
        let recording = Joint::open(&self.paths, layout(plan), self.options.clone())?;
        let reading = Box::new(Reading {
            recording,
            dataset: self,
            time,
        });
        Ok(thin(reading, plan, &self.thinned, |_| String::new()))
    }
}

/// A recording that is no file.
struct Other<'a> {
    source: Box<dyn Source + 'a>,
    /// The first instant that is taken in ns, and the first behind.
    taken: Option<(i64, i64)>,
    /// The first row of a segment, after the break before it was given.
    waiting: Option<(recording::Event, Samples)>,
    report: Report,
    dataset: &'a Dataset,
    time: TimeColumn,
}

impl Other<'_> {
    /// Whether a row is taken; what is not is noted.
    fn takes(&mut self, at: i64) -> bool {
        let is_taken = self.taken.is_none_or(|(from, to)| (from..to).contains(&at));
        if !is_taken {
            let (first, last) = self.report.outside.unwrap_or((at, at));
            self.report.outside = Some((first.min(at), last.max(at)));
        }
        is_taken
    }
}

impl Source for Other<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<recording::Event>, SourceError> {
        if let Some((row, of_row)) = self.waiting.take() {
            *samples = of_row;
            return Ok(Some(row));
        }
        let mut breaks = false;
        loop {
            let next = self.source.next(samples)?;
            match next {
                // One without a row that is taken before it or behind it parts nothing.
                Some(recording::Event::Segment) if self.taken.is_some() => {
                    breaks = self.report.rows > 0;
                    continue;
                }
                Some(recording::Event::Row(at)) if !self.takes(at.as_ns()) => continue,
                Some(recording::Event::Row(_)) => self.report.rows += 1,
                Some(recording::Event::Segment) => {}
                None => {
                    let name = self.dataset.paths[0].display().to_string();
                    let reports = vec![(name, self.report.clone())];
                    self.dataset.ended(reports, &self.time)?;
                }
            }
            if let (true, Some(row)) = (breaks, next) {
                self.waiting = Some((row, std::mem::take(samples)));
                return Ok(Some(recording::Event::Segment));
            }
            return Ok(next);
        }
    }
}

struct Reading<'a> {
    recording: Joint,
    dataset: &'a Dataset,
    time: TimeColumn,
}

impl Source for Reading<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<recording::Event>, SourceError> {
        let next = next_of(samples, |row| self.recording.next_into(row))?;
        if next.is_none() {
            self.dataset.ended(self.recording.reports(), &self.time)?;
        }
        Ok(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_folder_is_searched_without_following_links_to_folders() {
        let name = format!("athermal-files-{}-links", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(folder.join("logs/inner")).unwrap();
        let log = folder.join("logs/inner/a.csv");
        std::fs::write(&log, "t,x\n0,1\n").unwrap();
        let linked = folder.join("logs/b.csv");
        std::os::unix::fs::symlink(&log, &linked).unwrap();
        // Followed, these would give each log twice, or without end.
        std::os::unix::fs::symlink("inner", folder.join("logs/again")).unwrap();
        std::os::unix::fs::symlink("..", folder.join("logs/inner/up")).unwrap();
        std::os::unix::fs::symlink("logs", folder.join("given")).unwrap();
        assert_eq!(recordings_in(&folder.join("logs")), [linked, log.clone()]);
        assert_eq!(recordings_in(&folder.join("given")).len(), 2);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
