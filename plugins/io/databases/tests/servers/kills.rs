//! A service that is killed twenty times and a database that is killed five times while rows come: each key once, none missing.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use athermal_connectors as _;
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_databases as _;
use athermal_features as _;
use athermal_run::model::Model;
use athermal_serve::deployment::Deployment;
use athermal_serve::service::{Service, ServiceOptions};

use crate::server::{Folder, Kind, Server};

const GRAPH: &str = r#"schema = 1
name = "tester"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate"], max_age = "1min" }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3s", "1min"] }
outputs.masses = "masses"
"#;

/// What a machine file declares that says so beside the graph.
pub fn declared(folder: &Folder, more: &str) -> (Model, Deployment) {
    let source = "[sources.log]\ntype = \"csv\"\npath = \"log.csv\"\n";
    let runtime = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\ncheckpoint = \"200 ms\"\n";
    let path = folder.0.join("machine.toml");
    fs::write(&path, format!("{GRAPH}{runtime}{source}{more}")).unwrap();
    read(&path)
}

fn read(path: &Path) -> (Model, Deployment) {
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let model = Model::load_from(path, Wanted::default(), &mut sources, &mut doubts).unwrap();
    let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut doubts);
    let deployment =
        deployment.unwrap_or_else(|| panic!("{}", doubts.render(&sources, false, 120)));
    (model, deployment)
}

/// The service of the tests below, where this program is asked to be that.
#[test]
fn child() {
    let Some(folder) = std::env::var_os("ATHERMAL_TEST_SERVICE") else {
        return;
    };
    let (model, deployment) = read(&Path::new(&folder).join("machine.toml"));
    let options = ServiceOptions::new(Path::new(&folder).join("state"));
    let (mut service, _) = Service::start(&model, deployment, &options).unwrap();
    let end = Path::new(&folder).join("end");
    while !end.exists() {
        for event in service.pump() {
            println!("{event:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    service.stop().unwrap();
}

fn service(folder: &Folder) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "kills::child", "--nocapture"])
        .env("ATHERMAL_TEST_SERVICE", &folder.0)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn killed(kind: Kind) {
    let Some(mut server) = Server::start(kind) else {
        return;
    };
    let folder = Folder::new("killed");
    fs::write(folder.0.join("password"), "w0rd\n").unwrap();
    let sinks = format!(
        "[sinks.database]\n{}retry = \"500 ms\"\n[sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n",
        server.sink()
    );
    declared(&folder, &sinks);
    let log = folder.0.join("log.csv");
    let mut text = "time_s,plate\n".to_owned();
    let mut row = 0;
    let mut more = |text: &mut String| {
        for _ in 0..100 {
            row += 1;
            *text += &format!(
                "{}.{:02},{}\n",
                row / 100,
                row % 100,
                20.0 + f64::from(row % 37) / 10.0
            );
        }
        fs::write(&log, &*text).unwrap();
    };
    for nth in 0..20 {
        more(&mut text);
        let mut child = service(&folder);
        std::thread::sleep(Duration::from_millis(300 + 37 * (nth % 7)));
        more(&mut text);
        if nth % 4 == 2 {
            server.kill();
            std::thread::sleep(Duration::from_millis(200));
        }
        std::thread::sleep(Duration::from_millis(100));
        child.kill().unwrap();
        child.wait().unwrap();
        if nth % 4 == 2 {
            server.again();
        }
    }
    let mut child = service(&folder);
    let lines = || fs::read_to_string(folder.0.join("history.csv")).unwrap_or_default();
    let began = Instant::now();
    // Two outputs of each row.
    while lines().lines().count() < 4001 || server.rows("tester").len() < 8000 {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "{} rows, {} in the database",
            lines().lines().count(),
            server.rows("tester").len()
        );
        std::thread::sleep(Duration::from_millis(200));
    }
    fs::write(folder.0.join("end"), "").unwrap();
    child.wait().unwrap();
    let found = server.rows("tester");
    let (text, mut expected) = (lines(), Vec::new());
    let names: Vec<_> = text.lines().next().unwrap().split(',').collect();
    for line in text.lines().skip(1) {
        let cells: Vec<_> = line.split(',').collect();
        let us = (cells[0].parse::<f64>().unwrap() * 1e6).round() as i64;
        for nth in 1..3 {
            expected.push((
                us,
                names[nth].to_owned(),
                cells[nth].parse::<f64>().unwrap(),
            ));
        }
    }
    expected.sort_by(|a, b| (a.0, &a.1).cmp(&(b.0, &b.1)));
    assert_eq!(found.len(), expected.len(), "{kind:?}");
    assert!(
        found == expected,
        "{kind:?}: other values than those of the file"
    );
    println!(
        "{kind:?}: {} keys, each once, after 20 kills of the service and 5 of the server",
        found.len()
    );
}

#[test]
fn each_key_stands_once_in_influxdb_after_twenty_kills_of_the_service_and_five_of_the_server() {
    killed(Kind::Influx);
}

#[test]
fn each_key_stands_once_in_postgresql_after_twenty_kills_of_the_service_and_five_of_the_server() {
    killed(Kind::Postgres);
}
