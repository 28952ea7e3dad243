//! Which predictions a combiner may put together.

use super::estimator::{about, std_dev_of};
use super::instance::Instance;
use super::plan::{AuxPorts, NOVELTY, PlannedRole, STD_DEV, TruthLink, WEIGHTS};
use super::provenance::Provenance;
use super::resolver::Resolver;
use crate::channel::Channel;
use crate::node::{Combiner, InputPort, OutputPort};
use crate::time::Duration;
use crate::unit::Unit;

/// What comes out of a combiner, where in the plan that is which always stands beside the prediction, and the gathers of the
/// deviations of its votes and of their novelties.
type Ports = (
    Vec<OutputPort>,
    AuxPorts,
    Option<usize>,
    Option<(usize, Vec<usize>)>,
);

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
        self.doubt_age(instance, port.name, &voters);
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
        if let Some(predicts) = predicts {
            let link = TruthLink {
                slot: predicts,
                ahead,
                span: self.provenance[predicts].span(),
                limit: Duration::ZERO,
            };
            // Predictions have been looked at with the nodes that make them.
            let is_other = |slot: &usize| self.channels[*slot].predicts.is_none();
            let others = voters.iter().copied().filter(is_other).collect();
            self.suspect(instance, port.name, others, Duration::ZERO, &link);
            if let Some((port, slot)) = state {
                self.suspect(instance, port.name, vec![slot], Duration::ZERO, &link);
            }
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
        let (outputs, beside, std_devs, novelties) =
            self.ports(instance, combiner, combined, (&port, &voters))?;
        let channels = outputs.iter().map(|port| port.channels.len()).sum();
        let behind = vec![behind; channels];
        let role = PlannedRole::Combiner {
            voters: gather,
            std_devs,
            novelties,
            state,
            truth: link,
            beside,
        };
        self.add(instance, outputs, role, behind, predicts)
    }

    /// Warns of an age that votes reach while all that they are made of counts: then there is no vote, and nothing says why.
    fn doubt_age(&mut self, instance: &Instance<'_>, port: &str, voters: &[usize]) {
        let Some((stated, place)) = instance.input(port).and_then(|input| input.max_age) else {
            return;
        };
        let older = |&slot: &usize| {
            let counts = self.channels[slot].channel.default_max_age()?;
            let sources = self.provenance[slot].sources();
            let ages = sources.filter_map(|(of, _)| Some((self.channels[of].channel.max_age?, of)));
            // What is rarer than that does not age it.
            let oldest = ages.filter(|(age, _)| *age <= counts).max()?;
            (oldest.0 > stated).then_some((slot, oldest))
        };
        let Some((slot, (age, of))) = voters.iter().find_map(older) else {
            return;
        };
        let (voter, signal) = (&self.channels[slot].name, &self.channels[of].name);
        let problem = super::problem::Doubt {
            message: format!(
                "no vote older than {stated} counts, while `{voter}` is made of `{signal}`, which counts for {age}: where its samples are that \
                 far apart, there is no vote"
            ),
            help: Some(format!("leave `max_age` out, or set it to {age} at least")),
        };
        self.diagnostics.report(place, problem);
    }

    /// What comes out of a combiner, and what is read for it beside the votes.
    fn ports(
        &mut self,
        instance: &Instance<'_>,
        combiner: &dyn Combiner,
        combined: Channel,
        (port, voters): (&InputPort, &[usize]),
    ) -> Option<Ports> {
        let number = about(&self.channels[voters[0]].channel, combined.name.clone());
        let std_dev = std_dev_of(&combined);
        let mut outputs = vec![OutputPort {
            name: "prediction",
            channels: vec![combined.clone()],
        }];
        let mut next = self.channels.len() + 1;
        let mut put = |name, channels: Vec<Channel>| {
            let first = next;
            next += channels.len();
            outputs.push(OutputPort { name, channels });
            first
        };
        let (mut beside, mut of_votes) = (AuxPorts::default(), None);
        if combiner.has_weights() {
            put(WEIGHTS, self.weights(voters));
        }
        if combiner.has_reason() {
            beside.reason = Some(put("reason", vec![number.clone()]));
        }
        if combiner.coverage().is_some() {
            let mut bound = |name| put(name, vec![combined.clone()]);
            beside.bounds = Some((bound("lower"), bound("upper")));
        }
        if combiner.has_weights()
            && let Some(of_voters) = self.std_devs(voters)
        {
            let unit = std_dev.channels[0].unit.clone();
            let lags = [Duration::ZERO];
            put(std_dev.name, std_dev.channels);
            of_votes = Some(self.gather(instance, port, &of_voters, &lags, Some(&unit))?);
        }
        let mut novelties = None;
        if combiner.has_weights()
            && let Some((which, slots)) = self.novelties(voters)
        {
            put(NOVELTY, vec![number]);
            let (unit, lags) = (Unit::one(), [Duration::ZERO]);
            let gather = self.gather(instance, port, &slots, &lags, Some(&unit))?;
            novelties = Some((gather, which));
        }
        Some((outputs, beside, of_votes, novelties))
    }

    /// The novelties that stand beside these predictions, with which of them they are of; none where there is none.
    fn novelties(&self, voters: &[usize]) -> Option<(Vec<usize>, Vec<usize>)> {
        let beside = |(nth, &slot): (usize, &usize)| Some((nth, self.beside(slot, NOVELTY)?));
        let (which, slots): (Vec<_>, Vec<_>) = voters.iter().enumerate().filter_map(beside).unzip();
        (!slots.is_empty()).then_some((which, slots))
    }

    /// The standard deviation that stands beside each of these predictions, where all have one.
    fn std_devs(&self, voters: &[usize]) -> Option<Vec<usize>> {
        let all = voters.iter().map(|&slot| self.beside(slot, STD_DEV));
        all.collect()
    }

    /// The channel of a port that stands beside a prediction.
    fn beside(&self, slot: usize, port: &str) -> Option<usize> {
        let node = &self.nodes[self.channels[slot].node?];
        let (_, predictions) = node.ports.first()?;
        let (_, beside) = node.ports.iter().find(|(name, _)| *name == port)?;
        let nth = slot.checked_sub(predictions.start)?;
        (nth < beside.len()).then(|| beside.start + nth)
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
        let weight = |&slot: &usize| {
            let vote = &self.channels[slot].channel;
            about(vote, format!("weight-{}", name(slot)))
        };
        voters.iter().map(weight).collect()
    }
}
