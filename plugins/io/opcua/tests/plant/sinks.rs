//! What a service writes into the variables of a server.

use std::time::Duration;

use athermal_serve::connector::Outlet;
use athermal_serve::testkit::{open_sink, put};

use crate::plant::{Folder, Line, Plant, until};
use crate::service::{GRAPH, Running, declared};

const SECOND: Duration = Duration::from_secs(1);

/// The output that there is.
fn output() -> String {
    let folder = Folder::new("output");
    let (_, deployment) = declared(&folder, &whole(1, "nodes = \"s={output}\"")).unwrap();
    deployment.sinks[0].outputs[0].clone()
}

fn machine(port: u16, keys: &str) -> String {
    whole(port, &keys.replace("OUTPUT", &output()))
}

fn whole(port: u16, keys: &str) -> String {
    format!(
        "{GRAPH}[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n\
         [sources.plc]\ntype = \"opcua\"\nendpoint = \"opc.tcp://127.0.0.1:{port}\"\nnamespace = \"urn:plant\"\n\
         channels = {{ \"temperature.plate\" = \"s=Therm.0\" }}\n\
         [sinks.drift]\ntype = \"opcua\"\nendpoint = \"opc.tcp://127.0.0.1:{port}\"\nnamespace = \"urn:plant\"\n\
         rate = \"1000/s\"\nretry = \"1 s\"\n{keys}\n"
    )
}

/// A sink that has written two outputs, each in the type of its node, and whose counter grows.
pub fn written(plant: &mut Plant, folder: &Folder) -> Box<dyn Outlet> {
    plant.add("a", "Float", 0.0);
    plant.add("b", "Int16", 0);
    plant.add("alive", "Byte", 0);
    let keys = "nodes = \"s={output}\"\nalive = \"s=alive\"\nevery = \"100 ms\"";
    let (_, mut deployment) =
        declared(folder, &machine(plant.port, keys)).unwrap_or_else(|of| panic!("{of}"));
    let sink = deployment.sinks.remove(0).parameters;
    let mut outlet = open_sink(&*sink, &folder.0, &["a", "b"]).unwrap();
    until("it is connected", 20 * SECOND, || outlet.state().is_ok());
    put(&mut *outlet, 7, 2).unwrap();
    assert_eq!(plant.read("a"), (7.0, "Float".to_owned()));
    assert_eq!(plant.read("b"), (8.0, "Int16".to_owned()));
    let first = plant.read("alive").0;
    until("the counter grows", 5 * SECOND, || {
        plant.read("alive").0 != first
    });
    outlet
}

#[test]
fn each_output_is_written_in_the_type_of_its_node_and_a_counter_says_that_the_service_lives() {
    let Some(mut plant) = Plant::start(&[]) else {
        return;
    };
    let folder = Folder::new("written");
    let mut outlet = written(&mut plant, &folder);
    assert_eq!(plant.read("alive").1, "Byte");
    // What does not fit is not written, and the next one is.
    let error = put(&mut *outlet, 100_000, 2).unwrap_err();
    assert!(error.contains("100001 is no Int16"), "{error}");
    assert_eq!(plant.read("a").0, 7.0);
    put(&mut *outlet, 9, 2).unwrap();
    drop(outlet);
    // The last value stands, and the counter with it.
    let last = plant.read("alive").0;
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!((plant.read("a").0, plant.read("alive").0), (9.0, last));
}

#[test]
fn a_service_commands_by_what_is_applied_and_goes_on_when_the_line_is_back() {
    let Some(mut plant) = Plant::start(&["--hz", "10"]) else {
        return;
    };
    let folder = Folder::new("commands");
    plant.add("Drift", "Double", 0.0);
    plant.add("Applied", "Double", 1000.0);
    plant.add("alive", "UInt32", 0);
    let line = Line::to(plant.port);
    let keys = "nodes = { \"OUTPUT\" = \"s=Drift\" }\napplied = { \"OUTPUT\" = \"s=Applied\" }\nalive = \"s=alive\"\nevery = \"200 ms\"";
    let text = machine(plant.port, keys).replace("1000/s", "1/s");
    let to = format!("127.0.0.1:{}", plant.port);
    // Only the sink is behind the line.
    let at = text.rfind(&to).unwrap();
    let text = format!(
        "{}127.0.0.1:{}{}",
        &text[..at],
        line.port,
        &text[at + to.len()..]
    );
    let mut service = Running::start(&folder, &text);
    service.until("a command", |_| plant.read("Drift").0 != 0.0);
    // From where the machine is, at its rate, and not from zero.
    let first = plant.read("Drift").0;
    assert!((900.0..=1000.0).contains(&first), "{first}");
    line.cut(true);
    service.until("it is noticed", |of| of.sink_error().is_some());
    std::thread::sleep(SECOND);
    line.cut(false);
    service.until("it is back", |of| of.sink_error().is_none());
    let before = plant.read("Drift").0;
    service.until("commands go on", |_| plant.read("Drift").0 < before);
    service.stop();
}

#[test]
fn what_cannot_be_written_is_refused_before_anything_runs() {
    let Some(mut plant) = Plant::start(&[]) else {
        return;
    };
    let folder = Folder::new("refused");
    plant.add("text", "String", "a");
    plant.add("number", "Float", 2.5);
    let order = serde_json::json!({ "do": "add", "name": "fixed", "kind": "Double", "value": 0.0 });
    plant.order(&order);
    let look = |node: &str, alive: &str| {
        let keys = format!("nodes = {{ \"OUTPUT\" = \"s={node}\" }}\nalive = \"s={alive}\"");
        let (model, deployment) =
            declared(&folder, &machine(plant.port, &keys)).unwrap_or_else(|of| panic!("{of}"));
        let found = deployment.look(&model.plan, &folder.0.join("state"), 20 * SECOND);
        found[1].to_string()
    };
    let fine = look("number", "number");
    assert!(fine.contains("sink `drift`, 0 of 1 missing"), "{fine}");
    assert!(
        fine.contains("Float, can be written") && fine.contains("2.5"),
        "{fine}"
    );
    for (node, why) in [
        ("text", "it is a String, and no number"),
        ("fixed", "it cannot be written by this user"),
        ("nowhere", "BadNodeIdUnknown"),
    ] {
        let found = look(node, "number");
        assert!(
            found.contains("1 of 1 missing") && found.contains(why),
            "{found}"
        );
    }
    assert!(look("number", "text").contains("`alive`: it is a String"));
    for (keys, why) in [
        (
            "nodes = \"s=one\"",
            "all outputs would be written into one node",
        ),
        ("", "nodes"),
    ] {
        let error = declared(&folder, &machine(1, keys)).unwrap_err();
        assert!(error.contains(why), "{error}");
    }
}
