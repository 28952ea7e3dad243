//! `athermal fleet report`: one page about a fleet.

use std::collections::BTreeMap;
use std::path::PathBuf;

use athermal_command::{Answer, Failure, Terminal, print};
use athermal_run::live::store::write_whole;
use athermal_run::model::Model;
use clap::Args;

use super::evaluate::{Scored, Scoring};
use super::{models_in, warn_failed};
use crate::figure::{Figure, standings};
use crate::manifest::{Manifest, Outcome};
use crate::page::{Facts, Known, page};
use crate::unlike::{FEWEST, compare, traits_of};

/// Write one page about a fleet
///
/// The page shows how errors are spread over the machines, the worst ten, those that are unlike the others, and what is
/// known of each machine. It needs nothing else to be read: no script, and no request leaves it. Errors are those on the
/// rows of the fit, or with `--data` those on other rows.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal fleet report models -o fleet.html\n  \
                        athermal fleet report models --data 'new/machine=*/*.csv' -o fleet.html"
)]
pub(crate) struct Report {
    /// The folder of the models
    models: PathBuf,
    /// Score the models on these data: files, folders of files, or quoted patterns, such as 'new/machine=*/*.csv'
    #[arg(long = "data", short, num_args = 1.., value_name = "FILES")]
    data: Vec<String>,
    #[command(flatten)]
    scoring: Scoring,
    /// Where the page goes; `-` is standard output
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
}

impl Report {
    /// Gathers and writes.
    ///
    /// # Errors
    /// When there is no model, the data cannot be used, or the page cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let loaded = models_in(&self.models, terminal, |model: Model| {
            (traits_of(&model), Known::of(&model))
        })?;
        let (mut traits, mut known) = (BTreeMap::new(), BTreeMap::new());
        for (machine, (of_traits, of_known)) in loaded {
            traits.insert(machine.clone(), of_traits);
            known.insert(machine, of_known);
        }
        let manifest =
            Manifest::read(&self.models).map_err(|error| Failure::Request(error.to_string()))?;
        let scored = match &*self.data {
            [] => None,
            data => Some(self.scoring.score(&self.models, data, terminal)?),
        };
        let figures = match &scored {
            Some(scored) => scored.figures(),
            None => known
                .iter()
                .map(|(name, of)| (name.clone(), Figure::of_card(&of.card)))
                .collect(),
        };
        let mut failed = scored
            .as_ref()
            .map_or_else(BTreeMap::new, |of| of.failed.clone());
        for (machine, entry) in manifest.iter().flat_map(|of| &of.machines) {
            let doubts = match &scored {
                Some(scored) => scored.machines.get(machine).map(|of| &of.doubts),
                None => Some(&entry.doubts),
            };
            if let (Some(known), Some(doubts)) = (known.get_mut(machine), doubts) {
                known.doubts.clone_from(doubts);
            }
            if let (Outcome::Failed, Some(error)) = (entry.outcome, &entry.error) {
                failed
                    .entry(machine.clone())
                    .or_insert_with(|| error.clone());
            }
        }
        let comparison = (traits.len() >= FEWEST).then(|| compare(&traits));
        let page = page(&Facts {
            title: self.title(manifest.as_ref()),
            on_other_rows: scored.is_some(),
            standings: standings(&figures),
            failed: &failed,
            comparison: comparison.as_ref(),
            known: &known,
        });
        if self.output.as_os_str() == "-" {
            print!("{page}");
        } else {
            write_whole(&self.output, page.as_bytes()).map_err(|error| {
                Failure::Outside(format!("cannot write {}: {error}", self.output.display()))
            })?;
            let kb = page.len() / 1000;
            terminal.note(format_args!("wrote {} ({kb} kB)", self.output.display()));
        }
        let of_data: &BTreeMap<_, _> = scored.as_ref().map_or(&failed, |of: &Scored| &of.failed);
        warn_failed(terminal, of_data);
        Ok(Answer::Fine)
    }

    fn title(&self, manifest: Option<&Manifest>) -> String {
        match manifest {
            Some(of) => format!("{}: the fleet of {}", self.models.display(), of.graph),
            None => self.models.display().to_string(),
        }
    }
}
