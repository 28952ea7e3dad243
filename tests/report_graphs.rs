//! `athermal report` of graphs that have several truths of an axis, several predictions of a truth, or several nodes of a kind.

#![allow(clippy::unwrap_used)]

mod workbench;

use std::path::{Path, PathBuf};

use serde_json::Value;
use workbench::{Finished, Scratch, athermal_on, simulated};

/// The die tester with two axes, their drift and the gradients of four sensors.
const BASE: &str = r#"schema = 1
name = "small"
[sets]
axis = ["X1", "Z1"]
kind = ["150s", "600s"]
[time]
column = "time_s"
[signals.temperature]
unit = "Cel"
channels = ["plate1", "holder1", "room", "chuck"]
column = "{channel}_degC"
max_age = "1min"
[signals.position]
unit = "nm"
channels = "axis"
column = "{channel}_nm"
max_age = "3min"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
unit = "nm/min"
[nodes.gradients]
type = "slope"
inputs.signal = "temperature"
windows = ["150s", "5min", "10min"]
unit = "mK/min"
[nodes.thermal]
type = "linear"
each = "axis"
inputs.features = "gradients"
inputs.truth = "drift.{axis}"
ahead = "150s"
"#;

/// A model of [`BASE`] with more nodes, fitted on half a day, and eight hours of another.
struct Reported {
    scratch: Scratch,
    model: PathBuf,
    data: PathBuf,
}

impl Reported {
    fn new(name: &str, more: &str) -> Self {
        let scratch = Scratch::new(name);
        let graph = scratch.file("graph.toml", format!("{BASE}{more}"));
        let fit = simulated(&scratch, "fit.csv", "die-tester", 0.5, 1);
        let data = simulated(&scratch, "data.csv", "die-tester", 0.35, 2);
        let model = scratch.path("model.json");
        athermal_on("fit", &graph, &fit, &[&"-o", &model]).ended(0);
        Self {
            scratch,
            model,
            data,
        }
    }

    fn report(&self, more: &[&dyn AsRef<std::ffi::OsStr>]) -> Finished {
        athermal_on("report", &self.model, &self.data, more).ended(0)
    }

    fn facts(&self) -> Value {
        self.report(&[&"--format", &"json"]).json()
    }
}

fn texts<'a>(list: &'a Value, key: &str) -> Vec<&'a str> {
    let of = |item: &'a Value| item[key].as_str().unwrap();
    list.as_array().unwrap().iter().map(of).collect()
}

/// The names of the pictures in a folder that are SVG files.
fn pictures(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let svg = names.filter_map(|name| Some(name.strip_suffix(".svg")?.to_owned()));
    svg.collect()
}

#[test]
fn the_verdict_is_that_of_the_prediction_that_is_put_out_where_a_node_predicts_a_truth_twice() {
    let reported = Reported::new(
        "report-twice-predicted",
        "[nodes.twice]\ntype = \"linear\"\neach = [\"axis\", \"kind\"]\ninputs.features = \"gradients.*@{kind}\"\n\
         inputs.truth = \"drift.{axis}\"\nahead = \"5min\"\n[outputs]\npredicted = \"twice.*-600s\"\n",
    );
    let facts = reported.facts();
    for verdict in facts["verdicts"].as_array().unwrap() {
        let axis = verdict["axis"].as_str().unwrap();
        let put_out = format!("twice.{axis}-600s");
        assert_eq!(verdict["prediction"], put_out);
        let scores = facts["scores"].as_array().unwrap().iter();
        let score = scores.clone().find(|of| of["output"] == put_out).unwrap();
        assert_eq!(verdict["rmse"], score["rmse"], "{axis}");
    }
    let told = reported.report(&[]).out.replace("\n   ", " ");
    assert!(
        told.contains("X1: twice.X1-600s predicts the drift"),
        "{told}"
    );
}

