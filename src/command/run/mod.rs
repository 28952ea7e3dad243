//! `athermal run`: rows in, the graph's outputs out.

mod heard;
mod held;
mod kept;
mod ran;
mod rejected;
mod sensors;
mod standing;
mod stop;
mod swap;
mod watched;

use std::path::PathBuf;

use athermal::core::compile::{Plan, SourceChannel, Wanted};
use athermal::core::document::{NO_FILE, lasts};
use athermal::core::engine::SampleRange;
use athermal::diagnosis::feedback;
use athermal::files::{
    FileError, Flush, Layout, Options, Reader, STANDARD_INPUT, WithRevision, Writer, begun_columns,
    layout,
};
use athermal::run::live::{self, Frame, LiveOptions, RunError, Sink, pair_from};
use athermal::run::recording::{Event, Samples, Source};
use athermal::{Engine, Model};
use clap::Args;
use serde_json::json;

use crate::command::aside::check_apart;
use crate::command::model::{self, check_fitted, warn_unfitted};
use crate::command::{beyond, data, refused, unread};
use crate::message::Message;
use crate::terminal::{Answer, Failure, Format, Terminal, outside};
use athermal_analysis::figures::{counted, instant, length, seconds};
use heard::Heard;
use held::Held;
use kept::Kept;
use ran::Ran;
use rejected::Ranged;
use sensors::Sensors;
use standing::Standing;
use watched::Watched;

