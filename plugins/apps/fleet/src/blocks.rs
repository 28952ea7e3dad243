//! A machine fitted on the sums of its days: made just now, or kept in a folder of the machine's own. Not how rows become sums.

use std::path::PathBuf;

use athermal_analysis::diagnosis::watch::{ChannelFaults, FaultWatch, Purpose};
use athermal_blocks::KeptBlocks;
use athermal_files::{Dataset, Options};
use athermal_run::fit::{Block, FitError, FitOptions, blocks_of, check_blocks, fit_from_blocks};
use athermal_run::model::Model;

use crate::doubts::{Doubt, of_reading};
use crate::machine::{MachineError, MachineFit};
use athermal_jobs::RowsId;

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
