//! What is kept of a UTC day in place of its rows: sums of the examples of each estimator. Not how rows become sums, nor a fit.

use athermal_core::channel::{ABSENT, COLD, is_cold};
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::doubt::Truths;
use super::rates::Kept;
use crate::engine::SampleRange;

/// The form that this version writes.
const FORMAT: u64 = 1;

/// What a fit needs of the rows of one UTC day, or of another stretch of time, with which it can do without them.
///
/// Windows and lags at the beginning of the day know the day before. What was summed is known by two checksums: of the rows of both days,
/// and of [the part of the graph](super::rows_identity) that makes examples of them. In JSON every number comes back to the bit.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    athermal_block: u64,
    /// Which one it is of its length, counted from 1970-01-01.
    pub day: i64,
    /// The checksum of the rows of this day and the day before: instants and values, wherever they were read from.
    pub rows: String,
    /// The checksum of what makes examples of rows: [`rows_identity`](super::rows_identity).
    pub graph: String,
    /// Rows of this day.
    pub ticks: u64,
    /// Segments that begin in it.
    pub segments: u64,
    /// The first instant of the day and the last, in ns since 1970.
    pub period: (i64, i64),
    /// Rows refused because their time was not after the one before.
    pub(super) refused: u64,
    /// Samples rejected as infinite or out of range, by measured channel.
    pub(super) rejected: Vec<(String, u64)>,
    pub(super) ranges: Vec<SampleRange>,
    /// The steps between the samples of each measured channel.
    #[serde(default)]
    pub(super) steps: Kept,
    /// The sum of each truth that is a level, and how many values it has.
    pub(super) levels: Vec<(f64, u64)>,
    /// The measured channels that had no value.
    pub(super) silent: Vec<String>,
    pub(super) estimators: Vec<Examples>,
}

/// The examples of one estimator.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Examples {
    pub(super) node: String,
    /// Whether it ran at all.
    pub(super) ran: bool,
    pub(super) without_run: u64,
    pub(super) outside_limits: u64,
    #[serde(default)]
    pub(super) leapt: u64,
    pub(super) groups: Vec<Group>,
}

/// Examples that have values for the same candidates. Which candidates a fit keeps, and so which rows are complete, is known at the
/// end of the data alone.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Group {
    #[serde(with = "states")]
    pub(super) states: Vec<State>,
    pub(super) content: Content,
}

/// What a candidate is in all examples of a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum State {
    Present,
    Absent,
    Cold,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Content {
    /// Of few examples the values that are there, and the truth, one example after the other.
    Rows(Vec<f64>),
    Sums {
        truths: Truths,
        /// The lowest and highest of each value that is there, and of the truth.
        extremes: Vec<(f64, f64)>,
        /// What the estimator's trainer gave.
        sums: Box<RawValue>,
    },
}

impl State {
    pub(super) fn of(value: f64) -> Self {
        match value.is_nan() {
            false => Self::Present,
            true if is_cold(value) => Self::Cold,
            true => Self::Absent,
        }
    }

    /// A value of this state; what it is where there is one is not known.
    pub(super) fn value(self) -> f64 {
        match self {
            Self::Present => 0.0,
            Self::Absent => ABSENT,
            Self::Cold => COLD,
        }
    }
}

impl Group {
    /// How many values an example has, with the truth.
    fn order(&self) -> usize {
        self.place(self.states.len()) + 1
    }

    /// How many candidates before one have values.
    pub(super) fn place(&self, candidate: usize) -> usize {
        let before = self.states.iter().take(candidate);
        before.filter(|state| **state == State::Present).count()
    }

    /// How many examples there are.
    pub(super) fn count(&self) -> u64 {
        match &self.content {
            Content::Rows(values) => (values.len() / self.order()) as u64,
            Content::Sums { truths, .. } => truths.rows,
        }
    }

    /// Gives each example that is kept as a row with all candidates, and its truth.
    pub(super) fn each_row(&self, mut take: impl FnMut(&[f64], f64)) {
        let Content::Rows(values) = &self.content else {
            return;
        };
        let mut row: Vec<f64> = self.states.iter().map(|state| state.value()).collect();
        for example in values.chunks_exact(self.order()) {
            let (truth, mut values) = (example[example.len() - 1], example.iter());
            let present = row.iter_mut().zip(&self.states);
            for (cell, _) in present.filter(|(_, state)| **state == State::Present) {
                values.next().into_iter().for_each(|value| *cell = *value);
            }
            take(&row, truth);
        }
    }

    /// Whether all of it fits together, for an estimator of so many candidates.
    fn is_whole(&self, candidates: usize) -> bool {
        let order = self.order();
        self.states.len() == candidates
            && match &self.content {
                Content::Rows(values) => values.len().is_multiple_of(order),
                Content::Sums { extremes, .. } => extremes.len() == order,
            }
    }
}

impl Block {
    /// One of a day, without anything.
    pub(super) fn new(day: i64, graph: String) -> Self {
        Self {
            athermal_block: FORMAT,
            day,
            rows: String::new(),
            graph,
            ticks: 0,
            segments: 0,
            period: (i64::MAX, i64::MIN),
            refused: 0,
            rejected: Vec::new(),
            ranges: Vec::new(),
            steps: Kept::new(),
            levels: Vec::new(),
            silent: Vec::new(),
            estimators: Vec::new(),
        }
    }

    /// Reads a block.
    ///
    /// # Errors
    /// When it is none of this version.
    pub fn from_json(text: &str) -> Result<Self, serde_json::Error> {
        let block: Self = serde_json::from_str(text)?;
        match block.athermal_block {
            FORMAT => Ok(block),
            other => Err(serde::de::Error::custom(format!(
                "it has the form {other} and this version reads {FORMAT}; delete it, it is made anew from the rows"
            ))),
        }
    }

    /// The block as JSON.
    ///
    /// # Errors
    /// When a number in it is not finite.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }

    /// The examples of an estimator with so many candidates, where all of them fit together.
    pub(super) fn examples(&self, node: &str, candidates: usize) -> Option<&Examples> {
        let mut all = self.estimators.iter();
        let own = all.find(|examples| examples.node == node)?;
        let is_whole = own.groups.iter().all(|group| group.is_whole(candidates));
        is_whole.then_some(own)
    }
}

/// States as a text with a letter for each.
mod states {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    use super::State;

    pub(super) fn serialize<S: Serializer>(states: &[State], to: S) -> Result<S::Ok, S::Error> {
        let letters = states.iter().map(|state| match state {
            State::Present => '1',
            State::Absent => '0',
            State::Cold => 'c',
        });
        to.serialize_str(&letters.collect::<String>())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<State>, D::Error> {
        let text = String::deserialize(from)?;
        let states = text.chars().map(|letter| match letter {
            '1' => Ok(State::Present),
            '0' => Ok(State::Absent),
            'c' => Ok(State::Cold),
            other => Err(D::Error::custom(format!("`{other}` is no state"))),
        });
        states.collect()
    }
}
