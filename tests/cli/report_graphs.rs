//! `athermal report` and `diagnose` of graphs that have several truths of an axis, several predictions of a truth, or several nodes of a kind.

use std::path::{Path, PathBuf};

use crate::workbench::{Finished, Graph, Scratch, athermal_on, simulated};
use serde_json::Value;

/// The die tester with two axes, their drift and the gradients of four sensors.
fn base() -> Graph {
    Graph::named("small")
        .section("sets", "axis = ['X1', 'Z1']; kind = ['150s', '600s']")
        .time("time_s")
        .signal("temperature", "Cel", "plate1 holder1 room chuck", "1min")
        .with("column = '{channel}_degC'")
        .section("signals.position", "unit = 'nm'; channels = 'axis'")
        .with("column = '{channel}_nm'; max_age = '3min'")
        .slope("drift", "position", "5min", "nm/min")
        .slope("gradients", "temperature", "150s 5min 10min", "mK/min")
        .model("thermal", "linear", "gradients", "drift.{axis}", "150s")
        .with("each = 'axis'")
}

/// A model of [`base`] with more nodes, fitted on half a day, and eight hours of another.
struct Reported {
    scratch: Scratch,
    model: PathBuf,
    data: PathBuf,
}

impl Reported {
    fn new(name: &str, more: &str) -> Self {
        let scratch = Scratch::new(name);
        let graph = scratch.file("graph.toml", format!("{}{more}", base()));
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

    fn page(&self) -> String {
        let page = self.scratch.path("page.html");
        self.report(&[&"-o", &page]);
        std::fs::read_to_string(page).unwrap()
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

    let (of, more) = (
        (&reported.model, &reported.data),
        [&"--window" as _, &"--no-fit" as _],
    );
    let windows = athermal_on("diagnose", of.0, of.1, &more).ended(0).out;
    assert!(
        windows.contains("window  drift.X1  drift.Z1  slow.X1  slow.Z1"),
        "{windows}"
    );

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

const COMPENSATE: &str = "type = \"compensate\"\nrange = \"200 um\"\nmax_rate = \"2000 nm/min\"\nmax_slew = \"50 nm/s\"\n";

/// Names in TOML, such as the axes of the die tester's corrected graph in another order.
fn drifts(names: &[&str]) -> String {
    let names: Vec<String> = names
        .iter()
        .map(|name| format!("\"drift.{name}\""))
        .collect();
    names.join(", ")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn largest(series: &Value) -> f64 {
    let values = series["value"].as_array().unwrap().iter();
    values.filter_map(Value::as_f64).fold(0.0, f64::max)
}

#[test]
fn graphs_whose_channels_have_names_of_their_own_are_reported() {
    let windows = "[nodes.two]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"5min\", \"10min\"]\nunit = \"nm/min\"\n\
                   [nodes.named]\ntype = \"pick\"\ninputs.signal = \"position\"\nnames = [\"X left\", \"Z.1\"]\n\
                   [nodes.fall]\ntype = \"slope\"\ninputs.signal = \"named\"\nwindows = [\"5min\"]\nunit = \"nm/min\"\n\
                   [nodes.a]\ntype = \"linear\"\ninputs.features = \"gradients\"\ninputs.truth = \"two.Z1@300s\"\nahead = \"150s\"\n\
                   [nodes.b]\ntype = \"linear\"\ninputs.features = \"gradients\"\ninputs.truth = \"fall.X left\"\nahead = \"150s\"\n";
    let rates = ["a", "b", "thermal"].map(|rate| {
        format!("[nodes.by_{rate}]\ninputs.rate = {{ from = \"{rate}\", max_age = \"1min\" }}\n{COMPENSATE}")
    });
    let again = format!(
        "[nodes.again]\ninputs.rate = {{ from = \"thermal\", max_age = \"1min\" }}\n{COMPENSATE}deadband = \"30 nm/min\"\n"
    );
    let outputs = "[outputs]\na = \"by_a\"\nb = \"by_b\"\nc = \"by_thermal\"\nd = \"again\"\n";
    let reported = Reported::new(
        "report-own-names",
        &format!("{windows}{}{again}{outputs}", rates.concat()),
    );
    let facts = reported.facts();
    assert_eq!(facts["unjudged"], serde_json::json!([]));
    let worth = &facts["worth"];
    let axes: Vec<&str> = worth["axes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|of| of.as_str().unwrap())
        .collect();
    for axis in ["by_thermal.X1", "by_thermal.Z1", "again.X1", "again.Z1"] {
        assert!(axes.contains(&axis), "{axes:?}");
    }
    assert_eq!(axes.len(), 6, "{axes:?}");
    for drift in worth["drift_with"].as_array().unwrap() {
        assert!(largest(drift) > 0.0);
    }
    // The verdict is of the first that integrates what is put out.
    let verdicts = facts["verdicts"].as_array().unwrap();
    let verdict = verdicts
        .iter()
        .find(|of| of["prediction"] == "thermal.Z1")
        .unwrap();
    assert!(verdict["with_correction"].is_number(), "{verdict}");
}

#[test]
fn losses_are_those_of_the_drifts_that_their_nodes_read_in_any_order_and_each_of_several_is_told() {
    let more = format!(
        "[nodes.compensate]\ninputs.rate = {{ from = \"thermal\", max_age = \"1min\" }}\n{COMPENSATE}\
         [nodes.turned]\ntype = \"optical_loss\"\ninputs.drift = [{}]\nradii = [\"1.274 um\", \"10.19 um\"]\n\
         [nodes.side]\ntype = \"optical_loss\"\neach = \"axis\"\ninputs.drift = \"drift.{{axis}}\"\npreset = \"mandelli\"\n\
         [nodes.settled]\ntype = \"settled\"\ninputs.loss = \"side.Z1\"\ninputs.set_point = \"temperature.chuck\"\n\
         below = \"0.3 dB\"\nchange = \"3000 mK\"\n\
         [outputs]\ncorrection = \"compensate\"\nturned = \"turned\"\nside = \"side\"\nsettle_time = \"settled\"\n",
        drifts(&["Z1", "X1"])
    );
    let reported = Reported::new("report-losses", &more);
    let run = reported.scratch.path("run.csv");
    let from = [&reported.model, &reported.data];
    crate::workbench::athermal(&[&"run", from[0], &"--input", from[1], &"--output", &run]).ended(0);
    let text = std::fs::read_to_string(&run).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let facts = reported.facts();
    let worth = &facts["worth"];
    let others = worth["others"].as_array().unwrap();
    let told: Vec<&Value> = std::iter::once(worth).chain(others).collect();
    let expected = [
        ("turned", "turned.loss"),
        ("side.X1", "side.X1"),
        ("side.Z1", "side.Z1"),
    ];
    assert_eq!(told.len(), 3);
    for (light, (node, output)) in told.iter().zip(expected) {
        assert_eq!(light["loss"], node);
        let column = names.iter().position(|name| *name == output).unwrap();
        let cells = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(column).unwrap());
        let most = cells
            .filter_map(|cell| cell.parse().ok())
            .fold(0.0, f64::max);
        let found = largest(&light["loss_without"]);
        assert!(
            (found / most - 1.0).abs() < 1e-6,
            "{node}: {found}, and {most} put out"
        );
    }
    // A settle time belongs to the loss that it reads, and the same steps are one kind whatever the unit of a change.
    assert_eq!(number(&told[2]["loss_limit"]), 0.3);
    assert!(told[0]["settling"].as_array().unwrap().is_empty());
    let changes: Vec<f64> = (told[2]["settling"].as_array().unwrap().iter())
        .map(|change| number(&change["to"]).round())
        .collect();
    assert_eq!(changes, [30.0, 50.0]);
    let steps = told[2]["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 3, "{steps:#?}");
    let told = reported.report(&[]).out.replace('\n', " ");
    assert!(told.contains("losses (side.Z1) below 0.3 dB"), "{told}");
    let page = reported.page();
    assert!(
        !page.contains("NaN"),
        "without a set point there are no steps"
    );
    assert!(page.contains("<h3>turned</h3>") && page.contains("<h3>side.X1</h3>"));
}

#[test]
fn what_cannot_be_judged_of_a_correction_is_told_and_the_rest_is_there() {
    let more = format!(
        "[nodes.limited]\ntype = \"safe_state\"\ninputs.signal = {{ from = \"thermal\", max_age = \"1min\" }}\n\
         when_lost = \"zero\"\nmax_slew = \"100 nm/min/s\"\n\
         [nodes.compensate]\ninputs.rate = {{ from = \"limited\", max_age = \"1min\" }}\n{COMPENSATE}\
         [signals.speed]\nunit = \"nm/min\"\nchannels = [\"S1\"]\ncolumn = \"X1_nm\"\nmax_age = \"3min\"\n\
         [nodes.stepping]\ntype = \"linear\"\ninputs.features = \"gradients\"\ninputs.truth = \"speed.S1\"\nahead = \"0s\"\n\
         [nodes.other]\ninputs.rate = {{ from = \"stepping\", max_age = \"1min\" }}\n{COMPENSATE}\
         [nodes.forecast]\ntype = \"optical_loss\"\ninputs.drift = \"speed.S1\"\nradii = [\"2 um\"]\n\
         [outputs]\nrate = \"thermal\"\ncorrection = \"compensate\"\nother = \"other\"\nloss = \"forecast\"\n"
    );
    let reported = Reported::new("report-unjudged", &more);
    let facts = reported.facts();
    assert_eq!(texts(&facts["unjudged"], "of"), ["other.S1", "forecast"]);
    // What is behind a safe state is corrected like anything else.
    let axes = &facts["worth"]["axes"];
    assert_eq!(axes.as_array().unwrap().len(), 2, "{axes}");
    let verdict = &facts["verdicts"][0];
    assert!(verdict["with_correction"].is_number(), "{verdict}");
    assert_eq!(verdict["node"], "thermal");
    reported.report(&[]).tells(&[
        "`other.S1` cannot be judged: `speed.S1` is no slope of a position",
        "`forecast` cannot be judged: it reads `speed.S1`, which is no drift of a measured position",
    ]);
    assert!(
        reported
            .page()
            .contains("Nothing is known of <b>other.S1</b>")
    );
}

#[test]
fn the_drift_of_a_filtered_position_is_taken_over_its_own_window() {
    let more = format!(
        "[nodes.calm]\ntype = \"hampel\"\ninputs.signal = \"position\"\nwindow = \"10min\"\nthreshold = 5.0\nreplace = \"median\"\n\
         [nodes.fall]\ntype = \"slope\"\ninputs.signal = \"calm\"\nwindows = [\"5min\"]\nunit = \"nm/min\"\n\
         [nodes.rate]\ntype = \"linear\"\neach = \"axis\"\ninputs.features = \"gradients\"\ninputs.truth = \"fall.{{axis}}\"\nahead = \"150s\"\n\
         [nodes.compensate]\ninputs.rate = {{ from = \"rate\", max_age = \"1min\" }}\n{COMPENSATE}\
         [outputs]\nrate = \"rate\"\ncorrection = \"compensate\"\n"
    );
    let reported = Reported::new("report-filtered", &more);
    let facts = reported.facts();
    let axes = facts["course"]["axes"].as_array().unwrap();
    for (nth, axis) in ["fall.X1", "fall.Z1"].iter().enumerate() {
        let measured = axes.iter().find(|of| of["name"] == *axis).unwrap();
        let (measured, without) = (
            largest(&measured["truth"]),
            largest(&facts["worth"]["drift_without"][nth]),
        );
        assert!(
            (without / measured - 1.0).abs() < 1e-9,
            "{axis}: {without}, {measured}"
        );
    }
}

#[test]
fn states_of_stability_are_those_of_the_node_that_reads_the_axis() {
    let state = |axis: &str, stable: u32, transient: u32| {
        format!(
            "[nodes.state_{axis}]\ntype = \"stability\"\ninputs.drift = \"drift.{axis}1\"\n\
             stable_below = \"{stable} nm/min\"\ntransient_above = \"{transient} nm/min\"\n"
        )
    };
    let more = format!(
        "[nodes.slow]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"30min\"]\nunit = \"nm/min\"\n\
         [nodes.slowly]\ntype = \"linear\"\ninputs.features = \"gradients\"\ninputs.truth = \"slow.Z1\"\nahead = \"15min\"\n{}{}\
         [outputs]\npredicted = \"thermal\"\nslow = \"slowly\"\nx = \"state_X\"\nz = \"state_Z\"\n",
        state("X", 5, 15),
        state("Z", 100, 400)
    );
    let reported = Reported::new("report-states", &more);
    let facts = reported.facts();
    let axes = facts["course"]["axes"].as_array().unwrap();
    let states: Vec<&Value> = axes.iter().map(|of| &of["states"]).collect();
    let expected = [
        serde_json::json!([5.0, 15.0]),
        serde_json::json!([100.0, 400.0]),
        Value::Null,
    ];
    assert!(states.into_iter().eq(&expected), "{axes:#?}");
    let page = reported.page();
    assert!(page.contains("Shaded of X1: quasi-stable from 5, transient from 15 nm/min."));
    assert!(page.contains("Shaded of drift.Z1: quasi-stable from 100, transient from 400 nm/min."));
}

#[test]
fn what_was_not_measured_has_no_largest_value() {
    let more = format!(
        "[nodes.compensate]\ninputs.rate = {{ from = \"thermal\", max_age = \"1min\" }}\n{COMPENSATE}\
         [nodes.loss]\ntype = \"optical_loss\"\ninputs.drift = \"drift\"\npreset = \"mandelli\"\n\
         [nodes.settled]\ntype = \"settled\"\ninputs.loss = \"loss\"\ninputs.set_point = \"temperature.chuck\"\n\
         below = \"0.2 dB\"\nchange = \"3 K\"\n[outputs]\ncorrection = \"compensate\"\nloss = \"loss\"\nsettle_time = \"settled\"\n"
    );
    let mut reported = Reported::new("report-unmeasured", &more);
    // From three hours on, and so before and after the change at four, the position of Z1 is not measured, and so no loss.
    let text = std::fs::read_to_string(&reported.data).unwrap();
    let names: Vec<String> = text
        .lines()
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let time: f64 = cells[0].parse().unwrap_or(0.0);
        let cell = |(name, cell): (&String, &&str)| match name.as_str() {
            "Z1_nm" if time > 10_800.0 => String::new(),
            _ => (*cell).to_owned(),
        };
        let cells: Vec<String> = names.iter().zip(&cells).map(cell).collect();
        cells.join(",") + "\n"
    };
    let lost: String = text.lines().map(row).collect();
    reported.data = reported.scratch.file("lost.csv", lost);
    let facts = reported.facts();
    let change = &facts["worth"]["settling"][0];
    for key in ["without_min", "with_min", "largest_without", "largest_with"] {
        assert!(
            change.as_object().unwrap()[key].is_null(),
            "{key}: {change}"
        );
    }
    let step = &facts["worth"]["steps"][1];
    assert!(
        step.as_object().unwrap()["largest_with"].is_null(),
        "{step}"
    );
    let told = reported.report(&[]).out;
    assert!(!told.contains("0.00"), "{told}");
}

#[test]
fn responses_are_those_of_the_estimator_that_is_put_out_though_it_stands_for_no_set() {
    let more = r#"
[nodes.other]
type = "linear"
inputs.features = "gradients.chuck@*"
inputs.truth = "drift.X1"
ahead = "150s"
[outputs]
other = "other"
"#;
    let reported = Reported::new("report-put-out", more);
    let folder = reported.scratch.path("plots");
    reported.report(&[&"--plots", &folder]);
    for kind in ["steps", "impulses"] {
        let svg = std::fs::read_to_string(folder.join(format!("{kind}-X1.svg"))).unwrap();
        assert!(svg.contains("response of other"), "{svg}");
    }
}
