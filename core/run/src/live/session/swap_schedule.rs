//! Which graphs take over during a run, and when.

use std::path::{Path, PathBuf};

use super::watched_graph::Went;
use super::{
    ANOTHER_RUN, Replacement, Report, Reporter, Swap, SwapTime, WatchedGraph, load_replacement,
};
use crate::live::{Control, Feed, LiveGraph, StageError, Staged, Stepped};
use crate::model::Model;
use crate::time::{Duration, Instant};

/// How often a watched file is looked at, however fast or slowly rows come.
const LOOK_EVERY: std::time::Duration = std::time::Duration::from_millis(200);

/// Why a graph does not take over, in a word for programs and for people.
type Why = (&'static str, &'static str);
const CHANGED: Why = (
    "changed",
    "has changed: as it was in the shadow until now, it does not take over",
);
const GONE: Why = (
    "changed",
    "is gone: as it was in the shadow until now, it does not take over",
);
const LARGER_ERROR: Why = ("larger_error", "does not take over: its error is larger");
const NOTHING_TO_COMPARE: Why = (
    "nothing_to_compare",
    "does not take over: there was nothing to compare",
);
const DATA_ENDED: Why = ("data_ended", "did not take over: the data ended before");

/// So few values of an output may be missing in the past by chance.
const FEW: f64 = 10.0;

/// Which graphs take over during a run, and when.
#[derive(Debug)]
pub(super) struct SwapSchedule {
    /// Latest first, once there has been a row.
    waiting: Vec<Swap>,
    first: Option<Instant>,
    staged: Option<(Model, PathBuf)>,
    watched: Option<WatchedGraph>,
    shadow: Option<Duration>,
    margin: f64,
    looked: std::time::Instant,
    /// The channels of a row.
    feed: Vec<Feed>,
    /// The outputs that are put out, and where they stand among those of the graph.
    columns: Vec<String>,
    places: Vec<Option<usize>>,
    shown: Vec<f64>,
    /// How many graphs had taken over when the places were found.
    generation: Option<u64>,
    /// At how many rows each of them had a value, of whichever graph.
    gave: Vec<u64>,
    rows: u64,
}

impl SwapSchedule {
    pub(super) fn new(replacement: Replacement, feed: Vec<Feed>, columns: Vec<String>) -> Self {
        let mut schedule = Self {
            waiting: replacement.swaps,
            first: None,
            staged: None,
            watched: replacement.watched,
            shadow: replacement.shadow,
            margin: replacement.margin,
            looked: std::time::Instant::now(),
            feed,
            columns: Vec::new(),
            places: Vec::new(),
            shown: Vec::new(),
            generation: None,
            gave: Vec::new(),
            rows: 0,
        };
        schedule.set_columns(columns);
        schedule
    }

    /// The channels of a row.
    pub(super) fn feed(&self) -> &[Feed] {
        &self.feed
    }

    /// The outputs in the order of the columns.
    pub(super) fn shown(&self) -> &[f64] {
        &self.shown
    }

    /// Puts out these outputs.
    pub(super) fn set_columns(&mut self, columns: Vec<String>) {
        self.gave = vec![0; columns.len()];
        self.shown = vec![f64::NAN; columns.len()];
        self.columns = columns;
        self.generation = None;
    }

    /// Takes what came of a row, and counts which columns have a value; whether it is the first of a graph.
    pub(super) fn show(&mut self, stepped: &Stepped<'_>) -> bool {
        // Two graphs of one revision may give their outputs in another order.
        let is_first = self.generation.replace(stepped.generation) != Some(stepped.generation);
        if is_first {
            let outputs = &stepped.plan.outputs;
            let place = |name: &String| outputs.iter().position(|of| of.name == *name);
            self.places = self.columns.iter().map(place).collect();
        }
        let shown = self.shown.iter_mut().zip(&mut self.gave);
        for ((shown, gave), place) in shown.zip(&self.places) {
            *shown = place.map_or(f64::NAN, |place| stepped.outputs[place]);
            *gave += u64::from(!shown.is_nan());
        }
        is_first
    }

