//! What merging gives, and where the limits of reading are.

use super::*;

const BASE: &str = r#"
schema = 1
name = "base"
[sets]
axis = ["X", "Y"]
[signals.p]
unit = "nm"
channels = "axis"
[nodes.thermal]
type = "linear"
each = "axis"
ahead = "5min"
lags = ["0s", "5min"]
solver = { type = "ridge", alpha = 1.0 }
inputs.truth = "p.{axis}"
[nodes.motion]
type = "ar"
"#;

fn graph(files: &[(&str, &str)]) -> GraphFile {
    let Outcome {
        graph,
        sources,
        diagnostics,
    } = read(files);
    let whole = graph.filter(|_| !diagnostics.has_errors());
    whole.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 120)))
}

fn node<'a>(graph: &'a GraphFile, name: &str) -> &'a NodeDecl {
    graph
        .nodes
        .iter()
        .find(|node| node.name == name)
        .unwrap_or_else(|| panic!("no node {name}"))
}

fn json(value: &Value) -> String {
    value.to_json().to_string()
}

#[test]
fn tables_merge_and_all_else_replaces() {
    let over = "schema = 1\nextends = \"base.toml\"\nname = \"over\"\n\
        nodes.thermal = { ahead = \"0s\", lags = [\"10min\"], solver.alpha = 2.0 }\nsets.axis = [\"Z\"]";
    let graph = graph(&[("over.toml", over), ("base.toml", BASE)]);
    assert_eq!(graph.name.as_deref(), Some("over"));
    let instances = &node(&graph, "thermal").instances;
    assert_eq!(instances.len(), 1);
    assert_eq!(instances[0].member.as_deref(), Some("Z"));
    assert_eq!(instances[0].inputs[0].references[0].0, "p.Z");
    assert_eq!(
        json(&instances[0].parameters),
        r#"{"ahead":"0s","lags":["10min"],"solver":{"type":"ridge","alpha":2.0}}"#
    );
    assert!(
        graph
            .tree
            .as_table()
            .is_some_and(|tree| !tree.contains("extends") && tree.contains("schema"))
    );
}

