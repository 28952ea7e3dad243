//! The verdict on each axis, one sentence.

use std::fmt::Write as _;

use athermal_run::score::{NoModel, Score};
use serde::Serialize;

use super::{Axis, Stays, Worth, figure, rms};
use crate::figures::apart_by;

/// The share of predictions from which on those that lack are not spoken of; the first windows of a recording are among them.
const NEARLY_ALWAYS: f64 = 0.95;

/// What a model is worth on an axis. Figures are root mean squares in the unit of an error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// The axis.
    pub axis: String,
    /// The node that predicts it.
    pub node: String,
    /// The prediction: `vote.Z1`.
    pub prediction: String,
    /// What the sentence calls it: its node, or its channel where that node predicts the axis twice.
    #[serde(skip)]
    pub(super) called: String,
    /// The unit.
    pub unit: String,
    /// Whether the truth is a level whose zero is arbitrary, such as a position or a temperature in °C: no model is its mean.
    pub on_scale: bool,
    /// Error of the prediction on the instants on which it is scored, or, where these leave many out, wherever there is one; none
    /// where it gave nothing.
    #[serde(rename = "rmse")]
    pub error: Option<f64>,
    /// What no model predicts: zero, or of a level its mean over the fit.
    pub no_model: Option<f64>,
    /// Which of these it is.
    #[serde(skip)]
    pub(super) no_model_is: NoModel,
    /// The truth less that on the same instants: the error of no model.
    pub baseline_zero: Option<f64>,
    /// Whether the drift was measured at any instant.
    pub measured: bool,
    /// The share of the instants at which it was measured that have a prediction.
    pub valid: f64,
    /// What it goes out as, or else its channel.
    #[serde(skip)]
    pub(super) output: String,
    /// How far ahead the prediction looks, in s.
    #[serde(skip)]
    pub(super) ahead_s: f64,
    /// How near the axis stays that is not measured again for a while; none of too few truths.
    pub stays: Option<Stays>,
    /// The standard error of the measured drift, in which scatter and curvature within its windows both count.
    #[serde(rename = "truth_noise")]
    pub noise: Option<f64>,
    /// Drift over all that is corrected, without the correction.
    pub without_correction: Option<f64>,
    /// The same with the correction.
    pub with_correction: Option<f64>,
}

impl Verdict {
    /// Of the prediction of an axis at a place among its voters.
    pub(super) fn of(axis: &Axis, nth: usize, scores: &[Score], worth: Option<&Worth>) -> Self {
        let put_out = &axis.voters[nth];
        let errors = axis.errors_of(put_out);
        let both = || {
            axis.truth
                .value
                .iter()
                .zip(&errors)
                .filter(|(_, e)| !e.is_nan())
        };
        let score = scores
            .iter()
            .find(|score| score.output == put_out.prediction);
        // As the table of scores has it, unless it hides much of what happened where other predictions have no value.
        let scored = score.filter(|score| !score.leaves_many_out());
        let scored = scored.and_then(|score| Some((score.rmse?, score.baseline_zero?)));
        let of_scores = score.and_then(|score| score.no_model);
        let no_model_is = axis.no_model;
        let no_model = no_model_is.value(both().map(|(y, _)| *y));
        let own = || {
            let departures = both().map(|(y, _)| *y - no_model);
            rms(both().map(|(_, e)| *e)).zip(rms(departures))
        };
        let figures = scored.or_else(own);
        let measured = axis.truth.value.iter().filter(|y| !y.is_nan()).count();
        let worth = worth.filter(|_| nth == axis.main);
        let corrected = worth.and_then(|worth| {
            let i = worth.place_of(axis)?;
            let pairs = worth.drift_without[i]
                .value
                .iter()
                .zip(&worth.drift_with[i].value);
            let both: Vec<_> = pairs.filter(|(y, r)| !y.is_nan() && !r.is_nan()).collect();
            rms(both.iter().map(|b| *b.0)).zip(rms(both.iter().map(|b| *b.1)))
        });
        Self {
            axis: axis.name.clone(),
            node: put_out.node.clone(),
            prediction: put_out.prediction.clone(),
            called: put_out.called.clone(),
            unit: axis.error_unit.clone(),
            on_scale: no_model_is != NoModel::Zero,
            no_model: figures.and(scored.and(of_scores).or(Some(no_model))),
            no_model_is,
            error: figures.map(|of| of.0),
            baseline_zero: figures.map(|of| of.1),
            measured: measured > 0,
            stays: Stays::of(axis, put_out, no_model),
            output: put_out
                .output
                .as_ref()
                .unwrap_or(&put_out.prediction)
                .clone(),
            ahead_s: axis.aheads_s[nth],
            valid: both().count() as f64 / measured.max(1) as f64,
            noise: score.and_then(|score| score.truth_noise),
            without_correction: corrected.map(|both| both.0),
            with_correction: corrected.map(|both| both.1),
        }
    }

