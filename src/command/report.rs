//! `athermal report`: what a model is worth on recorded data, as a page.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use athermal::chart::Plot;
use athermal::core::compile::Wanted;
use athermal::core::watch::Watch;
use athermal::report::{page, plots};
use athermal_jobs::model::load_fitted;
use athermal_jobs::path::{graph_or_model, written};
use athermal_jobs::report as job;
use clap::Args;

use super::aside::{check_apart, write_aside};
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Show what a model is worth on recorded data, as one page
///
/// Prints a verdict per axis, optical loss and settle time without and with the correction, and which sensors to look at.
/// With `-o` it writes a self-contained HTML page that also has scores, drift and its correction over time, votes and
/// errors, chosen features, all sensors, and the model's card. With `--format json` the same facts go to standard output.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal report model.json --data test.csv\n  \
                        athermal report model.json --data test.csv -o report.html --open\n  \
                        athermal report model.json --data test.csv --plots plots\n  \
                        athermal report model.json --data test.csv --format json"
)]
pub struct Report {
    /// The model, or a graph that names one or in which nothing needs fitting
    #[arg(value_parser = graph_or_model())]
    model: PathBuf,
    #[command(flatten)]
    job: job::Report,
    /// Where the page goes; `-` is standard output
    #[arg(long, short, value_name = "FILE", value_parser = written())]
    output: Option<PathBuf>,
    /// Open the page in a browser; without `-o` it goes into the folder for temporary files
    #[arg(long)]
    open: bool,
    /// A folder for the pictures, each as an SVG file
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
}

impl Report {
    /// Gathers the facts and writes them.
    ///
    /// # Errors
    /// When the model or the data cannot be used, or a file cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        self.job.data.check_lasting("--data")?;
        let to_stdout = self.output.as_deref() == Some(Path::new("-"));
        if to_stdout && self.open {
            let message = "--output -: what goes to standard output cannot be opened; name a file, or leave `-o` out";
            return Err(Failure::Request(message.to_owned()));
        }
        let output = self.output.clone().or_else(|| self.open.then(passing));
        if let Some(output) = &self.output {
            if to_stdout && terminal.format == Format::Json {
                let message = "--output -: the page and the facts as JSON cannot both go to standard output; name a file for the page";
                return Err(Failure::Request(message.to_owned()));
            }
            let read = self.job.data.paths().chain([&*self.model]);
            check_apart("--output", output, read)?;
        }
        let model = load_fitted(&self.model, Wanted::SCORES, terminal)?;
        self.job.data.thin(Some(&self.model), &model)?;
        let (found, facts) = self.job.find(&model, terminal)?;
        match terminal.format {
            Format::Json => println!("{:#}", found.facts),
            Format::Table if to_stdout => {}
            Format::Table => print!("{}", found.text),
        }
        if let Some(path) = &output {
            let page = page(&facts);
            if to_stdout {
                print!("{page}");
            } else {
                write_aside(path, &page)?;
                let (path, kb) = (path.display(), page.len() / 1000);
                terminal.note(format_args!("wrote {path} ({kb} kB)"));
            }
        }
        if let Some(path) = output.filter(|_| self.open)
            && let Err(error) = opened(&path)
        {
            let path = path.display();
            terminal.warning(format_args!(
                "no browser opens {path} ({error}): open it yourself"
            ));
        }
        if let Some(folder) = &self.plots {
            write_plots(terminal, folder, &plots(&facts))?;
        }
        Ok(Answer::Fine)
    }
}

/// A page that nobody asked to keep.
fn passing() -> PathBuf {
    std::env::temp_dir().join(format!("athermal-report-{}.html", std::process::id()))
}

/// Hands a page to whatever shows pages here: the program that `BROWSER` names, or that of the system.
fn opened(path: &Path) -> std::io::Result<()> {
    let path = std::path::absolute(path)?;
    let named = std::env::var("BROWSER")
        .ok()
        .filter(|name| !name.is_empty());
    let usual = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let mut browser = Command::new(named.as_deref().unwrap_or(usual));
    let silent = browser.stdin(Stdio::null()).stdout(Stdio::null());
    silent.stderr(Stdio::null()).arg(path).spawn().map(drop)
}

/// Writes pictures into a folder.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_plots(host: &dyn Watch, folder: &Path, plots: &[Plot]) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::Outside(format!("cannot make {}: {error}", folder.display())))?;
    let names = file_names(plots.iter().map(|plot| plot.name.as_str()));
    for (plot, name) in plots.iter().zip(names) {
        write_aside(&folder.join(format!("{name}.svg")), &plot.svg)?;
    }
    let (count, folder) = (plots.len(), folder.display());
    host.note(format_args!("wrote {count} pictures to {folder}"));
    Ok(())
}

/// The most bytes of a name: file systems take 255, of which an ending and what a file is called while it is written have a share.
const LONGEST: usize = 180;

/// Names that are one file each in any folder, whatever axes are called: those that are too long lose their ends, and those that
/// would be the same have a number, also where only letters are upper or lower.
fn file_names<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let is_plain = |c: char| c.is_alphanumeric() || "-_@".contains(c);
    let mut taken = BTreeSet::new();
    let one = |name: &str| {
        let mut name = name.replace(|c| !is_plain(c), "_");
        while name.len() > LONGEST {
            name.pop();
        }
        let numbered = (2..).map(|nth: u32| format!("{name}-{nth}"));
        let mut all = std::iter::once(name.clone()).chain(numbered);
        all.find(|name| taken.insert(name.to_lowercase()))
            .unwrap_or(name)
    };
    names.map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_has_a_file_of_its_own_whatever_its_axis_is_called() {
        let long = format!("drift-{}", "é".repeat(400));
        let names = ["drift-a.b", "drift-a_b", "drift-A_b", &long, &long];
        let files = file_names(names.into_iter());
        assert_eq!(files[..3], ["drift-a_b", "drift-a_b-2", "drift-A_b-3"]);
        let short = format!("drift-{}", "é".repeat(87));
        assert_eq!(files[3..], [short.clone(), format!("{short}-2")]);
    }
}
