//! Graph files changed at random are read, compiled or refused: never a panic, never a hang, never an error without a place.
//!
//! The contract: every change of a shipped graph, by bytes, by tokens or by whole sections, gives a plan or errors that all
//! have a place; and a plan is the same as itself. `ATHERMAL_LONG=1` changes a hundred thousand.

use std::path::Path;
use std::time::{Duration, Instant};

use athermal as _;
use athermal::core::compile::{Wanted, compile, compile_part, diff};
use athermal::core::diagnostic::{Diagnostics, Severity, Sources, explain};
use athermal::core::document::{Memory, declare, load};
use athermal::trial;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// Longer than a mutated graph of a few kilobytes can take on any machine, and shorter than a hang.
const TOO_LONG: Duration = Duration::from_secs(10);

const GRAPHS: [&str; 4] = [
    include_str!("../../graphs/die-tester.toml"),
    include_str!("../../graphs/linear-axis.toml"),
    include_str!("../../graphs/z-probe.toml"),
    MODULES,
];

/// What the shipped graphs do not have: modules, several sets, feedback, choices.
const MODULES: &str = r#"
schema = 1
[sets]
side = ["1", "2"]
axis = ["X", "Z"]
[signals.position]
unit = "um"
channels = ["1-X", "1-Z", "2-X", "2-Z"]
max_age = "3min"
range = ["-1 mm", "1 mm"]
[modules.model]
inputs = ["position"]
required = ["lags"]
parameters = { ahead = "5min", window = "5min" }
outputs = { predicted = "vote", drift = "drift:slope" }
nodes.drift = { type = "slope", inputs.signal = "{position}", windows = ["{window}"] }
nodes.ar = { type = "ar", inputs.truth = "drift", ahead = "{ahead}", lags = "{lags}" }
nodes.zero = { type = "zero", inputs.truth = "drift", ahead = "{ahead}" }
nodes.vote = { type = "auto_weighted", inputs.voters = ["ar", "zero"], inputs.truth = "drift", memory = "15min" }
[modules.pair]
inputs = ["position"]
outputs.predicted = "inner"
nodes.inner = { module = "model", inputs.position = "{position}", lags = ["0s", "5min"] }
[nodes.m]
module = "pair"
each = ["side", "axis"]
inputs.position = "position.{side}-{axis}"
[nodes.back]
type = "delay"
inputs.signal = "sum.1-X"
delay = "1 tick"
unit = "um/min"
[nodes.sum]
type = "pick"
inputs.signal = ["m.{1,2}-X", "back"]
[outputs]
all = "m.*"
back = { from = "sum", blend = "5 nm/min/s" }
"#;

const TOKENS: [&str; 44] = [
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    ",",
    "\n",
    "#",
    ":",
    "*",
    "{axis}",
    "{x}",
    "{position}",
    "5",
    "-1e999",
    "nan",
    "\"5min\"",
    "\"-5min\"",
    "\"106751d\"",
    "\"0s\"",
    "\"99999999999999999999 nm\"",
    "false",
    "each",
    "type",
    "module",
    "inputs",
    "each = [\"axis\", \"side\"]\n",
    "extends = \"a.toml\"\n",
    "extends = \"b.toml\"\n",
    "from = \"b.toml\"\n",
    "[[tests]]\n",
    "[nodes.a]\n",
    "\"2 samples\"",
    "\u{b5}",
    "\u{0}",
    "1979-05-27",
    "\"drift\"",
    "\"vote\"",
    "\"Cel\"",
    "\"K\"",
    "ahead = \"-1s\"\n",
];

#[derive(Debug, Clone)]
enum Change {
    /// A byte, whatever it does to the text.
    Byte {
        at: f64,
        to: u8,
    },
    Remove {
        from: f64,
        length: usize,
    },
    Token {
        at: f64,
        token: usize,
    },
    Copy {
        from: f64,
        to: f64,
        length: usize,
    },
    /// The values of two lines are exchanged.
    Values {
        a: f64,
        b: f64,
    },
    /// A line moves elsewhere.
    Line {
        from: f64,
        to: f64,
    },
    /// A section is taken out, or written again elsewhere.
    Section {
        from: f64,
        to: f64,
        stays: bool,
    },
}

fn change() -> impl Strategy<Value = Change> {
    let share = || 0.0..1.0;
    prop_oneof![
        (share(), any::<u8>()).prop_map(|(at, to)| Change::Byte { at, to }),
        (share(), 1..40usize).prop_map(|(from, length)| Change::Remove { from, length }),
        (share(), 0..TOKENS.len()).prop_map(|(at, token)| Change::Token { at, token }),
        (share(), share(), 1..200usize).prop_map(|(from, to, length)| Change::Copy {
            from,
            to,
            length
        }),
        (share(), share()).prop_map(|(a, b)| Change::Values { a, b }),
        (share(), share()).prop_map(|(from, to)| Change::Line { from, to }),
        (share(), share(), any::<bool>()).prop_map(|(from, to, stays)| Change::Section {
            from,
            to,
            stays
        }),
    ]
}

