//! Fits on the sums of days in place of rows: made just now, or kept in a folder.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal_blocks::{KeptBlocks, OtherFolder};
use athermal_core::compile::Plan;
use athermal_core::failure::Failure;
use athermal_core::watch::Watch;
use athermal_files::{Dataset, Report};
use athermal_run::fit::{
    Block, Blocks, FitError, FitOptions, blocks_of, check_blocks, fit_from_blocks,
};
use athermal_run::model::DataCard;
use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::RowsId;
use crate::faults::{ChannelFaults, FaultWatch, Purpose};
use crate::fit::FitOutcome;

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

/// Data of which sums are made: files, and how some of them are read, of which no rows outside of a stretch of time are needed.
pub struct OfFiles<'a> {
    /// The files; none where something else is read.
    pub files: Option<Vec<PathBuf>>,
    /// How they are read, in words that differ where rows may.
    pub reading: String,
    /// Some of them as a data set.
    pub data: &'a dyn Fn(Vec<PathBuf>, Option<(i64, i64)>) -> Dataset,
}

/// The sums of the days of some data.
pub struct Sums {
    blocks: Kept,
    faults: Vec<ChannelFaults>,
    files: Vec<(String, Report)>,
}

enum Kept {
    Here(Vec<Block>),
    InFolder(KeptBlocks),
}

impl Sums {
    /// Makes them, or brings those of a folder up to date.
    ///
    /// # Errors
    /// When the graph has nodes that sums do not suffice, there are no files of which they could be kept, or data or blocks cannot be read.
    pub fn of(
        plan: &Arc<Plan>,
        kept: Option<&Path>,
        of: &OfFiles<'_>,
        host: &dyn Watch,
    ) -> Result<Self, Failure> {
        check_blocks(plan).map_err(FitError::from)?;
        let (mut faults, mut files) = (Vec::new(), Vec::new());
        let mut progress = host.progress("summing");
        let mut make =
            |dataset: &Dataset,
             wanted: &dyn Fn(i64) -> bool,
             take: &mut dyn FnMut(Block) -> Result<(), FitError>| {
                let watch = FaultWatch::new(dataset, Purpose::Fit);
                blocks_of(plan, &watch, wanted, &mut |ticks| progress.set(ticks), take)?;
                (faults, files) = (watch.found(), dataset.reports());
                Ok(())
            };
        let blocks = match (kept, &of.files) {
            (None, given) => {
                let mut blocks = Vec::new();
                let dataset = (of.data)(given.clone().unwrap_or_default(), None);
                make(&dataset, &|_| true, &mut |block| {
                    blocks.push(block);
                    Ok(())
                })?;
                Kept::Here(blocks)
            }
            (Some(folder), Some(files)) => {
                let (reading, data) = (&of.reading, of.data);
                let kept = KeptBlocks::refresh(folder, plan, files, reading, data, &mut make);
                Kept::InFolder(kept.map_err(|error| match error {
                    FitError::Recording(error) if error.is::<OtherFolder>() => {
                        Failure::Request(format!("--keep-blocks {error}"))
                    }
                    other => other.into(),
                })?)
            }
            (Some(_), None) => {
                let words = "--keep-blocks: blocks are kept of files, not of a journal or of a table in memory";
                return Err(Failure::Request(words.to_owned()));
            }
        };
        Ok(Self {
            blocks,
            faults,
            files,
        })
    }

    fn blocks(&self) -> &dyn Blocks {
        match &self.blocks {
            Kept::Here(blocks) => blocks,
            Kept::InFolder(blocks) => blocks,
        }
    }

    /// The rows that they are of.
    ///
    /// # Errors
    /// When a block cannot be read.
    pub fn rows(&self) -> Result<RowsId, FitError> {
        RowsId::of_blocks(self.blocks())
    }

    /// What was met in each file that was read.
    #[must_use]
    pub fn files(&self) -> &[(String, Report)] {
        &self.files
    }

    /// The cards of the data where blocks are kept.
    #[must_use]
    pub fn cards(&self) -> Option<&[DataCard]> {
        match &self.blocks {
            Kept::Here(_) => None,
            Kept::InFolder(blocks) => Some(&blocks.cards),
        }
    }

    /// Fits a graph on them.
    ///
    /// # Errors
    /// When a block cannot be read, or a node panics.
    pub fn fit(self, plan: &Arc<Plan>, options: &FitOptions) -> Result<FitOutcome, FitError> {
        let fitted = fit_from_blocks(plan, self.blocks(), options, &mut |_| {})?;
        let lost = match self.blocks {
            Kept::Here(_) => Vec::new(),
            Kept::InFolder(blocks) => blocks.lost,
        };
        Ok(FitOutcome {
            files: self.files,
            lost,
            ..FitOutcome::with(plan, fitted, self.faults)
        })
    }
}
