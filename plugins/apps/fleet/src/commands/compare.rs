//! `athermal fleet compare`: the machines that are unlike the others.

use std::path::PathBuf;

use athermal_analysis::figures::{counted, number, paragraph};
use athermal_command::{Answer, Failure, Format, Terminal, print, println};
use athermal_run::live::store::write_whole;
use clap::Args;
use serde_json::json;

use super::models_in;
use crate::unlike::{Comparison, FEWEST, compare, picture, traits_of};

/// Show the machines that are unlike the others
///
/// The models of a folder are compared by their coefficients, by their errors on the rows of the fit, and by the range of
/// each sensor in these rows. A loose sensor or a worn part shows in them. The score of a value is its distance from what the
/// fleet has in common, in standard deviations: how far machines differ, and how sure the value is. Of a hundred machines
/// that are as they should be about two are beyond the limit. The exit status is 1 where a machine is beyond it.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal fleet compare models\n  athermal fleet compare models --plot unlike.svg"
)]
pub(crate) struct Compare {
    /// The folder of the models
    models: PathBuf,
    /// Draw the scores of all machines, as SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// So many departures of a machine are shown.
const SHOWN: usize = 5;

impl Compare {
    /// Compares and prints.
    ///
    /// # Errors
    /// When there are too few models, or the picture cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let fleet = models_in(&self.models, terminal, |model| traits_of(&model))?;
        if fleet.len() < FEWEST {
            return Err(Failure::Request(format!(
                "{}: {} cannot be compared: of fewer than {FEWEST} no spread is known",
                self.models.display(),
                counted(fleet.len() as u64, "machine")
            )));
        }
        let comparison = compare(&fleet);
        if terminal.format == Format::Json {
            println!(
                "{:#}",
                json!({
                    "models": self.models,
                    "limit": comparison.limit,
                    "expected": comparison.expected,
                    "traits": comparison.traits,
                    "machines": comparison.machines.iter().map(|of| json!({
                        "machine": of.machine,
                        "unlike": of.unlike,
                        "departures": of.departures.iter().take(SHOWN).collect::<Vec<_>>(),
                    })).collect::<Vec<_>>(),
                })
            );
        } else {
            print!("{}", text(&comparison));
        }
        if let Some(path) = &self.plot {
            write_whole(path, picture(&comparison, |chart| chart.file()).as_bytes()).map_err(
                |error| Failure::Outside(format!("cannot write {}: {error}", path.display())),
            )?;
            terminal.note(format_args!("wrote {}", path.display()));
        }
        let unlike = comparison.machines.iter().any(|of| of.unlike);
        Ok(if unlike { Answer::No } else { Answer::Fine })
    }
}

fn text(comparison: &Comparison) -> String {
    let mut text = format!(
        "{} by {}; named is what has a score beyond {}, as {} would if all were as they should be\n",
        counted(comparison.machines.len() as u64, "machine"),
        counted(comparison.traits as u64, "trait"),
        number(comparison.limit),
        number(comparison.expected)
    );
    let mut any = false;
    for of in comparison.machines.iter().filter(|of| of.unlike) {
        any = true;
        text.push_str(&format!("{}\n", of.machine));
        let beyond = of.beyond(comparison.limit).count();
        for departure in of.beyond(comparison.limit).take(SHOWN) {
            text.push_str(&paragraph("  ", 4, &departure.sentence()));
        }
        if beyond > SHOWN {
            text.push_str(&format!("  and {} more\n", beyond - SHOWN));
        }
    }
    if !any {
        text.push_str("no machine is unlike the others\n");
    }
    text
}
