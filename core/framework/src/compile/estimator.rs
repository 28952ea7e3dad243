//! What an estimator learns from and what it gives. [`row`](super::row) has what its rows are made of.

use std::collections::BTreeSet;

use super::instance::{Declared, Instance, instance_name};
use super::keys::{EstimatorKeys, Limits, Outside};
use super::kind_fault::KindFault;
use super::learning;
use super::plan::{NOVELTY, PlannedFit, PlannedRole, STD_DEV, TrainingLimits, TruthLink};
use super::problem;
use super::provenance::Provenance;
use super::resolver::Resolver;
use super::row::Row;
use crate::channel::Channel;
use crate::diagnostic::Problem;
use crate::node::{Estimator, FREEZE, Mistake, OutputPort, PlannedRow};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

/// The port of the standard deviation of the truth about a prediction.
pub(super) fn std_dev_of(prediction: &Channel) -> OutputPort {
    let channel = Channel {
        unit: prediction.unit.difference(),
        ..prediction.clone()
    };
    OutputPort {
        name: STD_DEV,
        channels: vec![channel],
    }
}

/// A channel of plain numbers about a prediction, held as long as the prediction is.
pub(super) fn about(prediction: &Channel, name: String) -> Channel {
    Channel {
        name,
        unit: Unit::one(),
        span: Duration::ZERO,
        ahead: Duration::ZERO,
        max_age: prediction.default_max_age(),
    }
}

