//! That the page on JSON (`docs/src/json.md`) names every key that the commands print, and none that never comes.

mod messages;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::workbench::{Graph, Scratch, athermal, athermal_on, graph};
use athermal::Duration;
use athermal::serve::connector::{ConnectorError, Seen};
use athermal::serve::deployment::Found;
use serde_json::Value;

/// What the logs here do not bring about: a sensor that cannot be tried since a node takes it for dead.
const RARE: [&str; 8] = [
    "untold[].sensor",
    "untold[].estimator",
    "untold[].silent",
    "learners[].node",
    "learners[].learner",
    "learners[].too_few",
    "learners[].worse",
    "learners[].silence",
];

/// A row of a table: keys, whether names that nobody knows beforehand stand below them, and the section whose keys do.
#[derive(Debug)]
struct Row {
    keys: Vec<String>,
    open: bool,
    below: Option<String>,
}

/// The tables of the page, by the anchors of their headings.
struct Page(BTreeMap<String, Vec<Row>>);

/// What a section says of paths: of each the row that lists it, and below which anything may stand.
#[derive(Debug, Default)]
struct Listed {
    paths: BTreeMap<String, (String, String)>,
    open: BTreeSet<String>,
}

impl Page {
    fn read() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src/json.md");
        let text = std::fs::read_to_string(path).unwrap();
        let (mut sections, mut section) = (BTreeMap::<String, Vec<Row>>::new(), String::new());
        for line in text.lines() {
            if let Some(heading) = line.strip_prefix('#') {
                let heading = heading.trim_start_matches('#').trim().replace('`', "");
                section = heading.to_lowercase().replace(' ', "-");
            }
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            if cells.len() != 5 || cells[1] == "key" || cells[1].starts_with("---") {
                continue;
            }
            let keys = cells[1].split('`').skip(1).step_by(2);
            let link = cells[3].split_once("](#").map(|(_, rest)| rest);
            let below = link.and_then(|rest| rest.split_once(')'));
            sections.entry(section.clone()).or_default().push(Row {
                keys: keys.map(str::to_owned).collect(),
                open: cells[1].contains('…'),
                below: below.map(|(anchor, _)| anchor.to_owned()),
            });
        }
        Self(sections)
    }

    fn listed(&self, section: &str) -> Listed {
        let mut listed = Listed::default();
        self.list(section, "", &mut listed);
        listed
    }

    fn list(&self, section: &str, above: &str, listed: &mut Listed) {
        let rows = self.0.get(section);
        for row in rows.unwrap_or_else(|| panic!("there is no section `{section}`")) {
            for key in &row.keys {
                let path = format!("{above}{key}");
                let plain = path.trim_end_matches("[]").to_owned();
                if row.open {
                    listed.open.insert(format!("{plain}."));
                }
                let origin = (section.to_owned(), key.clone());
                listed.paths.entry(plain).or_insert(origin);
                if let Some(below) = &row.below {
                    self.list(below, &format!("{path}."), listed);
                }
            }
            if let (true, Some(below)) = (row.keys.is_empty(), &row.below) {
                self.list(below, above, listed);
            }
        }
    }
}

