//! Decides where a run goes on from, and how often what it knows is kept; not what an engine knows.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant as Clock};

use athermal::files::Reader;
use athermal::run::live::{Sink, SinkError};
use athermal::run::recording::{Event, Samples, Source, SourceError};
use athermal::{Engine, Instant, Model};
use serde_json::json;

use super::ran::Ran;
use super::standing::Standing;
use crate::command::aside::{not_written, whole_aside};
use crate::message::Message;
use crate::terminal::{Failure, Terminal, outside};
use athermal_analysis::figures::{count, instant, length, seconds};

/// How long a run that is killed may have learned in vain.
const KEEP_EVERY: Duration = Duration::from_secs(60);

/// What a run knows, in a file from one run to the next.
pub struct Kept {
    terminal: Terminal,
    path: Option<PathBuf>,
    written: Clock,
    /// Whether the first row is still to come: what is known before says nothing of where the data were.
    is_before_first: bool,
    /// What runs is kept with what it knows, where that may be another graph than the one given.
    ran: Option<Ran>,
    /// The revision of what ran when this was last written.
    revision: String,
    /// The last instant that the run before had seen.
    seen: Option<Instant>,
    /// The output, which is looked at as often.
    output: Option<Standing>,
}

impl Kept {
    /// Lets the engine of a model go on from a file, if it is there; without a file nothing is kept.
    ///
    /// # Errors
    /// When the file is not one of the same graph and fit, or cannot be written where it is not there yet.
    pub fn begin(
        terminal: &Terminal,
        path: Option<&Path>,
        ran: Option<Ran>,
        engine: &mut Engine,
        model: &Model,
    ) -> Result<Self, Failure> {
        let mut kept = Self {
            terminal: *terminal,
            path: path.map(Path::to_owned),
            written: Clock::now(),
            is_before_first: true,
            ran,
            revision: String::new(),
            seen: None,
            output: None,
        };
        let Some(path) = path else { return Ok(kept) };
        let read = std::fs::read(path);
        let is_read = read.is_ok();
        match read {
            Ok(bytes) => {
                engine.restore(&bytes).map_err(|error| {
                    Failure::Request(format!(
                        "cannot go on from {}: {error}; name another file to begin cold and keep this one",
                        path.display()
                    ))
                })?;
                engine.count_afresh();
                kept.seen = engine.last();
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                terminal.note(format_args!(
                    "{}: not there yet, the run begins cold",
                    path.display()
                ));
            }
            Err(error) => {
                let cannot = format!("cannot read {}: {error}", path.display());
                return Err(Failure::Outside(cannot));
            }
        }
        // Better now than after the first minute. What was read needs not be written yet: a disk may be full for a while.
        match kept.write(engine, model) {
            Err(error) if is_read => terminal.warning(format_args!(
                "{error}; the run goes on from what was read, and tries again after the first row"
            )),
            written => written.map_err(outside)?,
        }
        Ok(kept)
    }

    /// The output that is written beside what is known.
    pub fn write_beside(&mut self, output: Standing) {
        self.output = Some(output);
    }

    /// The last instant that the run before had seen.
    pub fn seen(&self) -> Option<Instant> {
        self.seen
    }

