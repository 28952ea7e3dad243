//! What modules become.

use super::*;

const GRAPH: &str = r#"
schema = 1
[sets]
axis = ["X", "Z"]
side = ["left", "right"]
[modules.pair]
inputs = ["signal"]
required = ["windows"]
parameters = { unit = "nm/min" }
outputs = { slope = "drift", late = "late:delayed" }
nodes.drift = { type = "slope", inputs.signal = "{signal}", windows = "{windows}", unit = "{unit}" }
nodes.late = { type = "delay", each = "side", inputs.signal = ["drift", "drift.a@{unit}"], delay = "1{unit}" }
[modules.outer]
inputs = ["signal"]
outputs = { late = "inner:late" }
nodes.inner = { module = "pair", inputs.signal = "{signal}.*", windows = ["1min"], each = "side" }
nodes.last = { type = "x", inputs.a = "inner", inputs.b = "inner:late.left" }
[nodes.n]
module = "pair"
each = "axis"
inputs.signal = { from = ["p.{axis}", "q"], max_age = "1min" }
windows = "5min of {axis}"
[nodes.deep]
module = "outer"
each = "axis"
inputs.signal = "n:late.{axis}-left"
[nodes.user]
type = "y"
inputs.a = ["n.X", "deep", "n:late"]
[outputs]
all = { from = "deep.X-left" }
"#;

fn graph() -> GraphFile {
    let Outcome {
        graph,
        sources,
        diagnostics,
    } = read(&[("a.toml", GRAPH)]);
    graph.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 120)))
}

fn instance<'a>(graph: &'a GraphFile, node: &str, member: Option<&str>) -> &'a InstanceDecl {
    let node = graph.nodes.iter().find(|decl| decl.name == node);
    let mut instances = node.into_iter().flat_map(|node| &node.instances);
    instances
        .find(|instance| instance.member.as_deref() == member)
        .expect("the graph has the instance")
}

fn references(instance: &InstanceDecl) -> Vec<&str> {
    let inputs = instance.inputs.iter().flat_map(|input| &input.references);
    inputs.map(|(text, _)| text.as_str()).collect()
}

#[test]
fn nodes_inside_are_named_after_the_instances_around_them() {
    let graph = graph();
    let names: Vec<_> = graph.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "n/drift",
            "n/late",
            "deep/inner/drift",
            "deep/inner/late",
            "deep/last",
            "user"
        ]
    );
}

#[test]
fn inputs_and_parameters_take_the_place_of_their_names() {
    let graph = graph();
    let drift = instance(&graph, "n/drift", Some("Z"));
    assert_eq!(references(drift), ["p.Z", "q"]);
    assert_eq!(
        drift.inputs[0].max_age.map(|(age, _)| age.to_string()),
        Some("1min".to_owned())
    );
    assert_eq!(
        drift.parameters.to_json().to_string(),
        r#"{"windows":"5min of Z","unit":"nm/min"}"#
    );
    let inner = instance(&graph, "deep/inner/drift", Some("X-left"));
    assert_eq!(
        inner.parameters.to_json().to_string(),
        r#"{"windows":["1min"],"unit":"nm/min"}"#
    );
}

#[test]
fn references_inside_stay_within_one_member() {
    let graph = graph();
    let late = instance(&graph, "n/late", Some("X-right"));
    assert_eq!(references(late), ["n[X]/drift", "n[X]/drift.a@nm/min"]);
    let inner = instance(&graph, "deep/inner/late", Some("Z-left-right"));
    assert_eq!(references(inner)[0], "deep[Z]/inner[left]/drift");
    let last = instance(&graph, "deep/last", Some("Z"));
    assert_eq!(
        references(last),
        ["deep[Z]/inner/drift", "deep[Z]/inner/late:delayed.left"]
    );
    assert_eq!(
        inner.scopes,
        [
            (
                "deep[Z]/inner/late".to_owned(),
                Some("left-right".to_owned())
            ),
            (
                "deep[Z]/inner[left]/late".to_owned(),
                Some("right".to_owned())
            ),
        ]
    );
}

#[test]
fn references_from_outside_lead_to_outputs() {
    let graph = graph();
    assert_eq!(
        references(instance(&graph, "user", None)),
        ["n/drift.X", "deep/inner/late:delayed", "n/late:delayed"]
    );
    assert_eq!(
        references(instance(&graph, "deep/inner/drift", Some("X-left"))),
        ["n/late:delayed.X-left.*"]
    );
    assert_eq!(graph.outputs[0].from[0].0, "deep/inner/late:delayed.X-left");
}

