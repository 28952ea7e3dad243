//! Reporting to people and programs: notes, warnings, progress, errors and exit statuses.

use std::fmt;
use std::io::{IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use athermal_core::diagnostic::{Diagnostics, Sources};
pub use athermal_core::failure::{Failure, outside, status_of};
use athermal_core::figures::counted;
use athermal_core::watch::{Progress, Watch};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;

use crate::message::Message;

/// Options that every command takes.
#[derive(Debug, Args)]
pub struct Options {
    /// Text for people, or the same facts as JSON
    // A text, so that a command with forms of its own can declare the same option with other values.
    #[arg(long, global = true, value_name = "FORMAT", value_parser = formats(), default_value = "table")]
    pub format: String,
    /// Print only the result, warnings and errors
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

fn formats() -> PossibleValuesParser {
    PossibleValuesParser::new([
        PossibleValue::new("table").help("For people").alias("text"),
        PossibleValue::new("json").help("For programs"),
    ])
}

/// The form of what is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// For people
    Table,
    /// For programs
    Json,
}

/// Where the program speaks.
#[derive(Debug, Clone, Copy)]
pub struct Terminal {
    /// The form of what is printed.
    pub format: Format,
    /// Whether to be brief.
    pub quiet: bool,
    /// Whether reports beside the result are for programs: a JSON object a line.
    pub events: bool,
    colour: bool,
}

impl Terminal {
    /// The terminal as it is and as the user wants it, of words alone beside the result.
    #[must_use]
    pub fn new(options: &Options) -> Self {
        let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        let colour = std::io::stderr().is_terminal() && !plain;
        Self {
            format: match &*options.format {
                "json" => Format::Json,
                _ => Format::Table,
            },
            quiet: options.quiet,
            events: false,
            colour,
        }
    }

    /// Notes something that the user should know beside the result.
    pub fn note(&self, message: impl Into<Message>) {
        if !self.quiet {
            self.write("note", None, &message.into());
        }
    }

    /// Warns of what is not as it should be, but did not stop the work.
    pub fn warning(&self, message: impl Into<Message>) {
        self.write("warning", Some("\x1b[1;33m"), &message.into());
    }

    /// Reports why the program gives up.
    pub fn error(&self, failure: &Failure) {
        match failure {
            Failure::Graph {
                diagnostics,
                sources,
            } => self.diagnostics(diagnostics, sources),
            other => self.setback(other),
        }
    }

    /// Reports why something is not done, while the result goes on.
    pub fn setback(&self, failure: &Failure) {
        match failure {
            Failure::Graph {
                diagnostics: all,
                sources,
            } => match self.events {
                true => self.doubts(all, sources),
                false => self.diagnostics(all, sources),
            },
            Failure::Exit(_) => {}
            Failure::Request(text) | Failure::Outside(text) => {
                let message = Message::new("error", Value::Null, text);
                self.write("error", Some("\x1b[1;31m"), &message);
            }
        }
    }

    /// Shows the mistakes of a file, in the form asked for.
    pub fn diagnostics(&self, diagnostics: &Diagnostics, sources: &Sources) {
        if diagnostics.is_empty() {
            return;
        }
        if self.format == Format::Json {
            println!("{:#}", diagnostics.to_json(sources));
        } else {
            self.doubts(diagnostics, sources);
            let (errors, warnings) = (diagnostics.error_count(), diagnostics.warning_count());
            let kinds = [(errors, "error"), (warnings, "warning")].into_iter();
            let kinds = kinds.filter(|(count, _)| *count > 0);
            let words: Vec<_> = kinds.map(|(n, what)| counted(n as u64, what)).collect();
            self.note(words.join(", "));
        }
    }

    /// Shows what is doubtful or wrong in a file, beside a result that there is nevertheless.
    pub fn doubts(&self, diagnostics: &Diagnostics, sources: &Sources) {
        if self.events {
            let all = diagnostics.to_json(sources);
            for of in all["diagnostics"].as_array().into_iter().flatten() {
                let text = |key: &str| of[key].as_str().unwrap_or_default();
                let message = Message::new("diagnostic", of.clone(), text("message"));
                self.print(message.line(text("severity")));
            }
        } else if !diagnostics.is_empty() {
            self.print(diagnostics.render(sources, self.colour, 100).trim_end());
        }
    }

    /// Writes an event for programs or a line for people, with a label of this colour where it is graver than a note.
    fn write(&self, level: &'static str, colour: Option<&str>, message: &Message) {
        if let Some(to) = &*diversion() {
            return to(level, message);
        }
        match colour {
            _ if self.events => self.print(message.line(level)),
            Some(colour) if self.colour => {
                self.print(format_args!(
                    "{colour}{level}\x1b[0m\x1b[1m:\x1b[0m {message}"
                ));
            }
            Some(_) => self.print(format_args!("{level}: {message}")),
            None => self.print(message),
        }
    }

    /// A reader of standard error that has gone away is no reason to stop.
    fn print(&self, text: impl fmt::Display) {
        let _ = writeln!(std::io::stderr(), "{text}");
    }
}

/// Where reports go instead of standard error: they are given with `note`, `warning` or `error`.
pub type Diversion = Box<dyn Fn(&str, &Message) + Send>;

/// From here on reports of this process go elsewhere, such as into a log.
pub fn divert(to: Option<Diversion>) {
    *diversion() = to;
}

fn diversion() -> MutexGuard<'static, Option<Diversion>> {
    static DIVERSION: Mutex<Option<Diversion>> = Mutex::new(None);
    DIVERSION.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes to standard output; a reader who has seen enough ends the program quietly.
///
/// # Errors
/// When it cannot be written.
pub fn print(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(bytes)
        .and_then(|()| out.flush())
        .map_err(|error| match error.kind() {
            std::io::ErrorKind::BrokenPipe => Failure::Exit(0),
            _ => Failure::Outside(format!("cannot write to standard output: {error}")),
        })
}

impl Watch for Terminal {
    fn remark(&self, level: &'static str, message: Message) {
        match level {
            "note" => self.note(message),
            "warning" => self.warning(message),
            level => self.write(level, Some("\x1b[1;31m"), &message),
        }
    }

    fn begin(&self, what: &str, total: Option<u64>) -> Box<dyn Progress> {
        let (bar, template) = match total {
            None => (ProgressBar::no_length(), "{msg}: {human_pos} ticks"),
            Some(total) => (
                ProgressBar::new(total),
                "{msg} {bar:24} {percent:>3} %, {eta} left",
            ),
        };
        bar.set_draw_target(ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(what.to_owned());
        let waits = std::io::stderr().is_terminal() && !self.quiet;
        Box::new(Bar { bar, waits })
    }

    fn doubts(&self, diagnostics: &Diagnostics, sources: &Sources) {
        Self::doubts(self, diagnostics, sources);
    }
}

/// A line on standard error that shows how far the work has come, once it takes a second.
struct Bar {
    bar: ProgressBar,
    /// Whether the line waits for the second to pass.
    waits: bool,
}

impl Progress for Bar {
    fn set(&mut self, done: u64) {
        self.bar.set_position(done);
        if self.waits && self.bar.elapsed() >= Duration::from_secs(1) {
            self.waits = false;
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }

    fn doing(&mut self, what: String) {
        self.bar.set_message(what);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// The answer of a command that did its work, as its exit status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// All is well.
    Fine,
    /// The answer is no: something was checked and does not hold.
    No,
}

impl Answer {
    /// The exit status.
    #[must_use]
    pub fn status(self) -> u8 {
        match self {
            Self::Fine => 0,
            Self::No => 1,
        }
    }
}
