//! What cannot be exported is named by node, with a way.

use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::time::Duration;
use athermal_export::{ExportError, Options, Rates, export_c, lower};

use crate::support::{made_up, plan, project};

const GRAPH: &str = r#"schema = 1
name = "7 of all"
[sets]
copy = ["b", "c", "d"]
[time]
column = "t"
[signals.temperature]
unit = "Cel"
channels = ["a"]
max_age = "20s"
[signals.position]
unit = "nm"
channels = ["Z"]
max_age = "20s"
[signals.planned]
unit = "Cel"
channels = ["p", "q"]
max_age = "20s"
known_ahead = "60s"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["60s"]
unit = "nm/min"
[nodes.smooth]
type = "moving"
inputs.signal = "temperature"
windows = ["60s"]
[nodes.warm]
type = "slope"
inputs.signal = "temperature"
windows = ["60s"]
[nodes.thermal]
type = "linear"
inputs.features = "warm"
inputs.truth = "drift"
ahead = "60s"
[nodes.nothing]
type = "zero"
inputs.truth = "drift"
ahead = "60s"
[nodes.watch]
type = "page_hinkley"
each = "copy"
inputs.voters = "thermal"
inputs.truth = "drift"
[nodes.ahead]
type = "slope"
inputs.signal = "planned"
windows = ["60s"]
[nodes.filtered]
type = "kalman"
inputs.features = "warm"
inputs.truth = "drift"
ahead = "60s"
[nodes.learner]
type = "rls"
inputs.features = "warm"
inputs.truth = "drift"
ahead = "60s"
[outputs]
smooth = "smooth"
error = "warm:stderr"
r2 = "warm:r2"
filtered = "filtered"
thermal = "thermal"
watch = "watch"
ahead = "ahead"
learner = "learner"
"#;