#[test]
fn a_module_comes_from_another_file_with_the_modules_that_it_sees_there() {
    let library = "schema = 1\n[modules.a]\nnodes.n = { module = \"b\" }\nparameters = { p = 1 }\n\
        [modules.b]\nnodes.m = { type = \"slope\" }";
    let graph = "schema = 1\nmodules.mine = { from = \"lib/axis.toml\", module = \"a\", parameters.p = 2 }\n\
        [modules.b]\nnodes.other = { type = \"x\" }\n[nodes.x]\nmodule = \"mine\"";
    let Outcome {
        graph,
        sources,
        diagnostics,
    } = read(&[("a.toml", graph), ("lib/axis.toml", library)]);
    let graph = graph.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 120)));
    assert_eq!(graph.nodes[0].name, "x/n/m");
    assert_eq!(sources.path(graph.nodes[0].place.source), "lib/axis.toml");
    // What a model stores needs no other file.
    let tree = graph.tree.to_json();
    assert_eq!(tree["modules"]["mine"]["parameters"]["p"], 2);
    assert_eq!(tree["modules"]["mine"]["from"], serde_json::Value::Null);
}

#[test]
fn an_extending_file_changes_the_nodes_of_a_module() {
    let base = "schema = 1\n[modules.m]\nnodes.a = { type = \"x\", p = 1 }\nnodes.b = { type = \"y\" }\n[nodes.n]\nmodule = \"m\"";
    let over = "schema = 1\nextends = \"base.toml\"\nmodules.m.nodes = { a.p = 2, b = false }";
    let Outcome { graph, .. } = read(&[("a.toml", over), ("base.toml", base)]);
    let graph = graph.expect("the files have no mistake");
    assert_eq!(graph.nodes.len(), 1);
    assert_eq!(
        graph.nodes[0].instances[0].parameters.to_json().to_string(),
        r#"{"p":2}"#
    );
}

/// The nodes of an instance of the module that [`LENT`] lends, each with its parameters.
fn changed(over: &str) -> Vec<(String, String)> {
    let graph = format!(
        "schema = 1\n[modules.axis]\nfrom = \"lib.toml\"\n{over}\n[nodes.n]\nmodule = \"axis\"\n"
    );
    let files = [("a.toml", graph.as_str()), ("lib.toml", LENT)];
    let Outcome {
        graph,
        sources,
        diagnostics,
    } = read(&files);
    let whole = graph.filter(|_| !diagnostics.has_errors());
    let graph = whole.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 120)));
    let nodes = graph.nodes.iter().map(|node| {
        let parameters = node.instances[0].parameters.to_json().to_string();
        (node.name.clone(), parameters)
    });
    nodes.collect()
}

const LENT: &str = r#"
schema = 1
[modules.axis]
outputs = { a = "a", b = "b" }
nodes.a = { type = "x", p = 1, q = 1 }
nodes.b = { type = "y", p = 1 }
"#;

