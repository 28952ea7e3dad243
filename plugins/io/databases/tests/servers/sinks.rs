//! What a sink puts out, and what becomes of what is refused.

use std::collections::BTreeSet;
use std::fs;
use std::time::{Duration, Instant};

use athermal_serve::connector::{Outlet, Sink};
use athermal_serve::testkit::{open_sink, put};

use crate::kills::declared;
use crate::server::{Folder, Kind, Server};

fn sink(folder: &Folder, server: &Server, keys: &str) -> std::sync::Arc<dyn Sink> {
    fs::write(folder.0.join("password"), "w0rd\n").unwrap();
    let machine = format!("[sinks.log]\n{}{keys}\n", server.sink());
    let (_, mut deployment) = declared(folder, &machine);
    deployment.sinks.remove(0).parameters
}

fn until(what: &str, mut is: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is() {
        assert!(
            began.elapsed() < Duration::from_secs(40),
            "{what} takes too long"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn put_all(outlet: &mut dyn Outlet, seconds: std::ops::Range<i64>) {
    for second in seconds {
        until("a row", || put(outlet, second, 2).is_ok());
    }
    until("all", || outlet.flush().is_ok());
}

#[test]
fn each_key_stands_once_however_often_its_row_comes() {
    for kind in [Kind::Influx, Kind::Postgres] {
        let Some(server) = Server::start(kind) else {
            continue;
        };
        let folder = Folder::new("once");
        let sink = sink(&folder, &server, "");
        let mut outlet = open_sink(&*sink, &folder.0, &["a", "b c=d,e"]).unwrap();
        let began = Instant::now();
        for _ in 0..2 {
            put_all(&mut *outlet, 1000..4000);
        }
        println!("{kind:?}: 2 times 6,000 values in {:?}", began.elapsed());
        // The test kit names no machine.
        let count = match kind {
            Kind::Postgres => {
                let text = "select count(*), count(distinct (time, output)), max(value) from athermal where time >= '1970-01-01T00:16:40Z'";
                let row = server.client().unwrap().query_one(text, &[]).unwrap();
                let (all, keys, most): (i64, i64, f64) = (row.get(0), row.get(1), row.get(2));
                assert_eq!((all, most), (keys, 4000.0));
                all
            }
            _ => {
                let found = server.query("SELECT count(\"value\") FROM \"athermal\" WHERE time >= 1000s GROUP BY \"output\"");
                let series = found["results"][0]["series"].as_array().unwrap().clone();
                let names: Vec<_> = series
                    .iter()
                    .map(|of| of["tags"]["output"].as_str().unwrap())
                    .collect();
                assert_eq!(names, ["a", "b c=d,e"]);
                series
                    .iter()
                    .map(|of| of["values"][0][1].as_i64().unwrap())
                    .sum()
            }
        };
        assert_eq!(count, 6000, "{kind:?}");
    }
}

/// The query of the variable of a dashboard, and those of its panels with their titles.
fn dashboard(name: &str, key: &str) -> (String, Vec<(String, String)>) {
    let path = format!(
        "{}/../../../docs/grafana/{name}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let read: serde_json::Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let text = |of: &serde_json::Value| of.as_str().unwrap().to_owned();
    let variables = read["templating"]["list"].as_array().unwrap();
    let variable = variables.iter().find(|of| of["name"] == "machine").unwrap();
    let panels = read["panels"].as_array().unwrap().iter();
    let panels = panels.map(|of| (text(&of["title"]), text(&of["targets"][0][key])));
    (text(&variable["query"]), panels.collect())
}

#[test]
fn each_query_of_the_dashboards_gives_rows() {
    for kind in [Kind::Influx, Kind::Postgres] {
        let Some(server) = Server::start(kind) else {
            continue;
        };
        let folder = Folder::new("dashboards");
        let sink = sink(&folder, &server, "");
        let mut outlet = open_sink(&*sink, &folder.0, &["a", "b"]).unwrap();
        put_all(&mut *outlet, 1000..1300);
        let (name, key) = match kind {
            Kind::Postgres => ("postgresql", "rawSql"),
            _ => ("influxdb", "query"),
        };
        let (variable, panels) = dashboard(name, key);
        assert_eq!(panels.len(), 4);
        let found = |text: &str| -> (usize, String) {
            let Kind::Postgres = kind else {
                let found = server.query(text);
                let series = found["results"][0]["series"].as_array();
                let series = series.unwrap_or_else(|| panic!("{text}: {found}"));
                let rows = series.iter().map(|of| of["values"].as_array().unwrap());
                let last = series[0]["values"][0].as_array().unwrap().last().unwrap();
                return (
                    rows.map(Vec::len).sum(),
                    last.as_str().unwrap_or_default().to_owned(),
                );
            };
            let rows = server.client().unwrap().query(text, &[]);
            let rows = rows.unwrap_or_else(|error| panic!("{text}: {error}"));
            let first = rows.first().and_then(|of| of.try_get(0).ok());
            (rows.len(), first.unwrap_or_default())
        };
        let (count, machine) = found(&variable);
        assert_eq!(count, 1);
        for (title, query) in panels {
            // As Grafana does.
            let query = query
                .replace("$machine", &machine)
                .replace("$timeFilter", "time >= 1000s AND time < 1300s")
                .replace(
                    "$__timeFilter(time)",
                    "time BETWEEN '1970-01-01T00:16:40Z' AND '1970-01-01T00:21:40Z'",
                )
                .replace(
                    "$__timeGroupAlias(time,$__interval)",
                    "floor(extract(epoch from time)/60)*60 AS \"time\"",
                )
                .replace("$__interval", "1m");
            let (rows, _) = found(&query);
            let expected = match title.as_str() {
                "Newest values" => 2,
                "Revision of the graph" => 6,
                _ => 12,
            };
            assert_eq!(rows, expected, "{title}: {query}");
        }
    }
}

#[test]
fn points_go_to_the_later_interface_with_a_token() {
    let Some(server) = Server::start(Kind::Victoria) else {
        return;
    };
    let folder = Folder::new("later");
    let sink = sink(&folder, &server, "");
    let mut outlet = open_sink(&*sink, &folder.0, &["a", "b"]).unwrap();
    let now = std::time::SystemTime::UNIX_EPOCH
        .elapsed()
        .unwrap()
        .as_secs() as i64;
    put_all(&mut *outlet, now - 50..now);
    until("the points", || {
        let found = server.get("/api/v1/export?match[]=athermal_value").unwrap();
        found.contains("\"output\":\"a\"")
            && found.contains("\"output\":\"b\"")
            && found.contains("\"machine\":\"machine\"")
    });
}

#[test]
fn a_row_that_is_refused_is_set_aside_with_its_reason_and_the_next_ones_go_on() {
    for kind in [Kind::Influx, Kind::Postgres] {
        let Some(server) = Server::start(kind) else {
            continue;
        };
        let folder = Folder::new("refused");
        let sink = sink(&folder, &server, "");
        let mut outlet = open_sink(&*sink, &folder.0, &["a", "b"]).unwrap();
        let now = std::time::SystemTime::UNIX_EPOCH
            .elapsed()
            .unwrap()
            .as_secs() as i64;
        put_all(&mut *outlet, now..now + 10);
        match kind {
            // A rule of the table.
            Kind::Postgres => {
                let rule = "alter table athermal add check (value <> 77 or output <> 'a')";
                server.client().unwrap().batch_execute(rule).unwrap();
            }
            // A time that it does not keep.
            _ => drop(server.query("ALTER RETENTION POLICY autogen ON plant DURATION 52w")),
        }
        for second in (now + 20..now + 60).chain([77]).chain(now + 60..now + 100) {
            put(&mut *outlet, second, 2).unwrap();
        }
        until("all", || outlet.flush().is_ok());
        let aside = fs::read_to_string(folder.0.join("tried/refused.jsonl")).unwrap();
        assert_eq!(aside.lines().count(), 1, "{aside}");
        assert!(aside.contains("\"time_ns\":77000000000,"), "{aside}");
        let said = outlet.state().unwrap_err().to_string();
        assert!(
            said.contains("is set aside in ") && outlet.state().is_ok(),
            "{said}"
        );
        let last = match kind {
            Kind::Postgres => {
                let row = server
                    .client()
                    .unwrap()
                    .query_one("select max(value) from athermal", &[]);
                row.unwrap().get::<_, f64>(0)
            }
            _ => server.query("SELECT max(\"value\") FROM \"athermal\"")["results"][0]["series"][0]
                ["values"][0][1]
                .as_f64()
                .unwrap(),
        };
        assert_eq!(last, (now + 100) as f64);
    }
}

#[test]
fn a_wrong_password_or_a_database_that_is_not_there_is_a_state_and_no_end() {
    if let Some(server) = Server::start(Kind::Postgres) {
        let folder = Folder::new("password");
        let sink = sink(&folder, &server, "");
        fs::write(folder.0.join("password"), "other").unwrap();
        let mut outlet = open_sink(&*sink, &folder.0, &["a"]).unwrap();
        put(&mut *outlet, 1, 1).unwrap();
        let why = outlet.flush().unwrap_err().to_string();
        assert!(
            why.contains("password authentication failed") && why.contains("see `login`"),
            "{why}"
        );
        assert!(outlet.state().is_err() && outlet.held() == 1);
    }
    if let Some(server) = Server::start(Kind::Influx) {
        let folder = Folder::new("nowhere");
        let sink = sink(&folder, &server, "");
        server.query("DROP DATABASE plant");
        let mut outlet = open_sink(&*sink, &folder.0, &["a"]).unwrap();
        put(&mut *outlet, 1, 1).unwrap();
        let why = outlet.flush().unwrap_err().to_string();
        assert!(
            why.contains("404") && why.contains("make the database"),
            "{why}"
        );
        server.query("CREATE DATABASE plant");
        until("it goes on", || outlet.flush().is_ok());
        assert!(outlet.state().is_ok() && outlet.held() == 0);
    }
}

#[test]
fn a_full_disk_is_a_state_and_no_end_and_nothing_is_missing_once_there_is_room() {
    for kind in [Kind::Influx, Kind::Postgres] {
        let Some(mut server) = Server::start_on_small_disk(kind) else {
            continue;
        };
        let folder = Folder::new("full");
        let sink = sink(&folder, &server, "");
        let mut outlet = open_sink(&*sink, &folder.0, &["a", "b"]).unwrap();
        put_all(&mut *outlet, 0..1000);
        server.disk.as_ref().unwrap().fill();
        // What fits into what was reserved before may go yet.
        let mut second = 1000;
        let why = loop {
            assert!(second < 100_000, "{kind:?}: it is never full");
            match put(&mut *outlet, second, 2) {
                Ok(()) => second += 1,
                Err(why) => break why,
            }
        };
        assert!(why.to_lowercase().contains("no space left"), "{why}");
        assert!(outlet.state().is_err() && outlet.held() > 0);
        assert!(!folder.0.join("tried/refused.jsonl").exists(), "{why}");
        server.disk.as_ref().unwrap().clear();
        if kind == Kind::Influx {
            // It takes nothing any more until it is started again, whatever room there is.
            server.kill();
            server.again();
        }
        put_all(&mut *outlet, second..second + 1000);
        assert!(outlet.state().is_ok() && outlet.held() == 0);
        let rows = server.rows("machine");
        let keys: BTreeSet<_> = rows.iter().map(|of| (of.0, &of.1)).collect();
        let expected = 2 * (second + 1000) as usize;
        assert_eq!((rows.len(), keys.len()), (expected, expected), "{kind:?}");
        println!("{kind:?} was full after {second} rows: {why}");
    }
}
