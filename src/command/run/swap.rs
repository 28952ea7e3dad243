//! Decides when a graph is replaced while recorded data run through it.

pub(super) mod told;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal::core::compile::Wanted;
use athermal::core::document::TimeBase;
use athermal::core::time::Civil;
use athermal::files::{TimeColumn, TimeForm};
use athermal::run::live::{Control, Feed, StageError, Staged};
use athermal::{Duration, Instant, Model};
use clap::Args;

use super::ran;
use super::watched::{Watched, Went};
use crate::command::model::{self, check_fitted, few, warn_unfitted};
use crate::terminal::{Failure, Terminal};
use athermal_analysis::figures::length;

/// When and how the graph is replaced.
#[derive(Debug, Args)]
pub struct Options {
    /// Replace the graph at this time of the data, or so long after its first row, by another model or a graph whose
    /// estimators mean the same
    #[arg(
        long,
        value_name = "TIME=GRAPH",
        allow_hyphen_values = true,
        group = "replaced"
    )]
    swap_at: Vec<String>,
    /// Compare a new graph with the running one for so long before it takes over
    #[arg(long, value_name = "DURATION", value_parser = some_time, requires = "replaced")]
    shadow: Option<Duration>,
    /// By how much the error of a new graph may be larger, such as "5%"
    #[arg(
        long,
        value_name = "PERCENT",
        default_value = "0%",
        value_parser = percent,
        allow_hyphen_values = true,
        requires = "shadow"
    )]
    margin: f64,
    /// Replace the graph whenever its file changes. With `--state` a run that is started again goes on with what ran last, and takes
    /// another graph that it finds in the file as a change
    #[arg(long, group = "replaced")]
    watch: bool,
}

/// How often a watched file is looked at, however fast or slowly rows come.
const LOOK_EVERY: std::time::Duration = std::time::Duration::from_millis(200);

/// So few values of an output may be missing in the past by chance.
const FEW: f64 = 10.0;

fn percent(text: &str) -> Result<f64, String> {
    let digits = text.trim().strip_suffix('%').map(str::trim);
    match digits.and_then(|digits| digits.parse::<f64>().ok()) {
        Some(percent) if percent.is_finite() && percent >= 0.0 => Ok(percent / 100.0),
        _ => Err(format!(
            "expected a percentage such as \"5%\", found {text:?}"
        )),
    }
}

fn some_time(text: &str) -> Result<Duration, String> {
    match text.parse::<Duration>() {
        Ok(time) if time > Duration::ZERO => Ok(time),
        Ok(_) => Err(format!(
            "expected some time such as \"30min\", found {text:?}"
        )),
        Err(error) => Err(error.to_string()),
    }
}

impl Options {
    /// Whether the graph may be replaced at all.
    #[must_use]
    pub fn any(&self) -> bool {
        self.watch || !self.swap_at.is_empty()
    }

    /// Whether the graph's file is watched.
    #[must_use]
    pub fn watch(&self) -> bool {
        self.watch
    }

    /// The files of the graphs named at the start.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        let named = self.swap_at.iter().filter_map(|text| text.split_once('='));
        named.map(|(_, path)| Path::new(path))
    }

    /// The graphs named at the start, each with the time at which it takes over.
    ///
    /// # Errors
    /// When a time cannot be read, or a graph not be used.
    pub fn schedule(&self, running: &Model, terminal: &Terminal) -> Result<Vec<Swap>, Failure> {
        let mut swaps: Vec<Swap> = Vec::new();
        for text in &self.swap_at {
            let named = text.split_once('=').filter(|(_, path)| !path.is_empty());
            let (time, path) = named.ok_or_else(|| {
                Failure::Request(format!("--swap-at takes TIME=GRAPH, such as 3600=new.toml or 1h=new.toml, found {text:?}"))
            })?;
            let at = When::read(time, &running.plan.time)?;
            let known = std::iter::once(running).chain(swaps.iter().map(|swap| &swap.model));
            let model = load(Path::new(path), known, terminal)?;
            let known = std::iter::once(running).chain(swaps.iter().map(|swap| &swap.model));
            let refused = |known: &Model| StageError::between(&known.plan, &model.plan);
            if let Some(refused) = known.filter_map(refused).next() {
                return Err(Failure::Request(format!("{path}: {refused}")));
            }
            swaps.push(Swap {
                at,
                path: path.into(),
                model,
            });
        }
        Ok(swaps)
    }
}