    /// What the run before has not seen of a source. `stood` is the last row of its output, up to which none is written again;
    /// `at_once` says whether rows may never end.
    pub fn rest<'a>(
        &self,
        source: &'a mut Reader,
        stood: Option<Instant>,
        at_once: bool,
    ) -> Rest<'a> {
        let stood = stood.filter(|_| self.path.is_some());
        if let Some(last) = self.seen.max(stood) {
            source.begin_after(last, &instant(seconds(last)));
        }
        Rest {
            terminal: self.terminal,
            source,
            seen: self.seen,
            stood,
            at_once,
            passed_over: 0,
            before: athermal::Duration::ZERO,
        }
    }

    /// Keeps what is known after the first row, when another graph has taken over and now and then, once what came of it has left
    /// the program: a run that goes on from there does not predict it again. Where it cannot be kept, as on a disk that is full,
    /// that is told and tried again: a machine goes without what it would know after a restart rather than without its
    /// predictions.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn after_tick(
        &mut self,
        engine: &Engine,
        model: &Model,
        sink: &mut dyn Sink,
    ) -> Result<(), SinkError> {
        let is_time = self.is_before_first || self.written.elapsed() >= KEEP_EVERY;
        if is_time {
            self.is_before_first = false;
            self.look_at_output();
        }
        if self.path.is_none() {
            if is_time {
                self.written = Clock::now();
            }
            return Ok(());
        }
        if !is_time && engine.revision() == self.revision {
            return Ok(());
        }
        sink.flush()?;
        if let Err(error) = self.write(engine, model) {
            self.terminal.warning(format_args!(
                "{error}; the run goes on, and tries again in a minute"
            ));
        }
        Ok(())
    }

    /// Keeps what is known at the end, once what came of it lasts.
    ///
    /// # Errors
    /// When the sink fails, or the file cannot be written.
    pub fn end(
        &mut self,
        engine: &Engine,
        model: &Model,
        sink: &mut dyn Sink,
    ) -> Result<(), SinkError> {
        self.look_at_output();
        if self.path.is_some() {
            sink.flush()?;
        }
        self.write(engine, model)
    }

    fn look_at_output(&mut self) {
        if let Some(output) = &mut self.output {
            output.look(&self.terminal);
        }
    }

    /// Keeps what is known.
    ///
    /// # Errors
    /// When the file cannot be written.
    fn write(&mut self, engine: &Engine, model: &Model) -> Result<(), SinkError> {
        let Some(path) = &self.path else {
            return Ok(());
        };
        self.written = Clock::now();
        engine.revision().clone_into(&mut self.revision);
        if let Some(ran) = &mut self.ran {
            let kept = ran.keep(model, &self.revision);
            kept.map_err(|error| not_written(ran.paths()[0], &error))?;
        }
        whole_aside(path, &engine.snapshot()).map_err(|error| not_written(path, &error))?;
        if let Some(ran) = &self.ran {
            ran.let_go();
        }
        Ok(())
    }
}

/// The rows of a source that the run before had not seen.
pub struct Rest<'a> {
    terminal: Terminal,
    source: &'a mut dyn Source,
    /// The last instant that the run before had seen.
    seen: Option<Instant>,
    /// The last of which its output has a row.
    stood: Option<Instant>,
    at_once: bool,
    /// How many rows nothing came of so far.
    passed_over: u64,
    /// How long the last of them was before the last of the run before.
    before: athermal::Duration,
}

impl Rest<'_> {
    fn pass_over(&mut self, samples: &Samples, before: athermal::Duration) {
        self.passed_over += 1;
        self.before = before;
        if self.passed_over == 1 && self.seen.is_some() {
            let words = format!(
                "the row of {} was seen by the run before: it and all like it are passed over",
                samples.time_text
            );
            self.terminal.note(self.passed(samples, words));
        }
        // 10, 100, 1,000 and so on: where the clock has been set back, it goes on for as long as that.
        let rows = self.passed_over;
        if self.at_once && rows >= 10 && 10_u64.pow(rows.ilog10()) == rows {
            let words = format!(
                "{} rows so far, up to that of {}, which is {} before the last of the run before: nothing is put out until rows come \
                 after that; this is right where a log is read again, and not where a clock was ahead then: {BEGIN_COLD}",
                count(rows),
                samples.time_text,
                length(before)
            );
            self.terminal.warning(self.passed(samples, words));
        }
    }

    fn passed(&self, newest: &Samples, words: String) -> Message {
        let facts = json!({ "count": self.passed_over, "time": newest.time_text });
        Message::new("passed_over", facts, words)
    }

    /// Tells of an input that has come to its end while all of it was passed over: a clock may once have been ahead.
    fn note_nothing(&self) {
        if self.before > athermal::Duration::ZERO {
            self.terminal.warning(format_args!(
                "the last row is {} before what the run before saw last: nothing was predicted; if a clock was ahead then, {BEGIN_COLD}",
                length(self.before)
            ));
        } else {
            self.terminal.note(
                "no row is after what the run before saw last: nothing was predicted; where times begin anew with each file, a run \
                 with another `--state` and `--output` file takes them",
            );
        }
    }
}

