//! `athermal fit --blocks day`: a fit on blocks, made just now or kept in a folder.

use athermal_core::watch::Watch;
use std::path::Path;

use athermal::Model;
use athermal::run::fit::{
    Block, FitError, FitOptions, FitProgress, blocks_of, check_blocks, fit_from_blocks,
};
use athermal::run::model::{Card, DataCard};
use athermal_analysis::figures::counted;
use athermal_blocks::{KeptBlocks, OtherFolder};
use athermal_fleet::blocks::BlockOptions;

use super::data::{self, Data};
use super::faults::{self, FaultWatch, Purpose};
use super::fit::{FitOutcome, created, warn_bare};
use crate::terminal::Failure;

/// Fits a model on blocks of data, fills in its card, and warns as a fit on rows does, of the rows that were read.
///
/// # Errors
/// When the graph has nodes that sums do not suffice, or data or blocks cannot be read.
pub fn fit_on_blocks(
    of: &BlockOptions,
    model: &mut Model,
    data: &Data,
    options: &FitOptions,
    host: &dyn Watch,
) -> Result<FitOutcome, Failure> {
    check_blocks(&model.plan).map_err(FitError::from)?;
    let mut faults = Vec::new();
    let mut progress = host.progress("summing");
    let plan = &model.plan;
    let mut make = |dataset: &athermal::files::Dataset,
                    wanted: &dyn Fn(i64) -> bool,
                    take: &mut dyn FnMut(Block) -> Result<(), FitError>|
     -> Result<(), FitError> {
        let watch = FaultWatch::new(dataset, Purpose::Fit);
        let stepped = &mut |ticks| progress.set(ticks);
        blocks_of(plan, &watch, wanted, stepped, take)?;
        faults = watch.found();
        Ok(())
    };
    let (dataset, cards, (fitted, report));
    let mut lost = Vec::new();
    match &of.keep_blocks {
        None => {
            let mut blocks = Vec::new();
            dataset = data.dataset();
            make(&dataset, &|_| true, &mut |block| {
                blocks.push(block);
                Ok(())
            })?;
            cards = data.cards(plan, &dataset)?;
            (fitted, report) = fit_from_blocks(plan, &blocks[..], options, &mut nothing)?;
        }
        Some(folder) => {
            let kept = refresh(folder, model, data, &mut make)?;
            lost.clone_from(&kept.0.lost);
            (fitted, report) = fit_from_blocks(plan, &kept.0, options, &mut nothing)?;
            (dataset, cards) = (data.dataset(), kept.1);
        }
    }
    drop(progress);
    let reports = dataset.reports();
    let doubts = data::doubts(plan, &reports, report.refused, &report.rejected);
    data::warn_of(host, doubts, &reports);
    if let (Some(first), Some(last)) = (lost.first(), lost.last()) {
        let (first, last) = (
            first.trim_end_matches(".json"),
            last.trim_end_matches(".json"),
        );
        host.warning(format_args!(
            "{} kept although the rows are gone, {first} to {last}: what files hold no more of these is as it was",
            counted(lost.len() as u64, "block")
        ));
    }
    faults::warn(host, &faults);
    let outcome = FitOutcome {
        bare: report.bare_outputs(plan),
        dataset,
        report,
        faults,
        doubts: Vec::new(),
    };
    warn_bare(&outcome, host);
    model.card = Some(Card::of(&outcome.report, cards, created()));
    model.fitted = fitted;
    Ok(outcome)
}

/// Brings the folder of blocks up to date.
fn refresh(
    folder: &Path,
    model: &Model,
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
        &model.plan,
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
