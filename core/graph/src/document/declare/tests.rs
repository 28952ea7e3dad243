use std::path::Path;

use super::declare;
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::{
    Arrangement, DecimalMark, Encoding, GraphFile, Memory, TableFormat, TimeBase, TimeForm,
    load_text,
};
use crate::time::Duration;

const SECOND: i64 = 1_000_000_000;

fn graph(text: &str) -> GraphFile {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let text = format!("schema = 1\n{text}");
    let document = load_text(
        Path::new("a.toml"),
        text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    );
    document
        .and_then(|document| declare(document, &mut diagnostics))
        .filter(|_| !diagnostics.has_errors())
        .unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 120)))
}

fn time(text: &str) -> (String, TimeForm) {
    let TimeBase::Column { column, form, .. } = graph(text).time;
    (column.to_string(), form)
}

#[test]
fn time_is_in_seconds_unless_the_file_says_otherwise() {
    let numbers = |ns| TimeForm::Numbers {
        unit: Duration::from_ns(ns),
    };
    assert_eq!(time(""), ("time_s".to_owned(), numbers(SECOND)));
    assert_eq!(
        time("[time]\ncolumn = \"t\""),
        ("t".to_owned(), numbers(SECOND))
    );
    assert_eq!(
        time("[time]\nunit = \"ms\""),
        ("time_ms".to_owned(), numbers(SECOND / 1_000))
    );
    assert_eq!(
        time("[time]\nunit = \"rfc3339\""),
        ("time".to_owned(), TimeForm::Rfc3339)
    );
    assert_eq!(
        time("[time]\ncolumn = \"{Date}T{Time}Z\"\nunit = \"rfc3339\""),
        ("{Date}T{Time}Z".to_owned(), TimeForm::Rfc3339)
    );
    let format = "%d.%m.%Y %H:%M";
    assert_eq!(
        time(&format!("[time]\nformat = \"{format}\"")),
        ("time".to_owned(), TimeForm::Format(format.parse().unwrap()))
    );
}

#[test]
fn a_step_or_the_unit_sample_makes_a_sample_base() {
    let step = Duration::from_ns(80_000_000);
    assert_eq!(
        time("[time]\ncolumn = \"n\"\nstep = \"0.08s\""),
        ("n".to_owned(), TimeForm::Samples { step: Some(step) })
    );
    assert_eq!(
        time("[time]\nunit = \"sample\""),
        ("sample".to_owned(), TimeForm::Samples { step: None })
    );
    assert_eq!(
        graph("[time]\nunit = \"sample\"").time.sample(),
        Some(Duration::from_ns(SECOND))
    );
    assert_eq!(graph("").time.sample(), None);
}

#[test]
fn samples_become_durations_wherever_they_stand() {
    let text = "\n[signals.p]\nunit = \"nm\"\nchannels = [\"a\"]\nmax_age = \"2 samples\"\n[nodes.n]\ntype = \"x\"\n\
        inputs.y = { from = \"p\", max_age = \"1 sample\" }\nlags = [\"0 samples\", \"3 samples\"]\ninner.by = \"1 sample\"";
    for (base, sample) in [
        ("[time]\nunit = \"sample\"", SECOND),
        ("[time]\nstep = \"0.08s\"", 80_000_000),
    ] {
        let graph = graph(&format!("{base}{text}"));
        let samples = |number: i64| Duration::from_ns(number * sample);
        assert_eq!(graph.signals[0].max_age, Some(samples(2)));
        let instance = &graph.nodes[0].instances[0];
        assert_eq!(
            instance.inputs[0].max_age.map(|(age, _)| age),
            Some(samples(1))
        );
        let expected = serde_json::json!({
            "lags": [samples(0), samples(3)],
            "inner": { "by": samples(1) },
        });
        assert_eq!(instance.parameters.to_json(), expected);
    }
}

#[test]
fn a_member_may_be_a_number_of_samples_or_of_minutes() {
    let graph = graph(
        "[sets]\nn = [\"1\", \"2\"]\n[time]\nstep = \"10s\"\n[signals.p]\nunit = \"nm\"\nchannels = [\"a\"]\n\
         [nodes.x]\ntype = \"x\"\neach = \"n\"\ninputs.y = { from = \"p\", max_age = \"{n} samples\" }\n\
         inputs.z = { from = \"p\", max_age = \"{n}min\" }\nlags = [\"{n} samples\", \"1 sample\"]",
    );
    let seconds = |number: i64| Duration::from_ns(number * SECOND);
    for (nth, instance) in (1..).zip(&graph.nodes[0].instances) {
        let lags = serde_json::json!({ "lags": [seconds(10 * nth), seconds(10)] });
        assert_eq!(instance.parameters.to_json(), lags);
        let ages = instance.inputs.iter().map(|input| input.max_age);
        let ages: Vec<_> = ages.map(|age| age.map(|(age, _)| age)).collect();
        assert_eq!(ages, [Some(seconds(10 * nth)), Some(seconds(60 * nth))]);
    }
}

#[test]
fn two_sets_make_their_product_the_first_slowest() {
    let graph = graph(
        "[sets]\nside = [\"1\", \"2\"]\naxis = [\"X\", \"Y\"]\n[nodes.n]\ntype = \"x\"\neach = [\"side\", \"axis\"]\n\
         inputs.y = [\"p.{axis}{side}\", \"q.{a,b}\"]\nlabel = \"{side}/{axis}\"",
    );
    let node = &graph.nodes[0];
    assert_eq!(node.each, ["side", "axis"]);
    let members: Vec<&str> = node
        .instances
        .iter()
        .filter_map(|instance| instance.member.as_deref())
        .collect();
    assert_eq!(members, ["1-X", "1-Y", "2-X", "2-Y"]);
    let third = &node.instances[2];
    let references: Vec<&str> = third.inputs[0]
        .references
        .iter()
        .map(|(text, _)| text.as_str())
        .collect();
    assert_eq!(references, ["p.X2", "q.{a,b}"]);
    assert_eq!(
        third.parameters.to_json(),
        serde_json::json!({ "label": "2/X" })
    );
}

