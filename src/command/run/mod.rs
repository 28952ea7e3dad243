//! `athermal run`: rows in, the graph's outputs out.

mod reports;
pub(super) mod stop;
mod swap;

use std::path::PathBuf;
use std::sync::Arc;

use athermal::Model;
use athermal::core::compile::Wanted;
use athermal::core::document::{NO_FILE, lasts};
use athermal::files::{
    FileError, Flush, Layout, Options, Reader, STANDARD_INPUT, TimeColumn, WithRevision, Writer,
    begun_columns, layout,
};
use athermal::run::live::monitor::{Finding, Watch};
use athermal::run::live::session::WatchedGraph;
use athermal::run::live::store::{FileLock, OutputIdentity};
use athermal::run::live::{Report, Reporter as _, Session, SessionOptions, Sink, StateStore};
use athermal::run::recording::thin;
use clap::Args;
use serde_json::json;

use crate::command::aside::check_apart;
use crate::command::unread;
use crate::message::Message;
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_analysis::figures::{counted, instant, seconds};
use athermal_jobs::faults::{self, ChannelWatch, Purpose};
use athermal_jobs::model::{self, check_fitted, warn_unfitted, warn_without_novelty};
use athermal_jobs::{beyond, path, refused, remarks, thinned};
use reports::Reports;

/// Run a model: rows in, predictions out
///
/// Reads rows of measurements and writes one row per tick with the graph's outputs. Each row is answered before the next is read.
/// Columns are the time as in the input, then the outputs. A cell is empty where the node did not run or gave nothing at the tick.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal run model.json --input test.csv --output predicted.csv\n  \
                        tail -n +1 -f log.csv | athermal run model.json --input - --output -"
)]
pub struct Run {
    /// The model, or a graph that names one or in which nothing needs fitting
    #[arg(value_parser = athermal_jobs::path::graph_or_model())]
    model: PathBuf,
    /// CSV or JSON lines; `-` is standard input
    #[arg(long, short, value_name = "FILE", value_parser = athermal_jobs::path::recording())]
    input: PathBuf,
    /// CSV or JSON lines by its ending, CSV without one; `-` is standard output, as CSV, or JSON lines with `--format json`
    #[arg(long, short, value_name = "FILE", default_value = "-", value_parser = athermal_jobs::path::written())]
    output: PathBuf,
    /// Take cells and rows that cannot be read as missing, and count them
    #[arg(long)]
    lenient: bool,
    /// Let no estimator learn while it runs; votes still go by recent errors
    #[arg(long)]
    frozen: bool,
    /// Keep the state in this file, and go on from it if it is there. The state is what an earlier run knew and had learned. It is saved
    /// after the first row, once a minute while rows come, and when the input ends. Rows up to the last one known are skipped. Existing
    /// output is appended to, also after a cold start. Two runs at once cannot keep one file. With `--watch` the file has the state of
    /// whatever graph runs, and FILE.graph.json that graph
    #[arg(long, value_name = "FILE", conflicts_with = "swap_at")]
    state: Option<PathBuf>,
    #[command(flatten)]
    swap: swap::Options,
}

