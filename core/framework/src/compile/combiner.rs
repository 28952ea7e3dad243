//! Decides which predictions a combiner may put together.

use super::conversion::{factor, mismatch};
use super::estimator::{self, DEVIATION};
use super::instance::Instance;
use super::plan::{Beside, PlannedRole, TruthLink};
use super::problem::CompileProblem;
use super::provenance::Provenance;
use super::reference::Reference;
use super::resolver::{Resolver, Suspect};
use super::scope::Found;
use crate::channel::Channel;
use crate::node::{Combiner, OutputPort};
use crate::time::Duration;
use crate::unit::Unit;

impl Resolver<'_> {
    pub(super) fn combiner(
        &mut self,
        instance: &Instance<'_>,
        combiner: &dyn Combiner,
    ) -> Option<()> {
        let mistakes = combiner.mistakes();
        let sound = mistakes.is_empty();
        self.mistakes(instance, mistakes);
        let mut voters = None;
        let mut truth = Some(None);
        let mut state = Some(None);
        for port in (instance.kind.inputs)() {
            match port.name {
                "truth" | "state" if port.optional && instance.input(port.name).is_none() => {}
                "truth" => truth = self.single(instance, port).map(Some),
                "state" => state = self.single(instance, port).map(|slot| Some((*port, slot))),
                _ => voters = self.slots(instance, port).map(|slots| (*port, slots)),
            }
        }
        let (port, voters) = voters?;
        let Some(&first) = voters.first() else {
            self.wrong_count(instance, port.name, &[], "one channel or more");
            return None;
        };
        if !self.are_predictions(instance, port.name) {
            return None;
        }
        let mut agree = sound & self.votes_agree(instance, port.name, &voters);
        let truth = truth?;
        let state = state?;
        let ahead = self.channels[first].channel.ahead;
        let link: Option<TruthLink> = match truth {
            Some(truth) => {
                agree &= self.agree(instance, port.name, first, truth, false);
                Some(self.link(instance, truth, ahead)?)
            }
            None => None,
        };
        if !agree {
            return None;
        }
        let unit = truth.map_or(first, |truth| truth);
        let unit = self.channels[unit].channel.unit.clone();
        let gather = self.gather(instance, &port, &voters, &[Duration::ZERO], Some(&unit))?;
        let predicts = truth.or(self.channels[first].predicts);
        let name = predicts
            .map_or(&self.channels[first].channel.name, |slot| {
                &self.channels[slot].channel.name
            })
            .clone();
        let combined = Channel {
            name,
            unit,
            ..self.channels[first].channel.clone()
        };
        // Predictions have been looked at with the nodes that make them; what else votes or tells a state may see the answer too.
        let unseen = voters.iter().copied();
        let unseen = unseen.filter(|&slot| self.channels[slot].predicts.is_none());
        let unseen = [(port.name, unseen.collect::<Vec<usize>>())];
        let state_of = state.map(|(port, slot)| (port.name, vec![slot]));
        for (input, features) in unseen.into_iter().chain(state_of) {
            let Some(predicts) = predicts else { continue };
            self.suspects.push(Suspect {
                place: instance.input_place(input),
                context: instance.context(),
                features,
                lag: Duration::ZERO,
                link: TruthLink {
                    slot: predicts,
                    ahead,
                    span: self.provenance[predicts].span(),
                    limit: Duration::ZERO,
                },
            });
        }
        let slots = voters.iter().copied().chain(state.map(|(_, slot)| slot));
        let behind = Provenance::of(slots.map(|slot| (&self.provenance[slot], Duration::ZERO)));
        let state = match state {
            Some((port, slot)) => {
                let unit = Self::port_unit(&port);
                let lags = [Duration::ZERO];
                Some(self.gather(instance, &port, &[slot], &lags, unit.as_ref())?)
            }
            None => None,
        };
        let reason = self.beside(first, combined.name.clone());
        let mut outputs = vec![OutputPort {
            name: "prediction",
            channels: vec![combined.clone()],
        }];
        let mut beside = Beside::default();
        let mut next = self.channels.len() + 1;
        if combiner.weighs() {
            outputs.push(OutputPort {
                name: "weights",
                channels: self.weights(&voters),
            });
            beside.weights = Some(next);
            next += voters.len();
        }
        if combiner.reasons() {
            outputs.push(OutputPort {
                name: "reason",
                channels: vec![reason],
            });
            beside.reason = Some(next);
            next += 1;
        }
        if combiner.covers().is_some() {
            for name in ["lower", "upper"] {
                outputs.push(OutputPort {
                    name,
                    channels: vec![combined.clone()],
                });
            }
            beside.bounds = Some((next, next + 1));
            next += 2;
        }
        if combiner.weighs()
            && let Some(of_voters) = self.deviations(&voters)
        {
            let deviation = estimator::deviation_of(&combined);
            let unit = deviation
                .channels
                .first()
                .map(|channel| channel.unit.clone());
            let lags = [Duration::ZERO];
            let gather = self.gather(instance, &port, &of_voters, &lags, unit.as_ref())?;
            outputs.push(deviation);
            beside.deviation = Some((next, gather));
        }
        let channels = outputs.iter().map(|port| port.channels.len()).sum();
        let behind = vec![behind; channels];
        let role = PlannedRole::Combiner {
            voters: gather,
            state,
            truth: link,
            beside,
        };
        self.add(instance, outputs, role, behind, predicts)
    }

    /// The standard deviation that stands beside each of these predictions, where all have one.
    fn deviations(&self, voters: &[usize]) -> Option<Vec<usize>> {
        let beside = |&slot: &usize| {
            let node = &self.nodes[self.channels[slot].node?];
            let (_, predictions) = node.ports.first()?;
            let (_, deviations) = node.ports.iter().find(|(name, _)| *name == DEVIATION)?;
            let nth = slot.checked_sub(predictions.start)?;
            (nth < deviations.len()).then(|| deviations.start + nth)
        };
        voters.iter().map(beside).collect()
    }

    /// A channel for the weight of each voter, named after the voter's node, or after the voter where that is not enough.
    fn weights(&self, voters: &[usize]) -> Vec<Channel> {
        let node = |slot: usize| {
            self.channels[slot]
                .name
                .split(['.', ':'])
                .next()
                .unwrap_or_default()
        };
        let nodes: std::collections::BTreeSet<_> = voters.iter().map(|&slot| node(slot)).collect();
        let name = |slot: usize| {
            if nodes.len() == voters.len() {
                node(slot)
            } else {
                &self.channels[slot].name
            }
        };
        let weight = |&slot: &usize| self.beside(slot, format!("weight-{}", name(slot)));
        voters.iter().map(weight).collect()
    }

    /// A channel of plain numbers that tell of a vote, held as long as the vote is.
    fn beside(&self, slot: usize, name: String) -> Channel {
        Channel {
            name,
            unit: Unit::one(),
            span: Duration::ZERO,
            ahead: Duration::ZERO,
            max_age: self.channels[slot].channel.default_max_age(),
        }
    }

    /// Whether no voter is what an estimator or combiner gives beside its prediction. What else there is may vote: a feature of
    /// a prediction, such as its `scale`, is one for all that is known.
    pub(super) fn are_predictions(&mut self, instance: &Instance<'_>, input: &str) -> bool {
        let mut all = true;
        for (text, place) in instance
            .input(input)
            .map_or(&[][..], |input| &input.references)
        {
            let Ok(Found::Slots(slots)) = self.scopes.look_up(text) else {
                continue;
            };
            let mut told_of = slots.iter().map(|&slot| (slot, self.told_of(slot)));
            let Some((slot, Some(prediction))) = told_of.find(|(_, of)| of.is_some()) else {
                continue;
            };
            let reference = Reference::parse(text);
            let problem = CompileProblem::NoPrediction {
                channel: self.channels[slot].name.clone(),
                prediction: match reference.channel {
                    Some(_) => self.channels[prediction].name.clone(),
                    None => reference.node.to_owned(),
                },
            };
            self.diagnostics.report(*place, problem);
            all = false;
        }
        all
    }

    /// The prediction beside which an estimator or combiner gives this slot.
    pub(super) fn told_of(&self, slot: usize) -> Option<usize> {
        let node = &self.nodes[self.channels[slot].node?];
        let (_, predictions) = node.ports.first()?;
        let predicts = !matches!(node.role, PlannedRole::Feature { .. });
        (predicts && !predictions.contains(&slot)).then_some(predictions.start)
    }

    /// Whether predictions may be put together.
    pub(super) fn votes_agree(
        &mut self,
        instance: &Instance<'_>,
        input: &str,
        voters: &[usize],
    ) -> bool {
        let mut agree = true;
        for &other in voters.iter().skip(1) {
            agree &= self.agree(instance, input, voters[0], other, true);
        }
        agree
    }

    /// Whether two channels are different members of the same port or signal, as `drift.X` and `drift.Y` are. Of other channels,
    /// such as two slopes of the same position, it is not known whether they are the same quantity.
    fn are_members(&self, one: usize, other: usize) -> bool {
        let of = |slot: usize| self.channels[slot].name.split_once('.').map(|(of, _)| of);
        one != other && of(one).is_some() && of(one) == of(other)
    }

    /// Whether two channels may stand for the same quantity, and where both are votes, for the same instant. The second is another
    /// vote, or the truth.
    pub(super) fn agree(
        &mut self,
        instance: &Instance<'_>,
        input: &str,
        first: usize,
        second: usize,
        votes: bool,
    ) -> bool {
        let (a, b) = (&self.channels[first], &self.channels[second]);
        let problem = if factor(&b.channel.unit, &a.channel.unit).is_none() {
            mismatch(&b.name, &b.channel.unit, &a.name, &a.channel.unit)
        } else if a.channel.span != b.channel.span {
            CompileProblem::Spans {
                first: a.name.clone(),
                first_span: a.channel.span,
                second: b.name.clone(),
                second_span: b.channel.span,
            }
        } else if votes && a.channel.ahead != b.channel.ahead {
            CompileProblem::Horizons {
                first: a.name.clone(),
                first_ahead: a.channel.ahead,
                second: b.name.clone(),
                second_ahead: b.channel.ahead,
            }
        } else if let Some(of_first) = a.predicts
            && let Some(of_second) = if votes { b.predicts } else { Some(second) }
            && self.are_members(of_first, of_second)
        {
            let name = |slot: usize| self.channels[slot].name.clone();
            CompileProblem::Truths {
                first: a.name.clone(),
                first_truth: name(of_first),
                second: b.name.clone(),
                second_truth: name(of_second),
            }
        } else {
            return true;
        };
        self.diagnostics
            .report(instance.input_place(input), problem);
        false
    }
}
