//! Decides which cases are tried beside those that a test states: with learning and without, and with all ports connected.

use super::Case;
use super::case::{Given, by_default};
use super::fixture::Fixture;
use super::rules::Subject;
use crate::node::{FREEZE, InputPort, Kind, Learns, Read, Role};

/// The other side of each case: what learns where none does, and once what does not where all do.
pub(super) fn of_learning(stated: &[Subject<'_>]) -> Vec<Case> {
    let mut twins = Vec::new();
    let learning: Vec<Option<bool>> = stated.iter().map(learns).collect();
    let mut still = learning.contains(&Some(false));
    for (subject, learns) in stated.iter().zip(&learning) {
        let learn = match learns {
            Some(false) => true,
            Some(true) if !still => {
                still = true;
                false
            }
            _ => continue,
        };
        let twin = switched(subject, learn);
        let is_stated = |other: &&Subject<'_>| {
            let same = other.case.inputs == twin.inputs;
            same && learns_as(&other.parameters, learn) == learns_as(&subject.parameters, learn)
        };
        let others = || stated.iter().zip(&learning);
        let mut same_side = others().filter(|(_, other)| **other == Some(learn));
        if !same_side.any(|(other, _)| is_stated(&other)) {
            twins.push(twin);
        }
    }
    // What speaks without input may hang on learning.
    let speaks = stated
        .iter()
        .flat_map(|subject| &subject.case.without_input);
    let speaks: Vec<String> = speaks.cloned().collect();
    for twin in &mut twins {
        twin.without_input.clone_from(&speaks);
    }
    twins
}

/// Whether an estimator goes on learning in a case; none where it never can.
fn learns(subject: &Subject<'_>) -> Option<bool> {
    let Role::Estimator(estimator) = subject.fixture.plan.nodes[0].spec.role() else {
        return None;
    };
    let by_default = match estimator.learns() {
        Learns::Never { .. } => return None,
        Learns::OnRequest => false,
        Learns::ByDefault => true,
    };
    let learn = subject.parameters.get("learn");
    Some(learn.map_or(by_default, |learn| learn.as_bool() != Some(false)))
}

/// Parameters with `learn` as stated.
fn learns_as(parameters: &toml::Table, learn: bool) -> toml::Table {
    let mut parameters = parameters.clone();
    parameters.insert("learn".to_owned(), toml::Value::Boolean(learn));
    parameters
}

/// The same case, learning or not.
fn switched(subject: &Subject<'_>, learn: bool) -> Case {
    let mut case = subject.case.clone();
    let rest = if subject.parameters.contains_key("learn") {
        let mut parameters = subject.parameters.clone();
        parameters.remove("learn");
        toml::to_string(&parameters).expect("what was read as TOML can be written")
    } else {
        case.parameters.trim().to_owned()
    };
    case.parameters = format!("learn = {learn} # as the kit tries of itself\n{rest}");
    if !learn {
        case.inputs.retain(|given| given.port != FREEZE);
    }
    case
}

/// A case with all ports connected that a graph may leave out, where no case has them all and one can.
pub(super) fn of_ports(kind: &Kind, stated: &[Subject<'_>]) -> Option<Case> {
    // What freezes learning is connected where there is some.
    let some_learn = stated.iter().any(|subject| learns(subject) == Some(true));
    let left_out = |subject: &Subject<'_>| -> Vec<&InputPort> {
        let ports = (kind.inputs)().iter();
        let optional = ports.filter(|port| port.optional && (some_learn || port.name != FREEZE));
        let is_fed = |port: &&InputPort| subject.given.iter().any(|given| given.port == port.name);
        optional.filter(|port| !is_fed(port)).collect()
    };
    let fit = || {
        let all = stated.iter();
        all.filter(|subject| !some_learn || learns(subject) == Some(true))
    };
    if fit().any(|subject| left_out(subject).is_empty()) {
        return None;
    }
    fit().find_map(|subject| connected(kind, subject, &left_out(subject)))
}

/// The case with these ports too, if a graph with it can be compiled.
fn connected(kind: &Kind, subject: &Subject<'_>, left_out: &[&InputPort]) -> Option<Case> {
    let mut case = subject.case.clone();
    let mut connected_ports = Vec::new();
    for port in left_out {
        let given = candidates(port, &subject.given).into_iter().find(|given| {
            let mut with = case.clone();
            with.inputs.push(given.clone());
            Fixture::new(kind, &subject.parameters, &with.given(kind)).is_ok()
        })?;
        connected_ports.push(format!("`{}` in {}", port.name, given.unit));
        case.inputs.push(given);
    }
    let connected_ports = connected_ports.join(", ");
    case.parameters = format!(
        "# with what a graph may leave out: {connected_ports}\n{}",
        case.parameters.trim()
    );
    Some(case)
}

/// What a port may be fed: as by default, then as other ports are, then a number without a unit.
fn candidates(port: &InputPort, given: &[Given]) -> Vec<Given> {
    let usual = by_default(port);
    let mut units = vec![usual.unit.clone()];
    let mut widths = vec![usual.channels];
    if port.unit.is_none() && port.read != Read::Truth {
        units.extend(given.iter().map(|given| given.unit.clone()));
        units.push("1".to_owned());
    }
    widths.extend(given.iter().map(|given| given.channels));
    widths.push(1);
    let pairs = units.iter().flat_map(|unit| {
        let usual = &usual;
        widths.iter().map(move |&channels| Given {
            channels,
            unit: unit.clone(),
            ..usual.clone()
        })
    });
    pairs.collect()
}
