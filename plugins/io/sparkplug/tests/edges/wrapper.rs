//! What an edge node without aliases and without a store sends.

use crate::host::Host;
use crate::peers::{Broker, Edge, Folder, Make, until};

#[test]
fn a_host_takes_what_is_published_asks_for_rebirths_and_knows_what_is_dead() {
    let Some(mut broker) = Broker::start(Make::Wrapper) else {
        return;
    };
    let (port, folder) = (broker.port, Folder::new("wrapper"));
    let start = || Edge::start(Make::Wrapper, port, &[]);
    // It was born before the host was there: the host asks for a birth.
    let mut edge = start();
    let mut host = Host::start(&folder.0, port);
    until("the host", || host.is_connected());
    edge.hear("rebirth");
    edge.publish(21.5);
    until("a value", || host.last() == Some(21.5));
    // A death is absent, and a birth brings it back.
    edge.kill();
    until("the death", || host.is_dead());
    until("nothing is known", || host.last().is_none());
    let mut edge = start();
    edge.publish(22.5);
    until("a value again", || host.last() == Some(22.5));
    // The broker goes, with all that it knows.
    broker.kill();
    until("it is noticed", || !host.is_connected());
    broker.again();
    until("the host again", || host.is_connected());
    drop(edge);
    let mut edge = start();
    edge.publish(23.5);
    until("a value from the new broker", || host.last() == Some(23.5));
    let gap = "gap: what edge node `edge` published while the connection was away";
    assert!(host.heard(gap), "{:#?}", host.events);
    // The host is away for a while, and begins anew.
    host.stop();
    edge.publish(99.0);
    let mut host = Host::start(&folder.0, port);
    edge.hear("rebirth");
    edge.publish(24.5);
    until("a value after a restart", || host.last() == Some(24.5));
    host.stop();
}