/// What to do where a clock was ahead.
const BEGIN_COLD: &str =
    "a run with another `--state` and `--output` file begins cold and goes on from there";

impl Source for Rest<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        loop {
            let event = self.source.next(samples)?;
            match event {
                Some(Event::Row(time)) if self.seen.is_some_and(|seen| time <= seen) => {
                    let last = self.seen.max(self.stood).unwrap_or(time);
                    self.pass_over(samples, last - time);
                    continue;
                }
                Some(Event::Row(time)) => {
                    self.seen = None;
                    match self.stood.filter(|stood| time <= *stood) {
                        Some(stood) => self.pass_over(samples, stood - time),
                        None => (self.stood, self.passed_over) = (None, 0),
                    }
                }
                Some(Event::Segment) => self.seen = None,
                None if self.passed_over > 0 => self.note_nothing(),
                None => {}
            }
            return Ok(event);
        }
    }
}

#[cfg(test)]
mod tests {
    use athermal::run::live::Frame;

    use super::*;

    /// How often it was flushed.
    struct Flushed(u32);

    impl Sink for Flushed {
        fn put(&mut self, _frame: &Frame<'_>) -> Result<(), SinkError> {
            Ok(())
        }

        fn flush(&mut self) -> Result<(), SinkError> {
            self.0 += 1;
            Ok(())
        }
    }

    #[test]
    fn what_is_known_is_kept_after_the_first_row_and_once_a_minute_when_what_came_of_it_was_put_out()
     {
        let name = format!("athermal-kept-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let graph = folder.join("graph.toml");
        let text = "schema = 1\nname = \"none\"\nsignals.room = { unit = \"Cel\", channels = [\"air\"] }\n\
                    time.column = \"time_s\"\noutputs.room = \"room\"\n";
        std::fs::write(&graph, text).unwrap();
        let model = Model::load(&graph).unwrap();
        let mut engine = model.engine().unwrap();
        let terminal = Terminal::new(&crate::terminal::Options {
            format: "table".into(),
            quiet: true,
        });
        let path = folder.join("state");
        let mut kept = Kept::begin(&terminal, Some(&path), None, &mut engine, &model).unwrap();
        let mut sink = Flushed(0);
        engine.step(Instant::from_ns(1), &[20.0]).unwrap();
        kept.after_tick(&engine, &model, &mut sink).unwrap();
        let begun = std::fs::read(&path).unwrap();
        assert_eq!((sink.0, &begun), (1, &engine.snapshot()));
        engine.step(Instant::from_ns(2), &[20.0]).unwrap();
        kept.after_tick(&engine, &model, &mut sink).unwrap();
        assert_eq!(sink.0, 1);
        assert_eq!(std::fs::read(&path).unwrap(), begun);
        kept.written = Clock::now().checked_sub(KEEP_EVERY).unwrap();
        kept.after_tick(&engine, &model, &mut sink).unwrap();
        assert_eq!(sink.0, 2);
        assert_eq!(std::fs::read(&path).unwrap(), engine.snapshot());
        std::fs::remove_dir_all(&folder).unwrap();
        // The run goes on without its folder too, and tells at the end that nothing is kept.
        kept.written = Clock::now().checked_sub(KEEP_EVERY).unwrap();
        kept.after_tick(&engine, &model, &mut sink).unwrap();
        assert!(kept.written.elapsed() < KEEP_EVERY, "it was tried");
        assert!(kept.write(&engine, &model).is_err());
    }
}