/// Run a model: rows in, predictions out
///
/// Reads rows of measurements and writes one row per tick with the graph's outputs, as soon as it is read. Columns are the
/// time as in the input, then the outputs; a cell is empty where the node did not run or gave nothing at the tick.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal run model.json --input test.csv --output predicted.csv\n  \
                        tail -n +1 -f log.csv | athermal run model.json --input - --output -"
)]
pub struct Run {
    /// The model, or a graph that names one or in which nothing needs fitting
    model: PathBuf,
    /// CSV or JSON lines; `-` is standard input
    #[arg(long, short, value_name = "FILE")]
    input: PathBuf,
    /// CSV or JSON lines by its ending, CSV without one; `-` is standard output, as CSV, or JSON lines with `--format json`
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    /// Take cells and rows that cannot be read as missing, and count them
    #[arg(long)]
    lenient: bool,
    /// Let no estimator learn while it runs; votes still go by recent errors
    #[arg(long)]
    frozen: bool,
    /// Go on from what an earlier run knew and had learned, if the file is there, and keep it: after the first row, at least once a
    /// minute while rows come, and when the input ends. Rows up to the last one known are passed over. An output file of an earlier run
    /// is gone on with, also where the run begins cold, and never begun anew. Two runs at once do not keep one file. With `--watch` it is
    /// kept of whatever graph runs, and that graph beside it, in FILE.graph.json
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
        data::check_ending(&self.output)?;
        let read = [&*self.model, &*self.input];
        let swapped = self.swap.paths();
        check_apart("--output", &self.output, read.into_iter().chain(swapped))?;
        if let Some(state) = &self.state {
            if state.as_os_str() == "-" {
                let told = "--state -: what a run knows is kept in a file, from one run to the next; name a file";
                return Err(Failure::Request(told.to_owned()));
            }
            if !lasts(state) {
                let told = format!("--state {}: {NO_FILE}", state.display());
                return Err(Failure::Request(told));
            }
            // Where the output is a stream, the state is none.
            let output = Some(&*self.output).filter(|path| path.as_os_str() != "-");
            let others = || read.into_iter().chain(output);
            check_apart("--state", state, others())?;
            for beside in self.ran().iter().flat_map(Ran::paths) {
                check_apart("--state", beside, others())?;
            }
        }
        let _state = self.state.as_deref().map(Held::state).transpose()?;
        let _output = Held::output(&self.output)?;
        let (model, watched) = self.load(terminal)?;
        warn_unfitted(terminal, &model, &self.model);
        if let Some(told) = feedback::in_words(&model.plan) {
            terminal.warning(told);
        }
        if self.swap.any() {
            return self.run_replaceable(terminal, model, watched);
        }
        let mut engine = model.engine()?;
        let plan = std::sync::Arc::clone(engine.plan());
        let options = self.reading();
        let mut reader = self.open(terminal, layout(&plan), options)?;
        let mut kept = Kept::begin(terminal, self.state.as_deref(), None, &mut engine, &model)?;
        engine.freeze(self.frozen);
        let columns: Vec<String> = plan
            .outputs
            .iter()
            .map(|output| output.name.clone())
            .collect();
        let mut writer = self.writer(terminal, &kept, reader.layout(), &columns)?;
        kept.write_beside(Standing::at(&self.output));
        let mut rest = kept.rest(&mut reader, writer.stood(), !self.ends());
        let usual = model.sample_ranges();
        let mut ranged = Ranged::new(terminal, &mut rest, self.ranged(&plan), usual);
        let mut sensors = Sensors::new(terminal, &mut ranged, &plan, !self.ends());
        let mut keep = |engine: &Engine, sink: &mut dyn Sink| kept.after_tick(engine, &model, sink);
        let mut heard = Heard::of(&mut writer);
        let ended = live::run_keeping(&mut engine, &mut sensors, &mut heard, &mut keep);
        // Also where something cannot be read: what came before it is known, and is out.
        let kept_on = match ended {
            Ok(()) | Err(RunError::Source(_)) => kept.end(&engine, &model, &mut heard),
            Err(_) => Ok(()),
        };
        ended?;
        kept_on.map_err(outside)?;
        heard.end(terminal, &engine);
        sensors.end();
        self.tell(terminal, &engine, heard.rows(), &reader, usual);
        Ok(Answer::Fine)
    }

    /// What ran last, where that may be another graph than the one in the file that is given.
    fn ran(&self) -> Option<Ran> {
        let watched = self.state.as_ref().filter(|_| self.swap.watch());
        watched.map(|state| Ran::beside(state))
    }

    /// The graph to go on with, and its file as it stands to that: what ran last and has been kept, where the file has another.
    fn load(&self, terminal: &Terminal) -> Result<(Model, Watched), Failure> {
        let ran = self.ran().zip(self.state.as_ref());
        let last = ran.and_then(|(ran, state)| ran.of_state(state));
        // As it is before it is read, so that no change is missed.
        let watched = Watched::of(&self.model);
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
                if ran::revision(&given) == ran::revision(&last) {
                    return Ok((given, watched));
                }
                terminal.warning(format_args!(
                    "{} is not what ran last: that goes on, and the file is taken as a change of it",
                    self.model.display()
                ));
                Ok((last, watched.unlike()))
            }
            Err(failure) => {
                terminal.setback(&failure);
                terminal.warning(swap::told::unusable(&self.model, "what ran last goes on"));
                Ok((last, watched))
            }
        }
    }

    /// Runs so that the graph can be replaced; the rows say which revision made them.
    fn run_replaceable(
        &self,
        terminal: &Terminal,
        model: Model,
        watched: Watched,
    ) -> Result<Answer, Failure> {
        let swaps = self.swap.schedule(&model, terminal)?;
        let (feed, mut columns) = swap::union(&model, &swaps);
        let options = self.reading();
        let read = swap::reading(&model, &swaps, &feed);
        let opened = self.open(terminal, layout(&read), options);
        let mut reader = opened.map_err(|failure| swap::told::not_read(failure, &watched))?;
        let mut engine = model.engine()?;
        let state = self.state.as_deref();
        let mut kept = Kept::begin(terminal, state, self.ran(), &mut engine, &model)?;
        columns.push("revision".to_owned());
        self.widen(&mut columns);
        let writer = self.writer(terminal, &kept, reader.layout(), &columns)?;
        let names = &columns[..columns.len() - 1];
        kept.write_beside(Standing::at(&self.output));
        let mut rest = kept.rest(&mut reader, writer.stood(), !self.ends());
        let mut writer = WithRevision(writer);
        let mut heard = Heard::of(&mut writer);
        let usual = model.sample_ranges().to_vec();
        let mut ranged = Ranged::new(terminal, &mut rest, self.ranged(&read), &usual);
        let mut sensors = Sensors::new(terminal, &mut ranged, &model.plan, !self.ends());
        let live = LiveOptions {
            channels: feed.clone(),
            ..LiveOptions::default()
        };
        let (mut stepper, mut control) =
            pair_from(engine, live).map_err(|error| Failure::Request(error.to_string()))?;
        stepper.freeze(self.frozen);
        let mut course =
            swap::Course::new(terminal, &self.swap, watched, model, swaps, names.to_vec());
        let mut shown = vec![f64::NAN; names.len()];
        let mut samples = Samples::default();
        let mut places = (std::ptr::null(), Vec::new());
        let read = loop {
            let event = match sensors.next(&mut samples) {
                Ok(Some(event)) => event,
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
            };
            let Event::Row(time) = event else {
                stepper.segment();
                continue;
            };
            course.before(&mut control, time)?;
            let stepped = match stepper.step(time, &samples.values) {
                Ok(stepped) => stepped,
                Err(athermal::EngineError::NotAfter { .. }) => continue,
                Err(error) => return Err(Failure::Request(error.to_string())),
            };
            // Two graphs of one revision may give their outputs in another order. The plan before is kept until the next one runs,
            // so that no two that follow each other stand at the same place.
            if !std::ptr::eq(places.0, stepped.plan) {
                let place = |name: &String| {
                    let mut outputs = stepped.plan.outputs.iter();
                    outputs.position(|output| output.name == *name)
                };
                places = (
                    std::ptr::from_ref(stepped.plan),
                    names.iter().map(place).collect(),
                );
                sensors.follow(stepped.plan, &feed, course.running().sample_ranges());
            }
            for (shown, place) in shown.iter_mut().zip(&places.1) {
                *shown = place.map_or(f64::NAN, |place| stepped.outputs[place]);
            }
            course.gave(&shown);
            let frame = Frame {
                time,
                time_text: &samples.time_text,
                revision: stepped.revision,
                outputs: &shown,
            };
            heard.put(&frame).map_err(outside)?;
            let kept_on = kept.after_tick(stepper.engine(), course.running(), &mut heard);
            kept_on.map_err(outside)?;
        };
        let finished = heard.finish();
        // Also where something cannot be read: what came before it is known, and is out.
        let ended =
            finished.and_then(|()| kept.end(stepper.engine(), course.running(), &mut heard));
        read.and(ended).map_err(outside)?;
        course.end(&mut control);
        sensors.end();
        let engine = stepper.engine();
        heard.end(terminal, engine);
        self.tell(terminal, engine, heard.rows(), &reader, &usual);
        Ok(Answer::Fine)
    }

    /// What was recorded is read as it is for fitting; of what is still being written no row waits for the next.
    fn reading(&self) -> Options {
        Options {
            lenient: self.lenient,
            joins: self.ends(),
            goes_on: self.state.is_some() || !self.ends(),
            ..Options::default()
        }
    }

    fn open(
        &self,
        terminal: &Terminal,
        layout: Layout,
        options: Options,
    ) -> Result<Reader, Failure> {
        if self.ends() {
            return Ok(Reader::open(&self.input, layout, options)?);
        }
        let opened = Reader::open_through(&self.input, layout, options, stop::until_told);
        let mut reader = match opened {
            // Told to stop before there was anything.
            Err(FileError::Empty { .. }) if stop::is_told() => return Err(Failure::Exit(0)),
            opened => opened?,
        };
        let terminal = *terminal;
        reader.report_first(move |first| {
            let told = match first {
                FileError::MissingColumns { .. } => {
                    let words = format_args!("{first} (missing until a line has it)");
                    refused::message(first, None, words)
                }
                FileError::StillRefused { .. } | FileError::HeaderAgain { moved: true, .. } => {
                    refused::message(first, None, first)
                }
                _ => {
                    let words =
                        format_args!("{}; others like it are counted", first.without_advice());
                    refused::message(first, None, words)
                }
            };
            terminal.warning(told);
        });
        Ok(reader)
    }

    /// Takes all columns of an output that is gone on with, where some are of outputs that graphs before had.
    fn widen(&self, columns: &mut Vec<String>) {
        let stood = self
            .state
            .as_ref()
            .and_then(|_| begun_columns(&self.output));
        if let Some((_time, stood)) = stood.as_deref().and_then(<[String]>::split_first)
            && stood.last() == columns.last()
            && columns.iter().all(|column| stood.contains(column))
        {
            *columns = stood.to_vec();
        }
    }

    /// Goes on with the output of a run before where what runs know is kept, be this one cold: what stands there cannot be had again
    /// from a source that only gives what is new.
    fn writer(
        &self,
        terminal: &Terminal,
        kept: &Kept,
        read: &Layout,
        columns: &[String],
    ) -> Result<Writer, Failure> {
        let time = read.time.columns.title();
        if terminal.format == Format::Json && self.output.as_os_str() == "-" {
            let (name, stream) = ("standard output", std::io::stdout());
            let lines = athermal::files::Format::JsonLines;
            return Ok(Writer::to_write(
                name,
                stream,
                lines,
                &time,
                columns,
                self.flush(),
            )?);
        }
        if self.state.is_none() {
            return Ok(Writer::create(&self.output, &time, columns, self.flush())?);
        }
        let seen = kept.seen();
        let writer = Writer::resume(&self.output, &read.time, columns, seen, self.flush())?;
        let output = self.output.display();
        match (writer.stood(), seen) {
            (Some(last), Some(seen)) if last < seen => terminal.warning(format_args!(
                "{output}: its last row is {} before what the run before saw last: what was predicted between stands in another file, or is lost",
                length(seen - last)
            )),
            (Some(last), Some(seen)) if last > seen && !self.ends() => {
                terminal.warning(format_args!(
                    "{output}: its last row is {} after what the run before kept: what this run does not read again of that time it \
                     does not know",
                    length(last - seen)
                ));
            }
            (None, Some(seen)) if self.output.is_file() => terminal.warning(format_args!(
                "{output}: none of the rows up to {} stand there, which the run before saw: what was predicted stands in another file, or \
                 is lost",
                instant(seconds(seen))
            )),
            (Some(last), None) => terminal.warning(format_args!(
                "{output}: rows of a run before stand there and stay, though this one begins cold: none up to the last of them, of {}, is \
                 written again",
                instant(seconds(last))
            )),
            _ => {}
        }
        Ok(writer)
    }

    /// The channels of which a sample that does not count is told at once.
    fn ranged<'a>(&self, read: &'a Plan) -> &'a [SourceChannel] {
        if self.ends() { &[] } else { &read.sources }
    }

    /// Whether the input is known to end: beside a machine it does not, and nor would the wait for what is told then.
    fn ends(&self) -> bool {
        !self.input_is_standard() && self.input.is_file()
    }

    fn input_is_standard(&self) -> bool {
        self.input.as_os_str() == "-"
    }

    fn flush(&self) -> Flush {
        if !self.ends() {
            Flush::EachRow
        } else {
            Flush::Buffered
        }
    }

    fn tell(
        &self,
        terminal: &Terminal,
        engine: &Engine,
        ticks: u64,
        reader: &Reader,
        usual: &[SampleRange],
    ) {
        if stop::is_told() {
            terminal.note("told to stop: what had been read until then has been put out");
        }
        let input = if self.input_is_standard() {
            STANDARD_INPUT.to_owned()
        } else {
            self.input.display().to_string()
        };
        let reports = [(input, reader.report().clone())];
        let rejected = engine.rejected_channels();
        data::warn(
            terminal,
            engine.plan(),
            &reports,
            engine.refused(),
            &rejected,
        );
        if self.ends() {
            beyond::warn(terminal, &beyond::beyond(usual, &engine.sample_ranges()));
        }
        // People are told of what is not in order alone.
        if terminal.events {
            let report = reader.report();
            let by_time = report.refused_time.count + report.repeated_time.count;
            let refused = by_time + engine.refused();
            let facts = json!({
                "ticks": ticks,
                "refused": refused,
                "unreadable_rows": report.refused_rows.count,
                "unreadable_cells": report.bad_cells.count,
                "rejected": rejected,
            });
            let rows = counted(ticks, "row");
            terminal.note(Message::new("ended", facts, format_args!("{rows} stepped")));
        }
    }
}
