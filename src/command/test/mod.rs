//! `athermal test`: runs the tests that graph files carry.

mod report;
mod suite;
mod work;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::aside::{check_apart, write_aside};
use crate::output::offer;
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_jobs::Threads;
use report::Summary;
use suite::Suite;
use work::Status;

/// Run the tests that graph files carry
///
/// Each `[[tests]]` of a graph names data (files, a simulated machine, or made-up measurements), faults of sensors, and what
/// must come out. The graph is fitted and run over the data by the engine that runs live. One line is printed per test, in
/// the order of the files, with the figures of those that fail. The exit status is 1 if any fails, 2 if a file has mistakes,
/// 3 if one cannot be read.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  athermal test graphs/die-tester.toml\n  \
                        athermal test graphs/*.toml --junit tests.xml\n  \
                        athermal test machine.toml --filter \"dead sensor\" --format json")]
pub struct Test {
    /// Graph files
    #[arg(required = true, value_name = "GRAPH", value_parser = athermal_jobs::path::graph_or_model())]
    graphs: Vec<PathBuf>,
    /// Only tests whose name contains this text, in upper or lower case
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// Also write the results as JUnit XML; `-` is standard output, in place of the lines for people
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

impl Test {
    /// Runs the tests and prints their results.
    ///
    /// # Errors
    /// When a file has mistakes, data cannot be read, or the results not be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let began = Instant::now();
        let printed = self
            .junit
            .as_deref()
            .is_some_and(|path| path.as_os_str() == "-");
        if printed && terminal.format == Format::Json {
            let message = "--junit -: the results as JUnit XML and as JSON cannot both go to standard output; name a file for the XML";
            return Err(Failure::Request(message.to_owned()));
        }
        if let Some(path) = &self.junit {
            check_apart("--junit", path, self.graphs.iter().map(|path| &**path))?;
        }
        let mut suites = suite::load(&self.graphs, terminal)?;
        if let Some(path) = &self.junit {
            check_apart("--junit", path, suites.iter().flat_map(Suite::data))?;
        }
        if let Some(text) = &self.filter {
            let text = text.to_lowercase();
            for suite in &mut suites {
                let matches = |name: &str| name.to_lowercase().contains(&text);
                suite.trials.retain(|trial| matches(&trial.name));
            }
            if suites.iter().all(|suite| suite.trials.is_empty()) {
                let message = format!("no test has a name that contains `{text}`");
                return Err(Failure::Request(message));
            }
        } else {
            for suite in suites.iter().filter(|suite| suite.trials.is_empty()) {
                terminal.warning(format_args!("{} has no tests", suite.path));
            }
        }
        let people = terminal.format != Format::Json && !printed;
        let mut shown = None;
        let results = work::run(&suites, self.threads.count(), &mut |result| {
            if people {
                let suite = &suites[result.suite];
                if shown != Some(result.suite) && !terminal.quiet {
                    offer(format_args!("{}\n", suite.path));
                    shown = Some(result.suite);
                }
                if !(terminal.quiet && matches!(result.status, Status::Passed)) {
                    offer(format_args!("{}", report::lines(suite, result)));
                }
            }
        });
        let summary = Summary::of(&suites, &results, began.elapsed());
        match &self.junit {
            Some(_) if printed => print!("{}", summary.junit()?),
            Some(path) => write_aside(path, summary.junit()?)?,
            None => {}
        }
        let mut warned = BTreeSet::new();
        for warning in results.iter().flat_map(|ran| &ran.warnings) {
            if warned.insert(warning) {
                terminal.warning(warning);
            }
        }
        if terminal.format == Format::Json {
            println!("{:#}", summary.json());
        } else {
            terminal.note(summary.line());
        }
        summary.answer()
    }
}
