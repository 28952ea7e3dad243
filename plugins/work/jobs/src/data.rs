//! Recorded data: how files are named, and read as one recording.

mod cards;
mod reading;

use std::collections::BTreeSet;
use std::fs::Metadata;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;
use std::sync::OnceLock;

use athermal_analysis::figures::{DATES_S, instant};
use athermal_core::compile::Plan;
use athermal_core::failure::{Failure, outside};
use athermal_core::time::Duration;
use athermal_core::watch::Watch;
use athermal_files::{Dataset, Options, Report, Tables, recordings_in};
use athermal_run::model::{DataCard, Model};
use athermal_run::recording::ThinnedChannels;
use athermal_serve::journal::JournalRecording;
use clap::Args;
use clap::builder::TypedValueParser;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::RowsId;
use crate::model::few;
use crate::path::{quoted, recording};

pub use reading::{Joining, Reading, Times};

/// Recorded data.
#[derive(Debug, Args, Deserialize, JsonSchema)]
pub struct Data {
    /// CSV or JSON lines, or a folder of them. Several files of one clock are joined in the order of time. Those whose times start again are segments, in the order given. Files of different columns whose times overlap are merged by time. `journal:FOLDER` is what a service took, by its state folder, alone
    #[arg(long = "data", short = 'd', required = true, num_args = 1.., value_name = "FILE", value_parser = recording().map(Given::from))]
    #[serde(rename = "data")]
    #[schemars(with = "Vec<String>")]
    given: Vec<Given>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) reading: Reading,
    #[arg(skip)]
    #[serde(skip)]
    thinned: OnceLock<Vec<ThinnedChannels>>,
    #[arg(skip)]
    #[serde(skip)]
    tables: Tables,
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
        let mut files = recordings_in(&name);
        if files.is_empty() {
            files.push(name.clone());
        }
        Self { name, files }
    }
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
            reading,
            thinned: OnceLock::new(),
            tables: Tables::default(),
        }
    }

    /// From now on tables in memory stand for files of their names.
    pub fn lend(&mut self, tables: &Tables) {
        for given in self.given.iter_mut().filter(|of| tables.has(&of.name)) {
            given.files = vec![given.name.clone()];
        }
        self.tables = tables.clone();
    }

    /// From now on it is thinned as a graph says, of the file at the path where it was read from one.
    ///
    /// # Errors
    /// When that has mistakes.
    pub fn thin(&self, path: Option<&Path>, model: &Model) -> Result<(), Failure> {
        if self.thinned.get().is_none() {
            let _ = self.thinned.set(crate::thinned::of(path, model)?);
        }
        Ok(())
    }

    /// Refuses an offset of a file that is neither among these nor among others, and ways of reading that exclude each other.
    ///
    /// # Errors
    /// When there is one.
    pub fn check_offsets(&self, others: &[PathBuf]) -> Result<(), Failure> {
        let joining = &self.reading.joining;
        if joining.merge && joining.segments {
            let words = "--merge and --segments exclude each other";
            return Err(Failure::Request(words.to_owned()));
        }
        let others = self.others(others.to_vec());
        let unknown = |(file, _): &&(PathBuf, Duration)| {
            let mut all = self.paths().chain(others.paths());
            !all.any(|path| Joining::is_of(file, path))
        };
        match joining.offsets.iter().find(unknown) {
            Some((file, _)) => Err(Failure::Request(format!(
                "--offset {}: this is none of the files of the data, which are {}",
                file.display(),
                few(&self.names())
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
        let machines: BTreeSet<String> = self
            .paths()
            .filter_map(|file| of_folder(file, "machine"))
            .collect();
        if let (Some(first), true) = (machines.first(), machines.len() > 1) {
            host.warning(format_args!(
                "the data are of {} machines, by folders such as `machine={first}`, and are fitted as one: `athermal fleet fit` fits each",
                machines.len(),
            ));
        }
    }

    /// Whether only rows of some time are read.
    pub fn is_a_stretch(&self) -> bool {
        self.reading.times != Times::default()
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
        let times = Times::default();
        let reading = Reading {
            times,
            ..self.reading.clone()
        };
        let mut others = Self::of(files, reading);
        others.thinned = self.thinned.clone();
        others.lend(&self.tables);
        others
    }

    /// These data of a stretch of time alone.
    #[must_use]
    pub fn within(&self, from: Option<String>, to: Option<String>) -> Self {
        let names = self.given.iter().map(|given| given.name.clone());
        let mut within = self.others(names.collect());
        within.reading.times = Times { from, to };
        within
    }

    /// The rows that a fit up to a time has left out: these data from there on.
    #[must_use]
    pub fn rest(&self) -> Option<Self> {
        let to = self.reading.times.to.clone()?;
        Some(self.within(Some(to), None))
    }

    /// The data set.
    #[must_use]
    pub fn dataset(&self) -> Dataset {
        let first = self.paths().next();
        if let Some((name, journal)) = first.and_then(|path| Some((path, journal_of(path)?))) {
            let recording = Rc::new(JournalRecording::in_state(&journal));
            return Dataset::of(name.to_owned(), recording)
                .of_stretch(self.reading.times.stretch());
        }
        self.dataset_of(self.paths().map(Path::to_owned).collect(), None)
    }

    /// The files; none where a journal or a table in memory is read.
    #[must_use]
    pub fn files(&self) -> Option<Vec<PathBuf>> {
        let files = self.paths().map(|path| {
            (journal_of(path).is_none() && !self.tables.has(path)).then(|| path.to_owned())
        });
        files.collect()
    }

    /// A data set of some of the files, of which no rows outside of a stretch of time are needed.
    #[must_use]
    pub fn dataset_of(&self, files: Vec<PathBuf>, within: Option<(i64, i64)>) -> Dataset {
        let options = Options {
            within,
            tables: self.tables.clone(),
            ..self.reading.options(&files)
        };
        Dataset::new(files, options).thinned(self.thinned.get().cloned().unwrap_or_default())
    }

    /// These files as a command for a shell names them; more of them may follow.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let options = [
            (self.reading.lenient, "--lenient"),
            (self.reading.joining.segments, "--segments"),
            (self.reading.joining.merge, "--merge"),
        ];
        let options = options.into_iter().filter(|(given, _)| *given);
        let options = options.map(|(_, option)| option.to_owned());
        let offsets = self.reading.joining.offsets.iter();
        let offsets =
            offsets.flat_map(|of| ["--offset".to_owned(), quoted(&reading::in_words(of))]);
        let Times { from, to } = &self.reading.times;
        let times = [("--from", from), ("--to", to)].into_iter();
        let times = times.filter_map(|(option, time)| Some((option, time.as_ref()?)));
        let times = times.flat_map(|(option, time)| [option.to_owned(), quoted(time)]);
        let options = options.chain(offsets).chain(times);
        let files = self.given.iter();
        let files = files.map(|given| quoted(&given.name.display().to_string()));
        let words = options.chain(["--data".to_owned()]);
        words.chain(files).collect()
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
    pub fn cards(
        &self,
        plan: &Plan,
        reports: &[(String, Report)],
    ) -> Result<Vec<DataCard>, Failure> {
        if self.is_a_stretch() {
            return self.cards_of_rows(plan, reports);
        }
        let card = |path: &Path| {
            let name = path.display().to_string();
            if self.tables.has(path) {
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

/// The value of the last folder `key=value` on a path, by which files are of a machine.
#[must_use]
pub fn of_folder(file: &Path, key: &str) -> Option<String> {
    let folders = file.parent()?.components().rev();
    let mut values = folders.filter_map(|of| match of {
        Component::Normal(name) => {
            let value = name.to_str()?.strip_prefix(key)?.strip_prefix('=')?;
            Some(value.to_owned())
        }
        _ => None,
    });
    values.next().filter(|value| !value.is_empty())
}
