//! The whole text of every mistake that reading a graph file can find.

use std::path::Path;

use super::{check_cases, many_members, rendered};
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::{Memory, load};

#[test]
fn each_mistake_of_a_graph_file_is_shown_where_it_stands() {
    check_cases(include_str!("texts.txt"), |files| {
        let files: Vec<_> = (files.iter().map(|(name, text)| (&**name, &**text))).collect();
        rendered(&files)
    });
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
fn deep_keys_are_refused() {
    let files = [(
        "a.toml",
        &*format!("schema = 1\n{}x = 1\n", "a.".repeat(70)),
    )];
    assert_eq!(
        rendered(&files),
        r#"error[A003]: keys are nested more than 64 deep
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
        r#"error[A003]: the list has more than 200000 values
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
fn too_many_instances_are_counted_before_they_are_made() {
    let files = [("a.toml", &*many_members(&["a", "b"], ""))];
    assert_eq!(
        rendered(&files),
        r#"error[A016]: with node "n" the graph has 1000000 instances, more than 200000
 --> a.toml:5:8
  |
5 | [nodes.n]
  |        ^
  |
  = help: use fewer members, repeat less of what a module is given, or split the graph into several
"#
    );
}

#[test]
fn too_large_instances_are_weighed_before_they_are_made() {
    let files = [(
        "a.toml",
        &*many_members(&["a"], &format!("values = [{}]\n", "1, ".repeat(3_000))),
    )];
    assert_eq!(
        rendered(&files),
        r#"error[A016]: with node "n" the expanded graph has more than 4000000 values
 --> a.toml:5:8
  |
5 | [nodes.n]
  |        ^
  |
  = help: use fewer members, repeat less of what a module is given, or split the graph into several
"#
    );
}
