//! What truths say of a sensor that contradicts the others: whether predictions with it have been better than those without.

use std::collections::BTreeMap;

use athermal_core::node::{Hindsight, Mistake, Regressor};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{Gram, ridges_left_out};
use serde::{Deserialize, Serialize};

/// The penalty on the squares of the coefficients of standardised columns.
const PENALTY: f64 = 1.0;
/// So many windows of truth say something.
const WINDOWS: u32 = 3;
/// How much of what was summed stays with the next window.
const STAYS: f64 = 0.9;

/// A linear prediction of the truth, from all columns or from those of all sensors but one.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Answer {
    /// The first column of the sensor that is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) without: Option<usize>,
    pub(super) constant: f64,
    /// Of each column; 0 of those of the sensor that is left out.
    pub(super) coefficients: Vec<f64>,
}

impl Answer {
    /// What is predicted from all columns, and without each sensor, by ridges over the rows of a fit; none where they cannot be solved.
    pub(super) fn all(gram: &Gram, regressors: &[Regressor]) -> Option<Vec<Self>> {
        let mut sensors = BTreeMap::<&str, Vec<usize>>::new();
        for (column, of) in regressors.iter().enumerate() {
            let past = format!(" lag {}", of.lag);
            let name = of.name.strip_suffix(&past).unwrap_or(&of.name);
            sensors.entry(name).or_default().push(column);
        }
        let groups: Vec<Vec<usize>> = sensors.into_values().collect();
        let firsts = groups.iter().map(|of| Some(of[0]));
        let without = std::iter::once(None).chain(firsts);
        let found = ridges_left_out(gram, PENALTY, &groups)?;
        let each = without.zip(found).map(|(without, of)| Self {
            without,
            constant: of.intercept,
            coefficients: of.coefficients,
        });
        Some(each.collect())
    }

    pub(super) fn mistakes(all: &[Self], width: usize) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        for (nth, own) in all.iter().enumerate() {
            let at = format!("answers.{nth}.coefficients");
            mistakes.extend(Mistake::of_lengths(width, &[(&at, own.coefficients.len())]));
            if own.without.is_some_and(|column| column >= width) {
                let message = "it leaves out a column that there is not";
                mistakes.push(Mistake::at(format!("answers.{nth}.without"), message));
            }
        }
        mistakes
    }

    fn predict(&self, column: impl Fn(usize) -> f64) -> f64 {
        let terms = self.coefficients.iter().enumerate();
        terms.fold(self.constant, |sum, (nth, of)| sum + of * column(nth))
    }
}

/// The answers that a node asks for.
#[derive(Debug)]
pub(super) struct Answers {
    all: Answer,
    /// Of each channel that has columns.
    without: Vec<Option<Answer>>,
}

impl Answers {
    /// Those for channels with these first columns; none where one is not there.
    pub(super) fn of(answers: &[Answer], firsts: &[Option<usize>]) -> Option<Self> {
        let of = |without| answers.iter().find(|of| of.without == without).cloned();
        let each = firsts.iter().map(|first| match first {
            Some(_) => of(*first).map(Some),
            None => Some(None),
        });
        Some(Self {
            all: of(None)?,
            without: each.collect::<Option<_>>()?,
        })
    }

    /// The squares of what predictions err by, with a channel and without it; none where a column is not there.
    fn squares(
        &self,
        channel: usize,
        column: impl Fn(usize) -> f64,
        truth: f64,
    ) -> Option<[f64; 2]> {
        let without = self.without[channel].as_ref()?;
        let errors = [&self.all, without].map(|of| of.predict(&column) - truth);
        let known = errors.iter().all(|error| !error.is_nan());
        known.then(|| errors.map(|error| error * error))
    }
}

/// A truth, and what was seen at the run that it belongs to.
pub(super) struct Seen<'a> {
    pub(super) truth: f64,
    /// When the truth came to be known.
    pub(super) known: Instant,
    pub(super) hindsight: Hindsight,
    pub(super) column: &'a dyn Fn(usize) -> f64,
}

/// What truths have said while a sensor contradicted the others.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Verdict {
    /// The channel of the sensor.
    of: Option<usize>,
    /// When the last truth that was looked at came to be known.
    last: Option<Instant>,
    windows: u32,
    /// The squares of what predictions with the sensor err by, and without; the older, the less they count.
    with: f64,
    without: f64,
}

impl Verdict {
    /// A sensor begins to contradict the others. What is known of it counts for so long.
    pub(super) fn begin(&mut self, channel: usize, now: Instant, counts: Duration) {
        let is_old = self.last.is_some_and(|last| now - last >= counts);
        if self.of != Some(channel) || is_old {
            *self = Self {
                of: Some(channel),
                ..Self::default()
            };
        }
    }

    /// Looks at a truth of a run since the contradiction began, one a window.
    pub(super) fn look(
        &mut self,
        answers: &Answers,
        channel: usize,
        began: Instant,
        seen: &Seen<'_>,
    ) {
        let Hindsight { delay, span, .. } = seen.hindsight;
        let is_next = |last| seen.known > last && seen.known - last >= span;
        let is_since = seen.known - delay >= began;
        if seen.truth.is_nan() || !is_since || !self.last.is_none_or(is_next) {
            return;
        }
        if let Some([with, without]) = answers.squares(channel, seen.column, seen.truth) {
            self.last = Some(seen.known);
            self.windows = self.windows.saturating_add(1);
            self.with = STAYS * self.with + with;
            self.without = STAYS * self.without + without;
        }
    }

    /// Whether the sensor is right by them.
    pub(super) fn believes(&self) -> bool {
        self.windows >= WINDOWS && self.with < self.without
    }
}
