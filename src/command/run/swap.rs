//! The options of a replacement, read.

use std::path::Path;

use athermal::core::document::TimeBase;
use athermal::core::time::Civil;
use athermal::files::{TimeColumn, TimeForm};
use athermal::run::live::session::{ANOTHER_RUN, Swap, SwapTime, WatchedGraph, load_replacement};
use athermal::run::live::{Replacement, Reporter, StageError};
use athermal::{Duration, Model};
use clap::Args;

use crate::command::numbers;
use crate::terminal::Failure;

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
        value_parser = numbers::percent,
        allow_hyphen_values = true,
        requires = "shadow"
    )]
    margin: f64,
    /// Replace the graph whenever its file changes. With `--state` a run that is started again goes on with what ran last, and takes
    /// another graph that it finds in the file as a change
    #[arg(long, group = "replaced")]
    watch: bool,
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

    /// How the graph is replaced, where it is; `watched` is its file.
    ///
    /// # Errors
    /// When a time cannot be read, or a graph not be used.
    pub fn replacement(
        &self,
        running: &Model,
        watched: WatchedGraph,
        reporter: &dyn Reporter,
    ) -> Result<Option<Replacement>, Failure> {
        if !self.watch && self.swap_at.is_empty() {
            return Ok(None);
        }
        let mut swaps: Vec<Swap> = Vec::new();
        for text in &self.swap_at {
            let named = text.split_once('=').filter(|(_, path)| !path.is_empty());
            let (time, path) = named.ok_or_else(|| {
                Failure::Request(format!("--swap-at takes TIME=GRAPH, such as 3600=new.toml or 1h=new.toml, found {text:?}"))
            })?;
            let at = swap_time(time, &running.plan.time)?;
            let known = std::iter::once(running).chain(swaps.iter().map(|swap| &swap.model));
            let model = load_replacement(Path::new(path), known, reporter)?;
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
        Ok(Some(Replacement {
            swaps,
            watched: self.watch.then_some(watched),
            shadow: self.shadow,
            margin: self.margin,
        }))
    }
}

/// Why an input cannot be read: where it is not the watched graph that runs, that may be the one for it.
pub fn not_read(failure: Failure, watched: Option<&WatchedGraph>) -> Failure {
    match (failure, watched) {
        (Failure::Request(why), Some(watched)) if watched.is_unlike() => Failure::Request(format!(
            "{why} (that is what the graph reads that ran last and would go on; {} holds another: {ANOTHER_RUN})",
            watched.path().display()
        )),
        (other, _) => other,
    }
}

/// A time as the data give it, or a duration.
fn swap_time(text: &str, base: &TimeBase) -> Result<SwapTime, Failure> {
    let mut column = TimeColumn::from(base);
    let own = column.read(text.as_bytes(), None);
    column.form = TimeForm::Rfc3339;
    let at = match own.or_else(|| column.read(text.as_bytes(), None)) {
        Some(Civil::At(at)) => Some(SwapTime::At(at)),
        _ => None,
    };
    let after = || text.parse().ok().map(SwapTime::After);
    at.or_else(after).ok_or_else(|| {
        Failure::Request(format!("--swap-at: {text:?} is no time of these data: write it as they do, or as a duration such as 6h"))
    })
}