fn at(share: f64, length: usize) -> usize {
    (share * length as f64) as usize
}

fn apply(text: &str, change: &Change) -> String {
    let bytes = |text: Vec<u8>| String::from_utf8_lossy(&text).into_owned();
    let mut raw = text.as_bytes().to_vec();
    if raw.is_empty() {
        return String::new();
    }
    match *change {
        Change::Byte { at: share, to } => {
            let place = at(share, raw.len());
            raw[place] = to;
            bytes(raw)
        }
        Change::Remove { from, length } => {
            let from = at(from, raw.len());
            raw.drain(from..(from + length).min(text.len()));
            bytes(raw)
        }
        Change::Token { at: share, token } => {
            let place = at(share, raw.len());
            raw.splice(place..place, TOKENS[token].bytes());
            bytes(raw)
        }
        Change::Copy { from, to, length } => {
            let from = at(from, raw.len());
            let piece = raw[from..(from + length).min(text.len())].to_vec();
            let to = at(to, raw.len());
            raw.splice(to..to, piece);
            bytes(raw)
        }
        Change::Values { a, b } => {
            let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
            let (a, b) = (at(a, lines.len()), at(b, lines.len()));
            if let (Some((key, value)), Some((other, with))) =
                (lines[a].split_once('='), lines[b].split_once('='))
            {
                (lines[a], lines[b]) = (format!("{key}={with}"), format!("{other}={value}"));
            }
            lines.join("\n")
        }
        Change::Line { from, to } => {
            let mut lines: Vec<_> = text.lines().collect();
            let line = lines.remove(at(from, lines.len()));
            lines.insert(at(to, lines.len()), line);
            lines.join("\n")
        }
        Change::Section { from, to, stays } => {
            let mut sections: Vec<_> = text.split("\n[").collect();
            let from = at(from, sections.len());
            let section = if stays {
                sections[from]
            } else {
                sections.remove(from)
            };
            sections.insert(at(to, sections.len() + 1), section);
            sections.join("\n[")
        }
    }
}

fn holds(text: &str) -> Result<(), TestCaseError> {
    let began = Instant::now();
    let files = Memory::new().with("a.toml", text).with("b.toml", MODULES);
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let document = load(Path::new("a.toml"), &files, &mut sources, &mut diagnostics);
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    let compiled = graph
        .as_ref()
        .map(|graph| compile_part(graph, Wanted::default(), &mut diagnostics));
    let plan = compiled.as_ref().and_then(|made| made.as_ref().ok());
    prop_assert_eq!(plan.is_none(), diagnostics.has_errors());
    match (&graph, &compiled) {
        (Some(graph), Some(Ok(plan))) => {
            let trials = trial::declare(graph, plan, &files, &mut sources, &mut diagnostics);
            prop_assert_eq!(trials.is_none(), diagnostics.has_errors());
        }
        (Some(graph), Some(Err(part))) => {
            trial::mistakes(graph, part, &files, &mut sources, &mut diagnostics);
        }
        _ => {}
    }
    for found in diagnostics
        .iter()
        .filter(|found| found.severity == Severity::Error)
    {
        let fits = found.place.is_some_and(|place| {
            place.start <= place.end && place.end as usize <= sources.text(place.source).len()
        });
        prop_assert!(fits, "{:?}", found);
        prop_assert!(explain(found.code).is_some(), "{}", found.code);
    }
    prop_assert_eq!(
        diagnostics.render(&sources, false, 100).is_empty(),
        diagnostics.is_empty()
    );
    let json = diagnostics.to_json(&sources);
    let listed = json["diagnostics"].as_array().map(Vec::len);
    prop_assert_eq!(listed, Some(diagnostics.len()));
    if let Some(plan) = plan {
        prop_assert!(diff(plan, plan).is_same());
    }
    prop_assert!(began.elapsed() < TOO_LONG, "{:?}", began.elapsed());
    Ok(())
}

#[test]
fn a_changed_graph_gives_a_plan_or_errors_with_places() {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let mut runner = TestRunner::new(Config {
        cases: if is_long { 100_000 } else { 1_000 },
        failure_persistence: None,
        ..Config::default()
    });
    let changes = prop::collection::vec(change(), 1..6);
    runner
        .run(&(0..GRAPHS.len(), changes), |(graph, changes)| {
            let text = changes
                .iter()
                .fold(GRAPHS[graph].to_owned(), |text, change| {
                    apply(&text, change)
                });
            holds(&text)
        })
        .unwrap();
}

