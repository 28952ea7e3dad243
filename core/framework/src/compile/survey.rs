//! Decides what is told of an instance that cannot be resolved, since mistakes in it have been told: all that is wrong with the rest.

use super::feature::outputs_of;
use super::inputs::meant_input;
use super::instance::{Declared, ReadParts};
use super::keys::Learn;
use super::problem::CompileProblem;
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
        let inputs = ports.map(|ports| self.inputs(&declared, ports));
        let mistakes = agreed(spec.readings().map(|spec| match spec.role() {
            Role::Feature(feature) => {
                let inputs = inputs.as_ref().filter(|_| !feature.closes_loops());
                outputs_of(feature, inputs).err().unwrap_or_default()
            }
            Role::Estimator(estimator) => estimator.mistakes(),
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

    /// What each input port reads, where all of it is known; whatever is wrong with it is told.
    fn wired(&mut self, declared: &Declared<'_>) -> Option<Vec<(InputPort, Vec<usize>)>> {
        // Inputs that cannot be read at all are not missing.
        if declared.node.faulty.is_some() && declared.decl.inputs.is_empty() {
            return None;
        }
        let mut ports = Vec::new();
        let mut whole = true;
        for port in (declared.kind.inputs)() {
            let slots = self.slots(declared, port).unwrap_or_default();
            let is_gate = port.name == "state" && declared.kind.role == RoleName::Combiner;
            let takes_one = port.read == Read::Truth || is_gate;
            if takes_one && slots.len() > 1 {
                self.one_of(declared, port, &slots);
            }
            whole &= !slots.is_empty() || port.optional && declared.input(port.name).is_none();
            ports.push((*port, slots));
        }
        whole.then_some(ports)
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
            let problem = CompileProblem::UnknownInput {
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
