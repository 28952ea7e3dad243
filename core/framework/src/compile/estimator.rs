//! Decides what an estimator's rows are made of, and that none of it sees the future.

use super::plan::{PlannedRole, TrainingLimits, TruthLink};
use super::problem::CompileProblem;
use super::provenance::{ONE_SAMPLE, Provenance, leaks, persistence_lag};
use super::resolver::{Instance, Limits, Resolver};
use crate::channel::Channel;
use crate::diagnostic::Place;
use crate::node::{Estimator, OutputPort, Regressor, TruthLags};
use crate::quantity::Quantity;
use crate::time::Duration;

impl Resolver<'_> {
    pub(super) fn estimator(
        &mut self,
        instance: &Instance<'_>,
        estimator: &dyn Estimator,
    ) -> Option<()> {
        let mistakes = estimator.mistakes();
        let sound = mistakes.is_empty();
        self.mistakes(instance, mistakes);
        let ahead = instance.read.estimator.ahead;
        if ahead.is_none() {
            self.diagnostics.report(
                instance.node.place,
                CompileProblem::NoHorizon {
                    kind: instance.kind.name,
                },
            );
        }
        let mut features = Some((None, Vec::new()));
        let mut truth = None;
        for port in (instance.kind.inputs)() {
            match port.name {
                "truth" => truth = self.single(instance, port).map(|slot| (*port, slot)),
                _ => features = self.slots(instance, port).map(|slots| (Some(*port), slots)),
            }
        }
        let (truth_port, truth) = truth?;
        let link = self.link(instance, truth, ahead?)?;
        let (features_port, features) = features?;
        let wanted = estimator.regressors();

        let mut gathers = Vec::new();
        let mut regressors = Vec::new();
        let mut behind = Vec::new();
        let mut whole = sound;
        if let Some(port) = features_port {
            for &lag in &wanted.feature_lags {
                for &slot in &features {
                    whole &= self.check_feature(instance, slot, lag, &link);
                    regressors.push(self.regressor(slot, lag, false));
                    behind.push((slot, lag));
                }
                gathers.push(self.gather(instance, &port, &features, &[lag])?);
            }
        }
        let lags = match wanted.truth_lags {
            TruthLags::None => Vec::new(),
            TruthLags::At(lags) => lags,
            TruthLags::SmallestLegal => vec![persistence_lag(link.span, link.ahead)],
        };
        for &lag in &lags {
            if leaks(lag, link.span, link.ahead) {
                let place = self.lag_place(instance, &lags, lag);
                self.leak(place, truth, lag, &link);
                whole = false;
            }
            regressors.push(self.regressor(truth, lag, true));
            behind.push((truth, lag));
        }
        if !lags.is_empty() {
            gathers.push(self.gather(instance, &truth_port, &[truth], &lags)?);
        }
        let training = self.limits(instance, &link);
        if !whole {
            return None;
        }
        let behind = Provenance::of(
            behind
                .iter()
                .map(|&(slot, lag)| (&self.provenance[slot], lag)),
        );
        let of = &self.channels[truth].channel;
        let prediction = Channel {
            ahead: link.ahead,
            ..of.clone()
        };
        let role = PlannedRole::Estimator {
            regressors,
            gathers,
            every_tick: wanted.every_tick,
            truth: link,
            training: training?,
        };
        let port = OutputPort {
            name: "prediction",
            channels: vec![prediction],
        };
        self.add(instance, vec![port], role, vec![behind], Some(truth))
    }

    /// A truth as predictions `ahead` of it are paired with it.
    pub(super) fn link(
        &mut self,
        instance: &Instance<'_>,
        truth: usize,
        ahead: Duration,
    ) -> Option<TruthLink> {
        let channel = &self.channels[truth].channel;
        if channel.ahead != Duration::ZERO || self.channels[truth].predicts.is_some() {
            let problem = CompileProblem::PredictedTruth {
                channel: self.channels[truth].name.clone(),
            };
            self.diagnostics
                .report(instance.input_place("truth"), problem);
            return None;
        }
        let span = channel.span;
        let limit = if span > Duration::ZERO {
            Some(span)
        } else {
            self.max_age(instance, "truth", truth)
        };
        Some(TruthLink {
            slot: truth,
            ahead,
            span,
            limit: limit?,
        })
    }

    fn regressor(&self, slot: usize, lag: Duration, of_truth: bool) -> Regressor {
        let from = &self.channels[slot];
        let name = if of_truth && lag == ONE_SAMPLE {
            format!("{} one sample ago", from.name)
        } else if of_truth || lag > Duration::ZERO {
            format!("{} lag {lag}", from.name)
        } else {
            from.name.clone()
        };
        Regressor {
            name,
            unit: from.channel.unit.to_string(),
        }
    }

    /// Whether a feature, read at a lag, may know what it knows of the truth's signal.
    fn check_feature(
        &mut self,
        instance: &Instance<'_>,
        slot: usize,
        lag: Duration,
        link: &TruthLink,
    ) -> bool {
        let of_truth: Vec<usize> = self.provenance[link.slot]
            .sources()
            .map(|(source, _)| source)
            .collect();
        let nearest = self.provenance[slot]
            .sources()
            .filter(|(source, _)| of_truth.contains(source))
            .map(|(_, delay)| delay + lag)
            .min();
        match nearest {
            Some(delay) if leaks(delay, link.span, link.ahead) => {
                self.leak(instance.input_place("features"), slot, delay, link);
                false
            }
            _ => true,
        }
    }

    fn leak(&mut self, place: Place, slot: usize, lag: Duration, link: &TruthLink) {
        let problem = CompileProblem::Leak {
            regressor: self.regressor(slot, lag, slot == link.slot).name,
            lag,
            truth: self.channels[link.slot].name.clone(),
            span: link.span,
            ahead: link.ahead,
        };
        self.diagnostics.report(place, problem);
    }

    fn lag_place(&self, instance: &Instance<'_>, lags: &[Duration], lag: Duration) -> Place {
        let nth = lags.iter().position(|&l| l == lag).unwrap_or(0);
        instance.element_place("lags", nth)
    }

    fn limits(&mut self, instance: &Instance<'_>, link: &TruthLink) -> Option<TrainingLimits> {
        let Limits { below, above } = instance.read.estimator.train.abs_truth.clone();
        let unit = self.channels[link.slot].channel.unit.clone();
        let mut whole = true;
        let mut size = |limit: Option<Quantity>, default: f64| match limit {
            None => default,
            Some(limit) => limit.in_unit(&unit).unwrap_or_else(|| {
                let problem = CompileProblem::LimitUnit {
                    found: limit.unit.clone(),
                    expected: unit.clone(),
                };
                self.diagnostics
                    .report(instance.parameter_place("train"), problem);
                whole = false;
                default
            }),
        };
        let none = TrainingLimits::NONE;
        let limits = TrainingLimits {
            below: size(below, none.below),
            above: size(above, none.above),
        };
        whole.then_some(limits)
    }
}