/// When a graph takes over.
#[derive(Debug, Clone, Copy)]
enum When {
    At(Instant),
    /// So long after the first row.
    After(Duration),
}

/// A graph that takes over at a time.
#[derive(Debug)]
pub struct Swap {
    at: When,
    path: PathBuf,
    /// The graph, with fits.
    pub model: Model,
}

/// A graph or model, with the fits of what means the same in one that is known.
fn load<'a>(
    path: &Path,
    known: impl Iterator<Item = &'a Model>,
    terminal: &Terminal,
) -> Result<Model, Failure> {
    let mut model = model::load(path, Wanted::default(), terminal)?;
    // A graph goes by the fits of what runs; a model in which some are missing was to bring its own.
    let mut taken = model
        .card
        .as_ref()
        .map_or_else(Vec::new, |_| model.unfitted());
    let doubtful: Vec<String> = known.flat_map(|known| model.take_fits_of(known)).collect();
    check_fitted(&model, path)?;
    taken.retain(|node| model.fitted.contains_key(node));
    if !taken.is_empty() {
        terminal.warning(format_args!(
            "{}: {} could not be fitted there, and {} the fit of what ran before",
            path.display(),
            few(&taken),
            if taken.len() == 1 { "keeps" } else { "keep" },
        ));
    }
    warn_unfitted(terminal, &model, path);
    if !doubtful.is_empty() {
        terminal.warning(format_args!(
            "{}: {} {} as fitted before, though what they read is now made in another way: fit the graph anew to be sure",
            path.display(),
            doubtful.join(", "),
            if doubtful.len() == 1 { "stays" } else { "stay" },
        ));
    }
    Ok(model)
}

impl When {
    /// A time as the data give it, or a duration.
    fn read(text: &str, base: &TimeBase) -> Result<Self, Failure> {
        let mut column = TimeColumn::from(base);
        let own = column.read(text.as_bytes(), None);
        column.form = TimeForm::Rfc3339;
        let at = match own.or_else(|| column.read(text.as_bytes(), None)) {
            Some(Civil::At(at)) => Some(Self::At(at)),
            _ => None,
        };
        let after = || text.parse().ok().map(Self::After);
        at.or_else(after).ok_or_else(|| {
            Failure::Request(format!("--swap-at: {text:?} is no time of these data: write it as they do, or as a duration such as 6h"))
        })
    }

    fn instant(self, first: Instant) -> Instant {
        match self {
            Self::At(at) => at,
            Self::After(after) => first + after,
        }
    }
}

/// The course of replacements during a run.
pub struct Course<'a> {
    terminal: &'a Terminal,
    options: &'a Options,
    /// Latest first, once there has been a row.
    waiting: Vec<Swap>,
    first: Option<Instant>,
    running: Model,
    staged: Option<(Model, PathBuf)>,
    watched: Option<Watched>,
    looked: std::time::Instant,
    columns: Vec<String>,
    /// At how many rows each column had a value, of whichever graph.
    gave: Vec<u64>,
    rows: u64,
}

impl<'a> Course<'a> {
    /// The course that the options ask for; `watched` is the graph's file, which only the option lets watch.
    pub fn new(
        terminal: &'a Terminal,
        options: &'a Options,
        watched: Watched,
        running: Model,
        swaps: Vec<Swap>,
        columns: Vec<String>,
    ) -> Self {
        Self {
            terminal,
            options,
            waiting: swaps,
            first: None,
            running,
            staged: None,
            watched: options.watch.then_some(watched),
            looked: std::time::Instant::now(),
            gave: vec![0; columns.len()],
            columns,
            rows: 0,
        }
    }

    /// The graph that runs, once the row has been stepped before which it took over.
    pub fn running(&self) -> &Model {
        &self.running
    }

    /// Counts which columns have a value at a row.
    pub fn gave(&mut self, values: &[f64]) {
        for (gave, value) in self.gave.iter_mut().zip(values) {
            *gave += u64::from(!value.is_nan());
        }
    }