#[test]
fn all_nodes_that_cannot_be_exported_are_named_each_with_a_way() {
    let engine = Engine::new(plan(GRAPH), &Default::default()).unwrap();
    let options = Options {
        name: Some("math".to_owned()),
        ..Options::default()
    };
    let error = lower(&engine, &options).unwrap_err();
    let ExportError::Nodes(refusals) = &error else {
        panic!("{error}");
    };
    let nodes: Vec<&str> = refusals.iter().map(|of| &*of.node).collect();
    assert_eq!(
        nodes,
        [
            "smooth", "warm", "warm", "thermal", "watch", "filtered", "learner", "planned",
            "7 of all"
        ]
    );
    let text = error.to_string();
    for part in [
        "`smooth`: the kind `moving` of athermal-features cannot be exported; put `first_order` with",
        "`warm`: the port `stderr` of `slope` is read; leave out what reads it",
        "`thermal`: it has not been fitted; fit the graph first",
        "`watch` (3 instances): the kind `page_hinkley` of athermal-combiners cannot be exported; leave it out: errors are watched",
        "`warm`: the port `r2` of `slope` is read",
        "`filtered`: what `kalman` is fitted to is no linear form; put `linear` of the same features in its place",
        "`learner`: it has not been fitted; fit the graph first",
        "`7 of all`: its files and functions cannot be called `math`",
        "`planned` (2 instances): a signal that is known ahead cannot be exported; leave out `known_ahead`",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn a_rate_of_no_signal_and_one_of_nothing_are_refused() {
    let plan = plan(&crate::random::graph(&mut Prng::stream(1, "a graph")));
    let fitted = made_up(&plan, &mut Prng::stream(1, "fits"));
    let engine = Engine::new(plan, &fitted).unwrap();
    let with = |rates| {
        let options = Options {
            rates,
            ..Options::default()
        };
        lower(&engine, &options)
            .map(|form| form.layout.ints)
            .map_err(|error| error.to_string())
    };
    let second = Duration::from_ns(1_000_000_000);
    let error = with(Rates::every(second).with("postion", second)).unwrap_err();
    assert!(
        error.contains("no signal `postion`") && error.contains("position"),
        "{error}"
    );
    let error = with(Rates::every(Duration::ZERO)).unwrap_err();
    assert!(error.contains("above 0"), "{error}");
    let slow = with(Rates::every(second)).unwrap();
    let fast = with(Rates::every(Duration::from_ns(100_000_000))).unwrap();
    assert!(fast > 5 * slow, "{fast} {slow}");
    // Places have 32 bits: a microsecond has no room for minutes, and a nanosecond none for what no number counts.
    for period in [1_000, 1] {
        let error = with(Rates::every(Duration::from_ns(period))).unwrap_err();
        assert!(
            error.contains("bytes, more than there are places for: give the time between two samples with `--rate`"),
            "{error}"
        );
    }
}

#[test]
fn names_become_identifiers() {
    for (name, expected) in [
        ("die-tester", "die_tester"),
        ("7 of all", "g_7_of_all"),
        ("", "g_"),
        ("_Z", "g__z"),
    ] {
        assert_eq!(athermal_export::identifier(name), expected);
    }
}

#[test]
fn names_that_the_runtime_the_build_or_headers_of_c_have_are_refused_with_a_way() {
    let plan = plan(&crate::random::graph(&mut Prng::stream(1, "a graph")));
    let fitted = made_up(&plan, &mut Prng::stream(1, "fits"));
    let engine = Engine::new(plan, &fitted).unwrap();
    let named = |name: &str| {
        let options = Options {
            name: Some(name.to_owned()),
            ..Options::default()
        };
        lower(&engine, &options).map(|form| form.name)
    };
    for name in [
        "athermal rt",
        "AT",
        "at_tick",
        "math",
        "stdio",
        "Features",
        "test",
        "m",
    ] {
        let error = named(name).unwrap_err().to_string();
        let expected = format!("cannot be called `{}`", athermal_export::identifier(name));
        assert!(
            error.contains(&expected) && error.contains("`--name`"),
            "{error}"
        );
    }
    for name in ["attic", "mathematics", "athermal"] {
        assert_eq!(named(name).unwrap(), name);
    }
}

#[test]
fn channels_whose_names_become_the_same_end_in_numbers() {
    let text = GRAPH
        .replace("[\"a\"]", "[\"a-b\", \"a_b\", \"a__b\"]")
        .replace("known_ahead = \"60s\"\n", "");
    let text = text.split("[nodes.smooth]").next().unwrap().to_owned()
        + "[nodes.warm]\ntype = \"lag\"\ninputs.signal = \"temperature\"\nlags = [\"9s\"]\n[outputs]\nwarm = \"warm\"\n";
    let engine = Engine::new(plan(&text), &Default::default()).unwrap();
    let exported = export_c(&engine, &Options::default(), false).unwrap();
    let header = &exported.files[2].text;
    for (nth, name) in ["A_B", "A_B_2", "A__B"].iter().enumerate() {
        let constant = format!("_IN_TEMPERATURE_{name} = {nth}");
        assert!(header.contains(&constant), "{constant}: {header}");
    }
}

#[test]
fn of_every_shipped_graph_all_is_named_that_stands_in_the_way_and_ways_lead_to_graphs_that_are_exported()
 {
    let graphs = std::fs::read_dir(project().join("graphs")).unwrap();
    let mut names: Vec<String> = (graphs.map(|file| file.unwrap().path()))
        .filter(|path| path.extension().is_some_and(|of| of == "toml"))
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    let found = names.iter().map(|name| {
        let path = project().join(format!("graphs/{name}.toml"));
        let plan = plan(&std::fs::read_to_string(path).unwrap());
        let fitted = made_up(&plan, &mut Prng::stream(3, name));
        // What is made up is no fit of what goes on learning.
        let engine = Engine::new(plan.clone(), &fitted);
        let engine = engine
            .or_else(|_| Engine::new(plan, &Default::default()))
            .unwrap();
        (name, lower(&engine, &Options::default()))
    });
    let mut ways = String::new();
    let mut refused = Vec::new();
    for (name, found) in found {
        match found {
            Err(ExportError::Nodes(all)) => {
                refused.push(name.clone());
                all.iter().for_each(|of| ways.push_str(&of.way));
            }
            found => drop(found.unwrap()),
        }
    }
    let named = names
        .iter()
        .filter(|name| ways.contains(&format!("`{name}`")));
    let named: Vec<&String> = named.collect();
    assert!(!named.is_empty(), "{ways}");
    assert!(!named.iter().any(|name| refused.contains(name)), "{ways}");
    // The page has the same graphs.
    let page = std::fs::read_to_string(project().join("docs/src/export-c.md")).unwrap();
    let (_, table) = page
        .split_once("| graph | kinds that are not exported |")
        .unwrap();
    let rows = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'));
    let first = rows.map(|row| row.split('|').nth(1).unwrap());
    let mut of_page: Vec<&str> = first
        .flat_map(|cell| cell.split('`').skip(1).step_by(2))
        .collect();
    of_page.sort_unstable();
    assert_eq!(refused, of_page);
}
