//! Every job does the same for whoever asks for it: as words of the command line, and as data, which is how Python asks. The same facts to
//! the bit, and the same remarks, in the words of each.

use std::path::Path;

use athermal::core::compile::Wanted;
use athermal::core::watch::{Kept, Watch};
use athermal::jobs::asked::{Asked, Job, done, schemas};
use athermal::jobs::compare::Compare;
use athermal::jobs::diagnose::Diagnose;
use athermal::jobs::evaluate::Evaluate;
use athermal::jobs::fit::Fit;
use athermal::jobs::init::Init;
use athermal::jobs::model::for_scores;
use athermal::jobs::predict::Predict;
use athermal::jobs::report::Report;
use athermal::jobs::simulate::Simulate;
use athermal::run::live::{Frame, Sink, SinkError};
use athermal::{Instant, Model};
use athermal_command::Failure;
use serde_json::{Value, json};

use crate::workbench::{Scratch, athermal};

const GRAPH: &str = r#"schema = 1
name = "hosts"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], range = ["0 Cel", "60 Cel"], max_age = "5min" }
signals.position = { unit = "nm", channels = ["Z"], max_age = "5min" }
nodes.gradients = { type = "slope", inputs.signal = "temperature", windows = ["10min"], unit = "K/min" }
nodes.drift = { type = "slope", inputs.signal = "position", windows = ["10min"], unit = "nm/min" }
nodes.thermal = { type = "linear", inputs.features = "gradients", inputs.truth = "drift.Z", ahead = "0s" }
outputs.drift = "drift"
outputs.thermal = "thermal"
"#;

/// Three days, a row a minute, as strangers write them: a cell that is no number, a row that comes again, a sample far out of range, and
/// a sensor that is stuck for the last hours.
fn log() -> String {
    let mut text = "time_s,plate,room,Z\n".to_owned();
    for minute in 0..4_320_u32 {
        let t = f64::from(minute);
        let plate = 20.0 + 2.0 * (t / 97.0).sin() + 0.3 * (t / 11.0).sin();
        let room = 20.0 + 0.5 * (t / 310.0).cos() + 0.02 * (t * 1.7).sin();
        let z = 900.0 * plate - 700.0 * room + 3.0 * (t * 2.3).sin();
        let room = if minute > 3_900 { 20.125 } else { room };
        let plate = match minute {
            100 => "n.c.".to_owned(),
            200 => "850.0".to_owned(),
            _ => format!("{plate:.4}"),
        };
        text += &format!("{},{plate},{room:.4},{z:.2}\n", 60 * minute);
        if minute == 300 {
            text += &format!("{},20.0,20.0,0\n", 60 * minute);
        }
    }
    text
}

/// What a job said and found.
struct Heard {
    facts: Value,
    remarks: Vec<String>,
}

/// A text in the words of the command line, on one line.
fn of_the_command_line(text: &str) -> String {
    let mut text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for (name, schema) in schemas() {
        for (key, of) in schema["properties"].as_object().unwrap() {
            let flag = format!("--{}", key.replace('_', "-"));
            let by = match of["type"] == "boolean" {
                true => format!("{key}=True"),
                false => format!("`{key}="),
            };
            let is = match of["type"] == "boolean" {
                true => flag.clone(),
                false => format!("`{flag} "),
            };
            text = text.replace(&by, &is);
        }
        text = text.replace(&format!("`{name}(--"), &format!("`athermal {name} --"));
    }
    text.replace(")`", "`")
}

/// Asks by data.
fn by_data<T: Job>(
    options: &Value,
    job: impl FnOnce(&T, &dyn Watch) -> Result<Value, Failure>,
) -> Heard {
    let host = Kept::default();
    let asked = Asked {
        options: options.as_object().unwrap().clone(),
        ..Asked::default()
    };
    let facts = done(&asked, &host, job).unwrap();
    let remarks = host.remarks().into_iter();
    let warnings = remarks.filter(|of| of.level == "warning");
    Heard {
        facts,
        remarks: warnings
            .map(|of| of_the_command_line(&of.message.to_string()))
            .collect(),
    }
}

