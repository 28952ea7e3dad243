//! What `evaluate --mode` makes of past truths: measured ones, those of some steps before, or none but predictions.

use std::path::Path;

use crate::compare::scored_together;
use crate::workbench::{Graph, Scratch, athermal, data, graph};

fn modes(learn: &str) -> Graph {
    Graph::new()
        .time("time_s")
        .signal("input", "V", "a", "10s")
        .with("column = '{channel}'")
        .signal("output", "V", "y", "10s")
        .with("column = '{channel}'")
        .model("lasting", "persistence", "", "output.y", "10s")
        .section("nodes.features", "type = 'linear'; ahead = '10s'")
        .with("inputs = { features = 'input.a', truth = 'output.y' }")
        .model("level", "kalman", "", "output.y", "10s")
        .with(learn)
        .outputs("lasting = 'lasting'; features = 'features'; level = 'level'")
}

/// The same with an estimator that follows truths.
fn followed() -> Graph {
    modes("")
        .with("followed = 'followed'")
        .model("followed", "arma", "", "output.y", "0s")
        .with("na = 1; nc = 0")
}

/// Numbers without a pattern that a model of these could learn by heart.
fn series(length: usize) -> Vec<[f64; 2]> {
    let mut state = 12_345_u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1 << 30) - 1.0
    };
    let mut y = 0.0;
    (0..length)
        .map(|_| {
            let a = random();
            y = 0.9 * y + 0.3 * a + random();
            [a, y]
        })
        .collect()
}

fn csv(rows: &[[f64; 2]]) -> String {
    let lines = rows.iter().enumerate();
    let lines = lines.map(|(nth, [a, y])| format!("{},{a},{y}\n", 10 * nth));
    format!("time_s,a,y\n{}", lines.collect::<String>())
}

fn fitted(scratch: &Scratch, name: &str, graph: &Path, data: &Path) -> std::path::PathBuf {
    let model = scratch.path(name);
    athermal(&[&"fit", &graph, &"--data", &data, &"--output", &model]).ended(0);
    model
}

fn scores(model: &Path, data: &Path, mode: &[&str]) -> Vec<serde_json::Value> {
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
        vec![&"evaluate", &model, &"--data", &data, &"--format", &"json"];
    arguments.extend(mode.iter().map(|part| part as &dyn AsRef<std::ffi::OsStr>));
    let told = athermal(&arguments).ended(0).json();
    told["scores"].as_array().unwrap().clone()
}

fn figure(scores: &[serde_json::Value], node: &str, figure: &str) -> f64 {
    let of = scores.iter().find(|score| score["node"] == node).unwrap();
    of[figure].as_f64().unwrap()
}

fn root_mean_square(errors: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = errors.map(|error| error * error).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[track_caller]
fn near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() < 1e-9 * expected.abs(),
        "{found} is not {expected}"
    );
}

#[test]
fn the_last_truth_is_repeated_from_as_far_back_as_the_mode_says() {
    let scratch = Scratch::new("modes");
    let rows = series(200);
    let data = scratch.file("data.csv", csv(&rows));
    let graph = scratch.file("graph.toml", modes(""));
    let model = fitted(&scratch, "model.json", &graph, &data);
    let y: Vec<f64> = rows.iter().map(|row| row[1]).collect();

    let one = scores(&model, &data, &["--each-on-its-own"]);
    near(
        figure(&one, "lasting", "rmse"),
        root_mean_square((1..200).map(|t| y[t - 1] - y[t])),
    );
    let three = ["--mode", "k-step", "--steps", "3", "--each-on-its-own"];
    let three = scores(&model, &data, &three);
    near(
        figure(&three, "lasting", "rmse"),
        root_mean_square((3..200).map(|t| y[t - 3] - y[t])),
    );
    let repeats = root_mean_square((3..200).map(|t| y[t - 3] - y[t]));
    for of in &three {
        // Features have a prediction of the first three, and nothing to repeat.
        near(of["baseline_persistence"].as_f64().unwrap(), repeats);
    }
    let free = scores(&model, &data, &["--mode", "free-run", "--each-on-its-own"]);
    assert!(free.iter().all(|of| of["baseline_persistence"].is_null()));
    near(
        figure(&free, "lasting", "rmse"),
        root_mean_square((1..200).map(|t| y[0] - y[t])),
    );
    for mode in [&three, &free] {
        assert_eq!(
            figure(mode, "features", "rmse"),
            figure(&one, "features", "rmse"),
            "what reads no past truth differs"
        );
        assert!(figure(mode, "level", "rmse") > figure(&one, "level", "rmse"));
    }
    let spread = {
        let mean = y[1..].iter().sum::<f64>() / 199.0;
        root_mean_square(y[1..].iter().map(|y| y - mean))
    };
    near(
        figure(&one, "lasting", "fit"),
        100.0 * (1.0 - figure(&one, "lasting", "rmse") / spread),
    );
}