    /// Adds a graph that takes over as soon as it may, after those added before.
    pub(super) fn add(&mut self, path: PathBuf, model: Model) {
        let at = SwapTime::After(Duration::ZERO);
        let is_due =
            |swap: &Swap| matches!(swap.at, SwapTime::After(time) if time == Duration::ZERO);
        let nth = self.first.and(self.waiting.iter().position(is_due));
        let nth = nth.unwrap_or(self.waiting.len());
        self.waiting.insert(nth, Swap { at, path, model });
    }

    /// Does what is due before the row at `now`.
    ///
    /// # Errors
    /// When a graph named at the start cannot take over.
    pub(super) fn before(
        &mut self,
        live: &mut LiveGraph,
        running: &mut Model,
        now: Instant,
        reporter: &dyn Reporter,
    ) -> Result<(), StageError> {
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
        if !(due || look || self.staged.is_some() || self.rows.is_multiple_of(128)) {
            return Ok(());
        }
        pump(live, reporter);
        if look {
            self.look(live, running, now, reporter);
        }
        // One at a time: what is committed takes over with this row, and only then may the next be staged.
        if self.staged.is_some() {
            return match self.judge(live, running, reporter) {
                Err(error) if self.watched.is_some() => {
                    self.refuse(live, &error, reporter);
                    Ok(())
                }
                judged => judged,
            };
        }
        if due
            && let Some(Swap {
                path, mut model, ..
            }) = self.waiting.pop()
        {
            model.take_fits_of(running);
            return self.stage(live, running, (model, path), now, reporter);
        }
        Ok(())
    }

    /// Stages the watched file where it has changed; with a mistake in it, what runs goes on. What is in the shadow goes when it
    /// stands in the file no more.
    fn look(
        &mut self,
        live: &mut LiveGraph,
        running: &mut Model,
        now: Instant,
        reporter: &dyn Reporter,
    ) {
        self.looked = std::time::Instant::now();
        let Some(watched) = &mut self.watched else {
            return;
        };
        let path = watched.path().to_owned();
        if !watched.changed() {
            match watched.went() {
                Some(Went::Away(away)) => {
                    reporter.report(Report::FileGone(away));
                    if self.staged.is_some() {
                        self.withdraw(live, &path, GONE, reporter);
                    }
                }
                Some(Went::Back(back)) => reporter.report(Report::FileBack(back)),
                None => {}
            }
            return;
        }
        *watched = WatchedGraph::of(&path);
        let loaded = load_replacement(&path, std::iter::once(&*running), reporter);
        if self.staged.is_some() {
            let revision = loaded.as_ref().ok().and_then(Model::revision);
            let staged = live.control().and_then(|of| of.staged());
            let staged = staged.map(Staged::revision);
            if revision.is_some() && revision.as_deref() == staged {
                self.staged = loaded.ok().zip(Some(path));
                return;
            }
            self.withdraw(live, &path, CHANGED, reporter);
            if revision.is_some() && revision == running.revision() {
                reporter.report(Report::RunsAlready(path));
                return;
            }
        }
        let model = match loaded {
            Ok(model) => model,
            Err(error) => {
                reporter.report(Report::Unusable(error));
                return reporter.report(Report::refused(&path, "what runs goes on"));
            }
        };
        let mut outputs = model.plan.outputs.iter();
        let is_new = |name: &String| !self.columns.contains(name);
        if let Some(new) = outputs.find(|output| is_new(&output.name)) {
            let why = format!(
                "has the output `{}`, for which there is no column; what runs goes on; {ANOTHER_RUN}",
                new.name
            );
            reporter.report(Report::not_taken_over(&path, ("no_column", &why)));
        } else if let Err(error) = self.stage(live, running, (model, path), now, reporter) {
            self.refuse(live, &error, reporter);
        }
    }

    /// Lets go of what is in the shadow, since its file is no more what it was.
    fn withdraw(&mut self, live: &mut LiveGraph, path: &Path, why: Why, reporter: &dyn Reporter) {
        self.staged = None;
        live.control().into_iter().for_each(Control::discard);
        reporter.report(Report::not_taken_over(path, why));
    }

