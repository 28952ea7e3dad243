//! What a feature of a graph is given and what it gives.

use super::instance::Instance;
use super::kind_fault::KindFault;
use super::plan::{PlannedFit, PlannedRole, TruthLink};
use super::problem;
use super::provenance::{Provenance, persistence_lag};
use super::resolver::Resolver;
use crate::node::{Feature, Hindsight, InputPort, Inputs, Mistake, OutputPort, Read};
use crate::time::Duration;

/// The output ports of a feature, or all that is wrong with it; none and nothing where it is not known what it reads.
pub(super) fn outputs_of(
    feature: &dyn Feature,
    inputs: Option<&Inputs>,
) -> Result<Vec<OutputPort>, Vec<Mistake>> {
    let mut mistakes = feature.mistakes();
    match inputs.map_or(Ok(Vec::new()), |inputs| feature.outputs(inputs)) {
        Ok(outputs) if mistakes.is_empty() => return Ok(outputs),
        Ok(_) => {}
        Err(others) => {
            for other in others {
                if !mistakes.contains(&other) {
                    mistakes.push(other);
                }
            }
        }
    }
    Err(mistakes)
}

impl Resolver<'_> {
    /// Resolves a feature. One that closes a loop is given its inputs later, and knows none of them here.
    pub(super) fn feature(
        &mut self,
        instance: &Instance<'_>,
        feature: &dyn Feature,
        closes: bool,
    ) -> Option<()> {
        let encoder = feature.encoder();
        let mut lags = encoder.map_or_else(|| vec![Duration::ZERO], |encoder| encoder.lags());
        // Lags may follow from parameters that are wrong, which is then the mistake; the rest is looked at without them.
        let faults: Vec<KindFault> = KindFault::of_encoder(&lags).into_iter().collect();
        if !faults.is_empty() {
            lags = vec![Duration::ZERO];
        }
        let ahead = feature.reads_ahead();
        let mut ports = Vec::new();
        let mut gathers = Vec::new();
        let mut whole = true;
        for (nth, port) in (instance.kind.inputs)().iter().enumerate() {
            if closes {
                ports.push((*port, Vec::new()));
                continue;
            }
            let Some(slots) = self.slots(instance, port) else {
                whole = false;
                continue;
            };
            if port.read != Read::Truth {
                let unit = Self::port_unit(port);
                let mut lags = lags.clone();
                if nth == 0 && !ahead.is_empty() {
                    whole &= self.known_ahead(instance, port, &slots, &ahead);
                    lags.extend(ahead.iter().map(|&ahead| -ahead));
                }
                match self.gather(instance, port, &slots, &lags, unit.as_ref()) {
                    Some(gather) => gathers.push(gather),
                    None => whole = false,
                }
            }
            ports.push((*port, slots));
        }
        if !whole {
            self.mistakes(instance, feature.mistakes());
            return None;
        }
        let truth = ports.iter().find(|(port, _)| port.read == Read::Truth);
        let mut fit = match (encoder, truth) {
            (Some(_), Some((port, slots))) => {
                let truth = self.one_of(instance, port, slots)?;
                Some(self.fit(instance, truth, &lags, &ports)?)
            }
            _ => None,
        };
        let mut hindsight = None;
        if let Some(fit) = &mut fit
            && encoder.is_some_and(|encoder| encoder.looks_back())
        {
            hindsight = Some(self.hindsight(instance, fit, lags, &ports, &mut gathers)?);
        }
        let data = ports.iter().filter(|(port, _)| port.read != Read::Truth);
        let slots: Vec<Vec<usize>> = data.map(|(_, slots)| slots.clone()).collect();
        let mut inputs = self.inputs(instance, ports);
        inputs.hindsight = hindsight;
        let outputs = match outputs_of(feature, Some(&inputs)) {
            Ok(outputs) => outputs,
            Err(mistakes) => {
                self.mistakes(instance, mistakes);
                return None;
            }
        };
        self.sound(
            instance,
            faults.into_iter().chain(KindFault::of_outputs(&outputs)),
        )?;
        self.doubts(instance, feature.warnings(&inputs));
        inputs.names = Vec::new();
        let widths = outputs.iter().map(|port| (port.name, port.channels.len()));
        let behind = self.behind(feature, &slots, widths);
        let role = PlannedRole::Feature {
            inputs,
            gathers,
            wanted: vec![false; outputs.len()],
            every_tick: feature.every_tick(),
            closes_loops: feature.closes_loops(),
            fit,
        };
        self.add(instance, outputs, role, behind, None)
    }

    /// Whether channels are known so far ahead; reports the first that is not.
    fn known_ahead(
        &mut self,
        instance: &Instance<'_>,
        port: &InputPort,
        slots: &[usize],
        ahead: &[Duration],
    ) -> bool {
        let Some(&ahead) = ahead.iter().max() else {
            return true;
        };
        let known = |slot: usize| self.planned(slot).map(|planned| planned.known_ahead);
        let unknown = slots.iter().copied();
        let mut unknown = unknown.filter(|&slot| known(slot).is_none_or(|known| known < ahead));
        let Some(slot) = unknown.next() else {
            return true;
        };
        let problem = problem::NotKnownAhead {
            channel: self.channels[slot].name.clone(),
            ahead,
            known: known(slot),
            is_measured: self.channels[slot].node.is_none(),
        };
        let place = instance.input_place(port.name);
        self.diagnostics.report(place, problem);
        false
    }

    /// Adds what a feature that looks back is given and fitted on besides, behind the gathers that it has.
    fn hindsight(
        &mut self,
        instance: &Instance<'_>,
        fit: &mut PlannedFit,
        mut lags: Vec<Duration>,
        ports: &[(InputPort, Vec<usize>)],
        gathers: &mut Vec<usize>,
    ) -> Option<Hindsight> {
        let TruthLink { ahead, span, .. } = fit.truth;
        let data = || ports.iter().filter(|(port, _)| port.read != Read::Truth);
        if span > Duration::ZERO && !lags.contains(&span) {
            lags.push(span);
            for (port, slots) in data() {
                let unit = Self::port_unit(port);
                gathers.push(self.gather(instance, port, slots, &[span], unit.as_ref())?);
                let regressors = self.regressors(slots, span, unit.as_ref());
                fit.regressors.extend(regressors);
                self.suspect(instance, port.name, slots.clone(), span, &fit.truth);
            }
        }
        let port = gathers.len();
        let known = persistence_lag(span, ahead);
        let delay = known + ahead;
        lags.iter_mut().for_each(|lag| *lag += delay);
        for (port, slots) in ports {
            let (unit, lags) = match port.read {
                Read::Truth => (None, &[known][..]),
                _ => (Self::port_unit(port), &lags[..]),
            };
            gathers.push(self.gather(instance, port, slots, lags, unit.as_ref())?);
        }
        Some(Hindsight { port, delay, span })
    }

    /// The rows that a feature is fitted on; `None` when an error about them has been reported.
    fn fit(
        &mut self,
        instance: &Instance<'_>,
        truth: usize,
        lags: &[Duration],
        ports: &[(InputPort, Vec<usize>)],
    ) -> Option<PlannedFit> {
        let ahead = self.horizon(instance)?;
        let truth = self.link(instance, truth, ahead)?;
        let training = self.limits(instance, &instance.read.estimator, truth.slot)?;
        let mut regressors = Vec::new();
        for (port, slots) in ports.iter().filter(|(port, _)| port.read != Read::Truth) {
            let unit = Self::port_unit(port);
            for &lag in lags {
                regressors.extend(self.regressors(slots, lag, unit.as_ref()));
                self.suspect(instance, port.name, slots.clone(), lag, &truth);
            }
        }
        Some(PlannedFit {
            regressors,
            truth,
            training,
        })
    }

    /// What is behind each channel of a feature's output ports, given the slots of each input port.
    pub(super) fn behind(
        &self,
        feature: &dyn Feature,
        inputs: &[Vec<usize>],
        ports: impl Iterator<Item = (&'static str, usize)>,
    ) -> Vec<Provenance> {
        let mut behind: Vec<Provenance> = Vec::new();
        for (port, width) in ports {
            let reach = feature.reach(port);
            let mut before: Option<(Vec<_>, Provenance)> = None;
            for nth in 0..width {
                let parts = reach.parts(inputs, nth, width);
                // Neighbours are often made of the same, and then share it.
                let own = match before {
                    Some((same, own)) if same == parts => own,
                    _ => {
                        let of = |&(slot, delay): &(usize, _)| (&self.provenance[slot], delay);
                        Provenance::of(parts.iter().map(of))
                    }
                };
                behind.push(own.clone());
                before = Some((parts, own));
            }
        }
        behind
    }
}
