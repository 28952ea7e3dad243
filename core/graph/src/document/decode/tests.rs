use serde::Deserialize;

use super::*;
use crate::diagnostic::Sources;
use crate::document::tree::Data;
use crate::document::{Memory, load_text};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Parameters {
    ahead: Duration,
    unit: Unit,
    lags: Vec<Duration>,
    alpha: f64,
    below: Option<Quantity>,
    method: Option<Method>,
    folds: Option<u32>,
    solver: Option<Solver>,
    windows: Option<Windows>,
    shape: Option<Shape>,
    selection: Option<Selection>,
    stages: Option<Vec<Selection>>,
    pair: Option<(f64, f64)>,
    #[serde(default)]
    quiet: bool,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Method {
    Forward,
    Backward,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Solver {
    Ridge { alpha: f64 },
    Sgd { rate: f64, every: Option<Duration> },
    Searched { alpha: Searched },
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "by", rename_all = "snake_case", deny_unknown_fields)]
enum Searched {
    Error { folds: u32 },
    Score,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Windows {
    List(Vec<Duration>),
    Range { shortest: Duration, steps: u32 },
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Shape {
    Flat,
    Round { radius: f64 },
    Power(f64),
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Selection {
    folds: u32,
    tolerance: f64,
    method: Method,
}

fn read(text: &str) -> (Option<Parameters>, String) {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let text = format!("schema = 1\n[node]\n{text}");
    let document = load_text(
        "a.toml",
        text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    )
    .expect("the text is TOML");
    let node = document
        .tree
        .as_table()
        .and_then(|tree| tree.get("node"))
        .expect("the text has a node");
    let parameters = decode(node, "node \"n\"", &mut diagnostics);
    assert_eq!(parameters.is_none(), diagnostics.has_errors());
    (
        parameters,
        format!("\n{}", diagnostics.render(&sources, false, 120)),
    )
}

/// All that a table that is complete but for `text` may mean, and what was left out.
fn readings(text: &str) -> (Vec<Parameters>, LeftOut) {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let complete = "ahead = \"5min\"\nunit = \"nm\"\nlags = []\nalpha = 1\n";
    let text = format!("schema = 1\n{complete}{text}");
    let files = Memory::new();
    let document = load_text("a.toml", text, &files, &mut sources, &mut diagnostics);
    let mut tree = document.expect("the text is TOML").tree;
    if let Data::Table(table) = &mut tree.data {
        table.remove("schema");
    }
    let read =
        decode_rest::<Parameters>(&tree, "node \"n\"", &["each"], &|_| None, &mut diagnostics);
    let read = read.expect("something can be read");
    assert_eq!(diagnostics.error_count(), 1);
    let left_out = read.left_out().clone();
    (read.readings().cloned().collect(), left_out)
}

#[test]
fn a_misspelt_choice_leaves_what_stands_beside_it_to_be_looked_at() {
    let (read, left_out) = readings("solver = { type = \"rigde\", alpha = 2 }");
    assert_eq!(read.len(), 1);
    assert_eq!(read[0].solver, Some(Solver::Ridge { alpha: 2.0 }));
    assert!(left_out.explains("solver.type") && left_out.explains("solver"));
    assert!(!left_out.explains("solver.alpha"));
}

#[test]
fn a_choice_that_is_none_may_be_any_with_which_the_rest_can_be_read() {
    let (read, _) = readings("solver = { type = 5, rate = 2 }");
    let every = None;
    assert_eq!(read.len(), 1);
    assert_eq!(read[0].solver, Some(Solver::Sgd { rate: 2.0, every }));

    let (read, left_out) =
        readings("selection = { folds = 1, tolerance = 2, method = \"sideways\" }");
    let methods = read.iter().filter_map(|one| one.selection.as_ref());
    let methods: Vec<_> = methods.map(|selection| &selection.method).collect();
    assert_eq!(methods, [&Method::Forward, &Method::Backward]);
    assert!(!left_out.explains("selection.folds"));

    // No choice has both.
    let (read, left_out) = readings("solver = { type = 5, alpha = 1, rate = 2 }");
    assert_eq!(read[0].solver, None);
    assert!(left_out.explains("solver.alpha"));
}

/// The mistakes of a table that is complete but for `text`.
fn mistakes(text: &str) -> String {
    let complete = "ahead = \"5min\"\nunit = \"nm\"\nlags = []\nalpha = 1\n";
    let (parameters, report) = read(&format!("{complete}{text}"));
    assert_eq!(parameters, None);
    report
}

#[test]
fn a_table_without_mistakes_is_read() {
    let (parameters, report) = read(
        "ahead = \"5min\"\nunit = \"nm/min\"\nlags = [\"0s\", \"5min\"]\nalpha = 1\nbelow = \"150 nm/min\"\nmethod = \"forward\"\nfolds = 3\n\
         solver = { type = \"ridge\", alpha = 2 }\nwindows = { shortest = \"150s\", steps = 4 }\nshape = { round = { radius = 2.5 } }\n\
         pair = [1, 2.5]\nquiet = true",
    );
    assert_eq!(report, "\n");
    let five_minutes = Duration::from_ns(300_000_000_000);
    assert_eq!(
        parameters,
        Some(Parameters {
            ahead: five_minutes,
            unit: Unit::parse("nm/min").expect("it is a unit"),
            lags: vec![Duration::ZERO, five_minutes],
            alpha: 1.0,
            below: "150 nm/min".parse().ok(),
            method: Some(Method::Forward),
            folds: Some(3),
            solver: Some(Solver::Ridge { alpha: 2.0 }),
            windows: Some(Windows::Range {
                shortest: Duration::from_ns(150_000_000_000),
                steps: 4
            }),
            shape: Some(Shape::Round { radius: 2.5 }),
            selection: None,
            stages: None,
            pair: Some((1.0, 2.5)),
            quiet: true,
        })
    );
}

#[test]
fn a_model_stores_what_json_cannot_as_texts() {
    let (parameters, _) = read("ahead = \"0s\"\nunit = \"1\"\nlags = []\nalpha = \"inf\"");
    assert_eq!(
        parameters.map(|parameters| parameters.alpha),
        Some(f64::INFINITY)
    );
}

#[test]
fn all_mistakes_of_a_table_are_told_at_once() {
    let report = read("ahead = 5\nlgas = []\nlags = [\"5min\", \"5mn\", 5]\nalpha = \"x\"").1;
    assert_eq!(
        report,
        r#"
error[A007]: node "n" needs the key "unit"
 --> a.toml:2:1
  |
2 | [node]
  | ^^^^^^ "unit" is missing

error[A008]: expected a duration like "5min" for "ahead", found the number 5
 --> a.toml:3:9
  |
3 | ahead = 5
  |         ^ expected a duration like "5min"
  |
  = help: a duration needs a unit, e.g. "5min"

error[A006]: node "n" has no key "lgas"
 --> a.toml:4:1
  |
4 | lgas = []
  | ^^^^ unknown key
  |
  = help: did you mean "lags"?

error[A018]: "mn" is not a unit of time; the units are ns, us, ms, s, min (or m), h and d
 --> a.toml:5:17
  |
5 | lags = ["5min", "5mn", 5]
  |                 ^^^^^ not a duration

error[A008]: expected a duration like "5min" for "lags", found the number 5
 --> a.toml:5:24
  |
5 | lags = ["5min", "5mn", 5]
  |                        ^ expected a duration like "5min"
  |
  = help: a duration needs a unit, e.g. "5min"

error[A008]: expected a number for "alpha", found the text "x"
 --> a.toml:6:9
  |
6 | alpha = "x"
  |         ^^^ expected a number
"#
    );
}

#[test]
fn all_missing_keys_are_told_at_once() {
    let report = read("quiet = false").1;
    assert_eq!(
        report,
        r#"
error[A007]: node "n" needs the key "ahead"
 --> a.toml:2:1
  |
2 | [node]
  | ^^^^^^ "ahead" is missing

error[A007]: node "n" needs the key "unit"
 --> a.toml:2:1
  |
2 | [node]
  | ^^^^^^ "unit" is missing

error[A007]: node "n" needs the key "lags"
 --> a.toml:2:1
  |
2 | [node]
  | ^^^^^^ "lags" is missing

error[A007]: node "n" needs the key "alpha"
 --> a.toml:2:1
  |
2 | [node]
  | ^^^^^^ "alpha" is missing
"#
    );
}

#[test]
fn an_unknown_key_gets_the_nearest_one() {
    let report = mistakes("fold = 3");
    assert_eq!(
        report,
        r#"
error[A006]: node "n" has no key "fold"
 --> a.toml:7:1
  |
7 | fold = 3
  | ^^^^ unknown key
  |
  = help: did you mean "folds"?
"#
    );
}

#[test]
fn numbers_have_their_kinds() {
    let report =
        mistakes("folds = -1\nselection = { folds = 1.5, tolerance = true, method = \"forward\" }");
    assert_eq!(
        report,
        r#"
error[A008]: expected a whole number, 0 or more for "folds", found the number -1
 --> a.toml:7:9
  |
7 | folds = -1
  |         ^^ expected a whole number, 0 or more

error[A008]: expected a whole number, 0 or more for "folds", found the number 1.5
 --> a.toml:8:23
  |
8 | selection = { folds = 1.5, tolerance = true, method = "forward" }
  |                       ^^^ expected a whole number, 0 or more

error[A008]: expected a number for "tolerance", found true
 --> a.toml:8:40
  |
8 | selection = { folds = 1.5, tolerance = true, method = "forward" }
  |                                        ^^^^ expected a number
"#
    );
}

#[test]
fn a_choice_is_one_of_those_that_there_are() {
    let report = mistakes("method = \"forwrd\"");
    assert_eq!(
        report,
        r#"
error[A009]: "forwrd" is not a choice for "method"
 --> a.toml:7:10
  |
7 | method = "forwrd"
  |          ^^^^^^^^ not a choice
  |
  = help: did you mean "forward"?
"#
    );
}

#[test]
fn a_choice_is_a_name() {
    let report = mistakes("method = 5");
    assert_eq!(
        report,
        r#"
error[A008]: expected the name of a choice for "method", found the number 5
 --> a.toml:7:10
  |
7 | method = 5
  |          ^ expected the name of a choice
"#
    );
}

#[test]
fn a_choice_with_values_is_a_table() {
    let report = mistakes("shape = \"round\"");
    assert_eq!(
        report,
        r#"
error[A008]: expected a table with this choice and its keys for "shape", found its name alone
 --> a.toml:7:9
  |
7 | shape = "round"
  |         ^^^^^^^ expected a table with this choice and its keys
"#
    );
}

#[test]
fn a_choice_without_values_is_its_name_alone() {
    let report = mistakes("shape = { flat = 1 }");
    assert_eq!(
        report,
        r#"
error[A008]: expected the name of this choice alone for "flat", found the number 1
 --> a.toml:7:18
  |
7 | shape = { flat = 1 }
  |                  ^ expected the name of this choice alone
"#
    );
}

#[test]
fn a_choice_of_its_own_table_is_strict() {
    let report = mistakes("shape = { round = { radios = 1 } }");
    assert_eq!(
        report,
        r#"
error[A006]: "shape.round" of node "n" has no key "radios"
 --> a.toml:7:21
  |
7 | shape = { round = { radios = 1 } }
  |                     ^^^^^^ unknown key
  |
  = help: did you mean "radius"?
"#
    );
}

#[test]
fn a_tagged_table_shows_the_value_it_names() {
    let report = mistakes("solver = { type = \"ridge\", alpha = \"x\" }");
    assert_eq!(
        report,
        r#"
error[A008]: expected a number for "alpha", found the text "x"
 --> a.toml:7:36
  |
7 | solver = { type = "ridge", alpha = "x" }
  |                                    ^^^ expected a number
"#
    );
}

#[test]
fn a_tagged_table_shows_its_unknown_tag() {
    let report = mistakes("solver = { type = \"rigde\" }");
    assert_eq!(
        report,
        r#"
error[A009]: "rigde" is not a choice for "type"
 --> a.toml:7:19
  |
7 | solver = { type = "rigde" }
  |                   ^^^^^^^ not a choice
  |
  = help: did you mean "ridge"?
"#
    );
}

#[test]
fn a_tagged_table_shows_its_unknown_key() {
    let report = mistakes("solver = { type = \"sgd\", rate = 1, evry = \"1s\" }");
    assert_eq!(
        report,
        r#"
error[A006]: "solver" of node "n" has no key "evry"
 --> a.toml:7:36
  |
7 | solver = { type = "sgd", rate = 1, evry = "1s" }
  |                                    ^^^^ unknown key
  |
  = help: did you mean "every"?
"#
    );
}

#[test]
fn a_tagged_table_needs_its_tag() {
    let report = mistakes("solver = { alpha = 1 }");
    assert_eq!(
        report,
        r#"
error[A007]: "solver" of node "n" needs the key "type"
 --> a.toml:7:10
  |
7 | solver = { alpha = 1 }
  |          ^^^^^^^^^^^^^ "type" is missing
  |
  = help: the choices are "ridge", "sgd", "searched"
"#
    );
}

#[test]
fn a_tagged_table_within_another_needs_its_own_tag() {
    let report = mistakes("solver = { type = \"searched\", alpha = { folds = 3 } }");
    assert_eq!(
        report,
        r#"
error[A007]: "solver.alpha" of node "n" needs the key "by"
 --> a.toml:7:39
  |
7 | solver = { type = "searched", alpha = { folds = 3 } }
  |                                       ^^^^^^^^^^^^^ "by" is missing
  |
  = help: the choices are "error", "score"
"#
    );
    let report = mistakes("solver = { type = \"searched\", alpha = { by = \"r2\" } }");
    assert_eq!(report.matches("error[").count(), 1, "{report}");
    assert!(report.contains("A009"), "{report}");
}

#[test]
fn an_untagged_value_is_shown_whole() {
    let report = mistakes("windows = { shortest = 5 }");
    assert_eq!(
        report,
        r#"
error[A010]: "windows" is refused: it has none of the forms that are read here
 --> a.toml:7:11
  |
7 | windows = { shortest = 5 }
  |           ^^^^^^^^^^^^^^^^ refused
"#
    );
}

#[test]
fn every_entry_of_a_list_is_read() {
    let report = mistakes(
        "stages = [{ folds = 1 }, { folds = \"2\", tolerance = 1, method = \"forward\" }, 5]",
    );
    assert_eq!(
        report,
        r#"
error[A007]: "stages" of node "n" needs the key "tolerance"
 --> a.toml:7:11
  |
7 | stages = [{ folds = 1 }, { folds = "2", tolerance = 1, method = "forward" }, 5]
  |           ^^^^^^^^^^^^^ "tolerance" is missing

error[A007]: "stages" of node "n" needs the key "method"
 --> a.toml:7:11
  |
7 | stages = [{ folds = 1 }, { folds = "2", tolerance = 1, method = "forward" }, 5]
  |           ^^^^^^^^^^^^^ "method" is missing
  |
  = help: the choices are "forward", "backward"

error[A008]: expected a whole number, 0 or more for "folds", found the text "2"
 --> a.toml:7:36
  |
7 | stages = [{ folds = 1 }, { folds = "2", tolerance = 1, method = "forward" }, 5]
  |                                    ^^^ expected a whole number, 0 or more

error[A008]: expected a table for "stages", found the number 5
 --> a.toml:7:78
  |
7 | stages = [{ folds = 1 }, { folds = "2", tolerance = 1, method = "forward" }, 5]
  |                                                                              ^ expected a table
"#
    );
}

#[test]
fn a_pair_has_two_values() {
    let report = mistakes("pair = [1]");
    assert_eq!(
        report,
        r#"
error[A008]: expected a list of 2 values for "pair", found a list of 1 value
 --> a.toml:7:8
  |
7 | pair = [1]
  |        ^^^ expected a list of 2 values
"#
    );
}

#[test]
fn a_value_that_its_type_refuses_says_why() {
    let report = mistakes("below = \"5\"");
    assert_eq!(
        report,
        r#"
error[A018]: the number 5 needs a unit, e.g. "5 nm/min" ("5 1" if it has none)
 --> a.toml:7:9
  |
7 | below = "5"
  |         ^^^ not a quantity
"#
    );
    let report = mistakes("below = \"-82,5 Cel\"");
    assert_eq!(
        report,
        r#"
error[A018]: "-82,5 Cel" has a decimal comma
 --> a.toml:7:9
  |
7 | below = "-82,5 Cel"
  |         ^^^^^^^^^^^ not a quantity
  |
  = help: a number has a decimal point: "-82.5 Cel"
"#
    );
}