    /// Does what is due before the row at `now`.
    ///
    /// # Errors
    /// When a graph named at the start cannot take over.
    pub fn before(&mut self, control: &mut Control, now: Instant) -> Result<(), Failure> {
        self.rows += 1;
        let first = *self.first.get_or_insert_with(|| {
            // Of two for the same time, the first named takes over first.
            self.waiting.reverse();
            self.waiting
                .sort_by_key(|swap| std::cmp::Reverse(swap.at.instant(now)));
            now
        });
        let next = self.waiting.last();
        let due = next.is_some_and(|swap| swap.at.instant(first) <= now);
        let look = self.watched.is_some() && self.looked.elapsed() >= LOOK_EVERY;
        if !(due || look || self.staged.is_some() || self.rows.is_multiple_of(1024)) {
            return Ok(());
        }
        told::notices(self.terminal, control.pump());
        if look {
            self.look(control, now);
        }
        // One at a time: what is committed takes over with this row, and only then may the next be staged.
        if self.staged.is_some() {
            return match self.judge(control) {
                Err(error) if self.watched.is_some() => {
                    self.refuse(control, &error);
                    Ok(())
                }
                judged => judged.map_err(refused),
            };
        }
        if due
            && let Some(Swap {
                path, mut model, ..
            }) = self.waiting.pop()
        {
            model.take_fits_of(&self.running);
            return self.stage(control, model, path, now).map_err(refused);
        }
        Ok(())
    }

    /// Stages the watched file where it has changed; a mistake in it is told, and what runs goes on. What is in the shadow goes when it
    /// stands in the file no more.
    fn look(&mut self, control: &mut Control, now: Instant) {
        self.looked = std::time::Instant::now();
        let Some(watched) = &mut self.watched else {
            return;
        };
        if !watched.changed() {
            if let Some(went) = watched.went() {
                told::went(self.terminal, &went);
                if matches!(went, Went::Away(_)) && self.staged.is_some() {
                    let path = watched.path.clone();
                    self.withdraw(control, &path, "is gone");
                }
            }
            return;
        }
        let path = watched.path.clone();
        *watched = Watched::of(&path);
        let loaded = load(&path, std::iter::once(&self.running), self.terminal);
        if self.staged.is_some() {
            let revision = loaded.as_ref().ok().and_then(ran::revision);
            let staged = control.staged().map(Staged::revision);
            if revision.is_some() && revision.as_deref() == staged {
                self.staged = loaded.ok().zip(Some(path));
                return;
            }
            self.withdraw(control, &path, "has changed");
            if revision.is_some() && revision == ran::revision(&self.running) {
                let words = format_args!("{} is what runs again", path.display());
                self.terminal.note(words);
                return;
            }
        }
        let model = match loaded {
            Ok(model) => model,
            Err(failure) => {
                self.terminal.setback(&failure);
                self.terminal
                    .warning(told::unusable(&path, "what runs goes on"));
                return;
            }
        };
        let outputs = &model.plan.outputs;
        if let Some(new) = outputs
            .iter()
            .find(|output| !self.columns.contains(&output.name))
        {
            let words = format_args!(
                "has the output `{}`, for which there is no column; what runs goes on; {}",
                new.name,
                told::ANOTHER_RUN
            );
            self.terminal
                .warning(told::not_taken_over(&path, "no_column", words));
        } else if let Err(error) = self.stage(control, model, path, now) {
            self.refuse(control, &error);
        }
    }

    /// Lets go of what is in the shadow, since its file is no more what it was.
    fn withdraw(&mut self, control: &mut Control, path: &Path, why: &str) {
        self.staged = None;
        control.discard();
        let words = format_args!("{why}: as it was in the shadow until now, it does not take over");
        self.terminal
            .warning(told::not_taken_over(path, "changed", words));
    }

    /// Tells why the watched file, as it has become, does not take over, and lets go of it.
    fn refuse(&mut self, control: &mut Control, error: &StageError) {
        self.staged = None;
        control.discard();
        let Some(Watched { path, .. }) = &self.watched else {
            return;
        };
        let why = Failure::Request(format!("{}: {error}", path.display()));
        self.terminal.setback(&why);
        self.terminal.warning(told::refused(path, error));
    }

    fn stage(
        &mut self,
        control: &mut Control,
        model: Model,
        path: PathBuf,
        now: Instant,
    ) -> Result<(), StageError> {
        let staged = control.stage(&model, false)?;
        self.warn_lacking(&model, &path);
        self.terminal.note(told::staged(&path, staged));
        let (past, mut silent) = staged.silent();
        // What runs seldom gives any either, as a settle time, which there is when the set point has changed.
        silent.retain(|name| !self.gives_seldom(name, now, past));
        if !silent.is_empty() {
            let named: Vec<_> = silent.iter().map(|name| format!("`{name}`")).collect();
            self.terminal.warning(format_args!(
                "{} gives no {} over the past {} that it was warmed by: are its sensors those of this machine?",
                path.display(),
                named.join(", "),
                length(past)
            ));
        }
        self.staged = Some((model, path));
        match self.options.shadow {
            Some(duration) => control.shadow(duration, self.options.margin),
            None => self.commit(control),
        }
    }