#[test]
fn persistence_of_some_steps_repeats_the_last_truth_so_far_back_also_where_rows_are_not_as_far_apart()
 {
    let scratch = Scratch::new("modes-persistence");
    // Between 7 and 13 s apart, so that a step without a horizon is not always as long.
    let rows = series(200);
    let times: Vec<f64> = (0..200)
        .map(|nth| f64::from(10 * nth + [0, 3, 0, 2][nth as usize % 4]))
        .collect();
    let lines = rows.iter().zip(&times);
    let lines = lines.map(|([a, y], time)| format!("{time},{a},{y}\n"));
    let text = format!("time_s,a,y\n{}", lines.collect::<String>());
    let data = scratch.file("data.csv", text);
    let last = |limit: f64| times.iter().rposition(|&time| time <= limit);
    for ahead in [10.0, 0.0] {
        let text = modes("").replace("max_age = \"10s\"", "max_age = \"20s\"");
        let text = text.replace("ahead = \"10s\"", &format!("ahead = \"{ahead}s\""));
        let graph = scratch.file("graph.toml", text);
        let model = fitted(&scratch, "model.json", &graph, &data);
        for steps in [1, 2, 5] {
            let mode = [
                "--mode",
                "k-step",
                "--steps",
                &steps.to_string(),
                "--each-on-its-own",
            ];
            let scores = scores(&model, &data, &mode);
            let errors = (0..200).filter_map(|nth| {
                let run = last(times[nth] - ahead)?;
                let before = run
                    .checked_sub(1)
                    .map_or(0.0, |before| times[run] - times[before]);
                let step = if ahead > 0.0 { ahead } else { before };
                let mut origin = times[run] + ahead - f64::from(steps) * step;
                if ahead == 0.0 {
                    origin = origin.min(times[run] - 1e-9);
                }
                Some(rows[last(origin.min(times[run]))?][1] - rows[nth][1])
            });
            near(
                figure(&scores, "features", "baseline_persistence"),
                root_mean_square(errors),
            );
        }
    }
}

