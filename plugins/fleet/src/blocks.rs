//! A machine fitted on the sums of its days: made just now, or kept in a folder of the machine's own. Not how rows become sums.

use std::path::PathBuf;

use athermal_analysis::diagnosis::watch::{ChannelFaults, FaultWatch, Purpose};
use athermal_blocks::KeptBlocks;
use athermal_core::failure::Failure;
use athermal_files::{Dataset, Options};
use athermal_run::fit::{Block, FitError, FitOptions, blocks_of, check_blocks, fit_from_blocks};
use athermal_run::model::Model;
use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::doubts::{Doubt, of_reading};
use crate::machine::{MachineError, MachineFit};
use crate::rows::RowsId;

/// How rows are cut into blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// At the ends of UTC days
    Day,
}

/// A fit on sums in place of rows.
#[derive(Debug, Clone, Default, Args, Serialize, Deserialize, JsonSchema)]
pub struct BlockOptions {
    /// Fit on the sums of days in place of rows: folds end with UTC days, and windows at the beginning of a day know the day before.
    /// For estimators that are fitted by least squares
    #[arg(long, value_name = "CUT")]
    pub blocks: Option<Cut>,
    /// Keep the blocks in this folder, of a fleet in a folder inside it for each machine: the next fit reads them, and of the data only
    /// what is new or changed
    #[arg(long, value_name = "FOLDER", requires = "blocks", conflicts_with_all = ["from", "to"])]
    pub keep_blocks: Option<PathBuf>,
}

impl BlockOptions {
    /// Refuses what does not go together; a command line has refused it before.
    ///
    /// # Errors
    /// When blocks are kept without there being any, or of a stretch of time.
    pub fn check(&self, is_a_stretch: bool) -> Result<(), Failure> {
        let words = match self.keep_blocks {
            Some(_) if self.blocks.is_none() => "--keep-blocks needs `--blocks`",
            Some(_) if is_a_stretch => "--keep-blocks goes with neither --from nor --to",
            _ => return Ok(()),
        };
        Err(Failure::Request(words.to_owned()))
    }
}

/// A machine that was fitted on blocks, or the rows where they are those that are known.
pub(crate) enum Outcome {
    Same,
    Fitted(Box<MachineFit>, Vec<ChannelFaults>, Vec<Doubt>),
}

/// What is fitted, on what.
pub(crate) struct OnBlocks<'a> {
    pub graph: &'a Model,
    pub files: &'a [PathBuf],
    pub reading: &'a Options,
    /// The folder of the machine's blocks.
    pub kept: Option<PathBuf>,
}

impl OnBlocks<'_> {
    /// Fits, unless the rows are those that are known. Faults are those of the rows that were read.
    pub fn fit(
        &self,
        known: Option<&RowsId>,
        options: &FitOptions,
        created: Option<String>,
    ) -> Result<Outcome, MachineError> {
        let plan = &self.graph.plan;
        check_blocks(plan).map_err(|error| MachineError::Fit(error.into()))?;
        let (mut faults, mut reports, mut lost) = (Vec::new(), Vec::new(), 0);
        let mut make =
            |dataset: &Dataset,
             wanted: &dyn Fn(i64) -> bool,
             take: &mut dyn FnMut(Block) -> Result<(), FitError>| {
                let watch = FaultWatch::new(dataset, Purpose::Fit);
                blocks_of(plan, &watch, wanted, &mut |_| {}, take)?;
                (faults, reports) = (watch.found(), dataset.reports());
                Ok(())
            };
        let data = |files, within| {
            let reading = self.reading.clone();
            Dataset::new(files, Options { within, ..reading })
        };
        let (rows, fitted);
        match &self.kept {
            None => {
                let mut blocks = Vec::new();
                make(&data(self.files.to_vec(), None), &|_| true, &mut |block| {
                    blocks.push(block);
                    Ok(())
                })
                .map_err(MachineError::Fit)?;
                rows = RowsId::of_blocks(&blocks[..]).map_err(MachineError::Fit)?;
                if known == Some(&rows) {
                    return Ok(Outcome::Same);
                }
                fitted = fit_from_blocks(plan, &blocks[..], options, &mut |_| {});
            }
            Some(folder) => {
                let reading = format!("{:?}", self.reading);
                let blocks =
                    KeptBlocks::refresh(folder, plan, self.files, &reading, &data, &mut make)
                        .map_err(MachineError::Fit)?;
                lost = blocks.lost.len() as u64;
                rows = RowsId::of_blocks(&blocks).map_err(MachineError::Fit)?;
                if known == Some(&rows) {
                    return Ok(Outcome::Same);
                }
                fitted = fit_from_blocks(plan, &blocks, options, &mut |_| {});
            }
        }
        let (fitted, report) = fitted.map_err(MachineError::Fit)?;
        let fit = MachineFit::of(self.graph, fitted, report, rows, created)?;
        let mut doubts = of_reading(&reports);
        if lost > 0 {
            doubts.push(Doubt::counted("blocks_without_rows", lost, None));
        }
        Ok(Outcome::Fitted(Box::new(fit), faults, doubts))
    }
}