/// Asks by the same options as words, with what else the command line needs.
fn by_words(command: &str, files: &[&Path], options: &Value, more: &[&str]) -> Heard {
    let mut words: Vec<String> = vec![command.to_owned()];
    words.extend(files.iter().map(|of| of.display().to_string()));
    for (key, value) in options.as_object().unwrap() {
        let is_positional = command == "init" && key == "data" || key == "machine";
        let texts = match value {
            Value::Bool(_) => Vec::new(),
            Value::Array(all) => all
                .iter()
                .map(|of| of.as_str().unwrap().to_owned())
                .collect(),
            Value::String(text) => vec![text.clone()],
            other => vec![other.to_string()],
        };
        if !is_positional {
            words.push(format!("--{}", key.replace('_', "-")));
        }
        words.extend(texts);
    }
    words.extend(more.iter().map(|of| (*of).to_owned()));
    words.extend(["--format", "json"].map(str::to_owned));
    let words: Vec<&dyn AsRef<std::ffi::OsStr>> = words.iter().map(|of| of as _).collect();
    let ended = athermal(&words).ended(0);
    let lines = ended.told.split("\nwarning: ");
    let lines = lines.enumerate().filter_map(|(nth, line)| match nth {
        0 => line.strip_prefix("warning: "),
        _ => Some(line),
    });
    let text = |line: &str| line.split("\nnote: ").next().unwrap_or_default().to_owned();
    Heard {
        facts: serde_json::from_str(&ended.out).unwrap_or_default(),
        remarks: lines.map(|line| of_the_command_line(&text(line))).collect(),
    }
}

fn same(job: &str, words: &Heard, data: &Heard) {
    assert_eq!(words.remarks, data.remarks, "{job}");
    assert_eq!(words.facts, data.facts, "{job}");
}

/// A model but for its date.
fn undated(model: &Model) -> Value {
    let mut value: Value = serde_json::from_str(&model.to_text().unwrap()).unwrap();
    value["card"]["created"] = Value::Null;
    value
}

/// Keeps rows as a run writes them.
struct Rows(Vec<Vec<f64>>);

impl Sink for Rows {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        let secs = (frame.time - Instant::from_ns(0)).secs();
        self.0.push(
            std::iter::once(secs)
                .chain(frame.outputs.iter().copied())
                .collect(),
        );
        Ok(())
    }
}

#[test]
fn every_job_gives_the_same_facts_and_remarks_by_words_and_by_data() {
    let scratch = Scratch::new("hosts");
    let graph = scratch.file("graph.toml", GRAPH);
    let (log, model) = (scratch.file("log.csv", log()), scratch.path("model.json"));
    let loaded = Model::load_to_fit(
        &graph,
        Wanted::default(),
        &mut Default::default(),
        &mut Default::default(),
    );
    let loaded = loaded.unwrap();
    let data = json!({ "data": [log], "lenient": true });
    let mut tried = Vec::new();

    for (name, more) in [("fit", json!({})), ("blocks", json!({ "blocks": "day" }))] {
        let mut options = data.clone();
        options
            .as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        let output = model.display().to_string();
        let mut words = by_words("fit", &[&graph], &options, &["-o", &output]);
        words.facts = undated(&Model::load(&model).unwrap());
        let asked = by_data(&options, |job: &Fit, host| {
            let mut fitted = loaded.clone();
            job.fit(&mut fitted, host)?;
            Ok(undated(&fitted))
        });
        same(name, &words, &asked);
        assert!(words.remarks.len() > 3, "{:?}", words.remarks);
        tried.push(name);
    }
    athermal(&[&"fit", &graph, &"--data", &log, &"--lenient", &"-o", &model]).ended(0);
    let fitted = Model::load(&model).unwrap();

    let evaluated = by_data(&data, |job: &Evaluate, host| {
        Ok(job.find(&for_scores(&fitted)?, host)?.facts)
    });
    same(
        "evaluate",
        &by_words("evaluate", &[&model], &data, &[]),
        &evaluated,
    );
    let reported = by_data(&data, |job: &Report, host| {
        Ok(job.find(&for_scores(&fitted)?, host)?.0.facts)
    });
    same(
        "report",
        &by_words("report", &[&model], &data, &[]),
        &reported,
    );
    let diagnosed = by_data(&data, |job: &Diagnose, host| {
        Ok(job.find(&fitted, false, host)?.0.facts)
    });
    same(
        "diagnose",
        &by_words("diagnose", &[&model], &data, &[]),
        &diagnosed,
    );

    let mut options = data.clone();
    options["on"] = json!([log]);
    let untimed = |mut heard: Heard| {
        heard.facts["graphs"][0]["fit_s"] = Value::Null;
        heard
    };
    let graphs = vec![(graph.display().to_string(), loaded.clone())];
    let compared = by_data(&options, |job: &Compare, host| {
        Ok(job.find(graphs, host)?.0.facts)
    });
    same(
        "compare",
        &untimed(by_words("compare", &[&graph], &options, &[])),
        &untimed(compared),
    );

    let options = json!({ "data": [log], "drifts": ["Z"] });
    let written = scratch.path("starter.toml").display().to_string();
    let mut words = by_words("init", &[], &options, &["-o", &written]);
    words.facts["text"] = std::fs::read_to_string(&written).unwrap().into();
    let starter = by_data(&options, |job: &Init, _| {
        let of = job.find()?;
        Ok(json!({
            "graph": written, "columns": of.columns, "windows": of.windows, "remarks": of.remarks, "text": of.text,
        }))
    });
    same("init", &words, &starter);

    let options = json!({ "machine": "die-tester", "days": 0.05, "seed": 3, "truth": true, "fault": ["temperature.room=stuck,from=10min"] });
    let output = scratch.path("simulated.csv");
    let mut words = by_words(
        "simulate",
        &[],
        &options,
        &["-o", &output.display().to_string()],
    );
    words.facts = rows_of(&output);
    let simulated = by_data(&options, |job: &Simulate, host| {
        let (machine, mut rows) = (job.machine()?, Vec::new());
        job.rows(&*machine, host, &mut |at, values| {
            rows.push(row(
                std::iter::once(at as f64 / 1e9).chain(values.iter().copied())
            ));
            Ok(())
        })?;
        Ok(rows.into())
    });
    same("simulate", &words, &simulated);

    let output = scratch.path("predicted.csv");
    let mut words = by_words(
        "run",
        &[&model],
        &json!({ "input": log, "lenient": true }),
        &["--output", &output.display().to_string()],
    );
    words.facts = rows_of(&output);
    let predicted = by_data(&data, |job: &Predict, host| {
        let mut rows = Rows(Vec::new());
        job.run(&fitted, &mut rows, host)?;
        Ok(rows.0.into_iter().map(row).collect())
    });
    assert_eq!(words.facts, predicted.facts, "predict");
    tried.extend([
        "evaluate", "report", "diagnose", "compare", "init", "simulate", "predict",
    ]);
    for (name, _) in schemas() {
        assert!(tried.contains(&name), "{name} is not tried");
    }
}

