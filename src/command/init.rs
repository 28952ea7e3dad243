//! `athermal init`: a starter graph for logs.

use schemars::JsonSchema;
use serde::Deserialize;
use std::path::{Path, PathBuf};

use athermal::core::document::TableFormat;
use athermal::core::time::TimeFormat;
use clap::Args;
use serde_json::json;

use super::aside::{check_apart, write_aside};
use super::asked::some_by_text;
use super::data::{Data, Reading};
use crate::invocation::{command, quoted};
use crate::meant::{new_log, written};
use crate::starter::{NoStarter, Request, Starter, starter};
use crate::terminal::{Answer, Failure, Format, Terminal, print};
use athermal_analysis::figures::paragraph;

/// Write a starter graph for a log of yours
///
/// Looks at the names and values of CSV or JSON lines files. It guesses what is a temperature, what drifts, and in which
/// units. It measures rates and gaps, and chooses windows by the drift against its standard error. Every guess is printed,
/// and stands in the graph as a comment. The graph checks, fits and evaluates as it is. Files of different columns whose times
/// overlap are merged by time, as `fit` does.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[command(after_help = "Examples:
  athermal init log.csv
  athermal init log.csv -o graph.toml
  athermal init temperatures.csv positions.csv
  athermal init log.csv --time stamp --drifts probe1 probe2 -o -
  athermal init log.csv --time-format '%d.%m.%Y %H:%M:%S'

Names help: plate_degC, room_degF, Z1_nm, gap_um, heater_W, time_s, time_ms.")]
pub struct Init {
    /// The log, or the files of several loggers
    #[arg(required = true, value_name = "DATA", value_parser = new_log())]
    data: Vec<PathBuf>,
    /// Where the graph goes; `-` is standard output
    #[arg(long, short, value_name = "GRAPH", default_value = "graph.toml", value_parser = written())]
    #[serde(skip)]
    output: PathBuf,
    /// The column that gives the time, or several in braces: "{Date} {Time}"
    #[arg(long, value_name = "COLUMN")]
    #[serde(default)]
    time: Option<String>,
    /// How dates and times are written that are not as in RFC 3339, in the letters of strptime
    #[arg(long, value_name = "FORMAT")]
    #[serde(default, deserialize_with = "some_by_text")]
    #[schemars(with = "Option<String>")]
    time_format: Option<TimeFormat>,
    /// The columns that drift
    #[arg(long, num_args = 1.., value_name = "COLUMN")]
    #[serde(default)]
    drifts: Vec<String>,
    /// How the text is laid out where that is not found, as `[table]` of a graph says it: skip=2 names=1 separator=; decimal=,
    #[arg(long, num_args = 1.., value_name = "KEY=VALUE")]
    #[serde(default)]
    table: Vec<String>,
    /// Write over a graph that is there
    #[arg(long)]
    #[serde(skip)]
    force: bool,
    #[command(flatten)]
    #[serde(flatten)]
    reading: Reading,
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
        let data = Data::of(self.data.clone(), self.reading.clone());
        check_apart("--output", &self.output, data.paths())?;
        let starter = self.find()?;
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
            terminal.note(self.next(&data));
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

    /// Looks and guesses.
    ///
    /// # Errors
    /// When the log cannot be read, or nothing in it drifts.
    pub fn find(&self) -> Result<Starter, Failure> {
        let request = Request {
            time: self.time.clone(),
            format: self.time_format.clone(),
            drifting: self.drifts.clone(),
            table: self.table()?,
        };
        let data = Data::of(self.data.clone(), self.reading.clone());
        data.check_offsets(&[])?;
        starter(&data.dataset(), &request).map_err(|error| match error {
            NoStarter::File(error) => {
                // There is no `--lenient` here that it could advise.
                let reason = error.without_advice().to_string();
                match error.into() {
                    Failure::Request(_) => Failure::Request(reason),
                    other => other,
                }
            }
            NoStarter::Unfit(why) => Failure::Request(why),
        })
    }

    /// What `--table` declares.
    fn table(&self) -> Result<TableFormat, Failure> {
        let mut declared = toml::Table::new();
        for text in &self.table {
            let Some((key, value)) = text.split_once('=') else {
                return Err(Failure::Request(format!(
                    "--table {text}: expected a key of [table] and its value, such as skip=2"
                )));
            };
            let read = format!("value = {value}").parse::<toml::Table>().ok();
            let read = read.and_then(|mut of| of.remove("value"));
            declared.insert(key.to_owned(), read.unwrap_or_else(|| value.into()));
        }
        declared.try_into().map_err(|error: toml::de::Error| {
            Failure::Request(format!("--table: {}", error.message()))
        })
    }

    fn next(&self, data: &Data) -> String {
        let mut fit = data.words_with("fit", &self.output);
        fit.push("-o model.json".to_owned());
        let unseen = data.others(vec![data.unseen().into()]);
        let evaluate = unseen.words_with("evaluate", Path::new("model.json"));
        format!(
            "wrote {}; look it over, then fit it, and test it on another log:\n{}\n{}",
            quoted(&self.output.display().to_string()),
            command(&fit),
            command(&evaluate)
        )
    }
}
