//! Decides how long errors count: for a time, for so many truths, or ever less.

use athermal_core::node::{Forms, Kept};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// How long an error is remembered, counted from when the embargo lets its truth through.
///
/// `"15min"` forgets at once what was let through 15 minutes ago or earlier, `{ truths = 12 }` what came before the last twelve.
/// `{ half_life = "15min" }` counts an error half after that time, a quarter after twice that, and not at all after ten times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Memory {
    /// For this long.
    Time(Duration),
    /// For a number of truths.
    Truths(LastTruths),
    /// Ever less.
    HalfLife(Fading),
}

/// A memory of so many truths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LastTruths {
    /// How many of the last truths with a vote count, for each voter; 1 to 10,000.
    #[schemars(range(min = 1, max = 10_000))]
    pub truths: usize,
}

/// A memory that fades.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fading {
    /// The time after which an error counts half.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub half_life: Duration,
}

/// After this many half-lives an error counts less than a thousandth, and is forgotten.
const FORGOTTEN: i64 = 10;

impl<'de> Deserialize<'de> for Memory {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a duration such as \"15min\", { truths = 12 } or { half_life = \"15min\" }")
            .text(Self::Time)
            .table(|Tabled(memory)| memory)
            .read(deserializer)
    }
}

/// A memory that is written as a table.
#[derive(Deserialize)]
#[serde(try_from = "Table")]
struct Tabled(Memory);

/// Its keys.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    truths: Option<usize>,
    half_life: Option<Duration>,
}

impl TryFrom<Table> for Tabled {
    type Error = &'static str;

    fn try_from(table: Table) -> Result<Self, Self::Error> {
        match (table.truths, table.half_life) {
            (Some(truths), None) => Ok(Self(Memory::Truths(LastTruths { truths }))),
            (None, Some(half_life)) => Ok(Self(Memory::HalfLife(Fading { half_life }))),
            _ => Err("a memory has either `truths` or `half_life`"),
        }
    }
}

impl Memory {
    /// Whether there is no time after which nothing counts: so many truths may take as long as they please.
    pub(crate) fn is_endless(&self) -> bool {
        matches!(self, Self::Truths(_))
    }

    /// How long anything counts; nothing is known of it where truths are counted.
    pub(crate) fn longest(&self) -> Duration {
        match *self {
            Self::Time(time) => time,
            Self::Truths(_) => Duration::ZERO,
            Self::HalfLife(fading) => fading.longest(),
        }
    }

    /// What errors of so many voters take in memory, where truths come each `every`.
    pub(crate) fn keeps(&self, voters: usize, every: Duration) -> Vec<Kept> {
        let back = match *self {
            Self::Time(time) => time,
            Self::Truths(last) => {
                Duration::from_ns(every.as_ns().saturating_mul(last.truths as i64 - 1))
            }
            Self::HalfLife(_) => Duration::ZERO,
        };
        Kept::in_parts(back, every, 8 + 8 * voters)
    }
}

impl Fading {
    /// How long anything counts.
    pub(crate) fn longest(&self) -> Duration {
        Duration::from_ns(self.half_life.as_ns().saturating_mul(FORGOTTEN))
    }

    /// What is left of something after a time.
    pub(crate) fn left(&self, after: Duration) -> f64 {
        libm::exp2(-after.secs() / self.half_life.secs()).min(1.0)
    }
}
