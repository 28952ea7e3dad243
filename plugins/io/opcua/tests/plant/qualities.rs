//! Values that are none, and what is said of them.

use std::time::Duration;

use athermal_serve::connector::LeftOut;
use athermal_serve::testkit::SourceTrial;
use serde_json::json;

use crate::plant::{Folder, Plant, until};
use crate::service::{GRAPH, declared};

const SECOND: Duration = Duration::from_secs(1);

/// A source of these channels, each with its node, in a machine file of its own.
fn source(folder: &Folder, port: u16, keys: &str) -> Box<dyn athermal_serve::connector::Source> {
    let machine = format!(
        "{GRAPH}[sources.plc]\ntype = \"opcua\"\nendpoint = \"opc.tcp://127.0.0.1:{port}\"\nnamespace = \"urn:plant\"\n{keys}\n\
         channels = {{ \"temperature.plate\" = \"s=Therm.0\" }}\n"
    );
    let (_, mut deployment) = declared(folder, &machine).unwrap_or_else(|of| panic!("{of}"));
    deployment.sources.remove(0).parameters
}

#[test]
fn what_is_no_good_number_is_absent_with_its_name_and_counted() {
    let Some(mut plant) = Plant::start(&[]) else {
        return;
    };
    let folder = Folder::new("qualities");
    for (name, kind, value) in [
        ("text", "String", json!("on")),
        ("array", "Double", json!([1.0, 2.0])),
        ("truth", "Boolean", json!(true)),
        ("whole", "Int16", json!(-7)),
    ] {
        plant.add(name, kind, value);
    }
    let source = source(&folder, plant.port, "repeat = \"1 s\"");
    let channels = [
        ("a", "s=Therm.0"),
        ("b", "s=text"),
        ("c", "s=array"),
        ("d", "s=truth"),
        ("e", "s=whole"),
        ("f", "s=late"),
    ];
    let trial = SourceTrial::new(&*source, &folder.0, &channels).unit("Cel");
    let mut tried = trial.start().unwrap();
    let mut all = Vec::new();
    until("the first values", 10 * SECOND, || {
        all.extend(tried.take());
        (0..5).all(|channel| all.iter().any(|of| of.channel == channel))
    });
    let last = |all: &[athermal_serve::testkit::Given], channel| {
        all.iter()
            .rfind(|of| of.channel == channel)
            .map(|of| of.value)
    };
    assert_eq!(last(&all, 4), Some(-7.0));
    for channel in [1, 2, 3] {
        assert!(last(&all, channel).unwrap().is_nan());
    }
    let counts = std::sync::Arc::clone(&tried.counts);
    let state = |channel| counts.state(channel).unwrap_or_default();
    for (channel, words) in [
        (1, "a text, and no number since "),
        (2, "an array, and no number since "),
        (3, "a truth value, and no number since "),
        (4, "granted 100ms, queue 100"),
        (5, "waiting: BadNodeIdUnknown since "),
    ] {
        assert!(state(channel).starts_with(words), "{}", state(channel));
        let of = counts.left_out.of(Some(channel), LeftOut::NoNumber);
        assert_eq!(of > 0, (1..4).contains(&channel), "{channel}");
    }
    // A value that does not change counts again while the server lives.
    let before = all.iter().filter(|of| of.channel == 4).count();
    until("it counts again", 10 * SECOND, || {
        all.extend(tried.take());
        all.iter().filter(|of| of.channel == 4).count() > before + 1
    });
    // BadSensorFailure, UncertainLastUsableValue, and NaN, one after the other.
    for (value, status, reason, words) in [
        (
            json!(1.0),
            0x808c_0000_u32,
            LeftOut::BadQuality,
            "BadSensorFailure since",
        ),
        (
            json!(2.0),
            0x4090_0000,
            LeftOut::Uncertain,
            "UncertainLastUsableValue since",
        ),
        (
            json!("nan"),
            0,
            LeftOut::NoNumber,
            "NaN, and no number since",
        ),
    ] {
        plant.order(&json!({ "do": "write", "name": "Therm.0", "value": value, "status": status }));
        until(words, 10 * SECOND, || state(0).starts_with(words));
        until("it is absent", SECOND, || {
            all.extend(tried.take());
            last(&all, 0).is_some_and(f64::is_nan)
        });
        assert_eq!(counts.left_out.of(Some(0), reason), 1, "{words}");
        plant.write("Therm.0", 21.5);
        until("it is good", 10 * SECOND, || {
            state(0).starts_with("granted")
        });
        all.extend(tried.take());
        assert_eq!(last(&all, 0), Some(21.5));
    }
    // A node that comes later is there soon.
    plant.add("late", "Double", 3.5);
    until("the late one", 10 * SECOND, || {
        all.extend(tried.take());
        last(&all, 5) == Some(3.5)
    });
    tried.end(&mut all).unwrap().unwrap();
}

#[test]
fn a_source_keeps_the_rules_that_every_source_keeps() {
    let Some(plant) = Plant::start(&["--hz", "20", "--nodes", "2"]) else {
        return;
    };
    let folder = Folder::new("rules");
    let source = source(&folder, plant.port, "");
    let channels = [("a", "s=Therm.0"), ("b", "s=Therm.1")];
    let trial = SourceTrial::new(&*source, &folder.0, &channels);
    if let Err(broken) = trial.patience(10 * SECOND).check(20) {
        panic!("{broken}");
    }
}

#[test]
fn addresses_are_judged_where_they_stand() {
    let folder = Folder::new("addresses");
    let of = |node: &str, namespace: &str| {
        let machine = format!(
            "{GRAPH}[sources.plc]\ntype = \"opcua\"\nendpoint = \"opc.tcp://127.0.0.1\"\n{namespace}\n\
             channels = {{ \"temperature.plate\" = \"{node}\" }}\n"
        );
        let declared = declared(&folder, &machine);
        declared.map(|_| ())
    };
    let usual = "namespace = \"urn:plant\"";
    assert_eq!(of("s=a", usual), Ok(()));
    assert_eq!(of("ns=2;s=a", ""), Ok(()), "it is doubtful, and no mistake");
    for (node, namespace, why) in [
        ("plate", usual, "names no node"),
        ("s=a", "", "it has no namespace"),
        ("s=a", "endpoint = 1", "endpoint"),
    ] {
        let error = of(node, namespace).unwrap_err();
        assert!(error.contains(why), "{error}");
    }
}