    /// Whether the prediction is better than none, and the correction, where there is one, too.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let better = |with: Option<f64>, without: Option<f64>| {
            with.zip(without)
                .is_some_and(|(with, without)| !is_worse(with, without))
        };
        better(self.error, self.baseline_zero)
            && (self.with_correction.is_none()
                || better(self.with_correction, self.without_correction))
    }

    /// What is left, of what, and how near that keeps a position: for who looks first.
    #[must_use]
    pub fn short(&self) -> String {
        let (Some(error), Some(no_model)) = (self.error, self.baseline_zero) else {
            return self.sentence();
        };
        let [left, all] = apart_by([error, no_model], |value| figure(Some(value)));
        let unit = super::spelled(&self.unit);
        let mut text = format!("left of {all} {unit}: {left}");
        if let Some(with) = self.with_correction {
            let _ = write!(text, "; corrected, {} remain", figure(Some(with)));
        }
        let stays = self.stays.as_ref().map(Stays::sentence);
        stays.map_or(format!("{text}."), |stays| format!("{text}. {stays}"))
    }

    /// The sentence, after the name of the axis.
    #[must_use]
    pub fn sentence(&self) -> String {
        let (Some(error), Some(no_model)) = (self.error, self.baseline_zero) else {
            return if self.measured {
                format!("{} gave no prediction on these data.", self.called)
            } else {
                format!("these data have no truth to compare {} with.", self.called)
            };
        };
        let less = |with: f64, without: f64| 100.0 * (1.0 - with / without);
        let (node, unit) = (&self.called, &self.unit);
        let [left, all] = apart_by([error, no_model], |value| figure(Some(value)));
        let worth = if error < no_model {
            format!("{:.0} % less than no model", less(error, no_model))
        } else {
            "worse than no model".to_owned()
        };
        // A rate is a drift; what else there is has no name of its own.
        let drift = match self.no_model_is {
            NoModel::MeanOfFit(_) => "the departure from the mean of the fit of ",
            NoModel::Mean => "the departure from the mean of ",
            NoModel::Zero if unit.contains('/') => "the drift of ",
            NoModel::Zero => "",
        };
        let mut text = format!("{node} predicts {drift}{all} {unit} RMS to {left}, {worth}");
        if self.valid < NEARLY_ALWAYS {
            let none = 100.0 * (1.0 - self.valid);
            let _ = write!(text, ", and gives no prediction {none:.0} % of the time");
        }
        if let Some(noise) = self.noise {
            let _ = write!(
                text,
                " (the standard error of what was measured is {})",
                figure(Some(noise))
            );
        }
        if let (Some(without), Some(with)) = (self.without_correction, self.with_correction) {
            let [remain, of] = apart_by([with, without], |value| figure(Some(value)));
            let _ = write!(text, "; corrected, {remain} of {of} remain");
            let _ = if with < without {
                write!(text, ", {:.0} % less", less(with, without))
            } else {
                write!(text, ": worse than without")
            };
        }
        text.push('.');
        if let Some(stays) = &self.stays {
            let _ = write!(text, " {}", stays.sentence());
        }
        text
    }
}

/// Whether an error is worse than another by the digits that people see: what is equal to them is not.
pub(super) fn is_worse(error: f64, than: f64) -> bool {
    error > than && figure(Some(error)) != figure(Some(than))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sentence_says_what_is_left_and_calls_worse_worse() {
        let mut verdict = Verdict {
            axis: "Z1".into(),
            node: "vote".into(),
            prediction: "vote.Z1".into(),
            called: "vote".into(),
            unit: "nm/min".into(),
            on_scale: false,
            no_model: Some(0.0),
            no_model_is: NoModel::Zero,
            error: Some(20.0),
            baseline_zero: Some(50.0),
            measured: true,
            output: "predicted.Z1".into(),
            ahead_s: 0.0,
            stays: None,
            valid: 0.97,
            noise: Some(3.85),
            without_correction: Some(60.0),
            with_correction: Some(15.0),
        };
        assert!(verdict.is_good());
        let short = "left of 50.0 nm/min: 20.0; corrected, 15.0 remain.";
        assert_eq!(verdict.short(), short);
        assert_eq!(
            verdict.sentence(),
            "vote predicts the drift of 50.0 nm/min RMS to 20.0, 60 % less than no model (the standard error of what was measured is 3.85); \
             corrected, 15.0 of 60.0 remain, 75 % less."
        );
        verdict.valid = 0.6;
        let sentence = verdict.sentence();
        assert!(
            sentence.contains("less than no model, and gives no prediction 40 % of the time (the"),
            "{sentence}"
        );
        verdict.with_correction = Some(61.0);
        assert!(
            !verdict.is_good()
                && verdict
                    .sentence()
                    .ends_with("61.0 of 60.0 remain: worse than without.")
        );
        (verdict.on_scale, verdict.unit) = (true, "K".into());
        verdict.no_model_is = NoModel::MeanOfFit(21.0);
        let sentence = verdict.sentence();
        let of_level = "vote predicts the departure from the mean of the fit of 50.0 K RMS to 20.0, 60 % less than no model, and gives";
        assert!(sentence.starts_with(of_level), "{sentence}");
        (verdict.error, verdict.with_correction) = (Some(50.01), None);
        assert!(verdict.is_good(), "equal to three digits is not worse");
        verdict.error = Some(50.1);
        assert!(!verdict.is_good());
        assert_eq!(verdict.short(), "left of 50.0 K: 50.1.");
        verdict.error = None;
        assert_eq!(verdict.sentence(), "vote gave no prediction on these data.");
        verdict.measured = false;
        assert_eq!(
            verdict.sentence(),
            "these data have no truth to compare vote with."
        );
    }
}