#[test]
fn the_error_of_a_fit_of_kalman_is_that_of_evaluating_it_on_the_same_rows() {
    let scratch = Scratch::new("modes-in-sample");
    let rows = series(400);
    let first = scratch.file("first.csv", csv(&rows[..250]));
    let second = scratch.file("second.csv", csv(&rows[250..]));
    let node = "[nodes.level]\ntype = \"kalman\"\n";
    // Nothing fades in it between the truths of an evaluation.
    let forever = "memory = \"100000d\"";
    let features = "inputs.features = \"input.a\"";
    for (ahead, more) in [
        ("0s", ""),
        ("10s", features),
        ("30s", features),
        ("30s", "inputs.features = \"input.a\"\nlearn = false"),
    ] {
        let text = modes("");
        let text = text.replace(node, &format!("{node}{forever}\n{more}\n"));
        let text = text.replace("ahead = \"10s\"", &format!("ahead = \"{ahead}\""));
        let graph = scratch.file("graph.toml", text);
        let model = scratch.path("model.json");
        athermal(&[&"fit", &graph, &"--data", &first, &second, &"-o", &model]).ended(0);
        let text = std::fs::read_to_string(&model).unwrap();
        let kept: serde_json::Value = serde_json::from_str(&text).unwrap();
        let of = |all: &serde_json::Value| {
            let mut all = all.as_array().unwrap().iter();
            all.find(|of| of["node"] == "level").unwrap().clone()
        };
        let card = of(&kept["card"]["estimators"]);
        let score = athermal(&[
            &"evaluate",
            &model,
            &"--data",
            &first,
            &second,
            &"--each-on-its-own",
            &"--format",
            &"json",
        ]);
        let score = of(&score.ended(0).json()["scores"]);
        assert_eq!(card["rows"], score["n"], "{ahead} {more}");
        let of_fit = card["in_sample_rmse"].as_f64().unwrap();
        near(of_fit, score["rmse"].as_f64().unwrap());
    }
}

#[test]
fn in_a_free_run_nothing_is_learned_and_one_step_is_the_first_of_several() {
    let scratch = Scratch::new("modes-learning");
    let data = scratch.file("data.csv", csv(&series(200)));
    let graph = scratch.file("graph.toml", modes(""));
    let still = scratch.file("still.toml", modes("learn = false"));
    let model = fitted(&scratch, "model.json", &graph, &data);
    let still = fitted(&scratch, "still.json", &still, &data);
    let free = scores(&model, &data, &["--mode", "free-run"]);
    assert_eq!(
        figure(&free, "level", "rmse"),
        figure(&scores(&still, &data, &[]), "level", "rmse")
    );
    let first = scores(&model, &data, &["--mode", "k-step", "--steps", "1"]);
    let told = athermal(&[
        &"evaluate",
        &model,
        &"--data",
        &data,
        &"--mode",
        &"k-step",
        &"--steps",
        &"1",
    ]);
    let told = told.ended(0).out;
    assert!(told.starts_with("1 step ahead: "), "{told}");
    let one = scores(&model, &data, &[]);
    for node in ["lasting", "features", "level"] {
        assert_eq!(
            figure(&first, node, "rmse"),
            figure(&one, node, "rmse"),
            "{node}"
        );
    }
}

#[test]
fn what_follows_truths_predicts_from_as_many_steps_back_as_are_asked_for() {
    let scratch = Scratch::new("modes-followed");
    let rows = series(400);
    let data = scratch.file("data.csv", csv(&rows));
    let text = followed();
    let graph = scratch.file("graph.toml", text);
    let model = fitted(&scratch, "model.json", &graph, &data);
    let told = athermal(&[&"show", &model, &"--format", &"json"]).ended(0);
    let told = told.json();
    let mut all = told["estimators"].as_array().unwrap().iter();
    let followed = all.find(|of| of["node"] == "followed").unwrap();
    let terms = followed["coefficients"].as_array().unwrap();
    let value = |nth: usize| terms[nth]["value"].as_f64().unwrap();
    let (level, kept) = (value(0), -value(1));
    let ahead = |y: f64, steps: usize| level + kept.powi(steps as i32) * (y - level);
    for steps in [1, 2, 3] {
        let mode = ["--mode", "k-step", "--steps", &steps.to_string()];
        let found = scores(&model, &data, &[&mode[..], &["--each-on-its-own"]].concat());
        let errors = (steps..400).map(|t| ahead(rows[t - steps][1], steps) - rows[t][1]);
        let expected = root_mean_square(errors);
        let found = figure(&found, "followed", "rmse");
        // The first predictions, of a model that has yet to be told of a truth, count too.
        assert!(
            (found / expected - 1.0).abs() < 0.01,
            "{steps}: {found} {expected} {terms:?}"
        );
    }
}

