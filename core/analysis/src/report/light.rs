//! What a correction does for light: losses and waits without and with it, of one optical loss.

use std::fmt::Write as _;

use athermal_core::time::Duration;
use serde::Serialize;

use super::Series;
use super::change::{Changes, Settling, StepLoss};
use super::recomputed::LossNow;
use super::track::{TrackLoss, TrackSettled};

/// What a correction does for light. Without an `optical_loss` node there is nothing in it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Light {
    /// The node whose loss it is.
    pub loss: Option<String>,
    /// Optical loss in dB without the correction.
    pub loss_without: Series,
    /// The same with it, at the same instants.
    pub loss_with: Series,
    /// The limit of the loss in dB.
    pub loss_limit: f64,
    /// The set point at each loss.
    pub set_point: Vec<f64>,
    /// The set point's unit.
    pub set_point_unit: Option<String>,
    /// Share of the losses below the limit, without and with; none without losses.
    pub below_limit: Option<(f64, f64)>,
    /// The changes of the set point, in order.
    pub settling: Vec<Settling>,
    /// The largest loss after changes of one kind, first the time before any change.
    pub steps: Vec<StepLoss>,
    /// Over which time the loss is; none without one.
    #[serde(skip)]
    pub(super) over: Option<Duration>,
}

/// The limit where no `settled` node gives one: that of the article.
const LIMIT_DB: f64 = 0.2;

impl Light {
    /// What is known before the first row.
    pub(super) fn before(loss: Option<&TrackLoss>) -> Self {
        let settled = loss.and_then(|loss| loss.settled.as_ref());
        let limit = |settled: &TrackSettled| settled.below;
        Self {
            loss: loss.map(|loss| loss.node.clone()),
            loss_limit: settled.and_then(limit).unwrap_or(LIMIT_DB),
            set_point_unit: settled.map(|settled| settled.set_point.clone()),
            over: loss.and_then(|loss| loss.over),
            ..Self::default()
        }
    }

    /// Takes what is known of the loss at a row.
    pub(super) fn look(&mut self, at_s: f64, of: &LossNow, changes: &mut Changes) {
        let [without, with] = of.loss;
        // Both over the same windows: those in which there is a correction at all.
        if !without.is_nan() && !with.is_nan() {
            self.loss_without.push(at_s, without);
            self.loss_with.push(at_s, with);
            self.set_point.push(changes.set_point());
            changes.lose(of.loss);
        }
        changes.go_on(at_s, of.since, of.settled);
    }

    /// Works out the figures over all rows.
    pub(super) fn finish(&mut self, changes: Changes, loss: &TrackLoss) {
        let below = |losses: &Series| {
            let low = losses.value.iter().filter(|loss| **loss < self.loss_limit);
            low.count() as f64 / losses.value.len() as f64
        };
        self.below_limit = (!self.loss_with.value.is_empty())
            .then(|| (below(&self.loss_without), below(&self.loss_with)));
        let change = loss.settled.as_ref().map_or(0.0, |settled| settled.change);
        (self.settling, self.steps) = changes.steps(change);
    }

    /// Over which time the losses are, in words.
    pub(super) fn span(&self) -> String {
        match self.over {
            Some(over) if over.secs() != 300.0 => over.to_string(),
            _ => "five minutes".to_owned(),
        }
    }

    /// What the correction does for light and waiting, in a sentence; none without losses. Of several losses it has the name.
    #[must_use]
    pub fn headline(&self, of_several: bool) -> Option<String> {
        let (without, with) = self.below_limit?;
        let named = self.loss.as_ref().filter(|_| of_several);
        let named = named.map_or_else(String::new, |name| format!(" ({name})"));
        let losses = match self.span().as_str() {
            "five minutes" => "Five-minute losses".to_owned(),
            over => format!("Losses over {over}"),
        };
        let mut text = format!(
            "{losses}{named} below {} dB: {:.1} % without, {:.1} % with correction",
            self.loss_limit,
            100.0 * without,
            100.0 * with
        );
        if !self.settling.is_empty() {
            let waits = |pick: fn(&Settling) -> Option<f64>| self.settling.iter().map(pick);
            let longest = |pick| match waits(pick).try_fold(0.0_f64, |most, m| Some(most.max(m?))) {
                Some(most) => format!("{most:.0} min"),
                None => "never settling".to_owned(),
            };
            let _ = write!(
                text,
                "; longest wait after a change of the set point: {} without, {} with",
                longest(|s| s.without_min),
                longest(|s| s.with_min)
            );
        }
        Some(text + ".")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_that_never_ends_is_the_longest() {
        let settling = |without_min, with_min| Settling {
            at_s: 0.0,
            from: 20.0,
            to: 30.0,
            without_min,
            with_min,
            largest_without: Some(1.0),
            largest_with: Some(0.1),
        };
        let mut light = Light {
            loss: Some("loss.1".into()),
            loss_limit: 0.2,
            below_limit: Some((0.5, 0.975)),
            settling: vec![settling(Some(82.0), Some(32.4)), settling(None, Some(0.0))],
            ..Light::default()
        };
        assert_eq!(
            light.headline(false).unwrap(),
            "Five-minute losses below 0.2 dB: 50.0 % without, 97.5 % with correction; \
             longest wait after a change of the set point: never settling without, 32 min with."
        );
        light.settling.clear();
        light.over = Some(Duration::from_ns(600_000_000_000));
        assert_eq!(
            light.headline(true).unwrap(),
            "Losses over 10min (loss.1) below 0.2 dB: 50.0 % without, 97.5 % with correction."
        );
    }
}
