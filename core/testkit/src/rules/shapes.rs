//! Decides whether a node is right whichever of its ports are read, and however many channels come.

use super::super::case::Given;
use super::super::compared::course;
use super::super::fixture::Fixture;
use super::super::samples::{Coming, samples};
use super::Subject;
use crate::node::Read;

/// How many channels each port is given, beside those of the case.
const WIDTHS: [usize; 2] = [1, 8];

/// Ports that somebody reads give the same bits whatever is read beside them.
pub(super) fn wanted(subject: &Subject<'_>) -> Result<(), String> {
    if !subject.is_feature() {
        return Ok(());
    }
    let whole = subject.usual();
    let ports = subject.fixture.ports();
    let some = std::iter::once(Vec::new()).chain(ports.iter().map(|port| vec![port.clone()]));
    for read in some.filter(|read| read.len() < ports.len()) {
        let fixture = Fixture::reading(subject.kind, &subject.parameters, &subject.given, &read)?;
        let found = course(
            &fixture,
            &mut fixture.engine(&subject.fitted),
            subject.events(),
        );
        let is_read = |slot: usize| {
            let port = fixture.port(slot);
            port == fixture.default_port() || read.iter().any(|read| read == port)
        };
        if let Some(difference) = whole.difference_where(&found, &fixture, is_read) {
            let beside = match read.first() {
                Some(port) => format!("beside its first port only `{port}` is read"),
                None => "only its first port is read".to_owned(),
            };
            return Err(format!(
                "where {beside}, it gives other outputs: {difference}"
            ));
        }
    }
    Ok(())
}

/// However many channels come, where the kind takes so many, it runs, and gives the same bits again.
pub(super) fn widths(subject: &Subject<'_>) -> Result<(), String> {
    for width in WIDTHS {
        let is_wide = |given: &Given| {
            let mut ports = (subject.kind.inputs)().iter();
            let port = ports.find(|port| port.name == given.port);
            port.is_some_and(|port| port.read != Read::Truth && port.name != "state")
        };
        let mut given = subject.given.clone();
        let wide = given.iter_mut().filter(|given| is_wide(given));
        wide.for_each(|given| given.channels = width);
        let Ok(fixture) = Fixture::new(subject.kind, &subject.parameters, &given) else {
            continue;
        };
        let (ticks, every) = (subject.ticks() / 2, subject.case.every);
        let table = samples(subject.kind, &given, ticks, every, Coming::WithGaps);
        // So many may be more than the rows can tell.
        let Ok(other) = subject.fed(given, fixture, table).fitted() else {
            continue;
        };
        let run = || course(&other.fixture, &mut other.engine(), other.events());
        if let Some(difference) = run().difference(&run(), &other.fixture) {
            return Err(format!(
                "with {width} channels at each port, run again, it gives other bits: {difference}"
            ));
        }
    }
    Ok(())
}