    /// Whether what runs has an output of which no more than a few values are to be expected in so long a past.
    fn gives_seldom(&self, name: &str, now: Instant, past: Duration) -> bool {
        let mut columns = self.columns.iter().zip(&self.gave);
        let mut outputs = self.running.plan.outputs.iter();
        let gave = columns.find_map(|(column, gave)| (column == name).then_some(*gave));
        let ran = self.first.map_or(Duration::ZERO, |first| now - first);
        outputs.any(|output| output.name == name)
            && gave
                .is_some_and(|gave| gave as f64 * past.as_ns() as f64 <= FEW * ran.as_ns() as f64)
    }

    /// Tells of outputs of what runs that a new graph does not have, as one for another machine would not.
    fn warn_lacking(&self, new: &Model, path: &Path) {
        let has = |name: &str| new.plan.outputs.iter().any(|output| output.name == name);
        let running = self.running.plan.outputs.iter();
        let lacking: Vec<_> = running
            .filter(|output| !has(&output.name))
            .map(|output| format!("`{}`", output.name))
            .collect();
        if !lacking.is_empty() {
            let (what, are) = match lacking.len() {
                1 => ("output", "whose column is empty"),
                _ => ("outputs", "whose columns are empty"),
            };
            self.terminal.warning(format_args!(
                "{} has no {what} {}, {are} while it runs",
                path.display(),
                lacking.join(", ")
            ));
        }
    }

    fn judge(&mut self, control: &mut Control) -> Result<(), StageError> {
        let Some(verdict) = control.verdict().filter(|verdict| verdict.over) else {
            return Ok(());
        };
        // A file that is being written is read first.
        if self.watched.as_ref().is_some_and(Watched::differs) {
            return Ok(());
        }
        self.terminal.note(told::shadow(&verdict));
        if verdict.passes == Some(true) {
            return self.commit(control);
        }
        let (reason, why) = match verdict.passes {
            None => ("nothing_to_compare", "there was nothing to compare"),
            Some(_) => ("larger_error", "its error is larger"),
        };
        if let Some((_, path)) = self.staged.take() {
            let words = format_args!("does not take over: {why}");
            self.terminal
                .warning(told::not_taken_over(&path, reason, words));
        }
        control.discard();
        Ok(())
    }

    fn commit(&mut self, control: &mut Control) -> Result<(), StageError> {
        control.commit()?;
        if let Some((model, _)) = self.staged.take() {
            self.running = model;
        }
        Ok(())
    }

    /// Tells, once the data have ended, what has happened since and what has not.
    pub fn end(&self, control: &mut Control) {
        told::notices(self.terminal, control.pump());
        let shadowed = self.staged.iter().map(|(_, path)| path);
        let waiting = self.waiting.iter().rev().map(|swap| &swap.path);
        for path in shadowed.chain(waiting) {
            let words = "did not take over: the data ended before";
            self.terminal
                .warning(told::not_taken_over(path, "data_ended", words));
        }
    }
}

/// All channels that some graph reads, and all columns that some graph gives.
#[must_use]
pub fn union(running: &Model, swaps: &[Swap]) -> (Vec<Feed>, Vec<String>) {
    let mut feed = Vec::new();
    let mut columns = Vec::new();
    for model in std::iter::once(running).chain(swaps.iter().map(|swap| &swap.model)) {
        for channel in Feed::of(&model.plan) {
            if !feed.contains(&channel) {
                feed.push(channel);
            }
        }
        for output in &model.plan.outputs {
            if !columns.contains(&output.name) {
                columns.push(output.name.clone());
            }
        }
    }
    (feed, columns)
}

/// The plan whose sources are all channels of a feed, for laying out the columns that are read.
#[must_use]
pub fn reading(running: &Model, swaps: &[Swap], feed: &[Feed]) -> athermal::core::compile::Plan {
    let mut plan = (*Arc::clone(&running.plan)).clone();
    let models = || std::iter::once(running).chain(swaps.iter().map(|swap| &swap.model));
    let source = |channel: &Feed| {
        let mut read = models().filter_map(|model| channel.source(&model.plan));
        read.next().cloned()
    };
    plan.sources = feed.iter().filter_map(source).collect();
    plan
}

fn refused(error: StageError) -> Failure {
    Failure::Request(error.to_string())
}
