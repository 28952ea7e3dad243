//! Decides what is told of an instance that cannot be resolved, since mistakes in it have been told: all that is wrong with the rest.

use super::feature::outputs_of;
use super::inputs::{COUNTS_ONCE, meant_input};
use super::instance::{Declared, ReadParts};
use super::keys::Learn;
use super::problem;
use super::resolver::Resolver;
use crate::document::{InstanceDecl, LeftOut, NodeDecl};
use crate::node::{InputPort, Kind, Mistake, Read, Role, RoleName};

/// What is found whichever choice stands where one could not be read.
fn agreed(mut readings: impl Iterator<Item = Vec<Mistake>>) -> Vec<Mistake> {
    let mut agreed = readings.next().unwrap_or_default();
    for found in readings {
        agreed.retain(|mistake| found.contains(mistake));
    }
    agreed
}

impl Resolver<'_> {
    /// Looks through an instance of which nobody will read anything.
    pub(super) fn survey(
        &mut self,
        node: &NodeDecl,
        decl: &InstanceDecl,
        kind: Option<&'static Kind>,
        parts: &ReadParts,
    ) {
        let Some(kind) = kind else {
            for (text, place) in decl.inputs.iter().flat_map(|input| &input.references) {
                self.look_up(text, *place);
            }
            return;
        };
        let declared = Declared { node, decl, kind };
        self.known_inputs(&declared);
        let ports = self.wired(&declared);
        self.surely_read(&declared, parts, &ports);
        if let Some(keys) = &parts.estimator {
            let spec = parts.spec.as_ref().and_then(|spec| spec.as_whole());
            let ranged = spec.is_none_or(|spec| match spec.role() {
                Role::Estimator(estimator) => estimator.keeps_range(),
                _ => true,
            });
            let mistakes = agreed(keys.readings().map(|keys| match &keys.learn {
                Some(Learn::Within(limits)) => limits.mistakes(ranged),
                _ => Vec::new(),
            }));
            self.own_mistakes(&declared, mistakes, keys.left_out());
        }
        let Some(spec) = &parts.spec else {
            return;
        };
        let truth = self.only_truth(&ports);
        let truth = truth.map(|slot| self.channels[slot].channel.unit.clone());
        let features = ports
            .iter()
            .find(|(port, _)| COUNTS_ONCE.contains(&port.name));
        let features = features.and_then(|(_, slots)| Some(slots.as_ref()?.len()));
        let whole = ports.into_iter().map(|(port, slots)| Some((port, slots?)));
        let inputs = whole.collect::<Option<_>>();
        let inputs = inputs.map(|ports| self.inputs(&declared, ports));
        let mistakes = agreed(spec.readings().map(|spec| match spec.role() {
            Role::Feature(feature) => {
                let inputs = inputs.as_ref().filter(|_| !feature.closes_loops());
                outputs_of(feature, inputs).err().unwrap_or_default()
            }
            Role::Estimator(estimator) => {
                let mut mistakes = estimator.mistakes();
                mistakes.extend(
                    truth
                        .iter()
                        .flat_map(|unit| estimator.mistakes_beside(unit)),
                );
                mistakes.extend(features.iter().flat_map(|&of| estimator.mistakes_for(of)));
                mistakes
            }
            Role::Combiner(combiner) => combiner.mistakes(),
        }));
        self.own_mistakes(&declared, mistakes, spec.left_out());
    }

    /// Tells those mistakes that do not follow from what was left out.
    fn own_mistakes(
        &mut self,
        declared: &Declared<'_>,
        mut mistakes: Vec<Mistake>,
        left_out: &LeftOut,
    ) {
        // Where something that could not be read may be missing, only what stands there is sure.
        let open = self.diagnostics.is_open(declared.node.place);
        mistakes.retain(|mistake| {
            let mut behind = std::iter::once(&mistake.at).chain(&mistake.rests_on);
            behind.all(|way| !left_out.explains(way) && (!open || declared.states(way)))
        });
        self.mistakes(declared, mistakes);
    }

    /// What each input port reads, where all of that is known; whatever is wrong with it is told.
    fn wired(&mut self, declared: &Declared<'_>) -> Vec<(InputPort, Option<Vec<usize>>)> {
        // Inputs that cannot be read at all are not missing.
        let unread = declared.node.faulty.is_some() && declared.decl.inputs.is_empty();
        let ports = (declared.kind.inputs)().iter().map(|port| {
            let slots = (!unread).then(|| self.slots(declared, port)).flatten();
            let is_gate = port.name == "state" && declared.kind.role == RoleName::Combiner;
            let takes_one = port.read == Read::Truth || is_gate;
            if let Some(slots) = slots
                .as_deref()
                .filter(|slots| takes_one && slots.len() > 1)
            {
                self.one_of(declared, port, slots);
            }
            let left_out = port.optional && declared.input(port.name).is_none();
            (*port, slots.filter(|slots| left_out || !slots.is_empty()))
        });
        ports.collect()
    }

    /// The truth, where it is known and one channel.
    fn only_truth(&self, ports: &[(InputPort, Option<Vec<usize>>)]) -> Option<usize> {
        let (_, slots) = ports.iter().find(|(port, _)| port.read == Read::Truth)?;
        match slots.as_deref()? {
            [slot] => Some(*slot),
            _ => None,
        }
    }

    /// Tells what is wrong with what is read, whatever the parameters are that could not be.
    fn surely_read(
        &mut self,
        declared: &Declared<'_>,
        parts: &ReadParts,
        ports: &[(InputPort, Option<Vec<usize>>)],
    ) {
        // An age that could not be read is not missing.
        if declared.node.faulty.is_some() || self.diagnostics.is_open(declared.node.place) {
            return;
        }
        for (port, slots) in ports {
            let Some(slots) = slots else { continue };
            if port.read != Read::Truth {
                let unit = Self::port_unit(port);
                self.conversions(declared, port, slots, 1, unit.as_ref());
            }
            if port.read == Read::Held {
                self.max_ages(declared, port.name, slots);
            }
            if port.name == "voters" && self.are_predictions(declared, port.name) {
                self.votes_agree(declared, port.name, slots);
            }
        }
        let Some(truth) = self.only_truth(ports) else {
            return;
        };
        let voters = ports.iter().find(|(port, _)| port.name == "voters");
        let first = voters.and_then(|(_, slots)| slots.as_ref()?.first().copied());
        if declared.kind.role == RoleName::Combiner
            && let Some(first) = first
        {
            self.agree(declared, "voters", first, truth, false);
            self.link(declared, truth, self.channels[first].channel.ahead);
        }
        let (Some(spec), Some(keys)) = (&parts.spec, &parts.estimator) else {
            return;
        };
        if declared.kind.role != RoleName::Estimator {
            return;
        }
        let (read, is_read) = keys.sure();
        let is_sure = |way| is_read(way) && !spec.left_out().explains(way);
        self.link(declared, truth, read.ahead.unwrap_or_default());
        if is_sure("train") {
            self.limits(declared, read, truth);
        }
        if read.ahead.is_none() && is_sure("ahead") {
            let kind = declared.kind.name;
            let problem = problem::NoHorizon { kind };
            self.diagnostics.report(declared.node.place, problem);
        }
    }

    /// Tells of inputs that the kind does not have.
    pub(super) fn known_inputs(&mut self, declared: &Declared<'_>) {
        let ports = (declared.kind.inputs)();
        let strange = |port: &str| !ports.iter().any(|known| known.name == port);
        for input in declared
            .decl
            .inputs
            .iter()
            .filter(|input| strange(&input.port))
        {
            let problem = problem::UnknownInput {
                kind: declared.kind.name,
                input: input.port.clone(),
                meant: meant_input(declared, &input.port),
                known: ports.iter().map(|port| port.name).collect(),
            };
            self.diagnostics.report(input.place, problem);
            // What it reads is looked at all the same.
            for (text, place) in &input.references {
                self.look_up(text, *place);
            }
        }
    }
}
