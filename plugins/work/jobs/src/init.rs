//! `athermal init`: a starter graph for logs.

use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

use athermal_core::document::TableFormat;
use athermal_core::time::TimeFormat;
use clap::Args;

use crate::asked::some_by_text;
use crate::data::{Data, Joining, Reading};
use crate::path::new_log;
use athermal_core::failure::Failure;
use athermal_files::Tables;
pub use athermal_starter::Starter;
use athermal_starter::{NoStarter, Request, starter};

/// What is known of logs that a starter graph is written for.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[group(skip)]
pub struct Init {
    /// The log, or the files of several loggers
    #[arg(required = true, value_name = "DATA", value_parser = new_log())]
    data: Vec<PathBuf>,
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
    /// Columns that are inputs although they seem to repeat what drifts, or to count
    #[arg(long, num_args = 1.., value_name = "COLUMN")]
    #[serde(default)]
    keep: Vec<String>,
    /// The columns of what a correction applied, beside those that are called so
    #[arg(long, num_args = 1.., value_name = "COLUMN")]
    #[serde(default)]
    applied: Vec<String>,
    /// How the text is laid out where that is not found, as `[table]` of a graph says it: skip=2 names=1 separator=; decimal=,
    #[arg(long, num_args = 1.., value_name = "KEY=VALUE")]
    #[serde(default)]
    table: Vec<String>,
    #[command(flatten)]
    #[serde(flatten)]
    joining: Joining,
    #[arg(skip)]
    #[serde(skip)]
    tables: Tables,
}

impl Init {
    /// From now on tables in memory stand for files of their names.
    pub fn lend(&mut self, tables: &Tables) {
        self.tables = tables.clone();
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
            keep: self.keep.clone(),
            applied: self.applied.clone(),
            table: self.table()?,
        };
        let data = self.data();
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

    /// The data.
    #[must_use]
    pub fn data(&self) -> Data {
        let reading = Reading {
            joining: self.joining.clone(),
            ..Reading::default()
        };
        let mut data = Data::of(self.data.clone(), reading);
        data.lend(&self.tables);
        data
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
}
