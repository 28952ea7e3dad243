//! Texts of mistakes in nodes.

use super::{many_members, rendered};

#[test]
fn a_missing_type_is_asked_for() {
    let files = [(
        "a.toml",
        r#"schema = 1
[nodes]
n.inputs.x = "p"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A007]: node "n" needs the key "type"
 --> a.toml:3:1
  |
3 | n.inputs.x = "p"
  | ^ "type" is missing
  |
  = help: say which kind of node it is, e.g. type = "slope"
"#
    );
}

#[test]
fn too_many_instances_are_counted_before_they_are_made() {
    let files = [("a.toml", &*many_members(&["a", "b"], ""))];
    assert_eq!(
        rendered(&files),
        r#"
error[A016]: with node "n" the graph has 1000000 instances, more than 200000
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
        r#"
error[A016]: with node "n" the expanded graph has more than 4000000 values
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
fn an_input_table_says_from_where() {
    let files = [(
        "a.toml",
        r#"schema = 1
[nodes.n]
type = "a"
inputs.x = { form = "p" }
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A006]: input "x" of node "n" has no key "form"
 --> a.toml:4:14
  |
4 | inputs.x = { form = "p" }
  |              ^^^^ unknown key
  |
  = help: did you mean "from"?
"#
    );
}
