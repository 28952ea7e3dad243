//! `athermal report`: what a model is worth on recorded data, as a page.

use std::path::{Path, PathBuf};

use athermal::report::{WANTED, gather, page, plots};
use clap::Args;

use super::data::Data;
use super::evaluate::load_fitted;
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Show what a model is worth on recorded data, as one page
///
/// Writes a self-contained HTML page: a verdict per axis, scores, drift and its correction over time, optical loss and
/// settle time without and with the correction, chosen features, sensors, and the model's card. With `--format json` the
/// same facts go to standard output.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal report model.json --data test.csv -o report.html\n  \
                        athermal report model.json --data test.csv --plots plots\n  \
                        athermal report model.json --data test.csv --format json"
)]
pub struct Report {
    /// The model, or a graph in which nothing needs fitting
    model: PathBuf,
    #[command(flatten)]
    data: Data,
    /// Where the page goes; `-` is standard output
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// A folder for every picture as an SVG file of its own
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
}

impl Report {
    /// Gathers the facts and writes them.
    ///
    /// # Errors
    /// When the model or the data cannot be used, or a file cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        if self.output.is_none() && self.plots.is_none() && terminal.format != Format::Json {
            return Err(Failure::Request(
                "name a file for the page: `-o report.html` (or `--plots DIR`, or `--format json`)"
                    .to_owned(),
            ));
        }
        let model = load_fitted(&self.model, WANTED)?;
        let dataset = self.data.dataset();
        let names = dataset
            .paths()
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        let facts =
            gather(&model, &dataset, names).map_err(|error| Failure::Outside(error.to_string()))?;
        if facts.course.axes.is_empty() {
            terminal.warning(
                "the graph has no prediction of a measured truth, so there is little to report",
            );
        }
        if terminal.format == Format::Json {
            let text = serde_json::to_string_pretty(&facts)
                .map_err(|error| Failure::Outside(error.to_string()))?;
            println!("{text}");
        }
        if let Some(path) = &self.output {
            let page = page(&facts);
            if path.as_os_str() == "-" {
                print!("{page}");
            } else {
                write(path, &page)?;
                terminal.note(format_args!(
                    "wrote {} ({} kB)",
                    path.display(),
                    page.len() / 1000
                ));
            }
        }
        if let Some(folder) = &self.plots {
            write_pictures(terminal, folder, &plots(&facts))?;
        }
        Ok(Answer::Fine)
    }
}

/// Writes pictures, each a name and its SVG, into a folder.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_pictures(
    terminal: &Terminal,
    folder: &Path,
    pictures: &[(String, String)],
) -> Result<(), Failure> {
    let failed = |error: std::io::Error| {
        Failure::Outside(format!("cannot make {}: {error}", folder.display()))
    };
    std::fs::create_dir_all(folder).map_err(failed)?;
    for (name, svg) in pictures {
        write(&folder.join(file_name(name)), svg)?;
    }
    terminal.note(format_args!(
        "wrote {} pictures to {}",
        pictures.len(),
        folder.display()
    ));
    Ok(())
}

/// A name that is one file in any folder, whatever an axis is called.
fn file_name(name: &str) -> String {
    let plain = name.chars().map(|c| {
        if c.is_alphanumeric() || "-_@".contains(c) {
            c
        } else {
            '_'
        }
    });
    plain.chain(".svg".chars()).collect()
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text)
        .map_err(|error| Failure::Outside(format!("cannot write {}: {error}", path.display())))
}
