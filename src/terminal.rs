//! Decides how the program speaks to people and to other programs: colour, width, progress, one-line errors.

use std::fmt;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use athermal::ModelError;
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::fit::FitError;
use athermal::files::FileError;
use clap::{Args, ValueEnum};

/// Options that every command takes.
#[derive(Debug, Args)]
pub struct Options {
    /// Text for people, or the same facts as JSON
    #[arg(long, global = true, value_enum, default_value_t)]
    pub format: Format,
    /// Say only what was asked for and what went wrong
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

/// The form of what is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Format {
    /// For people
    #[default]
    #[value(alias = "text")]
    Table,
    /// For programs
    Json,
}

/// Where the program speaks.
#[derive(Debug)]
pub struct Terminal {
    /// The form of what is printed.
    pub format: Format,
    /// Whether to be brief.
    pub quiet: bool,
    colour: bool,
}

impl Terminal {
    /// The terminal as it is and as the user wants it.
    #[must_use]
    pub fn new(options: &Options) -> Self {
        let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        let colour = std::io::stderr().is_terminal() && !plain;
        Self {
            format: options.format,
            quiet: options.quiet,
            colour,
        }
    }

    /// Says something that the user should know beside the result.
    pub fn note(&self, text: impl fmt::Display) {
        if !self.quiet {
            self.say(format_args!("{text}"));
        }
    }

    /// Says what is not as it should be, but did not stop the work.
    pub fn warning(&self, text: impl fmt::Display) {
        self.labelled("warning", "\x1b[1;33m", &text);
    }

    /// Says why the program gives up.
    pub fn error(&self, failure: &Failure) {
        match failure {
            Failure::Graph {
                diagnostics,
                sources,
            } => self.diagnostics(diagnostics, sources),
            Failure::Told(_) => {}
            Failure::Request(text) | Failure::Outside(text) => {
                self.labelled("error", "\x1b[1;31m", text)
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
            self.say(diagnostics.render(sources, self.colour, 100).trim_end());
            let (errors, warnings) = (diagnostics.error_count(), diagnostics.warning_count());
            let counted = [(errors, "error"), (warnings, "warning")];
            let counted = counted.iter().filter(|(count, _)| *count > 0);
            let words: Vec<_> = counted
                .map(|(count, what)| {
                    format!("{count} {what}{}", if *count == 1 { "" } else { "s" })
                })
                .collect();
            self.note(words.join(", "));
        }
    }

    /// Shows how far a longer piece of work has come, once it has taken a second.
    #[must_use]
    pub fn progress(&self, what: &'static str) -> Progress {
        let shown = std::io::stderr().is_terminal() && !self.quiet;
        Progress {
            what,
            shown,
            began: Instant::now(),
            last: None,
        }
    }

    fn labelled(&self, label: &str, colour: &str, text: &dyn fmt::Display) {
        if self.colour {
            self.say(format_args!("{colour}{label}\x1b[0m\x1b[1m:\x1b[0m {text}"));
        } else {
            self.say(format_args!("{label}: {text}"));
        }
    }

    /// A reader of standard error that has gone away is no reason to stop.
    fn say(&self, text: impl fmt::Display) {
        let _ = writeln!(std::io::stderr(), "{text}");
    }
}

/// A line that says how many ticks have been stepped.
#[derive(Debug)]
pub struct Progress {
    what: &'static str,
    shown: bool,
    began: Instant,
    last: Option<Instant>,
}

impl Progress {
    /// Tells the number of ticks so far.
    pub fn tell(&mut self, ticks: u64) {
        if !self.shown || self.began.elapsed() < Duration::from_secs(1) {
            return;
        }
        if self
            .last
            .is_none_or(|last| last.elapsed() > Duration::from_millis(100))
        {
            self.last = Some(Instant::now());
            let rate = ticks as f64 / self.began.elapsed().as_secs_f64();
            let _ = write!(
                std::io::stderr(),
                "\r{}: {ticks} ticks, {rate:.0} per second ",
                self.what
            );
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.last.is_some() {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

/// What a command that did its work says through its exit status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// All is well.
    Fine,
    /// The answer is no: something was checked and does not hold.
    No,
}

impl From<Answer> for ExitCode {
    fn from(answer: Answer) -> Self {
        match answer {
            Answer::Fine => ExitCode::SUCCESS,
            Answer::No => ExitCode::from(1),
        }
    }
}

/// Why a command could not do its work.
#[derive(Debug)]
pub enum Failure {
    /// What was asked for makes no sense.
    Request(String),
    /// A graph has mistakes.
    Graph {
        /// The mistakes.
        diagnostics: Box<Diagnostics>,
        /// The texts that they point into.
        sources: Box<Sources>,
    },
    /// Something outside did not work.
    Outside(String),
    /// It has been told already, and ends with this status.
    Told(u8),
}

impl Failure {
    /// The exit status: 2 where the request was wrong, 3 where something outside failed.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Request(_) | Self::Graph { .. } => 2,
            Self::Outside(_) => 3,
            Self::Told(code) => *code,
        })
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        match error {
            ModelError::Graph {
                diagnostics,
                sources,
            } => Self::Graph {
                diagnostics,
                sources,
            },
            ModelError::Unreadable { .. } => Self::Outside(error.to_string()),
            other => Self::Request(other.to_string()),
        }
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        if error.is_closed_pipe() {
            // Whoever read our output has seen enough.
            return Self::Told(0);
        }
        match error {
            FileError::Open { .. } | FileError::Read { .. } | FileError::Write { .. } => {
                Self::Outside(error.to_string())
            }
            other => Self::Request(other.to_string()),
        }
    }
}

impl From<FitError> for Failure {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Recording(error) => match error.downcast::<FileError>() {
                Ok(error) => (*error).into(),
                Err(error) => Self::Outside(error.to_string()),
            },
            FitError::Engine(error) => Self::Request(error.to_string()),
        }
    }
}