impl Resolver<'_> {
    pub(super) fn estimator(
        &mut self,
        instance: &Instance<'_>,
        estimator: &dyn Estimator,
    ) -> Option<()> {
        let mistakes = estimator.mistakes();
        let sound = mistakes.is_empty();
        self.mistakes(instance, mistakes);
        let ahead = self.horizon(instance);
        let mut features = Some((None, Vec::new()));
        let mut truth = None;
        for port in (instance.kind.inputs)() {
            match port.name {
                "truth" => truth = self.single(instance, port).map(|slot| (*port, slot)),
                FREEZE => {}
                _ => features = self.slots(instance, port).map(|slots| (Some(*port), slots)),
            }
        }
        let mut beside = Vec::new();
        let mut link = None;
        if let Some((_, truth)) = truth {
            beside = estimator.mistakes_beside(&self.channels[truth].channel.unit);
            link = ahead.and_then(|ahead| self.link(instance, truth, ahead));
        }
        if let Some((Some(_), features)) = &features {
            beside.extend(estimator.mistakes_for(features.len()));
        }
        let sound = sound && beside.is_empty();
        self.mistakes(instance, beside);
        let (Some((truth_port, truth)), Some(link), Some(&(features_port, ref features))) =
            (truth, link, features.as_ref())
        else {
            if let Some((_, truth)) = truth {
                self.limits(instance, &instance.read.estimator, truth);
            }
            if let Some((Some(port), features)) = &features {
                self.max_ages(instance, port.name, features);
            }
            self.learning(instance, estimator);
            return None;
        };
        let wanted = estimator.regressors();
        if sound {
            self.sound(instance, KindFault::of_regressors(&wanted))?;
        }

        let mut row = Row::default();
        let mut whole = sound;
        if let Some(port) = features_port
            && !features.is_empty()
        {
            let mut unit = Self::port_unit(&port);
            if port.name == "voters" {
                let are_predictions = self.are_predictions(instance, port.name);
                whole &= are_predictions && self.may_stack(instance, port.name, features, &link);
                unit = are_predictions.then(|| self.channels[truth].channel.unit.clone());
            }
            let of = (&port, features.as_slice());
            whole &=
                self.features_of_row(instance, of, &wanted.feature_lags, unit, &link, &mut row);
        }
        whole &= self.truths_of_row(instance, &truth_port, wanted.truth_lags, &link, &mut row);
        if row.regressors.is_empty() && !wanted.every_tick {
            // An optional input that was left out, and nothing in its place.
            let port = features_port.unwrap_or(truth_port);
            self.missing_input(instance, &port);
            whole = false;
        }
        let training = self.limits(instance, &instance.read.estimator, link.slot);
        let learning = self.learning(instance, estimator);
        let outside = self.outside(instance, estimator);
        if whole {
            let member = instance.decl.member.as_deref();
            let mistakes = estimator.mistakes_of_row(&PlannedRow {
                instance: &instance_name(&instance.node.name, member),
                regressors: &row.regressors,
                truth: &self.channels[truth].channel.unit,
                ahead: link.ahead,
            });
            whole = mistakes.is_empty();
            self.mistakes(instance, mistakes);
        }
        if !whole {
            return None;
        }
        let (training, learning) = (training?, learning?);
        let learned_from = learning.as_ref().map(|_| link.learned_from());
        let behind = row.behind.iter().copied().chain(learned_from);
        let behind = Provenance::of(behind.map(|(slot, lag)| (&self.provenance[slot], lag)));
        let prediction = Channel {
            ahead: link.ahead,
            ..self.channels[truth].channel.clone()
        };
        let mut ports = vec![OutputPort {
            name: "prediction",
            channels: vec![prediction.clone()],
        }];
        if learning.is_some() {
            ports.push(learning::port(&prediction));
        }
        if estimator.has_std_dev() {
            ports.push(std_dev_of(&prediction));
        }
        if estimator.has_novelty() {
            ports.push(OutputPort {
                name: NOVELTY,
                channels: vec![about(&prediction, prediction.name.clone())],
            });
        }
        let behind = vec![behind; ports.len()];
        let role = PlannedRole::Estimator {
            fit: PlannedFit {
                regressors: row.regressors,
                truth: link,
                training,
            },
            gathers: row.gathers,
            every_tick: wanted.every_tick,
            learning,
            std_dev: None,
            novelty: None,
            outside: outside?,
        };
        self.add(instance, ports, role, behind, Some(truth))?;
        // Asked for later by whoever wants to know whether it needs a fit, and to fail here where it fails.
        let added = self.nodes.last();
        added.map(|node| drop(node.fixed()))
    }

    /// What becomes of predictions outside of the rows of the fit; `None` when an error about it has been reported.
    fn outside(&mut self, instance: &Instance<'_>, estimator: &dyn Estimator) -> Option<Outside> {
        match instance.read.estimator.outside {
            Some(outside) if estimator.has_novelty() => return Some(outside),
            None if estimator.has_novelty() => return Some(Outside::Shrink),
            None => return Some(Outside::Pass),
            Some(_) => {}
        }
        let message =
            "`outside` would do nothing: its fit does not say how far regressors are outside of it";
        let mistake = Mistake::at("outside", message).help("leave `outside` out");
        self.mistakes(instance, vec![mistake]);
        None
    }

    /// How far ahead of now the truth is that is learned from.
    pub(super) fn horizon(&mut self, instance: &Instance<'_>) -> Option<Duration> {
        let ahead = instance.read.estimator.ahead;
        if ahead.is_none() {
            let kind = instance.kind.name;
            let problem = problem::NoHorizon { kind };
            self.diagnostics.report(instance.node.place, problem);
        }
        ahead
    }

    /// Whether predictions may be stacked: they agree, and are of the truth that is predicted from them, as far ahead.
    fn may_stack(
        &mut self,
        instance: &Instance<'_>,
        input: &str,
        voters: &[usize],
        link: &TruthLink,
    ) -> bool {
        let agree = self.votes_agree(instance, input, voters);
        let voter = &self.channels[voters[0]];
        if voter.channel.ahead != link.ahead {
            let problem = problem::Horizons {
                first: voter.name.clone(),
                first_ahead: voter.channel.ahead,
                second: instance.node.name.clone(),
                second_ahead: link.ahead,
            };
            let place = instance.input_place(input);
            self.diagnostics.report(place, problem);
            return false;
        }
        agree & self.agree(instance, input, voters[0], link.slot, false)
    }

    /// A truth as predictions `ahead` of it are paired with it.
    pub(super) fn link(
        &mut self,
        instance: &Declared<'_>,
        truth: usize,
        ahead: Duration,
    ) -> Option<TruthLink> {
        let name = |slot: usize| self.channels[slot].name.clone();
        let own = &self.channels[truth];
        let problem: Box<dyn Problem> =
            if own.channel.ahead != Duration::ZERO || own.predicts.is_some() {
                let channel = name(truth);
                problem::PredictedTruth { channel }.into()
            } else if let Some(prediction) = self.prediction_beside(truth) {
                let (channel, prediction) = (name(truth), name(prediction));
                problem::TruthOfPrediction {
                    channel,
                    prediction,
                }
                .into()
            } else if let Some(node) = self.endless(truth) {
                let channel = name(truth);
                problem::EndlessTruth { channel, node }.into()
            } else {
                // A node may forget what its inputs are means of.
                let span = self.provenance[truth].span();
                let limit = if span > Duration::ZERO {
                    span
                } else {
                    self.max_ages(instance, "truth", &[truth])?[0]
                };
                return Some(TruthLink {
                    slot: truth,
                    ahead,
                    span,
                    limit,
                });
            };
        let place = instance.input_place("truth");
        self.diagnostics.report(place, problem);
        None
    }

    /// A node behind a slot whose values depend on all of the past.
    fn endless(&self, slot: usize) -> Option<String> {
        let mut ahead = vec![slot];
        let mut seen = BTreeSet::new();
        while let Some(slot) = ahead.pop() {
            let Some(node) = self.channels[slot].node.filter(|&node| seen.insert(node)) else {
                continue;
            };
            let node = &self.nodes[node];
            let PlannedRole::Feature { gathers, .. } = &node.role else {
                continue;
            };
            if node.endless {
                return Some(node.name.clone());
            }
            let entries = gathers
                .iter()
                .flat_map(|&gather| &self.gathers[gather].entries);
            ahead.extend(entries.map(|entry| entry.slot));
        }
        None
    }

    /// Notes which measured channels each regressor is made from, which is known once loops have been followed.
    pub(super) fn name_sensors(&mut self) {
        for node in &mut self.nodes {
            let (PlannedRole::Estimator { fit, gathers, .. }
            | PlannedRole::Feature {
                fit: Some(fit),
                gathers,
                ..
            }) = &mut node.role
            else {
                continue;
            };
            let entries = gathers
                .iter()
                .flat_map(|&gather| &self.gathers[gather].entries);
            for (regressor, entry) in fit.regressors.iter_mut().zip(entries) {
                let sources = self.provenance[entry.slot].sources();
                let name = |(source, _): (usize, Duration)| self.channels[source].name.clone();
                regressor.sensors = sources.map(name).collect();
            }
        }
    }

    pub(super) fn limits(
        &mut self,
        instance: &Declared<'_>,
        keys: &EstimatorKeys,
        truth: usize,
    ) -> Option<TrainingLimits> {
        let Limits { below, above } = keys.train.abs_truth.clone();
        let unit = self.channels[truth].channel.unit.clone();
        let mut whole = true;
        let mut size = |limit: Option<Quantity>, default: f64, key: &str| match limit {
            None => default,
            Some(limit) => limit.as_difference(&unit).unwrap_or_else(|| {
                let problem = problem::LimitUnit {
                    found: limit.unit.clone(),
                    expected: unit.clone(),
                };
                self.diagnostics
                    .report(instance.parameter_place(key), problem);
                whole = false;
                default
            }),
        };
        let none = TrainingLimits::NONE;
        let limits = TrainingLimits {
            below: size(below, none.below, "train.abs_truth.below"),
            above: size(above, none.above, "train.abs_truth.above"),
        };
        if whole && !(limits.above >= 0.0 && limits.below > limits.above) {
            let unit = |value| Quantity {
                value,
                unit: unit.clone(),
            };
            let problem = problem::NoRows {
                below: unit(limits.below),
                above: unit(limits.above),
            };
            let place = instance.parameter_place("train.abs_truth");
            self.diagnostics.report(place, problem);
            whole = false;
        }
        whole.then_some(limits)
    }
}
