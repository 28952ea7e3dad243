//! `athermal run`: rows in, the graph's outputs out.

use std::path::PathBuf;

use athermal::core::compile::{Plan, SourceChannel, Wanted};
use athermal::core::engine::SampleRange;
use athermal::core::live::{self, Frame, LiveOptions, Samples, Sink, Source, pair_from};
use athermal::core::recording::Event;
use athermal::diagnosis::feedback;
use athermal::files::{
    FileError, Flush, Layout, Options, Reader, STANDARD_INPUT, WithRevision, Writer, layout,
};
use athermal::{Engine, Model};
use clap::Args;

use super::aside::check_apart;
use super::kept::Kept;
use super::model::{self, check_fitted};
use super::rejected::Ranged;
use super::swap;
use super::{beyond, data};
use crate::figures::length;
use crate::terminal::{Answer, Failure, Terminal, outside};

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
    /// The model, or a graph in which nothing needs fitting
    model: PathBuf,
    /// CSV or JSON lines; `-` is standard input
    #[arg(long, short, value_name = "FILE")]
    input: PathBuf,
    /// CSV or JSON lines by its ending, CSV without one; `-` is standard output, as CSV
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    /// Take cells and rows that cannot be read as missing, and count them
    #[arg(long)]
    lenient: bool,
    /// Let no estimator learn while it runs; votes still go by recent errors
    #[arg(long)]
    frozen: bool,
    /// Go on from what an earlier run knew and had learned, if the file is there, and keep it: when the input ends, and at least once a
    /// minute while rows come. Rows up to the last one known are passed over, and an output file of that run is gone on with. With
    /// `--watch` it is kept of whatever graph runs
    #[arg(long, value_name = "FILE", conflicts_with = "swap_at")]
    state: Option<PathBuf>,
    #[command(flatten)]
    swap: swap::Options,
}

