//! Texts of mistakes in files as such: syntax, extending, keys.

use std::path::Path;

use super::rendered;
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::{Memory, load};

#[test]
fn a_syntax_error_is_told_as_the_parser_tells_it() {
    let files = [(
        "a.toml",
        r#"schema = 1
name = 
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A001]: this is not TOML: string values must be quoted, expected literal string
 --> a.toml:2:8
  |
2 | name = 
  |        ^ here
"#
    );
}

#[test]
fn every_syntax_error_is_told() {
    let files = [(
        "a.toml",
        r#"schema = 1
name = x y
[sets
axis = []
[[nodes]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A001]: this is not TOML: string values must be quoted, expected literal string
 --> a.toml:2:8
  |
2 | name = x y
  |        ^^^ here
  |
  = help: a text stands in quotes: "x y"

error[A001]: this is not TOML: unclosed table, expected `]`
 --> a.toml:3:6
  |
3 | [sets
  |      ^ here

error[A001]: this is not TOML: unclosed array table, expected `]`
 --> a.toml:5:9
  |
5 | [[nodes]
  |         ^ here
"#
    );
}

#[test]
fn a_key_that_stands_twice_is_not_told_to_be_a_text() {
    let text = "schema = 1\ntests = []\n\n[[tests]]\nname = \"t\"\n";
    let told = rendered(&[("a.toml", text)]);
    assert!(told.contains("this is not TOML: duplicate key"), "{told}");
    assert!(told.contains("a key stands once, be it"), "{told}");
    assert!(!told.contains("quotes"), "{told}");
}

#[test]
fn what_is_usual_elsewhere_and_no_toml_is_told_with_what_to_write() {
    for (line, help) in [
        ("a = 0,001", "a number has a decimal point: 0.001"),
        (
            "a = { b = 3, c = -1,5 }",
            "a number has a decimal point: -1.5",
        ),
        ("a = \u{201c}Cel\u{201d}", "quotes are straight: \"Cel\""),
        ("a = \u{201e}Cel\u{201c}", "quotes are straight: \"Cel\""),
        (
            r#"extends = "C:\athermal\a.toml""#,
            "in a text a backslash begins a special sign; write a path with slashes: \"C:/athermal/a.toml\"",
        ),
        (
            r#"extends = "C:\Users\a.toml""#,
            "in a text a backslash begins a special sign; write a path with slashes: \"C:/Users/a.toml\"",
        ),
    ] {
        let text = format!("schema = 1\n{line}\n");
        let told = rendered(&[("a.toml", &text)]);
        assert!(told.contains("error[A001]"), "{told}");
        assert!(told.contains(&format!("= help: {help}\n")), "{told}");
    }
    for line in ["a = [1,2", "a = { b = 1, c = ", "a = \"x\\\\y\" z"] {
        let text = format!("schema = 1\n{line}\n");
        let told = rendered(&[("a.toml", &text)]);
        for help in ["decimal point", "quotes are", "backslash"] {
            assert!(!told.contains(help), "{told}");
        }
    }
}

#[test]
fn a_file_that_is_not_there_is_named_where_it_is_extended() {
    let files = [(
        "m/a.toml",
        r#"schema = 1
extends = "b.toml"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A002]: cannot read "m/b.toml": there is no such file
 --> m/a.toml:2:11
  |
2 | extends = "b.toml"
  |           ^^^^^^^^ named here
  |
  = help: a relative path starts at the file in which it stands, and no other graph is in m
"#
    );
}

#[test]
fn a_file_that_is_not_there_may_be_one_that_stands_in_its_folder() {
    let told = ["die-testr.toml", "die-tester.tml", "c.toml"].map(|wanted| {
        let text = format!("schema = 1\nextends = \"{wanted}\"\n");
        let memory = Memory::new()
            .with("m/a.toml", text)
            .with("m/die-tester.toml", "")
            .with("m/linear-axis.toml", "")
            .with("stranger.toml", "");
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        load(
            Path::new("m/a.toml"),
            &memory,
            &mut sources,
            &mut diagnostics,
        );
        let told = diagnostics.render(&sources, false, 100);
        told.lines().last().unwrap_or_default().trim().to_owned()
    });
    let near = "= help: did you mean \"die-tester.toml\"?";
    let all = "= help: in that folder there is \"die-tester.toml\", \"linear-axis.toml\"";
    assert_eq!(told, [near, near, all]);
}

#[test]
fn extends_is_a_text() {
    let files = [(
        "a.toml",
        r#"schema = 1
extends = ["b.toml"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A008]: expected the path of a file in quotes for "extends", found a list
 --> a.toml:2:11
  |
2 | extends = ["b.toml"]
  |           ^^^^^^^^^^ expected the path of a file in quotes
"#
    );
}

#[test]
fn deep_keys_are_refused() {
    let files = [(
        "a.toml",
        &*format!("schema = 1\n{}x = 1\n", "a.".repeat(70)),
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A003]: keys are nested more than 64 deep
 --> a.toml:2:128
  |
2 | ....a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.x = 1
  |                                                          ^
"#
    );
}

#[test]
fn a_list_of_more_values_than_there_is_room_for_is_refused_before_it_is_kept() {
    let members = "\"m\",\n".repeat(200_002);
    let files = [(
        "a.toml",
        &*format!("schema = 1\n[sets]\na = [\n{members}]\n"),
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A003]: the list has more than 200000 values
 --> a.toml:3:3
  |
3 | a = [
  |   ^ of this list
  |
  = help: a graph has no room for so many members; samples stand in a file of data
"#
    );
}

#[test]
fn a_loop_names_its_files() {
    let files = [
        (
            "a.toml",
            r#"schema = 1
extends = "x/b.toml"
"#,
        ),
        (
            "x/b.toml",
            r#"schema = 1
extends = "../a.toml"
"#,
        ),
    ];
    assert_eq!(
        rendered(&files),
        r#"
error[A005]: `extends` comes back to its own file: a.toml → x/b.toml → a.toml
 --> x/b.toml:2:11
  |
2 | extends = "../a.toml"
  |           ^^^^^^^^^^^ extends this file
  |
  = help: one of these files must extend none of the others
"#
    );
}

#[test]
fn a_missing_schema_is_asked_for() {
    let files = [(
        "a.toml",
        r#"name = "x"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A004]: the file does not say which schema it follows
 --> a.toml:1:1
  |
1 | name = "x"
  | ^ `schema = 1` is missing
  |
  = help: begin the file with `schema = 1`
"#
    );
}

#[test]
fn another_schema_is_refused() {
    let files = [(
        "a.toml",
        r#"schema = 2
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A004]: the schema is 1, found the number 2
 --> a.toml:1:10
  |
1 | schema = 2
  |          ^ not 1
  |
  = help: begin the file with `schema = 1`
"#
    );
}

#[test]
fn an_unknown_key_gets_the_nearest_one() {
    let files = [(
        "a.toml",
        r#"schema = 1
singals = 1
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A006]: a graph file has no key "singals"
 --> a.toml:2:1
  |
2 | singals = 1
  | ^^^^^^^ unknown key
  |
  = help: did you mean "signals"?
"#
    );
}

#[test]
fn an_unknown_key_without_a_near_one_gets_the_list() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
colour = 1
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A006]: signal "p" has no key "colour"
 --> a.toml:5:1
  |
5 | colour = 1
  | ^^^^^^ unknown key
  |
  = help: the keys are "unit", "channels", "column", "range", "max_age", "optional"
"#
    );
}

#[test]
fn a_number_beyond_64_bits_is_refused() {
    let files = [(
        "a.toml",
        r#"schema = 1
[source]
big = 9223372036854775808
huge = 1e999
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A010]: the number 9223372036854775808 is too large
 --> a.toml:3:7
  |
3 | big = 9223372036854775808
  |       ^^^^^^^^^^^^^^^^^^^

error[A010]: the number 1e999 is too large
 --> a.toml:4:8
  |
4 | huge = 1e999
  |        ^^^^^
"#
    );
}

#[test]
fn there_must_be_a_node_or_an_output_to_remove() {
    let files = [
        (
            "a.toml",
            r#"schema = 1
extends = "b.toml"
nodes.themal = false
outputs.predictd = false
"#,
        ),
        (
            "b.toml",
            r#"schema = 1
[nodes.thermal]
type = "linear"
[outputs]
predicted = "thermal"
"#,
        ),
    ];
    assert_eq!(
        rendered(&files),
        r#"
error[A019]: there is no inherited node "themal" to remove
 --> a.toml:3:7
  |
3 | nodes.themal = false
  |       ^^^^^^
  |
  = help: did you mean "thermal"?

error[A019]: there is no inherited output "predictd" to remove
 --> a.toml:4:9
  |
4 | outputs.predictd = false
  |         ^^^^^^^^
  |
  = help: did you mean "predicted"?
"#
    );
}

#[test]
fn a_mistake_inside_a_module_is_told_once_and_names_its_first_instance() {
    let files = [(
        "a.toml",
        r#"schema = 1
[modules.m]
inputs = ["signal"]
nodes.n = { inputs.a = "{signal}", inputs.b = "p" }
[nodes]
x = { module = "m", inputs.signal = "q" }
y = { module = "m", inputs.signal = "q" }
z = { module = "n", inputs.signal = "q" }
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A007]: node "x/n" needs the key "type"
 --> a.toml:4:11
  |
4 | nodes.n = { inputs.a = "{signal}", inputs.b = "p" }
  |           ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ "type" is missing
  |
  = note: node `x/n`, and 1 more node
  = help: say which kind of node it is, e.g. type = "slope"

error[A027]: "p" is not a node of module "m"
 --> a.toml:4:47
  |
4 | nodes.n = { inputs.a = "{signal}", inputs.b = "p" }
  |                                               ^^^ out of the module's reach
  |
  = note: node `x/n`, and 1 more node
  = help: name it under the module's `inputs`; there it has "n", "{signal}"

error[A025]: there is no module "n"
 --> a.toml:8:16
  |
8 | z = { module = "n", inputs.signal = "q" }
  |                ^^^ not a module
  |
  = help: there is only "m"
"#
    );
}
#[test]
fn a_mistake_in_an_extended_file_is_shown_there() {
    let files = [
        (
            "a.toml",
            r#"schema = 1
extends = "b.toml"
name = "a"
"#,
        ),
        (
            "b.toml",
            r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
max_ago = "5s"
"#,
        ),
    ];
    assert_eq!(
        rendered(&files),
        r#"
error[A006]: signal "p" has no key "max_ago"
 --> b.toml:5:1
  |
5 | max_ago = "5s"
  | ^^^^^^^ unknown key
  |
  = help: did you mean "max_age"?
"#
    );
}

#[test]
fn a_line_with_wide_characters_is_marked_in_the_right_place() {
    let files = [(
        "a.toml",
        r#"schema = 1
description = "µm → 温度"
name = 5 # µ
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A008]: expected a text in quotes for "name", found the number 5
 --> a.toml:3:8
  |
3 | name = 5 # µ
  |        ^ expected a text in quotes
"#
    );
}
