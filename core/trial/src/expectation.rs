//! Decides what a test can expect; whether it holds is decided by the judge.

use crate::quantity::Quantity;
use crate::time::Duration;

/// What must come out of some channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Expectation {
    /// The channels, each of which is checked.
    pub slots: Vec<usize>,
    /// Only truths whose absolute value is below count.
    pub abs_truth_below: Option<Quantity>,
    /// When.
    pub period: Period,
    /// The time of the one value that `equals` and `between` look at, and of the tick that `absent` looks at.
    pub at: Option<Duration>,
    /// What is checked of each channel.
    pub checks: Vec<Check>,
}

/// A part of the data, counted from the first row of each segment; both ends belong to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Period {
    /// Its start.
    pub from: Duration,
    /// Its end.
    pub to: Duration,
}

impl Period {
    /// Whether a time is part of it.
    #[must_use]
    pub fn contains(&self, time: Duration) -> bool {
        self.from <= time && time <= self.to
    }
}

/// One thing that is checked.
#[derive(Debug, Clone, PartialEq)]
pub enum Check {
    /// The root mean square error is below.
    RmseBelow(Quantity),
    /// R² about the mean is above.
    R2Above(f64),
    /// The error is below that of another prediction; all are compared on the instants at which all have a value.
    Beats(Vec<Rival>),
    /// The share with a value is above.
    ValidAbove(f64),
    /// The share of all ticks at which it was given a value is above.
    GivenAbove(f64),
    /// The values are this, up to a tolerance.
    Equals(Quantity, Tolerance),
    /// The values lie between.
    Between(Quantity, Quantity),
    /// There is no value.
    Absent,
    /// Changes from one value to the next are below.
    MaxStepBelow(Quantity),
}

/// How far a value may be off.
#[derive(Debug, Clone, PartialEq)]
pub enum Tolerance {
    /// In the unit of what it should be.
    Number(f64),
    /// With a unit of its own.
    Quantity(Quantity),
}

/// Another prediction of the same truth.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Rival {
    /// Nothing moves.
    Zero,
    /// The truth at the smallest lag that sees nothing of the answer.
    Persistence,
    /// Others of the graph: the one that predicts the same truth is compared.
    Channels(String, Vec<usize>),
}

impl Check {
    /// The key in the file.
    #[must_use]
    pub fn key(&self) -> &'static str {
        match self {
            Self::RmseBelow(_) => "rmse_below",
            Self::R2Above(_) => "r2_above",
            Self::Beats(_) => "beats",
            Self::ValidAbove(_) => "valid_above",
            Self::GivenAbove(_) => "given_above",
            Self::Equals(..) => "equals",
            Self::Between(..) => "between",
            Self::Absent => "absent",
            Self::MaxStepBelow(_) => "max_step_below",
        }
    }

    /// Whether it looks at errors, so that it needs a prediction.
    #[must_use]
    pub fn is_of_predictions(&self) -> bool {
        matches!(self, Self::RmseBelow(_) | Self::R2Above(_) | Self::Beats(_))
    }
}