#[test]
fn a_model_that_goes_on_from_the_last_truth_knows_as_many_with_a_horizon_of_one_sample_as_with_none()
 {
    let scratch = Scratch::new("modes-horizon");
    // A gap before the last truth is not how far ahead the others are predicted.
    let data = scratch.file("data.csv", csv(&series(400)) + "4470,0.5,0.5\n");
    let text = followed();
    let models = ["0s", "10s"].map(|ahead| {
        let node = format!("inputs.truth = \"output.y\"\nahead = \"{ahead}\"");
        let text = text.replace("inputs.truth = \"output.y\"\nahead = \"10s\"", &node);
        let text = text.replace("inputs.truth = \"output.y\"\nahead = \"0s\"", &node);
        let graph = scratch.file("graph.toml", text);
        fitted(&scratch, &format!("{ahead}.json"), &graph, &data)
    });
    for steps in ["1", "2", "5"] {
        let mode = ["--mode", "k-step", "--steps", steps];
        let scores = models.each_ref().map(|model| scores(model, &data, &mode));
        for node in ["lasting", "level", "followed"] {
            let [none, one] = scores.each_ref().map(|of| figure(of, node, "rmse"));
            // The first truths have no run a sample before them.
            assert!(
                (one / none - 1.0).abs() < 0.01,
                "{node} {steps}: {none} {one}"
            );
            let ahead = 10.0 * (steps.parse::<f64>().unwrap() - 1.0);
            assert_eq!(figure(&scores[0], node, "horizon_s"), ahead, "{node}");
        }
    }
}

#[test]
fn deviations_are_those_of_as_many_steps_as_predictions_are_made_over() {
    let scratch = Scratch::new("modes-deviations");
    let data = scratch.file("data.csv", csv(&series(2000)));
    let text = modes("")
        .with("past = 'past'; followed = 'followed'")
        .model("past", "ar", "", "output.y", "10s")
        .with("lags = ['0s']; solver = { type = 'ols' }")
        .model("followed", "arma", "", "output.y", "0s")
        .with("na = 1; nc = 0");
    let graph = scratch.file("graph.toml", text);
    let model = fitted(&scratch, "model.json", &graph, &data);
    let widths = |mode: &[&str]| {
        let scores = scores(&model, &data, &[mode, &["--each-on-its-own"]].concat());
        ["past", "followed"].map(|node| {
            let of = scores.iter().find(|score| score["node"] == node).unwrap();
            of["interval"]["width"].as_f64().unwrap()
        })
    };
    let told = athermal(&[&"show", &model, &"--format", &"json"]).ended(0);
    let told = told.json();
    let kept = |node: &str| {
        let all = told["estimators"].as_array().unwrap().iter();
        let mut of = all.filter(|of| of["node"] == node);
        let terms = of.next().unwrap()["coefficients"].as_array().unwrap();
        terms[1]["value"].as_f64().unwrap().abs()
    };
    let one = widths(&[]);
    let three = widths(&["--mode", "k-step", "--steps", "3"]);
    let free = widths(&["--mode", "free-run"]);
    let off = |found: f64, expected: f64| (found / expected - 1.0).abs();
    // The sums of the squares of what an innovation of an autoregression leads to.
    let square = kept("past").powi(2);
    let of_three = (1.0 + square + square * square).sqrt() * one[0];
    assert!(off(three[0], of_three) < 1e-3, "{three:?}, {one:?}");
    for (nth, node) in ["past", "followed"].into_iter().enumerate() {
        let of_all = one[nth] / (1.0 - kept(node).powi(2)).sqrt();
        // At the beginning of the run it is less.
        assert!(off(free[nth], of_all) < 1e-2, "{node}: {free:?}, {one:?}");
    }
}