#[test]
fn a_machine_of_a_fleet_has_the_model_and_the_remarks_of_a_fit_and_of_an_evaluation_alone() {
    let scratch = Scratch::new("hosts-fleet");
    let graph = scratch.file("graph.toml", GRAPH);
    let folder = scratch.path("logs/machine=a");
    std::fs::create_dir_all(&folder).unwrap();
    let (log, models) = (folder.join("log.csv"), scratch.path("models"));
    std::fs::write(&log, self::log()).unwrap();
    let (data, alone) = (
        json!({ "data": [log], "lenient": true }),
        scratch.path("alone.json"),
    );
    let learned = |path: &Path| {
        let text = std::fs::read_to_string(path).unwrap();
        text[text.find("\"graph\":").unwrap()..].to_owned()
    };
    let texts = |doubts: &Value| -> Vec<String> {
        let all = doubts.as_array().unwrap().iter();
        all.map(|of| of_the_command_line(of["text"].as_str().unwrap()))
            .collect()
    };
    for more in [&[][..], &["--blocks", "day"]] {
        let mut words = vec!["-o", alone.to_str().unwrap()];
        words.extend(more);
        let fit = by_words("fit", &[&graph], &data, &words);
        let mut fleet: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![
            &"fleet",
            &"fit",
            &graph,
            &"--data",
            &log,
            &"--lenient",
            &"--all",
            &"-o",
            &models,
        ];
        fleet.extend(more.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
        athermal(&fleet).ended(0);
        let manifest = std::fs::read_to_string(models.join("_fleet.json")).unwrap();
        let manifest: Value = serde_json::from_str(&manifest).unwrap();
        assert_eq!(
            texts(&manifest["machines"]["a"]["doubts"]),
            fit.remarks,
            "{more:?}"
        );
        assert_eq!(learned(&models.join("a.json")), learned(&alone), "{more:?}");
    }
    let evaluated = by_words("evaluate", &[&alone], &data, &[]);
    let fleet = athermal(&[
        &"fleet",
        &"evaluate",
        &models,
        &"--data",
        &log,
        &"--lenient",
        &"--format",
        &"json",
    ]);
    let doubts = texts(&fleet.ended(0).json()["machines"][0]["doubts"]);
    assert!(doubts.len() > 3, "{doubts:?}");
    assert_eq!(doubts[..], evaluated.remarks[..doubts.len()]);
}

/// A row with its absent values as nothing.
fn row(values: impl IntoIterator<Item = f64>) -> Value {
    values
        .into_iter()
        .map(|of| if of.is_nan() { Value::Null } else { of.into() })
        .collect()
}

/// The rows of a table.
fn rows_of(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap();
    let cell = |cell: &str| cell.parse().unwrap_or(f64::NAN);
    text.lines()
        .skip(1)
        .map(|line| row(line.split(',').map(cell)))
        .collect()
}
