//! `athermal replay`: what a service stepped, once more.

use std::path::{Path, PathBuf};

use athermal::core::engine::Engine;
use athermal::files::{Flush, Writer};
use athermal::serve::folder::StatePaths;
use athermal::serve::recovery::Recovered;
use clap::Args;
use serde_json::json;

use super::serve::events::{damaged, steps};
use crate::message::Message;
use crate::terminal::{Answer, Failure, Terminal};
use athermal_analysis::figures::{instant, seconds};

/// Step the journal of a service again, to the same bits
///
/// Goes from as early on as the journal and its checkpoints allow, with the graphs that ran then. Nothing in the folder is changed; the
/// service may go on meanwhile.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal replay machine.state --check\n  athermal replay machine.state -o again.csv"
)]
pub struct Replay {
    /// The state folder of the service
    state: PathBuf,
    /// Fail where an output differs in a bit from what was put out then (exit status 1)
    #[arg(long)]
    check: bool,
    /// Write a row for each tick, as CSV, or JSON lines by its ending; `-` is standard output
    #[arg(long, short, value_name = "FILE", value_parser = athermal_jobs::path::written())]
    output: Option<PathBuf>,
}

impl Replay {
    /// Steps all again.
    ///
    /// # Errors
    /// When there is no journal, it is damaged, or the output cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let (mut rows, mut failed) = (None, None);
        let write = |_, engine: &Engine| {
            if let Some(path) = &self.output {
                let written = row(&mut rows, path, engine);
                failed = failed.take().or(written.err());
            }
        };
        let found = Recovered::replay(&StatePaths::new(&self.state), 0, write);
        let found = found.map_err(|error| Failure::Outside(error.to_string()))?;
        let Some(found) = found else {
            return Err(Failure::Request(format!(
                "{}: there is no journal in this folder; name the state folder of a service",
                self.state.display()
            )));
        };
        failed.map_or(Ok(()), Err)?;
        if let Some((writer, _)) = rows {
            writer.finish()?;
        }
        damaged(terminal, &found.report);
        let (steps, differs) = (steps(&found.report), found.report.difference);
        let facts = json!({
            "ticks": found.report.stepped - found.report.beats,
            "beats": found.report.beats,
            "first_difference_s": differs.map(|of| seconds(of.at)),
        });
        let words = match differs {
            None => format!("{steps} stepped again, to the same bits"),
            Some(of) => format!(
                "{steps} stepped again; the first that differs is at {}",
                instant(seconds(of.at))
            ),
        };
        terminal.note(Message::new("replayed", facts, words));
        Ok(match differs.filter(|_| self.check) {
            Some(_) => Answer::No,
            None => Answer::Fine,
        })
    }
}

/// Writes a row of the columns that the first graph had.
fn row(
    rows: &mut Option<(Writer, Vec<String>)>,
    path: &Path,
    engine: &Engine,
) -> Result<(), Failure> {
    let outputs = &engine.plan().outputs;
    let (writer, columns) = match rows {
        Some(rows) => rows,
        none => {
            let columns: Vec<_> = outputs.iter().map(|of| of.name.clone()).collect();
            let writer = Writer::create(path, "time_s", &columns, Flush::Buffered)?;
            none.insert((writer, columns))
        }
    };
    let value = |column: &String| {
        let place = outputs.iter().position(|of| of.name == *column);
        place.map_or(f64::NAN, |place| engine.outputs()[place])
    };
    let values: Vec<_> = columns.iter().map(value).collect();
    let at = engine.last().map_or(0, |at| at.as_ns());
    Ok(writer.write_row("", at, &values)?)
}