impl Listed {
    /// Whether a path is listed, stands above one that is, or below one that is open.
    fn knows(&self, path: &str) -> bool {
        let is_above = |of: &String| {
            let rest = of.strip_prefix(path);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        self.paths.keys().any(is_above) || self.open.iter().any(|open| path.starts_with(open))
    }
}

/// All keys of a value, each with its place.
fn paths(of: &Value, above: &str, found: &mut BTreeSet<String>) {
    match of {
        Value::Object(table) => {
            for (key, value) in table {
                let dot = if above.is_empty() { "" } else { "." };
                let path = format!("{above}{dot}{key}");
                paths(value, &path, found);
                found.insert(path);
            }
        }
        Value::Array(list) => list
            .iter()
            .for_each(|of| paths(of, &format!("{above}[]"), found)),
        _ => {}
    }
}

/// Half a day of the die tester with sensors that fail, dated, in two files of which the second begins before the first ends; and
/// without them.
fn recordings(scratch: &Scratch) -> (PathBuf, [PathBuf; 2]) {
    let simulated = |name: &str, seed: &str, faults: &[&str]| {
        let output = scratch.path(name);
        let of = ["simulate", "die-tester", "--days", "0.5", "--seed", seed];
        let mut arguments: Vec<&dyn AsRef<OsStr>> = of.iter().map(|of| of as _).collect();
        arguments.extend([&"-o" as &dyn AsRef<OsStr>, &output]);
        for fault in faults {
            arguments.extend([&"--fault" as &dyn AsRef<OsStr>, fault]);
        }
        athermal(&arguments).ended(0);
        output
    };
    let sound = simulated("sound.csv", "1", &[]);
    let faulty = [
        "temperature.plate1=stuck,from=2h,for=4h",
        "temperature.room=missing,from=5h,for=3h",
        "temperature.plate2=offset,from=9h,for=5min,size=150 K",
    ];
    let faulty = simulated("faulty.csv", "2", &faulty);
    let text = std::fs::read_to_string(faulty).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let dated = |row: &str| {
        let (time_s, rest) = row.split_once(',').unwrap();
        let time_s: f64 = time_s.parse().unwrap();
        format!("{:.1},{rest}\n", 1_700_000_000.0 + time_s)
    };
    let rows: Vec<String> = rows.lines().map(dated).collect();
    let part =
        |name: &str, rows: &[String]| scratch.file(name, format!("{header}\n{}", rows.concat()));
    let two = [
        part("one.csv", &rows[..3000]),
        part("two.csv", &rows[2900..]),
    ];
    (sound, two)
}

/// A graph whose combiner goes by more truths than there are, and one that is seldom there; and its log.
fn scarce(scratch: &Scratch) -> (PathBuf, PathBuf) {
    let text = Graph::named("scarce")
        .time("s")
        .signal("out", "V", "y", "20s")
        .with("column = '{channel}'")
        .model("often", "ar", "", "out.y", "10s")
        .with("lags = ['0s']")
        .model("seldom", "ar", "", "out.y", "10s")
        .with("lags = ['700s']")
        .section(
            "nodes.bounds",
            "type = 'conformal'; inputs.prediction = 'often'",
        )
        .with("inputs.truth = 'out.y'; coverage = 0.999; memory = '1h'")
        .outputs("often = 'often'; seldom = 'seldom'; bounds = 'bounds'");
    let rows = (0..100).map(|nth| {
        let size = if nth < 75 { 5.0 } else { 0.1 };
        format!("{},{:.4}\n", 10 * nth, size * (0.8 * f64::from(nth)).sin())
    });
    let rows: String = rows.collect();
    let log = scratch.file("scarce.csv", format!("s,y\n{rows}"));
    (scratch.file("scarce.toml", text), log)
}

/// A model of every kind that has something of its own to tell, on four hundred made-up rows.
fn many_kinds(scratch: &Scratch) -> PathBuf {
    let mut text = r#"schema = 1
name = "kinds"
time.column = "s"
signals.x = { unit = "K", channels = ["a", "b"], max_age = "1s" }
signals.y = { unit = "nm", channels = ["y"], max_age = "1s" }
[outputs]
level = "level"
"#
    .to_owned();
    for (name, node) in [
        ("level", "type = \"kalman\"\ninputs.features = \"x\""),
        (
            "noise",
            "type = \"arimax\"\nna = 1\nnc = 1\ninputs.features = \"x\"",
        ),
        (
            "products",
            "type = \"narx\"\nlags = [\"1s\"]\ninputs.features = \"x\"",
        ),
        (
            "powers",
            "type = \"polynomial\"\nsquares = true\ninputs.features = \"x\"",
        ),
        ("own", "type = \"ar\"\nlags = [\"1s\", \"2s\"]"),
    ] {
        writeln!(
            text,
            "[nodes.{name}]\n{node}\ninputs.truth = \"y.y\"\nahead = \"0s\""
        )
        .unwrap();
    }
    let mut rows = "s,a,b,y\n".to_owned();
    let mut y = 0.0;
    for second in 0..400 {
        let t = f64::from(second);
        let (a, b) = ((0.11 * t).sin() + (0.37 * t).cos(), (0.23 * t).sin());
        y = 0.6 * y + 3.0 * a - b + a * b + 0.1 * (1.7 * t * t).sin();
        writeln!(rows, "{t},{a},{b},{y}").unwrap();
    }
    let graph = scratch.file("kinds.toml", text);
    let (log, model) = (scratch.file("kinds.csv", rows), scratch.path("kinds.json"));
    athermal_on("fit", &graph, &log, &[&"-o", &model, &"-q"]).ended(0);
    model
}

/// The words that diagnose the log of many kinds, cut into one of its temperatures and one of its truth.
fn two_loggers(scratch: &Scratch, model: &Path) -> [std::ffi::OsString; 6] {
    let rows = std::fs::read_to_string(scratch.path("kinds.csv")).unwrap();
    let columns = |of: [usize; 2]| {
        let row = |row: &str| {
            let cells: Vec<&str> = row.split(',').collect();
            format!("{},{}\n", cells[0], cells[of[0]..=of[1]].join(","))
        };
        rows.lines().map(row).collect::<String>()
    };
    let (one, other) = (
        scratch.file("kinds-x.csv", columns([1, 2])),
        scratch.file("kinds-y.csv", columns([3, 3])),
    );
    let words: [&dyn AsRef<OsStr>; 6] = [&"diagnose", &model, &"--merge", &"--data", &one, &other];
    words.map(|word| word.as_ref().to_owned())
}

/// Tests of every kind of expectation, some of which do not hold.
fn tests(scratch: &Scratch) -> PathBuf {
    let text = r#"schema = 1
signals.position = { unit = "nm", channels = ["z"], max_age = "3min" }
nodes.still = { type = "zero", inputs.truth = "position.z", ahead = "10s" }
outputs.still = "still"
[[tests]]
name = "a ramp"
inputs = { "position.z" = { ramp = "1 nm/s", for = "5min", every = "2s" } }
expect = [
  { of = "position.z", equals = "3 nm", within = 1e-6 },
  { of = "position.z", between = ["0 nm", "1 um"] },
  { of = "position.z", absent = true },
  { of = "still", rmse_below = "1 nm", beats = ["persistence"] },
  { of = "still", given_above = 0.99 },
]
"#;
    scratch.file("tests.toml", text)
}

/// What the commands print, each with the section of the page that it belongs to.
fn printed(scratch: &Scratch) -> Vec<(&'static str, Value)> {
    let json = |arguments: &[&dyn AsRef<OsStr>]| {
        let mut all = arguments.to_vec();
        all.extend([&"--format" as &dyn AsRef<OsStr>, &"json"]);
        athermal(&all).json()
    };
    let (sound, [one, two]) = recordings(scratch);
    let pages = "core/serve/src/deployment/pages";
    let service = format!("{}/{pages}/A207-right.toml", env!("CARGO_MANIFEST_DIR"));
    let several = scratch.file(
        "several.toml",
        format!(
            r#"schema = 1
extends = {:?}
tests = []
[sets]
axis = ["Z1"]
sensor = ["room", "chuck"]
[nodes.side]
type = "linear"
each = ["sensor", "axis"]
inputs.features = "gradients.{{sensor}}@*"
inputs.truth = "drift.{{axis}}"
ahead = "150s"
[nodes.wait]
type = "settled"
inputs.loss = "loss"
inputs.set_point = "temperature.chuck"
below = "0.5 dB"
change = "3 K"
[nodes.again]
type = "remeasure"
inputs.std_dev = {{ from = "rate:std_dev", max_age = "1min" }}
tolerance = "200 nm"
longest = "1h"
[outputs]
side = "side"
again = "again"
wait = "wait"
"#,
            graph("die-tester-compensate")
        ),
    );
    let model = scratch.path("model.json");
    athermal_on("fit", &several, &sound, &[&"-o", &model, &"-q"]).ended(0);
    let (scarce, few) = scarce(scratch);
    let of_few = scratch.path("few.json");
    athermal_on("fit", &scarce, &few, &[&"-o", &of_few, &"-q"]).ended(0);
    let wrong = scratch.file("wrong.toml", "schema = 1\nnodes.a = { type = \"slop\" }\n");
    let (made, starter) = (scratch.path("made.csv"), scratch.path("starter.toml"));
    let kinds = many_kinds(scratch);
    let text = std::fs::read_to_string(&scarce).unwrap();
    let otherwise = scratch.file(
        "otherwise.toml",
        text.replace("unit = \"V\"", "unit = \"K\""),
    );
    let data = [&"--data" as &dyn AsRef<OsStr>, &one, &two];
    let with = |command: &'static str, more: &[&'static str]| {
        let mut arguments: Vec<&dyn AsRef<OsStr>> = vec![&command, &model];
        arguments.extend(data);
        arguments.extend(more.iter().map(|of| of as &dyn AsRef<OsStr>));
        json(&arguments)
    };
    let told = messages::by_runs(scratch, &model, [&one, &two]);
    let told = told.into_iter().map(|told| ("what-a-run-reports", told));
    let printed = vec![
        ("evaluate", with("evaluate", &[])),
        (
            "evaluate",
            with("evaluate", &["--abs-truth-below", "1e-9 nm/min"]),
        ),
        ("evaluate", json(&[&"evaluate", &of_few, &"--data", &few])),
        ("diagnose", with("diagnose", &["--window", "--day", "4h"])),
        (
            "diagnose",
            json(&two_loggers(scratch, &kinds).each_ref().map(|of| of as _)),
        ),
        ("report", with("report", &[])),
        (
            "compare",
            json(&[&"compare", &several, &"--data", &sound, &"--on", &one, &two]),
        ),
        (
            "compare",
            json(&[&"compare", &several, &"--data", &one, &two, &"--on", &sound]),
        ),
        (
            "compare",
            json(&[&"compare", &scarce, &"--data", &few, &"--on", &few]),
        ),
        ("show", json(&[&"show", &kinds])),
        ("check", json(&[&"check", &several, &wrong])),
        ("check", looked_at()),
        ("nodes", json(&[&"nodes"])),
        ("nodes", json(&[&"nodes", &"csv"])),
        ("a-node-type", json(&[&"nodes", &"slope"])),
        ("init", json(&[&"init", &sound, &"-o", &starter])),
        (
            "simulate",
            json(&[&"simulate", &"die-tester", &"--days", &"0.01", &"-o", &made]),
        ),
        ("simulate", json(&[&"simulate"])),
        ("test", json(&[&"test", &tests(scratch)])),
        ("diff", json(&[&"diff", &several, &scarce])),
        ("diff", json(&[&"diff", &scarce, &otherwise])),
        ("explain", json(&[&"explain"])),
        ("explain", json(&[&"explain", &"A048"])),
        ("explain", json(&[&"explain", &service])),
    ];
    printed.into_iter().chain(told).collect()
}

