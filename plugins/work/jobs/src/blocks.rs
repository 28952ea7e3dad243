//! Fits on the sums of days in place of rows: made just now, or kept in a folder.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal_blocks::{KeptBlocks, OtherFolder};
use athermal_core::compile::Plan;
use athermal_core::failure::Failure;
use athermal_core::watch::Watch;
use athermal_files::Dataset;
use athermal_run::fit::{
    Block, FitError, FitOptions, FitProgress, blocks_of, check_blocks, fit_from_blocks,
};
use athermal_run::model::DataCard;
use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::Data;
use crate::faults::{FaultWatch, Purpose};
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

/// Fits a graph on blocks of data, of which some may be kept. Gives the cards of the data beside it.
///
/// # Errors
/// When the graph has nodes that sums do not suffice, or data or blocks cannot be read.
pub fn fit_on_blocks(
    of: &BlockOptions,
    plan: &Arc<Plan>,
    data: &Data,
    options: &FitOptions,
    host: &dyn Watch,
) -> Result<(FitOutcome, Vec<DataCard>), Failure> {
    check_blocks(plan).map_err(FitError::from)?;
    let mut faults = Vec::new();
    let mut progress = host.progress("summing");
    let mut make = |dataset: &Dataset,
                    wanted: &dyn Fn(i64) -> bool,
                    take: &mut dyn FnMut(Block) -> Result<(), FitError>|
     -> Result<(), FitError> {
        let watch = FaultWatch::new(dataset, Purpose::Fit);
        let stepped = &mut |ticks| progress.set(ticks);
        blocks_of(plan, &watch, wanted, stepped, take)?;
        faults = watch.found();
        Ok(())
    };
    let (dataset, cards, fitted);
    match &of.keep_blocks {
        None => {
            let mut blocks = Vec::new();
            dataset = data.dataset();
            make(&dataset, &|_| true, &mut |block| {
                blocks.push(block);
                Ok(())
            })?;
            cards = data.cards(plan, &dataset)?;
            fitted = fit_from_blocks(plan, &blocks[..], options, &mut nothing)?;
        }
        Some(folder) => {
            let kept = refresh(folder, plan, data, &mut make)?;
            fitted = fit_from_blocks(plan, &kept.0, options, &mut nothing)?;
            (dataset, cards) = (data.dataset(), kept.1);
        }
    }
    drop(progress);
    let outcome = FitOutcome::with(plan, fitted, faults);
    Ok((outcome.read_from(&dataset), cards))
}

/// Brings the folder of blocks up to date.
fn refresh(
    folder: &Path,
    plan: &Arc<Plan>,
    data: &Data,
    make: athermal_blocks::Make<'_>,
) -> Result<(KeptBlocks, Vec<DataCard>), Failure> {
    let files = data.files().ok_or_else(|| {
        Failure::Request(
            "--keep-blocks: blocks are kept of files, not of a journal or of a table in memory"
                .to_owned(),
        )
    })?;
    let mut kept = KeptBlocks::refresh(
        folder,
        plan,
        &files,
        &data.reading_words(),
        &|files, within| data.dataset_of(files, within),
        make,
    )
    .map_err(|error| match error {
        FitError::Recording(error) if error.is::<OtherFolder>() => {
            Failure::Request(format!("--keep-blocks {error}"))
        }
        other => other.into(),
    })?;
    let cards = std::mem::take(&mut kept.cards);
    Ok((kept, cards))
}

fn nothing(_: FitProgress<'_>) {}
