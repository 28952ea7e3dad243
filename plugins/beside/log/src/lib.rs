//! The log of a service that nobody sits before: an event a line on standard error, through [`tracing`].
//!
//! | variable | value |
//! |---|---|
//! | `ATHERMAL_LOG` | `text` or `json`; without it a service reports as any command does |
//! | `ATHERMAL_LOG_LEVEL` | `error`, `warn`, or `info`, which is the default |
//!
//! A fault that repeats is written once, and then once a minute with how often it came: see [`sum::Summed`]. A program that has a
//! subscriber of its own gets the events as well.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod sum;

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use athermal_command::Message;
use athermal_command::terminal::divert;
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::{ConnectorError, Stop};
use athermal_serve::register_companion;
use schemars::JsonSchema;
use serde::Deserialize;
use tracing::level_filters::LevelFilter;

use sum::{Line, Summed};

/// How often is looked for what is to be summed up.
const LOOK: Duration = Duration::from_secs(1);

/// The log. It has no section: where a log goes is a matter of who starts the service.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub struct Log {}

register_companion!(Log, "");

impl Companion for Log {
    fn start(&self, _beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        let form = std::env::var("ATHERMAL_LOG").unwrap_or_default();
        let wrong = |name: &str, found: &str, known: &str| {
            ConnectorError::new(format_args!("{name}={found}: it is one of {known}"))
        };
        if form.is_empty() {
            return Ok(Box::new(()));
        }
        let level = std::env::var("ATHERMAL_LOG_LEVEL").unwrap_or_default();
        let level = match &*level {
            "" | "info" => LevelFilter::INFO,
            "warn" => LevelFilter::WARN,
            "error" => LevelFilter::ERROR,
            other => return Err(wrong("ATHERMAL_LOG_LEVEL", other, "error, warn, info")),
        };
        let lines = tracing_subscriber::fmt()
            .with_max_level(level)
            .with_target(false)
            .with_ansi(false)
            .with_writer(io::stderr);
        // Where the program has a subscriber already, that one goes on.
        let _ = match &*form {
            "text" => lines.try_init(),
            "json" => lines.json().flatten_event(true).try_init(),
            other => return Err(wrong("ATHERMAL_LOG", other, "text, json")),
        };
        Ok(Box::new(Running::start()))
    }
}

/// Until this is dropped. What is reported after that is written as it comes.
struct Running {
    stop: Stop,
    thread: Option<JoinHandle<()>>,
    summed: Arc<Mutex<Summed>>,
}

impl Running {
    fn start() -> Self {
        let summed = Arc::new(Mutex::new(Summed::default()));
        let (stop, own) = (Stop::default(), Arc::clone(&summed));
        divert(Some(Box::new(move |level, message| {
            let all = locked(&own).take(line(level, message), Instant::now());
            all.iter().for_each(emit);
        })));
        let (stopped, own) = (stop.clone(), Arc::clone(&summed));
        let thread = std::thread::spawn(move || {
            while stopped.wait(LOOK) {
                locked(&own).due(Instant::now()).iter().for_each(emit);
            }
        });
        Self {
            stop,
            thread: Some(thread),
            summed,
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.ask();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        // First, so that nothing is summed any more that nobody would write.
        divert(Some(Box::new(|level, message| emit(&line(level, message)))));
        locked(&self.summed).rest().iter().for_each(emit);
    }
}

fn locked(summed: &Mutex<Summed>) -> MutexGuard<'_, Summed> {
    summed.lock().unwrap_or_else(PoisonError::into_inner)
}

fn line(level: &str, message: &Message) -> Line {
    Line {
        level: level.to_owned(),
        event: message.name().to_owned(),
        facts: message.facts().to_string(),
        // An event is a line.
        words: message.to_string().replace('\n', "; "),
    }
}

fn emit(line: &Line) {
    let Line {
        level,
        event,
        facts,
        words,
    } = line;
    match level.as_str() {
        "error" => tracing::error!(event, facts, "{words}"),
        "warning" => tracing::warn!(event, facts, "{words}"),
        _ => tracing::info!(event, facts, "{words}"),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use athermal_command::{Terminal, terminal::Options};

    use super::*;

    static WRITTEN: Mutex<Vec<u8>> = Mutex::new(Vec::new());

    struct Written;

    impl Write for Written {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            WRITTEN.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_is_reported_after_the_end_is_written_as_it_comes() {
        let lines = tracing_subscriber::fmt().with_ansi(false);
        lines.with_writer(|| Written).init();
        let (format, quiet) = ("table".to_owned(), false);
        let terminal = Terminal::new(&Options { format, quiet });
        let running = Running::start();
        for nth in 0..3 {
            terminal.warning(format!("sink `out`: {nth} rows are lost"));
        }
        drop(running);
        for nth in 3..5 {
            terminal.warning(format!("sink `out`: {nth} rows are lost"));
        }
        let written = String::from_utf8(WRITTEN.lock().unwrap().clone()).unwrap();
        let words = written.lines().filter_map(|line| line.split_once("out`: "));
        let words: Vec<_> = words
            .map(|(_, rest)| rest.split(" event=").next().unwrap())
            .collect();
        let wanted = [
            "0 rows are lost",
            "2 rows are lost; 2 like it within 60 s",
            "3 rows are lost",
            "4 rows are lost",
        ];
        assert_eq!(words, wanted, "{written}");
    }
}