#[test]
fn what_is_laid_over_a_module_of_another_file_merges_as_extends_does() {
    let node = |name: &str, parameters: &str| (name.to_owned(), parameters.to_owned());
    assert_eq!(
        changed("nodes.b = false\noutputs.b = false"),
        [node("n/a", r#"{"p":1,"q":1}"#)]
    );
    assert_eq!(
        changed("nodes.a = { type = \"z\", r = 2 }\nnodes.b.p = 2"),
        [node("n/a", r#"{"r":2}"#), node("n/b", r#"{"p":2}"#)]
    );
}

#[test]
fn a_node_that_a_module_lacks_is_not_removed_from_it() {
    for (over, removed) in [
        ("from = \"lib.toml\"\nnodes.c = false", "c"),
        ("nodes.a.type = \"x\"\nnodes.d = false", "d"),
    ] {
        let graph = format!("schema = 1\n[modules.axis]\n{over}\n");
        let told = rendered(&[("a.toml", &graph), ("lib.toml", LENT)]);
        let expected = format!("error[A019]: there is no inherited node \"{removed}\" to remove");
        assert!(told.contains(&expected), "{told}");
        assert_eq!(told.matches("error[").count(), 1, "{told}");
    }
}

#[test]
fn a_module_from_a_file_replaces_an_inherited_one_of_its_name() {
    let base = "schema = 1\n[modules.axis]\nparameters.old = 1\nnodes.before = { type = \"x\" }\n[nodes.n]\nmodule = \"axis\"\n";
    let over = "schema = 1\nextends = \"base.toml\"\nmodules.axis = { from = \"lib.toml\", nodes.b = false, outputs.b = false }";
    let files = [("a.toml", over), ("base.toml", base), ("lib.toml", LENT)];
    let Outcome { graph, .. } = read(&files);
    let graph = graph.expect("the files have no mistake");
    let names: Vec<_> = graph.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["n/a"]);
    assert_eq!(
        graph.tree.to_json()["modules"]["axis"]["parameters"],
        serde_json::Value::Null
    );
}

#[test]
fn values_that_each_module_repeats_are_weighed_before_they_are_made() {
    for (given, repeated) in [
        (
            "inputs.x = [\"n0\"]",
            "inputs.x = [\"{x}\", \"{x}\", \"{x}\", \"{x}\"]",
        ),
        ("p = [1]", "p = [\"{p}\", \"{p}\", \"{p}\", \"{p}\"]"),
        ("p = \"a\"", "p = \"{p}{p}{p}{p}\""),
    ] {
        let (head, tail) = match given.starts_with('p') {
            true => ("parameters.p = {}\n", "p = \"{p}\""),
            false => ("inputs = [\"x\"]\n", "inputs.x = \"{x}\""),
        };
        let mut text = "schema = 1\n".to_owned();
        for level in 0..30 {
            let next = level + 1;
            text += &format!(
                "[modules.m{level}]\n{head}[modules.m{level}.nodes.n]\nmodule = \"m{next}\"\n{repeated}\n"
            );
        }
        text += &format!("[modules.m30]\n{head}[modules.m30.nodes.n]\ntype = \"x\"\n{tail}\n");
        text += &format!("[nodes.n0]\ntype = \"x\"\n[nodes.all]\nmodule = \"m0\"\n{given}\n");
        let Outcome {
            graph, diagnostics, ..
        } = read(&[("a.toml", &text)]);
        assert!(graph.is_none());
        let codes: Vec<_> = diagnostics.iter().map(|found| found.code).collect();
        assert_eq!(codes, ["A016"], "{repeated}");
    }
}

#[test]
fn modules_that_multiply_are_stopped() {
    let mut text = "schema = 1\n".to_owned();
    for level in 0..15 {
        text += &format!("[modules.m{level}]\n");
        for nth in 0..10 {
            text += &format!("nodes.n{nth} = {{ module = \"m{}\" }}\n", level + 1);
        }
    }
    text += "[modules.m15]\nnodes.n = { type = \"x\" }\n[nodes.all]\nmodule = \"m0\"";
    let Outcome {
        graph, diagnostics, ..
    } = read(&[("a.toml", &text)]);
    assert!(graph.is_none());
    let codes: Vec<_> = diagnostics.iter().map(|found| found.code).collect();
    assert_eq!(codes, ["A016"]);
}

#[test]
fn a_parameter_with_a_unit_that_its_module_adds_is_told_where_it_is_given() {
    let graph = |limit: &str, wait: &str| {
        format!(
            "schema = 1\n[modules.m]\nrequired = [\"limit\", \"wait\"]\n\
             nodes.a = {{ type = \"x\", below = \"{{limit}} nm/min\", memory = \"{{wait}}min\" }}\n\
             [nodes.n]\nmodule = \"m\"\nlimit = {limit}\nwait = {wait}\n"
        )
    };
    let told = rendered(&[("a.toml", &graph("\"0.15 um/min\"", "5"))]);
    assert_eq!(
        told,
        r#"error[A018]: module "m" adds the unit to `limit` itself, as "{limit} nm/min"
 --> a.toml:7:9
  |
7 | limit = "0.15 um/min"
  |         ^^^^^^^^^^^^^ has a unit already
  |
  = note: node `n/a`
  = help: give the number alone: limit = 150
"#
    );
    let told = rendered(&[("a.toml", &graph("150", "\"5min\""))]);
    assert!(told.contains("give the number alone: wait = 5\n"), "{told}");
    let told = rendered(&[("a.toml", &graph("\"5 K\"", "5"))]);
    assert!(told.contains("give a number alone, in nm/min\n"), "{told}");
    let fine = read(&[("a.toml", &graph("150", "5"))]);
    assert!(!fine.diagnostics.has_errors());
}
