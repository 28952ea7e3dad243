//! Decides whether what a kind names differs from what others name, and be referred to.

use super::super::compared::none_of;
use super::Subject;
use crate::compile::PlannedRole;
use crate::document::is_name;
use crate::node::{Kind, NodeKind, PredictorForm, Role, StateForm};
use crate::registry::{find, taken_twice};

/// What of a kind, and of its crate, has the name of something else, or one that no graph could write.
pub(in super::super) fn shared(kind: &Kind) -> Vec<String> {
    let mut found = Vec::new();
    let written = [
        find::<NodeKind>(kind.name).err(),
        taken_twice::<StateForm>(kind.package),
        taken_twice::<PredictorForm>(kind.package),
    ];
    found.extend(written.into_iter().flatten().map(|twice| twice.message()));
    let ports = (kind.inputs)().iter().map(|port| port.name);
    found.extend(unfit("the kind", std::iter::once(kind.name)));
    found.extend(unfit("the input port", ports));
    found
}

/// Output ports and channels that no reference could name, and ports of several that no page lists.
pub(super) fn names(subject: &Subject<'_>) -> Result<(), String> {
    let node = &subject.fixture.plan.nodes[0];
    let mut found = Vec::new();
    if let (Role::Feature(feature), PlannedRole::Feature { inputs, .. }) =
        (node.spec.role(), &node.role)
        && let Ok(ports) = feature.outputs(inputs)
    {
        found.extend(unfit("the output port", ports.iter().map(|port| port.name)));
        let listed = (subject.kind.ports)();
        let is_listed = |name: &str| {
            listed
                .iter()
                .any(|of| of.name == name && !of.summary.is_empty())
        };
        // The only port of a node need not be named by who reads it.
        let unlisted = ports.iter().filter(|port| !is_listed(port.name));
        let unlisted = unlisted.filter(|_| ports.len() > 1 || !listed.is_empty());
        found.extend(unlisted.map(|port| {
            let name = port.name;
            format!(
                "the output port `{name}` is not among `Feature::ports`, or has no summary there"
            )
        }));
        let channels = ports.iter().flat_map(|port| &port.channels);
        let strange = channels.filter(|channel| !is_channel(&channel.name));
        found.extend(strange.map(|channel| {
            let name = &channel.name;
            format!(
                "the channel `{name}` is not made of letters, digits and `_`, `-`, `@`, `.`, `/`"
            )
        }));
    }
    none_of(found)
}

/// Names that break the rules, or stand twice.
fn unfit<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let (mut found, mut seen) = (Vec::new(), Vec::new());
    for name in names {
        if !is_name(name, false) {
            found.push(format!(
                "{what} `{name}` is not a letter followed by letters, digits, `_` and `-`"
            ));
        }
        if seen.contains(&name) {
            found.push(format!("{what} `{name}` is there twice"));
        }
        seen.push(name);
    }
    found
}

/// Whether a reference can end in it, and no pattern is seen in it.
fn is_channel(name: &str) -> bool {
    let fits = |c: char| c.is_alphanumeric() || "_-@./".contains(c);
    !name.is_empty() && name.chars().all(fits)
}
