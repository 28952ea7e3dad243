//! Decides how a user says in which folds rows are cut for cross-validation.

use athermal_core::node::{Forms, TrainingReport};
use athermal_numerics::GramBlocks;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// How rows, in the order of time, are cut for cross-validation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Folds {
    /// Into so many contiguous parts, 2 to 1000, each of which is tested on once.
    Contiguous(#[schemars(range(min = 2, max = 1000))] usize),
    /// In a way of its own.
    Cut(Cut),
}

/// A way to cut rows for cross-validation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Cut {
    /// Each of so many contiguous parts is tested on once; the rest trains, apart from what is too near to be independent
    /// (López de Prado 2018, section 7.4).
    Blocked {
        /// How many parts, 2 to 1000.
        #[schemars(range(min = 2, max = 1000))]
        count: usize,
        /// Rows left out on either side of the tested part: windows that reach across the edge share measurements.
        #[serde(default)]
        gap_rows: u64,
        /// Rows left out after the tested part and its gap: what follows remembers it.
        #[serde(default)]
        embargo_rows: u64,
    },
    /// Each of the last parts is tested on by what came before it, as it would have been at the time.
    Expanding {
        /// How many tests, 2 to 1000; the rows are cut into one part more.
        #[schemars(range(min = 2, max = 1000))]
        count: usize,
        /// Rows left out between what trains and what is tested.
        #[serde(default)]
        gap_rows: u64,
    },
    /// Into whole segments of the data, each of which is tested on once; of a single segment into contiguous parts.
    Segments {
        /// How many parts at most, 2 to 1000: of more segments neighbours are put together.
        #[schemars(range(min = 2, max = 1000))]
        count: usize,
    },
}

/// Tells, once, where the folds of a cross-validation end elsewhere than they would had the rows been kept.
pub(crate) fn tell_moved(blocks: &GramBlocks, report: &mut TrainingReport) {
    const FIGURE: &str = "folds_end_at_multiples_of";
    if blocks.exact_folds() || report.figures.contains_key(FIGURE) {
        return;
    }
    if blocks.is_in_stretches() {
        return;
    }
    let rows = blocks.block_rows();
    report.figure(FIGURE, rows);
    report.notes.push(format!(
        "the rows did not fit in memory, so folds end at multiples of {rows} rows"
    ));
}

/// Tells of folds in which the truth stays the same; once, where several cross-validations cut them alike.
pub(crate) fn tell_quiet(quiet: &[usize], folds: usize, report: &mut TrainingReport) {
    if quiet.is_empty() {
        return;
    }
    let which: Vec<String> = quiet.iter().map(|fold| (fold + 1).to_string()).collect();
    let note = format!(
        "the truth hardly changes in fold {} of {folds}, so R² says nothing there and is the mean of the others",
        which.join(", ")
    );
    if !report.notes.contains(&note) {
        report.figure("quiet_folds", quiet.len());
        report.notes.push(note);
    }
}

impl<'de> Deserialize<'de> for Folds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a whole number or a table with `type` and `count`")
            .whole(Self::Contiguous)
            .table(Self::Cut)
            .read(deserializer)
    }
}

impl Folds {
    /// Three contiguous parts.
    pub(crate) fn three() -> Self {
        Self::Contiguous(3)
    }

    /// As the numerics have it.
    pub(crate) fn cut(&self) -> athermal_numerics::Folds {
        match *self {
            Self::Contiguous(count) => athermal_numerics::Folds::contiguous(count),
            Self::Cut(Cut::Blocked {
                count,
                gap_rows,
                embargo_rows,
            }) => athermal_numerics::Folds::Blocked {
                folds: count,
                gap: gap_rows,
                embargo: embargo_rows,
            },
            Self::Cut(Cut::Segments { count }) => {
                athermal_numerics::Folds::Segments { folds: count }
            }
            Self::Cut(Cut::Expanding { count, gap_rows }) => athermal_numerics::Folds::Expanding {
                folds: count,
                gap: gap_rows,
            },
        }
    }
}
