//! Decides whether a node goes on from its state as if it had never stopped, and what it makes of a state that is not its own.

use serde::{Deserialize, Serialize};

use super::super::Case;
use super::super::compared::course;
use super::super::fixture::NODE;
use super::Subject;
use crate::engine::{Carry, EngineState, StateTransfer};
use crate::node::State;
use crate::prng::Prng;

/// How often a run is cut.
const CUTS: usize = 6;

/// Of a run, cut anywhere.
pub(super) fn restores(subject: &Subject<'_>) -> Result<(), String> {
    let fixture = &subject.fixture;
    let whole = subject.usual();
    let mut random = Prng::stream(37, "cuts");
    let anywhere = |_| 1 + (random.uniform() * (subject.events().len() - 2) as f64) as usize;
    let cuts: Vec<usize> = std::iter::once(0).chain((0..CUTS).map(anywhere)).collect();
    for cut in cuts {
        let (before, after) = subject.events().split_at(cut);
        let mut engine = subject.engine();
        course(fixture, &mut engine, before);
        let snapshot = engine.snapshot();
        let mut other = subject.engine();
        other
            .restore(&snapshot)
            .map_err(|error| format!("cut after {cut} ticks: {error}"))?;
        let expected = whole.from(cut);
        for (mut engine, which) in [(other, "restored"), (engine, "asked for a snapshot")] {
            let goes_on = course(fixture, &mut engine, after);
            if let Some(difference) = expected.difference(&goes_on, fixture) {
                return Err(format!(
                    "{which} after {cut} ticks it does not go on as it would have: {difference}"
                ));
            }
        }
    }
    Ok(())
}

/// A state that no node but this test knows.
#[derive(Debug, Serialize, Deserialize)]
struct Foreign {
    numbers: Vec<f64>,
}

athermal_core::state!(Foreign, "testkit/1");

/// The name of a state, as it stands in a snapshot.
#[derive(Deserialize)]
struct Named {
    state: String,
}

/// States of other versions, kinds and shapes.
pub(super) fn versions(subject: &Subject<'_>, others: &[Subject<'_>]) -> Result<(), String> {
    let mut engine = subject.engine();
    course(&subject.fixture, &mut engine, subject.events());
    let state = engine.state();
    let Some(own) = state.nodes.get(NODE).and_then(|node| node.own.clone()) else {
        return Ok(());
    };
    let name = rmp_serde::from_slice::<Named>(&own)
        .map_err(|error| format!("the state cannot be read: {error}"))?
        .state;
    let Some(version) = name.rsplit_once('/').map(|(_, version)| version) else {
        return Err(format!("the state is called `{name}`, without a version"));
    };
    if version.parse::<u32>().is_err() {
        return Err(format!("the version of the state `{name}` is no number"));
    }
    let foreign: Box<dyn State> = Box::new(Foreign {
        numbers: vec![1.0; 3],
    });
    let foreign = rmp_serde::to_vec_named(&foreign).map_err(|error| error.to_string())?;
    for (bytes, which) in [
        (of_version_9(&own, &name), "an unknown version"),
        (foreign, "another kind"),
    ] {
        let mut state = engine.state();
        state.nodes.entry(NODE.to_owned()).or_default().own = Some(bytes);
        match offered(subject, &state) {
            Carry::Cold { reason } if reason.trim().is_empty() => {
                return Err(format!("a state of {which} is refused without a reason"));
            }
            Carry::Cold { .. } => {}
            Carry::Carried | Carry::Adopted { .. } | Carry::Warmed { .. } => {
                return Err(format!("a state of {which} is taken as if it were its own"));
            }
        }
    }
    for other in others {
        offer(subject, other);
    }
    for case in of_other_widths(subject) {
        // With other channels a case may be refused, or allow no fit.
        if let Ok(other) = Subject::new(subject.kind, &case) {
            offer(subject, &other);
        }
    }
    Ok(())
}

/// The same case with a channel less or more at each port in turn.
fn of_other_widths(subject: &Subject<'_>) -> Vec<Case> {
    let others = subject.given.iter().flat_map(|given| {
        let (low, high) = given.range();
        let widths = [given.channels.saturating_sub(1), given.channels + 1];
        widths.map(|channels| {
            let case = subject.case.clone();
            let case = case.input(&given.port, channels, &given.unit);
            case.between(&given.port, low, high)
        })
    });
    others.collect()
}

/// Offers what a node knows of one shape to one of another.
fn offer(subject: &Subject<'_>, other: &Subject<'_>) {
    let mut engine = other.engine();
    course(&other.fixture, &mut engine, other.events());
    offered(subject, &engine.state());
}

/// What the node answers to a state; then it has to live on.
fn offered(subject: &Subject<'_>, state: &EngineState) -> Carry {
    let mut engine = subject.engine();
    let carried = engine.adopt(state, &StateTransfer::all(&subject.fixture.plan), false);
    engine.segment();
    course(&subject.fixture, &mut engine, &subject.events()[..100]);
    let mut engine = subject.engine();
    engine.adopt(state, &StateTransfer::all(&subject.fixture.plan), false);
    for (event, values) in subject.events() {
        if let crate::recording::Event::Row(now) = event {
            let later = *now + crate::time::Duration::from_ns(1_000_000_000_000_000);
            let _ = engine.step(later, values);
        }
    }
    let first = carried.into_iter().next();
    first.map_or(Carry::Carried, |node| node.outcome)
}

/// The same bytes under a name of the same length that ends in a version that there is not.
fn of_version_9(own: &[u8], name: &str) -> Vec<u8> {
    let mut bytes = own.to_vec();
    let mut windows = own.windows(name.len());
    if let Some(at) = windows.position(|window| window == name.as_bytes()) {
        let last = &mut bytes[at + name.len() - 1];
        *last = if *last == b'9' { b'8' } else { b'9' };
    }
    bytes
}
