//! By which past truths predictions may be made in an evaluation.

use std::num::NonZeroU32;

use crate::time::Duration;

/// How far back a prediction's newest measured truth lies.
///
/// A step is the time from the newest truth that an estimator may read to the one that it predicts: its horizon and its
/// smallest lag of the truth together, and for kinds that read none the horizon or the span of the truth, the longer of both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// One step: as it runs beside a machine.
    #[default]
    OneStep,
    /// So many steps: past truths that are newer are replaced by predictions of them.
    Steps(NonZeroU32),
    /// All the way back to where the segment begins: past truths are replaced by predictions of them wherever there are any.
    FreeRun,
}

impl Mode {
    /// How much earlier than in one step the newest truth must have arrived that counts at all.
    pub fn earlier(self, step: Duration) -> Duration {
        match self {
            Self::OneStep | Self::FreeRun => Duration::ZERO,
            Self::Steps(steps) => times(step, i64::from(steps.get()) - 1),
        }
    }
}

/// So many steps; the longest duration where they are longer.
pub fn times(step: Duration, count: i64) -> Duration {
    Duration::from_ns(step.as_ns().saturating_mul(count))
}

/// The length of a step: as it was planned, or where that is nothing the time between the last two truths.
#[derive(Debug, Clone, Copy)]
pub struct StepLength {
    planned: Duration,
    last: Option<crate::time::Instant>,
    between: Duration,
}

impl StepLength {
    /// A step that was planned, or [`Duration::ZERO`] where none was.
    pub fn new(planned: Duration) -> Self {
        Self {
            planned,
            last: None,
            between: Duration::ZERO,
        }
    }

    /// Takes the instant of a truth.
    pub fn truth(&mut self, at: crate::time::Instant) {
        if let Some(last) = self.last
            && at > last
        {
            self.between = at - last;
        }
        self.last = Some(at);
    }

    /// As it was planned, else as it was between the last two truths.
    pub fn length(&self) -> Duration {
        self.planned().unwrap_or(self.between)
    }

    /// As it was planned, where that is anything.
    pub fn planned(&self) -> Option<Duration> {
        // A lag of one sample is written as the shortest there is.
        Some(self.planned).filter(|&planned| planned > Duration::from_ns(1))
    }

    /// Begins another segment: the next truth has none before it.
    pub fn segment(&mut self) {
        self.last = None;
    }
}