#[test]
fn what_learns_and_reads_past_truths_predicts_several_steps_from_those_that_were_measured() {
    let scratch = Scratch::new("modes-recursive");
    let rows = series(1500);
    let data = scratch.file("data.csv", csv(&rows));
    let nodes = |learn: &str| {
        modes("")
            .with("past = 'past'")
            .model("past", "arx", "input.a", "output.y", "10s")
            .with("lags = ['0s']; solver = { type = 'sgd', eta0 = 0.01 }")
            .with(learn)
    };
    let learns = scratch.file("learns.toml", nodes("learn = true\noutside = \"pass\""));
    let still = scratch.file("still.toml", nodes("learn = false\noutside = \"pass\""));
    let learns = fitted(&scratch, "learns.json", &learns, &data);
    let still = fitted(&scratch, "still.json", &still, &data);
    for steps in ["2", "5"] {
        let mode = ["--mode", "k-step", "--steps", steps, "--each-on-its-own"];
        let of = |model: &Path, more: &[&str]| {
            let scores = scores(model, &data, &[&mode[..], more].concat());
            assert!(figure(&scores, "past", "valid") > 0.99, "{scores:?}");
            figure(&scores, "past", "rmse")
        };
        let expected = of(&still, &[]);
        near(of(&learns, &["--frozen"]), expected);
        // What it learns is of the same series that it was fitted on.
        let learned = of(&learns, &[]);
        assert!(
            (learned / expected - 1.0).abs() < 0.02,
            "{learned}, {expected}"
        );
        assert_ne!(learned, expected);
    }
}

#[test]
fn steps_are_asked_for_and_refused_where_they_mean_nothing() {
    let scratch = Scratch::new("modes-steps");
    let data = scratch.file("data.csv", csv(&series(20)));
    let graph = scratch.file("graph.toml", modes(""));
    let model = fitted(&scratch, "model.json", &graph, &data);
    let evaluate = |mode: &[&str], code: i32| {
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"evaluate", &model, &"--data", &data];
        arguments.extend(mode.iter().map(|part| part as &dyn AsRef<std::ffi::OsStr>));
        athermal(&arguments).ended(code)
    };
    evaluate(&["--mode", "k-step"], 2).tells(&["--mode k-step needs the number of steps"]);
    evaluate(&["--mode", "free-run", "--steps", "3"], 2).tells(&["--mode k-step", "free-run"]);
    evaluate(&["--mode", "k-step", "--steps", "0"], 2).tells(&["--steps"]);
    evaluate(&["--mode", "k-step", "--steps", "1000"], 0)
        .tells(&["1000 steps ahead", "fewer `--steps`"]);
}

/// The rows of a file from one to another as a file of their own.
fn part(
    scratch: &Scratch,
    name: &str,
    from: &Path,
    rows: std::ops::Range<usize>,
) -> std::path::PathBuf {
    let text = std::fs::read_to_string(from).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let kept: Vec<&str> = lines.skip(rows.start).take(rows.len()).collect();
    scratch.file(name, format!("{header}\n{}\n", kept.join("\n")))
}

/// The free run of a shipped graph, fitted on the first rows of a file, over the rest.
fn free_run(
    (name, truth): (&str, Option<&str>),
    file: &str,
    rows: usize,
    first: usize,
    how: &[&str],
) -> Option<Vec<serde_json::Value>> {
    let file = data()?.join(file);
    let scratch = Scratch::new(&format!("modes-{name}-{}", how.len()));
    let train = part(&scratch, "train.csv", &file, 0..first);
    let test = part(&scratch, "test.csv", &file, first..rows);
    let together = |truth| {
        scored_together(
            &scratch,
            &graph(name),
            &["predicted", "arx", "states"],
            truth,
        )
    };
    let graph = truth.map_or_else(|| graph(name), together);
    let model = fitted(&scratch, "model.json", &graph, &train);
    let mode = [&["--mode", "free-run"], how].concat();
    Some(scores(&model, &test, &mode))
}

const ITS_OWN: &[&str] = &["--each-on-its-own"];