impl Run {
    /// Runs until the input ends.
    ///
    /// # Errors
    /// When the model or the input cannot be used, or the output not written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        self.check_files()?;
        let state = self.state.as_deref();
        let state = state.map(|path| StateStore::open(path, self.swap.watch()));
        let state = state.transpose()?;
        let _lock = FileLock::acquire(&self.output).ok_or_else(|| {
            Failure::Outside(format!(
                "{}: another run writes it: end that one first, or name another file with `--output`",
                self.output.display()
            ))
        })?;
        let (terminal, ends) = (*terminal, self.ends());
        let reports = Reports { terminal, ends };
        let (model, watched) = self.load(&reports, state.as_ref())?;
        warn_unfitted(&terminal, &model, &self.model);
        warn_without_novelty(&terminal, &model, &self.model);
        let options = SessionOptions {
            state,
            frozen: self.frozen,
            replacement: self.swap.replacement(&model, watched, &reports)?,
        };
        let read = options.reading(&model);
        let mut reader = self.open(&terminal, layout(&read)).map_err(|failure| {
            let replacement = options.replacement.as_ref();
            swap::not_read(failure, replacement.and_then(|of| of.watched.as_ref()))
        })?;
        let thinned = thinned::of(Some(&self.model), &model)?;
        let time = TimeColumn::from(&read.time);
        let mut columns = options.columns(&model);
        let is_replaceable = options.replacement.is_some();
        if is_replaceable {
            columns.push("revision".to_owned());
            self.widen(&mut columns);
        }
        let usual = model.sample_ranges().to_vec();
        let mut watch = Watch::new(&model.plan, &read.sources, &usual);
        let mut looks = ChannelWatch::at(&model.plan);
        let mut session = Session::begin(model, options, &reports)?;
        if ends {
            session.watch(&mut looks);
        } else {
            session.watch(&mut watch);
        }
        let writer = self.writer(&reports, &session, reader.layout(), &columns)?;
        session.watch_output(OutputIdentity::of(&self.output));
        if let Some(last) = session.append_after(writer.stood()) {
            reader.begin_after(last, &instant(seconds(last)));
        }
        let mut sink: Box<dyn Sink> = if is_replaceable {
            columns.pop();
            session.set_columns(columns);
            Box::new(WithRevision(writer))
        } else {
            Box::new(writer)
        };
        let mut rows = thin(Box::new(&mut reader), &read, &thinned, |at| time.write(at));
        session.run(&mut *rows, &mut *sink)?;
        drop(rows);
        let none = session.output().none(session.engine());
        reports.found(
            none.filter(|_| ends)
                .map(Finding::NoOutput)
                .into_iter()
                .collect(),
        );
        let (engine, ticks) = (session.engine(), session.output().rows());
        let (plan, ranges) = (Arc::clone(engine.plan()), engine.sample_ranges());
        let (refused, rejected) = (engine.refused(), engine.rejected_channels());
        if ends {
            faults::warn(&terminal, &looks.found(Purpose::Run));
        }
        if stop::is_stopped() {
            terminal.note("stopped: what had been read until then has been put out");
        }
        let input = match self.input_is_standard() {
            true => STANDARD_INPUT.to_owned(),
            false => self.input.display().to_string(),
        };
        let files = [(input, reader.report().clone())];
        remarks::warn(&terminal, &plan, &files, refused, &rejected);
        if ends {
            beyond::warn(&terminal, &beyond::beyond(&usual, &ranges));
        }
        // For people, only what is not in order.
        if terminal.events {
            let report = reader.report();
            let by_time = report.refused_time.count + report.repeated_time.count;
            let facts = json!({
                "ticks": ticks,
                "refused": by_time + refused,
                "unreadable_rows": report.refused_rows.count,
                "unreadable_cells": report.bad_cells.count,
                "rejected": rejected,
            });
            let rows = counted(ticks, "row");
            terminal.note(Message::new("ended", facts, format_args!("{rows} stepped")));
        }
        Ok(Answer::Fine)
    }

    /// Refuses an output or a state that is another file of the run.
    fn check_files(&self) -> Result<(), Failure> {
        path::check_ending(&self.output)?;
        let read = [&*self.model, &*self.input];
        let swapped = self.swap.paths();
        check_apart("--output", &self.output, read.into_iter().chain(swapped))?;
        let Some(state) = &self.state else {
            return Ok(());
        };
        if state.as_os_str() == "-" {
            let words = "--state -: what a run knows is kept in a file, from one run to the next; name a file";
            return Err(Failure::Request(words.to_owned()));
        }
        if !lasts(state) {
            let words = format!("--state {}: {NO_FILE}", state.display());
            return Err(Failure::Request(words));
        }
        // Where the output is a stream, the state is none.
        let output = Some(&*self.output).filter(|path| path.as_os_str() != "-");
        let others = || read.into_iter().chain(output);
        check_apart("--state", state, others())?;
        if self.swap.watch() {
            for beside in StateStore::model_paths(state) {
                check_apart("--state", &beside, others())?;
            }
        }
        Ok(())
    }

    /// The graph to go on with, and its file as it stands to that: what ran last and has been kept, where the file has another.
    fn load(
        &self,
        reports: &Reports,
        state: Option<&StateStore>,
    ) -> Result<(Model, WatchedGraph), Failure> {
        let terminal = &reports.terminal;
        let last = state.and_then(StateStore::last_model);
        // As it is before it is read, so that no change is missed.
        let watched = WatchedGraph::of(&self.model);
        let given = model::load(&self.model, Wanted::default(), terminal);
        if let Ok(given) = &given {
            unread::warn(terminal, &self.model, &given.graph);
        }
        let Some(last) = last else {
            let given = given?;
            check_fitted(&given, &self.model)?;
            return Ok((given, watched));
        };
        match given {
            Ok(mut given) => {
                given.take_fits_of(&last);
                if given.revision() == last.revision() {
                    return Ok((given, watched));
                }
                terminal.warning(format_args!(
                    "{} is not what ran last: that goes on, and the file is taken as a change of it",
                    self.model.display()
                ));
            }
            Err(failure) => {
                terminal.setback(&failure);
                reports.report(Report::refused(&self.model, "what ran last goes on"));
            }
        }
        Ok((last, watched.unlike()))
    }

    /// A recording is read as it is for fitting. Of a file that is still being written no row waits for the next.
    fn reading(&self) -> Options {
        Options {
            lenient: self.lenient,
            joins: self.ends(),
            goes_on: self.state.is_some() || !self.ends(),
            ..Options::default()
        }
    }

    fn open(&self, terminal: &Terminal, layout: Layout) -> Result<Reader, Failure> {
        let options = self.reading();
        if self.ends() {
            return Ok(Reader::open(&self.input, layout, options)?);
        }
        let opened = Reader::open_through(&self.input, layout, options, stop::until_stopped);
        let mut reader = match opened {
            // Stopped before there was anything.
            Err(FileError::Empty { .. }) if stop::is_stopped() => return Err(Failure::Exit(0)),
            opened => opened?,
        };
        let terminal = *terminal;
        reader.report_first(move |first| {
            let words = match first {
                FileError::MissingColumns { .. } => {
                    format!("{first} (missing until a line has it)")
                }
                FileError::StillRefused { .. } | FileError::HeaderAgain { moved: true, .. } => {
                    first.to_string()
                }
                _ => format!("{}; others like it are counted", first.without_advice()),
            };
            terminal.warning(refused::message(first, None, words));
        });
        Ok(reader)
    }

    /// Takes all columns of an output that is appended to, where some are of outputs that earlier graphs had.
    fn widen(&self, columns: &mut Vec<String>) {
        let state = self.state.as_ref();
        let stood = state.and_then(|_| begun_columns(&self.output));
        if let Some((_time, stood)) = stood.as_deref().and_then(<[String]>::split_first)
            && stood.last() == columns.last()
            && columns.iter().all(|column| stood.contains(column))
        {
            *columns = stood.to_vec();
        }
    }

    /// Appends to the output of an earlier run where a state is kept, also after a cold start: a source that only gives what is new
    /// cannot bring back what stands there.
    fn writer(
        &self,
        reports: &Reports,
        session: &Session<'_>,
        read: &Layout,
        columns: &[String],
    ) -> Result<Writer, Failure> {
        let time = read.time.columns.title();
        let flush = match self.ends() {
            true => Flush::Buffered,
            false => Flush::EachRow,
        };
        if reports.terminal.format == Format::Json && self.output.as_os_str() == "-" {
            let (name, stream) = ("standard output", std::io::stdout());
            let lines = athermal::files::Format::JsonLines;
            let writer = Writer::to_write(name, stream, lines, &time, columns, flush);
            return Ok(writer?);
        }
        if self.state.is_none() {
            return Ok(Writer::create(&self.output, &time, columns, flush)?);
        }
        let seen = session.seen();
        let writer = Writer::resume(&self.output, &read.time, columns, seen, flush)?;
        reports.appended(&self.output, writer.stood(), seen);
        Ok(writer)
    }

    /// Whether the input is known to end. Beside a machine it is not, and reports cannot wait for the end.
    fn ends(&self) -> bool {
        !self.input_is_standard() && self.input.is_file()
    }

    fn input_is_standard(&self) -> bool {
        self.input.as_os_str() == "-"
    }
}