#[test]
fn a_range_is_given_in_the_unit_of_its_signal() {
    let graph =
        graph("[signals.t]\nunit = \"Cel\"\nchannels = [\"a\"]\nrange = [\"0 K\", \"212 degF\"]");
    assert_eq!(graph.signals[0].range, Some((-273.15, 100.0)));
}

#[test]
fn deployment_sections_are_handed_on_as_they_stand() {
    let graph = graph(
        "model = \"m.json\"\n[sources.b]\nx = 1\n[sinks.a]\ny = 2\n[runtime]\nz = 3\n[[tests]]\nname = \"t\"",
    );
    assert_eq!(
        graph.deployment.keys().collect::<Vec<_>>(),
        ["sources", "sinks", "model", "runtime"]
    );
    assert_eq!(
        graph.tests.map(|tests| tests.to_json()),
        Some(serde_json::json!([{ "name": "t" }]))
    );
}

#[test]
fn an_output_may_be_blended() {
    let graph = graph(
        "[outputs]\na = \"x\"\nb = [\"x\", \"y:p.c\"]\nc = { from = \"x\", blend = \"5 nm/s\" }",
    );
    assert_eq!(
        graph.outputs[1]
            .from
            .iter()
            .map(|(text, _)| text.as_str())
            .collect::<Vec<_>>(),
        ["x", "y:p.c"]
    );
    assert_eq!(
        graph.outputs[2]
            .blend
            .as_ref()
            .map(|(rate, _)| rate.to_string())
            .as_deref(),
        Some("5 nm/s")
    );
    assert_eq!(graph.outputs[0].blend, None);
}

#[test]
fn a_table_is_declared_whole_and_changed_for_some_files() {
    let table = graph(
        "[table]\nseparator = \"\\t\"\ndecimal = \",\"\nencoding = \"windows-1252\"\nskip = 3\nnames = 2\nunits = 4\n\
         segment = \"day\"\nlenient = true\n\
         [[table.files]]\nmatch = \"temp*.csv\"\nskip = 0\nlayout = \"long\"\nname = \"tag\"\nvalue = \"val\"",
    )
    .table;
    let base = table.of("position.csv");
    assert_eq!(base.separator.map(|of| of.0), Some(b'\t'));
    assert_eq!(base.decimal, Some(DecimalMark::Comma));
    assert_eq!(base.encoding, Some(Encoding::Windows1252));
    assert_eq!(
        (base.skip, base.names, base.units),
        (Some(3), Some(2), Some(4))
    );
    assert_eq!((base.segment.as_deref(), base.lenient), (Some("day"), true));
    let long = TableFormat {
        skip: Some(0),
        layout: Arrangement::Long,
        name: Some("tag".to_owned()),
        value: Some("val".to_owned()),
        ..base.clone()
    };
    assert_eq!(*table.of("temp-2.csv"), long);
    assert_eq!(*graph("").table.of("a.csv"), TableFormat::default());
}

/// The diagnostics of a graph, each as its line and its code.
fn mistakes(text: &str) -> Vec<String> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let text = format!("schema = 1\n{text}");
    let document = load_text(
        Path::new("a.toml"),
        text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    );
    declare(document.unwrap(), &mut diagnostics);
    let text = diagnostics.render(&sources, false, 120);
    let codes = text.lines().filter_map(|line| line.strip_prefix("error["));
    let places = text.lines().filter_map(|line| line.split_once("a.toml:"));
    let pairs = codes.zip(places);
    let pairs = pairs.map(|(code, (_, at))| {
        let line = at.split(':').next().unwrap();
        format!("{line} {}", code.split(']').next().unwrap())
    });
    pairs.collect()
}

#[test]
fn each_mistake_in_a_table_is_reported_at_its_place() {
    for (text, expected) in [
        ("skp = 1", &["3 A006"][..]),
        ("separator = \"ab\"", &["3 A010"]),
        ("decimal = \";\"", &["3 A009"]),
        ("encoding = \"utf-9\"", &["3 A009"]),
        ("name = \"tag\"", &["3 A010"]),
        ("names = 0", &["3 A010"]),
        ("files = 1", &["3 A008"]),
        ("only = \"A\"", &["3 A010"]),
        ("rename = { a = \"c\", b = \"c\" }", &["3 A010"]),
        (
            "[[table.files]]\nmatch = \"a\"\nunits = 1\n\
             [[table.files]]\nlayout = \"long\"\nname = \"a\"",
            &["5 A010", "6 A007", "6 A007"],
        ),
    ] {
        assert_eq!(mistakes(&format!("[table]\n{text}")), expected, "{text}");
    }
}

#[test]
fn a_section_that_nothing_reads_is_refused_by_its_name() {
    let refused = |section: &str| {
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        let text = format!("schema = 1\n[{section}]\nport = \"many\"\n");
        let path = Path::new("a.toml");
        let document = load_text(path, text, &Memory::new(), &mut sources, &mut diagnostics);
        document.and_then(|document| declare(document, &mut diagnostics));
        diagnostics.render(&sources, false, 120)
    };
    for section in ["page", "alarms", "alarm"] {
        let text = refused(section);
        let words = format!("a graph file has no key \"{section}\"");
        assert!(text.contains(&words), "{text}");
        assert!(!text.replace(&words, "").contains("alarms\""), "{text}");
    }
    // No crate that reads others is linked here.
    assert_eq!(refused("runtime"), "");
}