#[test]
fn a_node_of_another_type_replaces_the_inherited_one_whole() {
    let over =
        "schema = 1\nextends = \"base.toml\"\nnodes.thermal = { type = \"zero\", span = \"5min\" }";
    let graph = graph(&[("over.toml", over), ("base.toml", BASE)]);
    let thermal = node(&graph, "thermal");
    let kind = thermal.kind.as_ref().map(|(kind, _)| kind.as_str());
    assert_eq!((kind, thermal.each.len()), (Some("zero"), 0));
    assert_eq!(json(&thermal.instances[0].parameters), r#"{"span":"5min"}"#);
    assert_eq!(thermal.instances[0].member, None);
}

#[test]
fn the_same_type_said_again_merges() {
    let over = "schema = 1\nextends = \"base.toml\"\nnodes.thermal = { type = \"linear\", ahead = \"0s\" }";
    let graph = graph(&[("over.toml", over), ("base.toml", BASE)]);
    assert_eq!(node(&graph, "thermal").instances.len(), 2);
}

#[test]
fn false_removes_an_inherited_node() {
    let over = "schema = 1\nextends = \"base.toml\"\nnodes.motion = false";
    let graph = graph(&[("over.toml", over), ("base.toml", BASE)]);
    assert_eq!(
        graph
            .nodes
            .iter()
            .map(|node| node.name.as_str())
            .collect::<Vec<_>>(),
        ["thermal"]
    );
}

#[test]
fn false_removes_an_inherited_output() {
    let base = format!("{BASE}\n[outputs]\na = \"thermal\"\nb = \"motion\"\n");
    let over = "schema = 1\nextends = \"base.toml\"\nnodes.motion = false\noutputs.b = false\noutputs.c = \"thermal\"";
    let graph = graph(&[("over.toml", over), ("base.toml", &base)]);
    let outputs = graph.outputs.iter().map(|output| output.name.as_str());
    assert_eq!(outputs.collect::<Vec<_>>(), ["a", "c"]);
}

#[test]
fn a_path_starts_at_the_file_in_which_it_stands() {
    let base = "schema = 1\nsources.a = { path = \"data.csv\" }";
    let middle = "schema = 1\nextends = \"types/base.toml\"";
    let files = [
        ("site/a.toml", "schema = 1\nextends = \"../middle.toml\""),
        ("middle.toml", middle),
        ("types/base.toml", base),
    ];
    let Outcome { graph, sources, .. } = read(&files);
    let sources_table = &graph.expect("the chain has no mistake").deployment["sources"];
    let inner = |table: &Value, key| table.as_table().and_then(|of| of.get(key)).cloned();
    let path = inner(sources_table, "a")
        .and_then(|source| inner(&source, "path"))
        .expect("the source has a path");
    let resolved = sources.resolve(path.place, path.as_text().expect("the path is a text"));
    assert_eq!(resolved, Path::new("site/../types/data.csv"));
}

#[test]
fn sixteen_files_may_extend_one_another_and_no_more() {
    let chain = |length: usize| {
        let files: Vec<(String, String)> = (0..length)
            .map(|number| {
                let extends = if number + 1 < length {
                    format!("extends = \"{}.toml\"\n", number + 1)
                } else {
                    String::new()
                };
                (format!("{number}.toml"), format!("schema = 1\n{extends}"))
            })
            .collect();
        let files: Vec<(&str, &str)> = files
            .iter()
            .map(|(name, text)| (name.as_str(), text.as_str()))
            .collect();
        read(&files)
            .diagnostics
            .iter()
            .map(|diagnostic| diagnostic.message.clone())
            .collect::<Vec<_>>()
    };
    assert!(chain(16).is_empty());
    assert_eq!(chain(17), ["more than 16 files extend one another"]);
}

#[test]
fn a_file_beyond_the_limit_is_not_parsed() {
    let text = format!("schema = 1\n#{}", "x".repeat(16_000_000));
    let Outcome {
        graph, diagnostics, ..
    } = read(&[("a.toml", &text)]);
    assert!(graph.is_none());
    let messages: Vec<&str> = diagnostics
        .iter()
        .map(|diagnostic| diagnostic.message.as_str())
        .collect();
    assert_eq!(messages, ["the file is larger than 16 MB"]);
}

#[test]
fn a_file_that_is_not_there_has_no_place() {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    assert_eq!(
        load(
            Path::new("no.toml"),
            &Memory::new(),
            &mut sources,
            &mut diagnostics
        ),
        None
    );
    assert_eq!(
        diagnostics.render(&sources, false, 80),
        "error[A002]: cannot read \"no.toml\": there is no such file\n"
    );
    assert_eq!(
        load(
            Path::new("/no/such/file.toml"),
            &Disk,
            &mut sources,
            &mut diagnostics
        ),
        None
    );
    assert_eq!(diagnostics.error_count(), 2);
}

#[test]
fn brackets_and_dotted_keys_nested_by_the_thousand_are_refused() {
    for text in [
        format!("schema = 1\nx = {}", "[".repeat(100_000)),
        format!("schema = 1\nx = {}", "{a=".repeat(100_000)),
        format!("schema = 1\n[{}a]", "a.".repeat(100_000)),
        format!("schema = 1\n{}a = 1", "'b' . ".repeat(100_000)),
        format!("schema = 1\nx = {{ {}a = 1 }}", "\"\\\"\".".repeat(100_000)),
    ] {
        let Outcome {
            graph, diagnostics, ..
        } = read(&[("a.toml", &text)]);
        // What the nesting costs is not told as missing.
        let refused = |found: &crate::diagnostic::Diagnostic| {
            matches!(found.code, "A001" | "A003") && found.place.is_some()
        };
        assert!(diagnostics.has_errors() && diagnostics.iter().all(refused));
        assert!(graph.is_none_or(|graph| graph.nodes.is_empty() && graph.signals.is_empty()));
    }
    let dots = format!(
        "schema = 1\nname = \"{}\" # {}",
        ".".repeat(500),
        ".".repeat(500)
    );
    assert!(read(&[("a.toml", &dots)]).graph.is_some());
}

#[test]
fn json_holds_a_tree_exactly() {
    let text = "schema = 1\n[runtime]\nwhole = 9007199254740993\nthird = 0.3333333333333333\none = 1.0\nsmall = 5e-324\n\
        t = 2020-01-01\nno = nan\nup = inf\ndown = -inf\nlist = [true, \"x\", {}]";
    let graph = graph(&[("a.toml", text)]);
    let stored = serde_json::to_string(&graph.tree.to_json()).expect("trees are serialisable");
    let json: serde_json::Value = serde_json::from_str(&stored).expect("what was written is JSON");
    assert_eq!(
        json["runtime"].to_string(),
        r#"{"whole":9007199254740993,"third":0.3333333333333333,"one":1.0,"small":5e-324,"t":"2020-01-01","no":"NaN","up":"inf","down":"-inf","list":[true,"x",{}]}"#
    );
    let place = graph.tree.place;
    let back = Value::from_json(&json, place).expect("there is no null in it");
    assert_eq!(back.to_json(), json);
    let again = declare(Document::new(place.source, back), &mut Diagnostics::new())
        .expect("the tree has no mistake");
    assert_eq!(again.tree.to_json(), json);
    let null = Value::from_json(&serde_json::json!({ "a": [1, null] }), place);
    assert_eq!(
        null.map_err(|error| error.to_string()),
        Err("\"a.1\" is null, which a graph cannot hold".to_owned())
    );
}