#[test]
fn the_unchanged_graphs_have_no_mistake() {
    for text in GRAPHS {
        let files = Memory::new();
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        let document = athermal::core::document::load_text(
            "a.toml",
            text,
            &files,
            &mut sources,
            &mut diagnostics,
        );
        let graph = document.and_then(|document| declare(document, &mut diagnostics));
        let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
        assert!(
            plan.is_some(),
            "{}",
            diagnostics.render(&sources, false, 100)
        );
    }
}

/// The codes of all errors in a graph and its tests.
fn errors(text: &str) -> Vec<&'static str> {
    let files = Memory::new().with("a.toml", text).with("b.toml", MODULES);
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let document = load(Path::new("a.toml"), &files, &mut sources, &mut diagnostics);
    if let Some(graph) = document.and_then(|document| declare(document, &mut diagnostics))
        && let Err(part) = compile_part(&graph, Wanted::default(), &mut diagnostics)
    {
        trial::mistakes(&graph, &part, &files, &mut sources, &mut diagnostics);
    }
    let found = diagnostics.iter();
    let found = found.filter(|found| found.severity == Severity::Error);
    found.map(|found| found.code).collect()
}

#[test]
fn a_mark_that_is_missing_brings_no_mistake_about_but_those_of_the_syntax() {
    const SYNTAX: &str = "A001";
    let mut wrong = 0;
    for graph in GRAPHS {
        for (at, mark) in graph.match_indices(['"', '[', ']', '{', '}', '=', ',', '\n']) {
            let text = [&graph[..at], &graph[at + mark.len()..]].concat();
            let errors = errors(&text);
            // A comment or a text may bear to lose one.
            if !errors.contains(&SYNTAX) {
                continue;
            }
            wrong += 1;
            let line = graph[..at].lines().count();
            let strange = errors.iter().any(|code| *code != SYNTAX);
            assert!(!strange, "{mark:?} in line {line}: {errors:?}\n{text}");
        }
    }
    assert!(wrong > 1_000, "{wrong}");
}

/// Reads and compiles a graph that has mistakes, in which `told` is to be helped with `help`; gives how many errors there are.
fn told_soon(files: &Memory, told: &str, help: &str) -> usize {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let started = Instant::now();
    let document = load(Path::new("a.toml"), files, &mut sources, &mut diagnostics);
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    if let Some(graph) = &graph {
        match compile_part(graph, Wanted::default(), &mut diagnostics) {
            Ok(plan) => drop(trial::declare(
                graph,
                &plan,
                files,
                &mut sources,
                &mut diagnostics,
            )),
            Err(part) => trial::mistakes(graph, &part, files, &mut sources, &mut diagnostics),
        }
    }
    let taken = started.elapsed();
    let one = diagnostics
        .iter()
        .find(|found| found.message.contains(told));
    let found = one.and_then(|found| found.help.as_deref());
    assert_eq!(found, Some(help), "{told}");
    assert!(taken < 3 * TOO_LONG / 4, "{told}: {taken:?}");
    diagnostics.error_count()
}

#[test]
fn thousands_of_unknown_references_are_told_soon() {
    let mut text = "schema = 1\n[signals.t]\nunit = \"Cel\"\nchannels = [\"a\"]\n".to_owned();
    for nth in 0..MANY {
        let node = format!(
            "[nodes.slope_{nth:04}]\ntype = \"slope\"\nwindows = [\"5min\"]\n\
             inputs.signal = [\"slop_{nth:04}\", \"epols_{nth:04}\"]\n"
        );
        text.push_str(&node);
    }
    text.push_str("[outputs]\nfirst = \"slope_0000\"\n");
    let files = Memory::new().with("a.toml", text);
    let errors = told_soon(&files, "slop_0999", "did you mean `slope_0999`?");
    assert_eq!(errors, 2 * MANY);
}

/// How many names there are, and how many more are not there, of each sort of names that a file may have many of.
const MANY: usize = 1_000;

/// A graph of nodes that read a signal, with what each of them has beside its type.
fn of_nodes(before: &str, each: impl Fn(usize) -> String) -> String {
    let nodes = (0..MANY).map(|nth| format!("[nodes.slope_{nth:04}]\n{}\n", each(nth)));
    let nodes: String = nodes.collect();
    format!("schema = 1\n{before}\n{nodes}[outputs]\nfirst = \"slope_0000\"\n")
}

fn slope(signal: &str) -> String {
    format!("type = \"slope\"\nwindows = [\"5min\"]\ninputs.signal = \"{signal}\"")
}

/// So many of something, one after the other.
fn many(one: impl Fn(usize) -> String) -> String {
    (0..MANY).map(one).collect()
}

const PLATE: &str = "[signals.t]\nunit = \"Cel\"\nchannels = [\"plate\"]\n";

