//! What is reported of an instance that is refused: all that is wrong with what could be read of it.

use super::inputs::meant_input;
use super::instance::{Declared, ReadParts};
use super::keys::Learn;
use super::problem;
use super::resolver::Resolver;
use crate::document::{InstanceDecl, NodeDecl};
use crate::node::{Kind, Read, Role};

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
        // Inputs that cannot be read at all are not missing.
        if !(node.faulty && decl.inputs.is_empty()) {
            for port in (kind.inputs)() {
                let slots = self.slots(&declared, port).unwrap_or_default();
                if port.read == Read::Truth && slots.len() > 1 {
                    self.one_of(&declared, port, &slots);
                }
            }
        }
        let role = parts.spec.as_ref().map(|spec| spec.role());
        if let Some(Learn::Within(limits)) = parts.estimator.as_ref().and_then(|keys| keys.learn) {
            let is_ranged = match &role {
                Some(Role::Estimator(estimator)) => estimator.keeps_range(),
                _ => true,
            };
            self.mistakes(&declared, limits.mistakes(is_ranged));
        }
        let mistakes = match role {
            Some(Role::Feature(feature)) => feature.mistakes(),
            Some(Role::Estimator(estimator)) => estimator.mistakes(),
            Some(Role::Combiner(combiner)) => combiner.mistakes(),
            None => Vec::new(),
        };
        self.mistakes(&declared, mistakes);
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