/// What a machine file may say and is not read here: its key, how it is written, and what to do instead.
const UNREAD: [(&str, &str, &str); 4] = [
    ("source", "`[source]`", "give the input with `--input`"),
    ("sinks", "`[sinks]`", "give the output with `--output`"),
    (
        "runtime",
        "`[runtime]`",
        "do without heartbeats, since every tick is a row",
    ),
    (
        "model",
        "`model`",
        "name the fitted model in place of the graph",
    ),
];

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
            let others = read.into_iter().chain([&*self.output]);
            check_apart("--state", state, others)?;
        }
        let model = model::load(&self.model, Wanted::default(), terminal)?;
        self.tell_unread(terminal, &model);
        check_fitted(&model, &self.model)?;
        if let Some(told) = feedback::in_words(&model.plan) {
            terminal.warning(told);
        }
        if self.swap.any() {
            return self.run_replaceable(terminal, model);
        }
        let mut engine = model.engine()?;
        let plan = std::sync::Arc::clone(engine.plan());
        let options = self.reading();
        let mut reader = self.open(terminal, layout(&plan), options)?;
        let mut kept = Kept::begin(terminal, self.state.as_deref(), &mut engine)?;
        engine.freeze(self.frozen);
        let columns: Vec<String> = plan
            .outputs
            .iter()
            .map(|output| output.name.clone())
            .collect();
        let mut writer = self.writer(terminal, &kept, reader.layout(), &columns)?;
        let mut rest = kept.rest(terminal, &mut reader);
        let usual = model.sample_ranges();
        let mut ranged = Ranged::new(terminal, &mut rest, self.ranged(&plan), usual);
        let mut keep = |engine: &Engine, sink: &mut dyn Sink| kept.after_tick(engine, sink);
        live::run_keeping(&mut engine, &mut ranged, &mut writer, &mut keep)?;
        kept.end(&engine, &mut writer).map_err(outside)?;
        self.tell(terminal, &engine, &reader, usual);
        Ok(Answer::Fine)
    }

    /// Runs so that the graph can be replaced; the rows say which revision made them.
    fn run_replaceable(&self, terminal: &Terminal, model: Model) -> Result<Answer, Failure> {
        let swaps = self.swap.schedule(&model, terminal)?;
        let (feed, mut columns) = swap::union(&model, &swaps);
        let options = self.reading();
        let read = swap::reading(&model, &swaps, &feed);
        let mut reader = self.open(terminal, layout(&read), options)?;
        let mut engine = model.engine()?;
        let mut kept = Kept::begin(terminal, self.state.as_deref(), &mut engine)?;
        columns.push("revision".to_owned());
        let writer = self.writer(terminal, &kept, reader.layout(), &columns)?;
        let names = &columns[..columns.len() - 1];
        let mut writer = WithRevision(writer);
        let mut rest = kept.rest(terminal, &mut reader);
        let usual = model.sample_ranges().to_vec();
        let mut ranged = Ranged::new(terminal, &mut rest, self.ranged(&read), &usual);
        let live = LiveOptions {
            channels: feed,
            ..LiveOptions::default()
        };
        let (mut stepper, mut control) =
            pair_from(engine, live).map_err(|error| Failure::Request(error.to_string()))?;
        stepper.freeze(self.frozen);
        let mut course = swap::Course::new(
            terminal,
            &self.swap,
            &self.model,
            model,
            swaps,
            names.to_vec(),
        );
        let mut shown = vec![f64::NAN; names.len()];
        let mut samples = Samples::default();
        let mut places = (std::ptr::null(), Vec::new());
        while let Some(event) = ranged.next(&mut samples).map_err(outside)? {
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
            }
            for (shown, place) in shown.iter_mut().zip(&places.1) {
                *shown = place.map_or(f64::NAN, |place| stepped.outputs[place]);
            }
            let frame = Frame {
                time,
                time_text: &samples.time_text,
                revision: stepped.revision,
                outputs: &shown,
            };
            writer.put(&frame).map_err(outside)?;
            let kept_on = kept.after_tick(stepper.engine(), &mut writer);
            kept_on.map_err(outside)?;
        }
        writer.finish().map_err(outside)?;
        let ended = kept.end(stepper.engine(), &mut writer);
        ended.map_err(outside)?;
        course.end(&mut control);
        let engine = stepper.engine();
        self.tell(terminal, engine, &reader, &usual);
        Ok(Answer::Fine)
    }

    /// Tells which sections of a machine file are not read, since whoever wrote them expects them to work.
    fn tell_unread(&self, terminal: &Terminal, model: &Model) {
        let written = |(key, ..): &&(&str, &str, &str)| model.graph.deployment.contains_key(*key);
        let unread: Vec<_> = UNREAD.iter().filter(written).collect();
        if unread.is_empty() {
            return;
        }
        let sections: Vec<_> = unread.iter().map(|(_, section, _)| *section).collect();
        let instead: Vec<_> = unread.iter().map(|(.., instead)| *instead).collect();
        terminal.warning(format_args!(
            "{}: `athermal run` does not yet read {}: {}",
            self.model.display(),
            sections.join(", "),
            instead.join("; ")
        ));
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
        let mut reader = Reader::open(&self.input, layout, options)?;
        if !self.ends() {
            let terminal = *terminal;
            reader.tell_first(move |first| match first {
                FileError::MissingColumns { .. } => {
                    terminal.warning(format_args!("{first} (missing until a line has it)"));
                }
                FileError::TimeStaysBehind { .. } | FileError::HeaderAgain { moved: true, .. } => {
                    terminal.warning(format_args!("{first}"));
                }
                _ => terminal.warning(format_args!("{first}; others like it are counted")),
            });
        }
        Ok(reader)
    }

    /// Goes on with the output of the run before, as the run does with what that one knew.
    fn writer(
        &self,
        terminal: &Terminal,
        kept: &Kept,
        read: &Layout,
        columns: &[String],
    ) -> Result<Writer, Failure> {
        let Some(seen) = kept.seen() else {
            let time = read.time.columns.title();
            return Ok(Writer::create(&self.output, &time, columns, self.flush())?);
        };
        let writer = Writer::resume(&self.output, &read.time, columns, self.flush())?;
        if let Some(last) = writer.stood()
            && last < seen
        {
            terminal.warning(format_args!(
                "{}: its last row is {} before what the run before saw last: what was predicted between stands in another file, or is lost",
                self.output.display(),
                length(seen - last)
            ));
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

    fn tell(&self, terminal: &Terminal, engine: &Engine, reader: &Reader, usual: &[SampleRange]) {
        let input = if self.input_is_standard() {
            STANDARD_INPUT.to_owned()
        } else {
            self.input.display().to_string()
        };
        let reports = [(input, reader.report().clone())];
        let rejected = engine.rejected_channels();
        data::tell(
            terminal,
            engine.plan(),
            &reports,
            engine.refused(),
            &rejected,
        );
        if self.ends() {
            beyond::tell(terminal, &beyond::beyond(usual, &engine.sample_ranges()));
        }
    }
}