fn signal_of_many() -> String {
    let channels = many(|nth| format!("\"plate_{nth:04}\", "));
    format!("[signals.t]\nunit = \"Cel\"\nchannels = [{channels}]\nmax_age = \"1min\"\n")
}

#[test]
fn thousands_of_unknown_channels_are_told_soon() {
    let text = of_nodes(&signal_of_many(), |nth| slope(&format!("t.plat_{nth:04}")));
    let files = Memory::new().with("a.toml", text);
    let errors = told_soon(&files, "plat_0999", "did you mean `plate_0999`?");
    assert_eq!(errors, MANY);

    let optional = many(|nth| format!("\"plat_{nth:04}\", "));
    let signal = signal_of_many() + &format!("optional = [{optional}]\n");
    let files = Memory::new().with("a.toml", format!("schema = 1\n{signal}"));
    told_soon(&files, "plat_0999", "did you mean \"plate_0999\"?");
}

#[test]
fn thousands_of_unknown_channels_of_tests_are_told_soon() {
    let node = slope("t");
    let test = |nth| {
        format!(
            "[[tests]]\nname = \"{nth}\"\ninputs = {{ \"t.plat_{nth:04}\" = {{ start = \"1 Cel\" }} }}\n\
             expect = [{{ of = \"s.plat_{nth:04}\", at = \"1h\", equals = \"1 K/h\" }}]\n"
        )
    };
    let (signal, tests) = (signal_of_many(), many(test));
    let text = format!("schema = 1\n{signal}[nodes.s]\n{node}\n[outputs]\nfirst = \"s\"\n{tests}");
    let files = Memory::new().with("a.toml", text);
    told_soon(&files, "plat_0999", "did you mean `plate_0999`?");
}

#[test]
fn thousands_of_unknown_sets_are_told_soon() {
    let node = slope("t");
    let using = |nth| format!("{node}\neach = \"axs_{nth:04}\"");
    for (members, more) in [("[\"X\"]", 0), ("[]", MANY)] {
        let sets = many(|nth| format!("axis_{nth:04} = {members}\n"));
        let text = of_nodes(&format!("[sets]\n{sets}{PLATE}"), using);
        let files = Memory::new().with("a.toml", text);
        let errors = told_soon(&files, "axs_0999", "did you mean \"axis_0999\"?");
        assert_eq!(errors, MANY + more);
    }
}

#[test]
fn thousands_of_unknown_modules_and_parts_of_modules_are_told_soon() {
    let inner = "inputs = [\"x\"]\nnodes.s = { type = \"slope\", inputs.signal = \"{x}\", windows = [\"5min\"] }\n";
    let modules = many(|nth| format!("[modules.mod_{nth:04}]\n{inner}"));
    let text = of_nodes(&format!("{modules}{PLATE}"), |nth| {
        format!("module = \"md_{nth:04}\"\ninputs.x = \"t\"")
    });
    let files = Memory::new().with("a.toml", text);
    let errors = told_soon(&files, "md_0999", "did you mean \"mod_0999\"?");
    assert_eq!(errors, MANY);

    let instance = "[nodes.i]\nmodule = \"m\"\ninputs.x = \"t\"\n";
    let outputs = many(|nth| format!("outputs.part_{nth:04} = \"s\"\n"));
    let module = format!("[modules.m]\n{inner}{outputs}{PLATE}{instance}");
    let text = of_nodes(&module, |nth| slope(&format!("i:prt_{nth:04}")));
    let files = Memory::new().with("a.toml", text);
    let errors = told_soon(&files, "prt_0999", "did you mean \"part_0999\"?");
    assert_eq!(errors, MANY);

    let nodes = many(|nth| {
        format!(
            "outputs.part_{nth:04} = \"slop_{nth:04}\"\nnodes.slope_{nth:04} = {{ type = \"slope\", \
             inputs.signal = \"slo_{nth:04}\", windows = [\"5min\"] }}\n"
        )
    });
    let text = format!("schema = 1\n[modules.m]\ninputs = [\"x\"]\n{nodes}{PLATE}{instance}");
    let files = Memory::new().with("a.toml", text);
    told_soon(&files, "\"slop_0999\"", "did you mean \"slope_0999\"?");
    told_soon(&files, "\"slo_0999\"", "did you mean \"slope_0999\"?");
}

#[test]
fn thousands_of_nodes_that_are_not_there_to_be_removed_are_told_soon() {
    let removed = many(|nth| format!("nodes.slop_{nth:04} = false\n"));
    let files = Memory::new()
        .with(
            "a.toml",
            format!("schema = 1\nextends = \"b.toml\"\n{removed}"),
        )
        .with("b.toml", of_nodes(PLATE, |_| slope("t")));
    let errors = told_soon(&files, "slop_0999", "did you mean \"slope_0999\"?");
    assert_eq!(errors, MANY);
}
