//! Texts of mistakes in names, sets and placeholders.

use super::rendered;

#[test]
fn a_node_name_begins_with_a_letter() {
    let files = [(
        "a.toml",
        r#"schema = 1
[nodes."1st"]
type = "slope"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A011]: "1st" cannot be the name of a node
 --> a.toml:2:8
  |
2 | [nodes."1st"]
  |        ^^^^^ not a name
  |
  = help: a name begins with a letter, then letters, digits, `_` and `-`
"#
    );
}

#[test]
fn a_member_name_has_no_dot() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
axis = ["X.1"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A011]: "X.1" cannot be the name of a member
 --> a.toml:3:9
  |
3 | axis = ["X.1"]
  |         ^^^^^ not a name
  |
  = help: a name begins with a letter or digit, then letters, digits, `_` and `-`
"#
    );
}

#[test]
fn nodes_sets_and_signals_share_one_name_space() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
[nodes.p]
type = "slope"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A012]: the node "p" has the name of a signal
 --> a.toml:5:8
  |
2 | [signals.p]
  |          - the signal is here
...
5 | [nodes.p]
  |        ^ this name is taken
  |
  = help: nodes, sets and signals share one name space
"#
    );
}

#[test]
fn members_are_distinct() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
axis = ["X", "Y", "X"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A012]: the member "X" has the name of another member
 --> a.toml:3:19
  |
3 | axis = ["X", "Y", "X"]
  |         ---       ^^^ this name is taken
  |         |
  |         the member is here
"#
    );
}

#[test]
fn an_unknown_set_gets_the_nearest_one() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
axis = ["X", "Y"]
[nodes.n]
type = "a"
each = "axes"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A013]: there is no set "axes"
 --> a.toml:6:8
  |
6 | each = "axes"
  |        ^^^^^^ not a set
  |
  = help: did you mean "axis"?
"#
    );
}

#[test]
fn a_text_for_channels_may_be_meant_for_one_channel() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.position]
unit = "nm"
channels = "X"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A013]: there is no set "X"
 --> a.toml:4:12
  |
4 | channels = "X"
  |            ^^^ not a set
  |
  = help: declare it under `[sets]`, or write `["X"]` for a channel of that name
"#
    );
}

#[test]
fn a_placeholder_is_a_set_of_the_node() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
axis = ["X", "Y"]
[nodes.n]
type = "a"
each = "axis"
inputs.x = ["p.{axis}", "p.{axs}"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A014]: "{axs}" stands for nothing in node "n"
 --> a.toml:7:25
  |
7 | inputs.x = ["p.{axis}", "p.{axs}"]
  |                         ^^^^^^^^^ stands for nothing
  |
  = help: did you mean "{axis}"?
"#
    );
}

#[test]
fn a_placeholder_needs_each() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
axis = ["X", "Y"]
[nodes.n]
type = "a"
inputs.x = "p.{axis}"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A014]: "{axis}" stands for nothing in node "n"
 --> a.toml:6:12
  |
6 | inputs.x = "p.{axis}"
  |            ^^^^^^^^^^ stands for nothing
  |
  = help: only a node with `each` has members to stand for
"#
    );
}

#[test]
fn an_output_has_no_placeholders() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
axis = ["X", "Y"]
[outputs]
x = "n.{axis}"
y = "n:reason.{axis}/value"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A014]: "{axis}" stands for nothing in output "x"
 --> a.toml:5:5
  |
5 | x = "n.{axis}"
  |     ^^^^^^^^^^ stands for nothing
  |
  = help: here a reference stands for all members: write "n"

error[A014]: "{axis}" stands for nothing in output "y"
 --> a.toml:6:5
  |
6 | y = "n:reason.{axis}/value"
  |     ^^^^^^^^^^^^^^^^^^^^^^^ stands for nothing
  |
  = help: here a reference stands for all members: write "n:reason.*/value"
"#
    );
}

#[test]
fn an_empty_set_is_refused() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
axis = []
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A015]: the set "axis" has no entries
 --> a.toml:3:8
  |
3 | axis = []
  |        ^^ empty
  |
  = help: name at least one
"#
    );
}
