//! Fits on the sums of days in place of rows: made just now, or kept in a folder.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use athermal_blocks::{KeptBlocks, OtherFolder};
use athermal_core::compile::Plan;
use athermal_core::failure::Failure;
use athermal_core::time::Duration;
use athermal_core::watch::Watch;
use athermal_files::{Dataset, Report};
use athermal_run::fit::{
    Block, Blocks, FitError, FitOptions, blocks_of, check_blocks, fit_from_blocks,
};
use athermal_run::model::DataCard;
use clap::Args;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::RowsId;
use crate::asked::by_text;
use crate::faults::{ChannelFaults, FaultWatch, Purpose};
use crate::fit::FitOutcome;

/// How long a block is: `day`, or a length such as `6h`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cut(Duration);

const DAY: Duration = Duration::from_ns(86_400_000_000_000);
const MINUTE: Duration = Duration::from_ns(60_000_000_000);

impl Cut {
    /// The length of a block.
    #[must_use]
    pub fn length(self) -> Duration {
        self.0
    }
}

impl FromStr for Cut {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "day" {
            return Ok(Self(DAY));
        }
        let length: Duration = text.parse().map_err(|error| format!("{error}; or `day`"))?;
        match length >= MINUTE && length.as_ns() % MINUTE.as_ns() == 0 {
            true => Ok(Self(length)),
            false => Err("expected `day`, or whole minutes such as `6h`".to_owned()),
        }
    }
}

impl fmt::Display for Cut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            DAY => f.write_str("day"),
            length => length.fmt(f),
        }
    }
}

impl Serialize for Cut {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Cut {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        by_text(from)
    }
}

/// A fit on sums in place of rows.
#[derive(Debug, Clone, Default, Args, Serialize, Deserialize, JsonSchema)]
pub struct BlockOptions {
    /// Fit on the sums of UTC days in place of rows (`day`), or of stretches of another length, such as `6h` where there are few days. Folds
    /// end with them, and windows at the beginning of one know the one before. For estimators that are fitted by least squares
    #[arg(long, value_name = "LENGTH")]
    #[serde(default)]
    #[schemars(with = "Option<String>")]
    pub blocks: Option<Cut>,
    /// Keep the blocks in this folder, of a fleet in a folder inside it for each machine. The next fit reads them, and of the data only
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
    /// How long a block is.
    pub cut: Cut,
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
        let length = of.cut.length();
        check_blocks(plan, length).map_err(FitError::from)?;
        let (mut faults, mut files) = (Vec::new(), Vec::new());
        let mut progress = host.progress("summing");
        let mut make =
            |dataset: &Dataset,
             wanted: &dyn Fn(i64) -> bool,
             take: &mut dyn FnMut(Block) -> Result<(), FitError>| {
                let watch = FaultWatch::new(dataset, Purpose::Fit);
                let stepped = &mut |ticks| progress.set(ticks);
                blocks_of(plan, &watch, length, wanted, stepped, take)?;
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
                let kept =
                    KeptBlocks::refresh(folder, plan, length, files, reading, data, &mut make);
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
