//! A server of another make, so that nothing of ours is made for one of them alone: node-opcua.

use std::time::{Duration, SystemTime};

use athermal_serve::connector::LeftOut;
use athermal_serve::testkit::SourceTrial;
use serde_json::json;

use crate::certificates::machine;
use crate::plant::{Folder, Make, Plant, until};
use crate::service::declared;
use crate::sinks;

const SECOND: Duration = Duration::from_secs(1);

fn start(folder: &Folder) -> Option<Plant> {
    let own = folder.0.join("pki").to_string_lossy().into_owned();
    Plant::of(Make::NodeOpcua, &["--folder", &own])
}

#[test]
fn another_make_gives_every_value_with_the_time_of_its_source_and_says_which_are_none() {
    let folder = Folder::new("node");
    let Some(mut plant) = start(&folder) else {
        return;
    };
    plant.add("text", "String", "on");
    plant.add("whole", "Int16", -7);
    let (_, mut deployment) =
        declared(&folder, &machine(plant.port, "")).unwrap_or_else(|of| panic!("{of}"));
    let source = deployment.sources.remove(0).parameters;
    let channels = [
        ("a", "s=Therm.0"),
        ("b", "s=text"),
        ("c", "s=whole"),
        ("d", "s=late"),
    ];
    let trial = SourceTrial::new(&*source, &folder.0, &channels).unit("Cel");
    let (mut tried, mut all) = (trial.start().unwrap(), Vec::new());
    until("the first values", 10 * SECOND, || {
        all.extend(tried.take());
        (0..3).all(|channel| all.iter().any(|of| of.channel == channel))
    });
    let counts = std::sync::Arc::clone(&tried.counts);
    let state = |channel| counts.state(channel).unwrap_or_default();
    for (channel, words) in [
        (0, "granted 100ms, queue "),
        (1, "a text, and no number since "),
        (3, "waiting: BadNodeIdUnknown since "),
    ] {
        let why = state(channel);
        assert!(why.starts_with(words), "{why}");
    }
    assert_eq!(all.iter().find(|of| of.channel == 2).unwrap().value, -7.0);
    // Written more rarely than it is sampled: each comes once, with its own time.
    all.clear();
    let now = SystemTime::UNIX_EPOCH.elapsed().unwrap().as_secs();
    for nth in 1..=10 {
        let order = json!({ "do": "write", "name": "Therm.0", "value": nth, "at": now + nth });
        plant.order(&order);
        std::thread::sleep(Duration::from_millis(250));
    }
    until("all values", 10 * SECOND, || {
        all.extend(tried.take());
        all.iter().filter(|of| of.channel == 0).count() >= 10
    });
    let own = all.iter().filter(|of| of.channel == 0);
    let found: Vec<_> = own.map(|of| (of.value, of.stamp.as_ns())).collect();
    let expected = (1..=10).map(|nth| (nth as f64, (now + nth) as i64 * 1_000_000_000));
    assert_eq!(found, expected.collect::<Vec<_>>());
    for (status, reason, words) in [
        (
            0x808c_0000_u32,
            LeftOut::BadQuality,
            "BadSensorFailure since",
        ),
        (
            0x4090_0000,
            LeftOut::Uncertain,
            "UncertainLastUsableValue since",
        ),
    ] {
        let order = json!({ "do": "write", "name": "Therm.0", "value": 3.5, "status": status });
        plant.order(&order);
        until(words, 10 * SECOND, || state(0).starts_with(words));
        assert_eq!(counts.left_out.of(Some(0), reason), 1, "{words}");
        plant.write("Therm.0", 21.5);
        until("it is good", 10 * SECOND, || {
            state(0).starts_with("granted")
        });
    }
    plant.add("late", "Double", 3.5);
    let mut came = |tried: &mut athermal_serve::testkit::Tried, channel, value| {
        all.extend(tried.take());
        let last = all.iter().rfind(|of| of.channel == channel);
        last.is_some_and(|of| of.value == value)
    };
    until("the late one", 10 * SECOND, || came(&mut tried, 3, 3.5));
    // It ends as `kill -9` does, and starts anew.
    plant.kill();
    until("it is noticed", 10 * SECOND, || !counts.is_connected());
    plant.again(&[]);
    plant.write("Therm.0", 22.5);
    until("data again", 10 * SECOND, || came(&mut tried, 0, 22.5));
    tried.end(&mut Vec::new()).unwrap().unwrap();
}

#[test]
fn another_make_takes_what_is_written_in_the_type_of_its_node() {
    let folder = Folder::new("node-sink");
    let Some(mut plant) = start(&folder) else {
        return;
    };
    drop(sinks::written(&mut plant, &folder));
}
