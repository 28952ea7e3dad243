//! Decides where a run goes on from, and how often what it knows is kept; not what an engine knows.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant as Clock};

use athermal::core::live::{Samples, Sink, SinkError, Source, SourceError};
use athermal::core::recording::Event;
use athermal::{Engine, Instant};

use super::aside::{not_written, whole_aside};
use crate::figures::length;
use crate::terminal::{Failure, Terminal, outside};

/// How long a run that is killed may have learned in vain.
const KEEP_EVERY: Duration = Duration::from_secs(60);

/// What a run knows, in a file from one run to the next.
pub struct Kept {
    terminal: Terminal,
    path: Option<PathBuf>,
    written: Clock,
    /// The last instant that the run before had seen.
    seen: Option<Instant>,
}

impl Kept {
    /// Lets an engine go on from a file, if it is there; without a file nothing is kept.
    ///
    /// # Errors
    /// When the file is not one of the same graph and fit, or cannot be written.
    pub fn begin(
        terminal: &Terminal,
        path: Option<&Path>,
        engine: &mut Engine,
    ) -> Result<Self, Failure> {
        let mut kept = Self {
            terminal: *terminal,
            path: path.map(Path::to_owned),
            written: Clock::now(),
            seen: None,
        };
        let Some(path) = path else { return Ok(kept) };
        match std::fs::read(path) {
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
        // Better now than after the first minute.
        kept.write(engine).map_err(outside)?;
        Ok(kept)
    }

    /// The last instant that the run before had seen.
    pub fn seen(&self) -> Option<Instant> {
        self.seen
    }

    /// What the run before has not seen of a source.
    pub fn rest<'a>(&self, terminal: &Terminal, source: &'a mut dyn Source) -> Rest<'a> {
        Rest {
            terminal: *terminal,
            source,
            seen: self.seen,
            passed_over: None,
        }
    }

    /// Keeps what is known now and then, once what came of it has left the program: a run that goes on from there does not
    /// predict it again. Where it cannot be kept, as on a disk that is full, that is told and tried again: a machine goes without
    /// what it would know after a restart rather than without its predictions.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn after_tick(&mut self, engine: &Engine, sink: &mut dyn Sink) -> Result<(), SinkError> {
        if self.path.is_none() || self.written.elapsed() < KEEP_EVERY {
            return Ok(());
        }
        sink.flush()?;
        if let Err(error) = self.write(engine) {
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
    pub fn end(&mut self, engine: &Engine, sink: &mut dyn Sink) -> Result<(), SinkError> {
        if self.path.is_some() {
            sink.flush()?;
        }
        self.write(engine)
    }

    /// Keeps what is known.
    ///
    /// # Errors
    /// When the file cannot be written.
    fn write(&mut self, engine: &Engine) -> Result<(), SinkError> {
        let Some(path) = &self.path else {
            return Ok(());
        };
        self.written = Clock::now();
        whole_aside(path, &engine.snapshot()).map_err(|error| not_written(path, &error).into())
    }
}

/// The rows of a source that the run before had not seen.
pub struct Rest<'a> {
    terminal: Terminal,
    source: &'a mut dyn Source,
    seen: Option<Instant>,
    /// How long before the last that had been seen the last row was that is passed over.
    passed_over: Option<athermal::Duration>,
}

impl Rest<'_> {
    fn pass_over(&mut self, samples: &Samples, before: athermal::Duration) {
        if self.passed_over.replace(before).is_none() {
            self.terminal.note(format_args!(
                "the row of {} was seen by the run before: it and all like it are passed over",
                samples.time_text
            ));
        }
    }

    /// Tells of an input that has come to its end while all of it was passed over: a clock may once have been ahead.
    fn tell_of_nothing(&self) {
        let Some(before) = self.passed_over else {
            return;
        };
        if before > athermal::Duration::ZERO {
            self.terminal.warning(format_args!(
                "the last row is {} before what the run before saw last: nothing was predicted; if a clock was ahead then, a \
                 run with another `--state` file begins cold and goes on from there",
                length(before)
            ));
        } else {
            self.terminal.note(
                "no row is after what the run before saw last: nothing was predicted; where times begin anew with each file, a run \
                 with another `--state` file takes them",
            );
        }
    }
}

impl Source for Rest<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        loop {
            let event = self.source.next(samples)?;
            match (event, self.seen) {
                (Some(Event::Row(time)), Some(seen)) if time <= seen => {
                    self.pass_over(samples, seen - time);
                }
                _ => {
                    if event.is_none() && self.seen.is_some() {
                        self.tell_of_nothing();
                    }
                    self.seen = None;
                    return Ok(event);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use athermal::core::live::Frame;

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
    fn what_is_known_is_kept_once_a_minute_after_what_came_of_it_was_put_out_and_not_at_every_tick()
    {
        let name = format!("athermal-kept-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let graph = folder.join("graph.toml");
        let text = "schema = 1\nname = \"none\"\nsignals.room = { unit = \"Cel\", channels = [\"air\"] }\n\
                    time.column = \"time_s\"\noutputs.room = \"room\"\n";
        std::fs::write(&graph, text).unwrap();
        let mut engine = athermal::Model::load(&graph).unwrap().engine().unwrap();
        let terminal = Terminal::new(&crate::terminal::Options {
            format: "table".into(),
            quiet: true,
        });
        let path = folder.join("state");
        let mut kept = Kept::begin(&terminal, Some(&path), &mut engine).unwrap();
        let begun = std::fs::read(&path).unwrap();
        engine.step(Instant::from_ns(1), &[20.0]).unwrap();
        let mut sink = Flushed(0);
        kept.after_tick(&engine, &mut sink).unwrap();
        assert_eq!(sink.0, 0);
        assert_eq!(std::fs::read(&path).unwrap(), begun);
        kept.written = Clock::now().checked_sub(KEEP_EVERY).unwrap();
        kept.after_tick(&engine, &mut sink).unwrap();
        assert_eq!(sink.0, 1);
        assert_eq!(std::fs::read(&path).unwrap(), engine.snapshot());
        std::fs::remove_dir_all(&folder).unwrap();
        // The run goes on without its folder too, and tells at the end that nothing is kept.
        kept.written = Clock::now().checked_sub(KEEP_EVERY).unwrap();
        kept.after_tick(&engine, &mut sink).unwrap();
        assert!(kept.written.elapsed() < KEEP_EVERY, "it was tried");
        assert!(kept.write(&engine).is_err());
    }
}