    /// Lets go of the watched file as it has become.
    fn refuse(&mut self, live: &mut LiveGraph, error: &StageError, reporter: &dyn Reporter) {
        self.staged = None;
        live.control().into_iter().for_each(Control::discard);
        if let Some(watched) = &self.watched {
            Report::unfit(watched.path(), error)
                .into_iter()
                .for_each(|of| reporter.report(of));
        }
    }

    fn stage(
        &mut self,
        live: &mut LiveGraph,
        running: &mut Model,
        (model, path): (Model, PathBuf),
        now: Instant,
        reporter: &dyn Reporter,
    ) -> Result<(), StageError> {
        let staged = live.stage(&model, false)?;
        let (past, mut silent) = staged.silent();
        // What runs seldom gives any either, as a settle time, which there is when the set point has changed.
        silent.retain(|name| !self.gives_seldom(name, running, now, past));
        let has = |name: &str| model.plan.outputs.iter().any(|output| output.name == name);
        let outputs = running.plan.outputs.iter();
        let outputs = outputs.map(|output| output.name.clone());
        let lacking: Vec<String> = outputs.filter(|name| !has(name)).collect();
        if !lacking.is_empty() {
            reporter.report(Report::Lacking(path.clone(), lacking));
        }
        reporter.report(Report::staged(&path, staged));
        if !silent.is_empty() {
            reporter.report(Report::Silent {
                path: path.clone(),
                past,
                outputs: silent.into_iter().map(str::to_owned).collect(),
            });
        }
        self.staged = Some((model, path));
        match self.shadow {
            Some(duration) => match live.control() {
                Some(control) => control.shadow(duration, self.margin),
                None => Ok(()),
            },
            None => self.commit(live, running),
        }
    }

    /// Whether what runs has an output of which no more than a few values are to be expected in so long a past.
    fn gives_seldom(&self, name: &str, running: &Model, now: Instant, past: Duration) -> bool {
        let mut columns = self.columns.iter().zip(&self.gave);
        let mut outputs = running.plan.outputs.iter();
        let gave = columns.find_map(|(column, gave)| (column == name).then_some(*gave));
        let ran = self.first.map_or(Duration::ZERO, |first| now - first);
        outputs.any(|output| output.name == name)
            && gave
                .is_some_and(|gave| gave as f64 * past.as_ns() as f64 <= FEW * ran.as_ns() as f64)
    }

    fn judge(
        &mut self,
        live: &mut LiveGraph,
        running: &mut Model,
        reporter: &dyn Reporter,
    ) -> Result<(), StageError> {
        let verdict = live.control().and_then(|of| of.verdict());
        let Some(verdict) = verdict.filter(|verdict| verdict.over) else {
            return Ok(());
        };
        // A file that is being written is read first.
        if self.watched.as_ref().is_some_and(WatchedGraph::differs) {
            return Ok(());
        }
        let passes = verdict.passes;
        reporter.report(Report::Shadow(verdict));
        let why = match passes {
            Some(true) => return self.commit(live, running),
            None => NOTHING_TO_COMPARE,
            Some(false) => LARGER_ERROR,
        };
        if let Some((_, path)) = self.staged.take() {
            reporter.report(Report::not_taken_over(&path, why));
        }
        live.control().into_iter().for_each(Control::discard);
        Ok(())
    }

    fn commit(&mut self, live: &mut LiveGraph, running: &mut Model) -> Result<(), StageError> {
        live.control().map_or(Ok(()), Control::commit)?;
        if let Some((model, _)) = self.staged.take() {
            *running = model;
        }
        Ok(())
    }

    /// Reports, once the data have ended, what has happened since and what has not.
    pub(super) fn end(&self, live: &mut LiveGraph, reporter: &dyn Reporter) {
        pump(live, reporter);
        let shadowed = self.staged.iter().map(|(_, path)| path);
        let waiting = self.waiting.iter().rev().map(|swap| &swap.path);
        for path in shadowed.chain(waiting) {
            reporter.report(Report::not_taken_over(path, DATA_ENDED));
        }
    }
}

fn pump(live: &mut LiveGraph, reporter: &dyn Reporter) {
    for notice in live.events().0 {
        reporter.report(Report::Swap(notice));
    }
}
