//! A plan through a service: messages with `applies_at` are known ahead, as the engine knows them by itself.

use std::fs;

use super::{FOLLOWED, Folder, KEPT, found, serve_to_the_end, until};

const GRAPH: &str = r#"
schema = 1
[time]
column = "time"
unit = "rfc3339"

[signals.set_point]
unit = "Cel"
channels = ["chuck"]
column = "value"
known_ahead = "10min"
max_age = "1h"

[nodes.recipe]
type = "lag"
inputs.signal = "set_point"
lags = ["-5min", "0s"]

[outputs]
recipe = "recipe"
"#;

/// A row a minute, of which the fourth announces 50 °C for the thirteenth.
fn rows() -> String {
    let row = |minute: usize| {
        let announced = match minute {
            0 => "20.0,2025-01-01T00:00:00Z",
            3 => "50.0,2025-01-01T01:12:00+01:00",
            _ => ",",
        };
        format!("2025-01-01T00:{minute:02}:00Z,{announced}\n")
    };
    "time,value,applies_at\n".to_owned() + &(0..30).map(row).collect::<String>()
}

/// What the service wrote: five minutes ahead, and now.
fn read_ahead(folder: &Folder) -> Vec<[f64; 2]> {
    let found = found(&folder.file("out.csv"));
    let row = |(_, bits): &(String, Vec<u64>)| [f64::from_bits(bits[0]), f64::from_bits(bits[1])];
    found.iter().map(row).collect()
}

fn expected() -> Vec<[f64; 2]> {
    let step = |minute: usize, at: usize| if minute >= at { 50.0 } else { 20.0 };
    let row = |minute| [step(minute, 7), step(minute, 12)];
    (0..30).map(row).collect()
}

#[test]
fn a_plan_that_is_replayed_is_known_ahead() {
    let folder = Folder::new();
    fs::write(folder.file("graph.toml"), GRAPH).unwrap();
    fs::write(folder.file("log.csv"), rows()).unwrap();
    let source = "type = \"replay\"\npath = \"log.csv\"\nspeed = \"fastest\"";
    let (_, events) = serve_to_the_end(folder.start(source, KEPT).unwrap());
    assert_eq!(read_ahead(&folder), expected(), "{events:?}");
}

#[test]
fn a_plan_in_a_file_that_is_followed_is_known_ahead() {
    let folder = Folder::new();
    fs::write(folder.file("graph.toml"), GRAPH).unwrap();
    fs::write(folder.file("log.csv"), rows()).unwrap();
    let mut service = folder.start(FOLLOWED, KEPT).unwrap();
    until("the rows", Some(&mut service), || {
        read_ahead(&folder).len() >= 29
    });
    let (_, events) = service.stop().unwrap();
    assert_eq!(read_ahead(&folder), expected(), "{events:?}");
}