#[test]
fn two_truths_of_one_axis_have_names_curves_and_pictures_of_their_own() {
    let reported = Reported::new(
        "report-two-truths",
        "[nodes.slow]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"30min\"]\nunit = \"nm/min\"\n\
         [nodes.slowly]\ntype = \"linear\"\neach = \"axis\"\ninputs.features = \"gradients\"\ninputs.truth = \"slow.{axis}\"\n\
         ahead = \"15min\"\n[nodes.compensate]\ntype = \"compensate\"\ninputs.rate = { from = \"thermal\", max_age = \"1min\" }\n\
         range = \"200 um\"\nmax_rate = \"2000 nm/min\"\nmax_slew = \"50 nm/s\"\n\
         [outputs]\npredicted = \"thermal\"\nslow = \"slowly\"\ncorrection = \"compensate\"\n",
    );
    let facts = reported.facts();
    let axes = ["drift.X1", "drift.Z1", "slow.X1", "slow.Z1"];
    assert_eq!(texts(&facts["course"]["axes"], "name"), axes);
    assert_eq!(texts(&facts["verdicts"], "axis"), axes);
    assert_eq!(texts(&facts["errors"], "axis"), axes);
    // What is corrected is the drift over five minutes.
    let corrected: Vec<bool> = (facts["verdicts"].as_array().unwrap().iter())
        .map(|verdict| verdict["with_correction"].is_number())
        .collect();
    assert_eq!(corrected, [true, true, false, false]);

    let folder = reported.scratch.path("plots");
    let told = reported.report(&[&"--plots", &folder]);
    let pictures = pictures(&folder);
    told.tells(&[&format!("wrote {} pictures", pictures.len())]);
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    for kind in ["lags", "autocorrelation", "drift"] {
        let [fast, slow] = ["drift", "slow"].map(|truth| read(&format!("{kind}-{truth}_Z1.svg")));
        let drawn = |svg: &str| svg.split("<path").nth(1).unwrap().to_owned();
        assert!(drawn(&fast) != drawn(&slow), "{kind}");
    }
}

#[test]
fn voters_keep_their_names_and_weights_whatever_their_nodes_are_called() {
    let reported = Reported::new(
        "report-named-voters",
        "[nodes.weight-old]\ntype = \"ar\"\neach = \"axis\"\ninputs.truth = \"drift.{axis}\"\nahead = \"150s\"\nlags = [\"150s\"]\n\
         [nodes.vote]\ntype = \"auto_weighted\"\neach = \"axis\"\ninputs.voters = [\"thermal.{axis}\", \"weight-old.{axis}\"]\n\
         inputs.truth = \"drift.{axis}\"\nmemory = \"15min\"\n[outputs]\npredicted = \"vote\"\n",
    );
    let facts = reported.facts();
    let axis = &facts["course"]["axes"][0];
    assert_eq!(texts(&axis["weights"], "voter"), ["thermal", "weight-old"]);
    let folder = reported.scratch.path("plots");
    reported.report(&[&"--plots", &folder]);
    let weights = std::fs::read_to_string(folder.join("weights-X1.svg")).unwrap();
    for voter in ["thermal", "weight-old"] {
        assert!(weights.contains(&format!(">{voter}</text>")), "{voter}");
    }
}

#[test]
fn two_voters_of_one_node_have_a_name_and_a_line_each() {
    let reported = Reported::new(
        "report-two-voters",
        "[nodes.twice]\ntype = \"linear\"\neach = [\"axis\", \"kind\"]\ninputs.features = \"gradients.*@{kind}\"\n\
         inputs.truth = \"drift.{axis}\"\nahead = \"150s\"\n[nodes.vote]\ntype = \"auto_weighted\"\neach = \"axis\"\n\
         inputs.voters = [\"twice.{axis}-150s\", \"twice.{axis}-600s\"]\ninputs.truth = \"drift.{axis}\"\nmemory = \"15min\"\n\
         [outputs]\npredicted = \"vote\"\n",
    );
    let folder = reported.scratch.path("plots");
    reported.report(&[&"--plots", &folder]);
    for kind in ["votes", "weights"] {
        let picture = std::fs::read_to_string(folder.join(format!("{kind}-X1.svg"))).unwrap();
        for voter in ["twice.X1-150s", "twice.X1-600s"] {
            assert!(
                picture.contains(&format!(">{voter}</text>")),
                "{kind}: {voter}"
            );
        }
    }
}
