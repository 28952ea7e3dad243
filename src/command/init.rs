//! `athermal init`: a starter graph for logs.

use std::path::{Path, PathBuf};

use athermal_analysis::figures::paragraph;
use athermal_jobs::data::Data;
use athermal_jobs::init as job;
use athermal_jobs::path::written;
use clap::Args;
use serde_json::json;

use super::aside::{check_apart, write_aside};
use crate::invocation::{command, program, quoted, words_with};
use crate::terminal::{Answer, Failure, Format, Terminal, print};

/// Write a starter graph for a log of yours
///
/// Looks at the names and values of CSV or JSON lines files. It guesses what is a temperature, what drifts, and in which
/// units. It measures rates and gaps, and chooses windows by the drift against its standard error. Every guess is printed,
/// and stands in the graph as a comment. The graph checks, fits and evaluates as it is. Files of different columns whose times
/// overlap are merged by time, as `fit` does.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal init log.csv
  athermal init log.csv -o graph.toml
  athermal init temperatures.csv positions.csv
  athermal init log.csv --time stamp --drifts probe1 probe2 -o -
  athermal init log.csv --time-format '%d.%m.%Y %H:%M:%S'

Names help: plate_degC, room_degF, Z1_nm, gap_um, heater_W, time_s, time_ms.")]
pub struct Init {
    #[command(flatten)]
    job: job::Init,
    /// Where the graph goes; `-` is standard output
    #[arg(long, short, value_name = "GRAPH", default_value = "graph.toml", value_parser = written())]
    output: PathBuf,
    /// Write over a graph that is there
    #[arg(long)]
    force: bool,
}

impl Init {
    /// Looks, guesses and writes.
    ///
    /// # Errors
    /// When the log cannot be read, nothing in it drifts, or the graph is there already.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let to_stdout = self.output == Path::new("-");
        if !to_stdout && !self.force && self.output.exists() {
            return Err(Failure::Request(format!(
                "{} is there already; name another with -o, or write over it with --force",
                self.output.display()
            )));
        }
        let data = self.job.data();
        check_apart("--output", &self.output, data.paths())?;
        let starter = self.job.find()?;
        let people = terminal.format == Format::Table;
        if people {
            for remark in &starter.remarks {
                terminal.note(paragraph("", 2, remark).trim_end());
            }
        }
        if to_stdout {
            print(starter.text.as_bytes())?;
            return Ok(Answer::Fine);
        }
        write_aside(&self.output, &starter.text)?;
        if people {
            terminal.note(self.next(&data, &starter));
        } else {
            let facts = json!({
                "graph": self.output,
                "columns": starter.columns,
                "windows": starter.windows,
                "remarks": starter.remarks,
            });
            println!("{facts:#}");
        }
        Ok(Answer::Fine)
    }

    /// What goes out of the graph, what to edit, and the commands up to a report; a log whose times do not start again is parted for them.
    fn next(&self, data: &Data, starter: &job::Starter) -> String {
        let model = Path::new("model.json");
        let cut = || starter.last_fifth.clone();
        let fitted = data.within(None, cut());
        let unseen = fitted.rest();
        let unseen = unseen.unwrap_or_else(|| data.others(vec![data.unseen().into()]));
        let graph = quoted(&self.output.display().to_string());
        let mut fit = words_with(&fitted, "fit", &self.output);
        fit.extend(["-o", "model.json"].map(str::to_owned));
        let mut report = words_with(&unseen, "report", model);
        report.extend(["-o", "report.html"].map(str::to_owned));
        let parted = match cut() {
            Some(cut) => format!("; the last fifth of the log, from {cut} on, is left to score it"),
            None => ", and score it on another log".to_owned(),
        };
        let commands = [
            vec![program(), "check".to_owned(), graph.clone()],
            fit,
            words_with(&unseen, "evaluate", model),
            report,
        ];
        let head = format!(
            "wrote {graph}: where a guess is wrong, edit its line there, or name columns with --time and --drifts. Then fit it{parted}:"
        );
        let head = paragraph("", 2, &starter.outputs) + &paragraph("", 2, &head);
        head + &commands.map(|words| command(&words)).join("\n")
    }
}