/// What `check --live` prints of sources: one that has a channel, and one that cannot be asked.
fn looked_at() -> Value {
    let seen = Seen {
        channel: 0,
        value: Some(21.0),
        quality: "good".to_owned(),
        stamp: Some("2026-01-01T00:00:00Z".to_owned()),
        offset: Some(Duration::from_secs_f64(0.1).unwrap()),
        granted: "QoS 1".to_owned(),
    };
    let of = |channels| Found {
        role: "source",
        name: "line".to_owned(),
        channels,
        missing: 0,
    };
    let there = of(Ok(vec![("plate".to_owned(), "a/b".to_owned(), seen)]));
    let away = of(Err(ConnectorError::new("refused")));
    let out = Found {
        role: "sink",
        ..of(Ok(Vec::new()))
    };
    serde_json::json!({ "live": [there.to_json(), away.to_json(), out.to_json()] })
}

#[test]
fn the_page_on_json_names_every_key_that_is_printed_and_none_that_never_comes() {
    let page = Page::read();
    let scratch = Scratch::new("json-page");
    let (mut unknown, mut came) = (BTreeSet::new(), BTreeSet::new());
    let mut promised: BTreeSet<(String, String)> = BTreeSet::new();
    for (section, told) in printed(&scratch) {
        let listed = page.listed(section);
        let mut found = BTreeSet::new();
        paths(&told, "", &mut found);
        for path in found {
            if let Some(origin) = listed.paths.get(&path) {
                came.insert(origin.clone());
            } else if !listed.knows(&path) {
                unknown.insert(format!("{section}: {path}"));
            }
        }
        promised.extend(listed.paths.into_values());
    }
    assert!(
        unknown.is_empty(),
        "not in docs/src/json.md:\n{}",
        unknown.into_iter().collect::<Vec<_>>().join("\n")
    );
    let is_rare = |key: &str| RARE.iter().any(|rare| key.ends_with(rare));
    let never = promised.difference(&came);
    let never: Vec<_> = never.filter(|(_, key)| !is_rare(key)).collect();
    assert!(
        never.is_empty(),
        "in docs/src/json.md and never printed: {never:#?}"
    );
}

#[test]
fn every_section_of_the_page_on_json_is_that_of_a_command_or_used_by_one() {
    let page = Page::read();
    let commands = [
        "evaluate", "compare", "diagnose", "report", "show", "check", "run", "nodes", "init",
        "simulate", "test", "diff", "explain",
    ];
    let links = page.0.values().flatten();
    let links: BTreeSet<&str> = links.filter_map(|row| row.below.as_deref()).collect();
    for section in page.0.keys() {
        assert!(
            commands.contains(&&**section) || links.contains(&**section),
            "{section}"
        );
    }
    for of in commands {
        assert!(page.0.contains_key(of), "{of}");
    }
}