#[test]
fn arx_runs_free_on_the_hairdryer_as_the_textbook_has_it() {
    let Some(free) = free_run(
        ("hairdryer", None),
        "hairdryer/hairdryer.csv",
        1000,
        500,
        ITS_OWN,
    ) else {
        return;
    };
    // Least squares of numpy on the same rows: 85.51 %.
    let fit = figure(&free, "arx", "fit");
    assert!(fit >= 85.0, "{fit}");
    assert!((fit - 85.508).abs() < 0.01, "{fit}");
    for (node, least) in [
        ("output_error", 81.0),
        ("armax", 85.0),
        ("box_jenkins", 85.0),
    ] {
        let fit = figure(&free, node, "fit");
        assert!(fit > least, "{node}: {fit}");
    }
}

#[test]
fn arx_runs_free_on_a_wall_and_on_a_plate_and_output_error_no_worse() {
    // Least squares of numpy on the same rows: 0.97149 and 0.72358.
    for (name, truth, file, rows, expected, least) in [
        (
            "wall-heatflow",
            "heatflow.y",
            "wall-heatflow/wall.csv",
            1680,
            0.971_49,
            0.97,
        ),
        (
            "heating-system",
            "plate.temperature",
            "heating-system/heating.csv",
            801,
            0.723_58,
            0.72,
        ),
    ] {
        let first = rows * 7 / 10;
        let Some(free) = free_run((name, None), file, rows, first, ITS_OWN) else {
            return;
        };
        let found = figure(&free, "arx", "r2_mean");
        assert!((found - expected).abs() < 1e-4, "{name}: {found}");
        let common = free_run((name, Some(truth)), file, rows, first, &[]).unwrap();
        let found = figure(&common, "output_error", "r2_mean");
        assert!(found >= least, "{name}: {found}");
        assert!(
            found >= figure(&common, "arx", "r2_mean"),
            "{name}: {found}"
        );
    }
}

/// A slow filter of an input that jumps and a fast one of another, with noise that is soon forgotten.
fn slow_graph() -> Graph {
    Graph::named("slow")
        .time("time_s")
        .signal("input", "V", "a b", "10s")
        .with("column = '{channel}'")
        .signal("output", "V", "y", "10s")
        .with("column = '{channel}'")
        .model("jenkins", "bj", "input", "output.y", "0s")
        .with("nb = 1; nf = 1; nk = 0; nc = 0; nd = 1; penalty = 0.0")
        .outputs("jenkins = 'jenkins'")
}

#[test]
fn a_run_may_begin_while_filters_are_far_from_rest() {
    let scratch = Scratch::new("evaluation-modes-amid");
    let (mut jumping, mut slow, mut fast, mut noise) = (1.0, 0.0, 0.0, 0.0);
    let mut lines = Vec::new();
    let draws: Vec<f64> = series(12_000).iter().map(|row| row[0]).collect();
    for (nth, draw) in draws.chunks_exact(2).enumerate() {
        if draw[0].abs() < 0.3 {
            jumping = -jumping;
        }
        slow = 0.99 * slow + jumping;
        fast = 0.7 * fast + draw[0];
        noise = 0.5 * noise + draw[1];
        let (b, y) = (draw[0], slow + fast + noise);
        lines.push(format!("{},{jumping},{b},{y}\n", 10 * nth));
    }
    let table = |lines: &[String]| format!("time_s,a,b,y\n{}", lines.concat());
    let graph = scratch.file("slow.toml", slow_graph());
    let train = scratch.file("train.csv", table(&lines[..3000]));
    let model = fitted(&scratch, "model.json", &graph, &train);
    let from_there = |from: usize| {
        let data = scratch.file("test.csv", table(&lines[from..from + 300]));
        figure(&scores(&model, &data, &[]), "jenkins", "rmse")
    };
    let errors: Vec<f64> = (0..8).map(|nth| from_there(3000 + 340 * nth)).collect();
    // What is drawn has a standard deviation of 0.58.
    assert!(errors.iter().all(|error| *error < 0.9), "{errors:?}");
}
