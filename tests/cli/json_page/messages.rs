//! What runs tell programs on standard error, so that all of it comes once.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::workbench::{Scratch, athermal_fed};

/// A drift, its last value and none at all, of which the graph shows one.
const GRAPH: &str = r#"
schema = 1
name = "shown"
time.column = "t"
signals.a = { unit = "nm", channels = ["x"], column = "{channel}", range = ["-1 um", "1 um"], max_age = "3min" }
nodes.drift = { type = "slope", inputs.signal = "a", windows = ["30s"], unit = "nm/min" }
nodes.same = { type = "persistence", inputs.truth = "drift.x", ahead = "30s" }
nodes.still = { type = "zero", inputs.truth = "drift.x", ahead = "30s" }
outputs.predicted = "same"
"#;

/// An object for each line that a run on this input told, with more arguments.
fn told(graph: &Path, input: &str, more: &[&dyn AsRef<OsStr>]) -> Vec<Value> {
    let mut arguments: Vec<&dyn AsRef<OsStr>> = vec![&"run", &graph];
    arguments.extend([&"--format" as &dyn AsRef<OsStr>, &"json"]);
    arguments.extend(more);
    let run = athermal_fed(&arguments, input.as_bytes());
    let lines = run.told.lines().map(serde_json::from_str);
    let told: Result<_, _> = lines.collect();
    told.unwrap_or_else(|error| panic!("{error} in:\n{}", run.told))
}

/// What a run of a model on two recordings with faults and some of a small graph tell.
pub fn by_runs(scratch: &Scratch, model: &Path, [one, two]: [&PathBuf; 2]) -> Vec<Value> {
    let folder = Scratch::new("json-page-told");
    let graph = folder.file("graph.toml", GRAPH);
    let other = |name: &str, text: &str| {
        let text = format!("schema = 1\nextends = \"graph.toml\"\nname = \"other\"\n{text}\n");
        folder.file(name, text)
    };
    let still = other(
        "still.toml",
        "outputs.predicted = \"still\"\nnodes.drift.windows = [\"40s\"]",
    );
    let none = other("none.toml", "outputs.predicted = \"still\"");
    let silent = other("silent.toml", "nodes.drift.windows = [\"1s\"]");
    let moved = other(
        "moved.toml",
        "outputs.correction = \"correction\"\nnodes.correction = { type = \"compensate\", inputs.rate = \"same\", range = \"50 um\", max_rate = \"1 um/min\", max_slew = \"50 nm/s\" }",
    );
    let x = |nth: u32| 10.0 * f64::from(nth) + 7.0 * (0.9 * f64::from(nth)).sin();
    let row = |nth: u32| format!("{},{:.3}\n", 10 * nth, x(nth));
    let log: String = (0..40).map(row).collect();
    let plain = format!("t,x\n{log}");
    let bad = format!("t,x\n{log}400,?\n300,1\nx,1\nt,x\n410,5000000\n420,1");
    let objects = "{\"t\":0}\n".repeat(2000);
    let (state, rows) = (folder.path("state"), folder.path("rows.csv"));
    let at = |graph: &Path| format!("--swap-at=200={}", graph.display());
    let (other, none) = (at(&still), at(&none));
    let out = scratch.path("told.csv");
    let kept: [&dyn AsRef<OsStr>; 6] = [&"-i", &"-", &"-o", &rows, &"--state", &state];
    let runs = [
        told(model, "", &[&"-i", one, &"-o", &out]),
        told(model, "", &[&"-i", two, &"-o", &out]),
        told(
            model,
            &std::fs::read_to_string(two).unwrap(),
            &[&"-i", &"-"],
        ),
        told(&graph, &bad, &[&"-i", &"-", &"--lenient"]),
        told(&graph, &objects, &[&"-i", &"-"]),
        told(&silent, &plain, &[&"-i", &"-"]),
        told(&moved, &plain, &[&"-i", &"-"]),
        told(&graph, &plain, &[&"-i", &"-", &other]),
        told(&graph, &plain, &[&"-i", &"-", &none, &"--shadow", &"100s"]),
        told(&graph, &plain, &kept),
        told(&graph, &plain, &kept),
    ];
    runs.into_iter().flatten().collect()
}
