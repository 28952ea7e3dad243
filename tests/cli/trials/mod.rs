//! The tests inside graph files, as `athermal test` runs them: a wrong expectation is told with its figures, in the order of the
//! file, and the exit status says so. Decides nothing about the figures of the shipped graphs, which their own tests hold.

mod looked_at;

use crate::workbench::{Graph, Scratch, athermal};

/// Two channels of which the slopes are known by hand, and one that is never measured.
fn plain() -> Graph {
    Graph::named("plain")
        .signal("temperature", "Cel", "room plate", "1min")
        .with("range = ['-20 Cel', '200 Cel']")
        .signal("position", "nm", "Z", "3min")
        .slope("drift", "position", "30s", "nm/min")
        .slope("slopes", "temperature", "30s", "mK/min")
        .model("zero", "zero", "", "drift.Z", "30s")
        .model("same", "persistence", "", "drift.Z", "30s")
        .outputs("predicted = ['zero', 'same']; slopes = 'slopes'")
}

/// The graph with these tests, without the output columns' clash.
fn graph(tests: &str) -> String {
    let graph = plain().replace(
        "predicted = [\"zero\", \"same\"]",
        "zero = \"zero\"\nsame = \"same\"",
    );
    format!("{graph}\n{tests}")
}

/// What was printed, with times taken out of it.
fn without_times(text: &str) -> String {
    let line = |line: &str| match line.rfind(" (") {
        Some(at) if line.ends_with(" s)") => line[..at].to_owned(),
        _ => line.to_owned(),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Runs tests and gives what was printed below the name of the file.
fn told(name: &str, tests: &str, status: i32) -> String {
    let scratch = Scratch::new(name);
    let path = scratch.file("graph.toml", graph(tests));
    let out = athermal(&[&"test", &path]).ended(status).out;
    let (_, results) = out.split_once('\n').unwrap();
    without_times(results)
}

/// A position that moves by 60 nm each minute, 1 nm/s, over ten minutes.
const EVENLY: &str =
    r#"inputs = { "position.Z" = { ramp = "1 nm/s", for = "10min", every = "5s" } }"#;

#[test]
fn what_is_not_as_expected_is_told_with_its_figures() {
    let tests = format!(
        r#"
[[tests]]
name = "holds"
{EVENLY}
expect = [{{ of = "drift.Z", equals = "60 nm/min", within = 1e-6 }}]
[[tests]]
name = "does not"
{EVENLY}
expect = [
  {{ of = "drift.Z", at = "1min", equals = "50 nm/min", within = "1 nm/min" }},
  {{ of = "drift.Z", from = "2min", between = ["61 nm/min", "70 nm/min"] }},
  {{ of = "zero.Z", rmse_below = "20 nm/min" }},
  {{ of = "slopes.room", valid_above = 0.5 }},
  {{ of = "slopes.plate", at = "1min", equals = "0 mK/min" }},
]
"#
    );
    insta::assert_snapshot!(told("figures", &tests, 1), @r"
      ✓ holds
      ✗ does not
          drift.Z: equals: found 60 nm/min at 1min, wanted 50 ± 1 nm/min
          drift.Z: between: found 60 nm/min at 2min, wanted between 61 and 70 nm/min
          zero.Z: rmse_below: found 60 nm/min over 115 instants, wanted below 20 nm/min
          slopes.room: valid_above: found no value over 0 instants, wanted above 0.5
          slopes.plate: equals: found no value over 0 instants, wanted exactly 0 mK/min
    ");
}

#[test]
fn made_up_measurements_have_the_shape_that_they_say() {
    let tests = r#"
[[tests]]
name = "a step is in the window for as long as the window is, and then gone"
inputs = { "temperature.room" = { start = "20 Cel", step = "1 K", delay = "2min", for = "5min", every = "5s" } }
expect = [
  { of = "slopes.room", to = "1min55s", equals = "0 mK/min" },
  { of = "slopes.room", at = "2min15s", between = ["1 K/min", "4 K/min"] },
  { of = "slopes.room", from = "2min30s", equals = "0 mK/min", within = 1e-9 },
  { of = "temperature.room", at = "5min", equals = "294.15 K", within = "1 nK" },
  { of = "temperature.room", max_step_below = "1001 mK" },
]
[[tests]]
name = "samples are taken one by one, and nan is none"
inputs = { "temperature.room" = { samples = ["20 Cel", nan, "22 Cel"], every = "5s" } }
expect = [
  { of = "temperature.room", at = "9s", equals = "20 Cel" },
  { of = "temperature.room", at = "10s", equals = "22 Cel" },
  { of = "temperature.room", given_above = 0.66 },
]
[[tests]]
name = "a sine comes back after its period, and noise has its size"
inputs = { "position.Z" = { sine = "100 nm", period = "1min", noise = "1 nm", seed = 7, for = "1min", every = "1s" } }
expect = [
  { of = "position.Z", at = "15s", equals = "100 nm", within = "4 nm" },
  { of = "position.Z", at = "1min", equals = "0 nm", within = "4 nm" },
]
[[tests]]
name = "a stuck sensor has no slope, and only while it is stuck"
inputs = { "temperature.room" = { ramp = "1 mK/s", for = "10min", every = "5s" } }
faults = [{ channel = "temperature", kind = "stuck", from = "3min", for = "3min" }]
expect = [
  { of = "slopes.room", to = "2min55s", equals = "60 mK/min", within = 1e-6 },
  { of = "slopes.room", from = "3min30s", to = "5min55s", equals = "0 mK/min", within = 1e-9 },
]
"#;
    let told = told("shapes", tests, 0);
    assert!(!told.contains('✗'), "{told}");
}

#[test]
fn a_fault_after_the_end_of_the_data_has_not_been_survived() {
    let tests = r#"
[[tests]]
name = "survives what never happens"
inputs = { "temperature.room" = { ramp = "1 mK/s", for = "10min", every = "5s" } }
faults = [{ channel = "temperature.room", kind = "stuck", from = "1d" }]
expect = [{ of = "slopes.room", at = "5min", equals = "60 mK/min", within = 1e-6 }]
"#;
    let told = told("late-fault", tests, 2);
    assert!(
        told.contains(
            "the fault of `temperature.room` begins 1d after the first row, and the data last 10min"
        ),
        "{told}"
    );
}

#[test]
fn a_machine_that_there_is_not_is_told_by_check_and_by_test() {
    let tests = r#"
[[tests]]
name = "no such machine"
on = { simulate = "plain-machine" }
expect = [{ of = "zero", valid_above = 0.5 }]
"#;
    let scratch = Scratch::new("unknown-machine");
    let path = scratch.file("graph.toml", graph(tests));
    for command in ["test", "check"] {
        let finished = athermal(&[&command, &path]).ended(2);
        finished.tells(&[
            "A073",
            "there is no simulated machine `plain-machine`",
            "graph.toml:45",
        ]);
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let graph = crate::workbench::graph("linear-axis");
    let run = |threads: &str| {
        let finished = athermal(&[
            &"test",
            &graph,
            &"--threads",
            &threads,
            &"--filter",
            &"dead",
            &"--format",
            &"json",
        ]);
        let mut json = finished.ended(0).json();
        json.as_object_mut().unwrap().remove("seconds");
        for test in json["tests"].as_array_mut().unwrap() {
            test.as_object_mut().unwrap().remove("seconds");
        }
        json
    };
    let alone = run("1");
    assert_eq!(alone["tests"].as_array().unwrap().len(), 4);
    assert_eq!(alone, run("3"));
}

#[test]
fn data_that_are_not_there_are_named_and_the_other_tests_run() {
    let tests = format!(
        r#"
[[tests]]
name = "lost"
on = "lost.csv"
expect = [{{ of = "drift.Z", given_above = 0.5 }}]
[[tests]]
name = "found"
{EVENLY}
expect = [{{ of = "drift.Z", at = "1min", equals = "60 nm/min", within = 1e-6 }}]
"#
    );
    let told = told("lost", &tests, 3);
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!((lines[0], lines[2]), ("  ✗ lost", "  ✓ found"), "{told}");
    assert!(lines[1].contains("lost.csv: cannot be opened"), "{told}");
}

#[test]
fn a_file_is_read_beside_the_graph_in_which_it_stands() {
    let tests = r#"
[[tests]]
name = "a file"
on = ["data/a.csv"]
expect = [{ of = "slopes.room", at = "40s", equals = "60 mK/min", within = 1e-6 }]
"#;
    let scratch = Scratch::new("beside");
    std::fs::create_dir_all(scratch.path("data")).unwrap();
    let rows: String = (0..10)
        .map(|row| format!("{},{},20,\n", row * 5, 20.0 + 0.005 * f64::from(row)))
        .collect();
    scratch.file("data/a.csv", format!("time_s,room,plate,Z\n{rows}"));
    let path = scratch.file("graph.toml", graph(tests));
    athermal(&[&"test", &path]).ended(0);
}

#[test]
fn absence_can_be_expected_and_is_told_where_it_is_broken() {
    let tests = r#"
[[tests]]
name = "a dead sensor has no slope until its window is whole again"
inputs = { "temperature.room" = { ramp = "1 mK/s", for = "10min", every = "5s" } }
faults = [{ channel = "temperature", kind = "missing", from = "3min", for = "3min" }]
expect = [
  { of = "slopes.room", to = "25s", absent = true },
  { of = "slopes.room", at = "4min", absent = true },
  { of = "slopes.room", from = "3min30s", to = "5min55s", absent = true },
  { of = "slopes.plate", absent = true },
]
[[tests]]
name = "it is not absent"
inputs = { "temperature.room" = { ramp = "1 mK/s", for = "2min", every = "5s" } }
expect = [
  { of = "slopes.room", absent = true },
  { of = "slopes.room", at = "1min", absent = true },
  { of = "slopes.plate", from = "1h", absent = true },
]
"#;
    insta::assert_snapshot!(told("absence", tests, 1), @r"
      ✓ a dead sensor has no slope until its window is whole again
      ✗ it is not absent
          slopes.room: absent: found 60 mK/min at 30s, wanted none
          slopes.room: absent: found 60 mK/min at 1min, wanted none
          slopes.plate: absent: found no value over 0 instants, wanted none
    ");
}

#[test]
fn what_stands_beside_absence_and_absence_that_is_not_meant_are_mistakes() {
    let tests = format!(
        "[[tests]]\nname = \"wrong\"\n{EVENLY}\nexpect = [\n  {{ of = \"drift.Z\", absent = false }},\n  {{ of = \"drift.Z\", absent = true, given_above = 0.5 }},\n]\n"
    );
    let scratch = Scratch::new("absent-mistakes");
    let path = scratch.file("graph.toml", graph(&tests));
    athermal(&[&"check", &path]).ended(2).tells(&[
        "`absent` is false and must be true, or left out",
        "`absent` has no meaning together with `given_above`",
    ]);
}

#[test]
fn a_test_names_what_an_instance_of_a_module_gives_as_the_graph_does() {
    let text = r#"
schema = 1
[sets]
axis = ["X", "Z"]
[signals.position]
unit = "nm"
channels = "axis"
max_age = "3min"
[modules.model]
inputs = ["position"]
outputs = { predicted = "same", drift = "slope" }
nodes.slope = { type = "slope", inputs.signal = "{position}", windows = ["30s"], unit = "nm/min" }
nodes.same = { type = "persistence", inputs.truth = "slope", ahead = "30s" }
nodes.zero = { type = "zero", inputs.truth = "slope", ahead = "30s" }
[nodes.model]
module = "model"
each = "axis"
inputs.position = "position.{axis}"
[nodes.none]
type = "zero"
inputs.truth = "model:drift.X"
ahead = "30s"
[outputs]
out = "model"
none = "none"
[[tests]]
name = "instances of modules"
inputs = { "position" = { ramp = "1 nm/s", for = "10min", every = "5s" } }
expect = [
  { of = "model.Z", rmse_below = "1e-6 nm/min", beats = ["zero"] },
  { of = "model", at = "1min", equals = "60 nm/min", within = 1e-6 },
  { of = "model:drift.{X,Z}", at = "1min", equals = "60 nm/min", within = 1e-6 },
  { of = "model.X", beats = ["none", "model/zero"] },
]
"#;
    let scratch = Scratch::new("modules-tested");
    let path = scratch.file("graph.toml", text);
    athermal(&[&"test", &path]).ended(0);
    athermal(&[&"check", &path]).ended(0).tells(&[
        "no output depends on the node `model",
        "or leave it out of the module",
    ]);
    for (right, wrong, told) in [
        (
            "of = \"model.X\"",
            "of = \"modle.X\"",
            "did you mean `model`?",
        ),
        (
            "of = \"model:drift.{X,Z}\"",
            "of = \"model:drif.X\"",
            "\"model\" has no output \"drif\"",
        ),
        (
            "of = \"model.Z\"",
            "of = \"zzz\"",
            "the graph has `position`, `model`, `none`, `out`",
        ),
    ] {
        let path = scratch.file("wrong.toml", text.replace(right, wrong));
        athermal(&[&"check", &path]).ended(2).tells(&[told]);
    }
}

#[test]
fn a_machine_follows_the_schedule_that_a_test_names() {
    let text = r#"
schema = 1
[signals.temperature]
unit = "Cel"
channels = ["chuck"]
max_age = "1min"
[nodes.shown]
type = "pick"
inputs.signal = "temperature"
[outputs]
shown = "shown"
[[tests]]
name = "the chuck is warm"
on = { simulate = "die-tester", days = 0.1, schedule = "steps.csv" }
expect = [{ of = "temperature.chuck", from = "2h", between = ["44 Cel", "46 Cel"] }]
"#;
    let scratch = Scratch::new("schedule");
    let path = scratch.file("graph.toml", text);
    scratch.file("steps.csv", "time_h,chuck_degC\n0,20\n1,45\n");
    athermal(&[&"test", &path]).ended(0);
    scratch.file("steps.csv", "time_h,chuck_degC\n0,20\n1,45\n0.5,999\n");
    let again = format!("{text}fit = {{ simulate = \"die-tester\", schedule = \"steps.csv\" }}\n");
    scratch.file("graph.toml", again);
    let finished = athermal(&[&"test", &path]).ended(2);
    finished.tells(&[
        "A170",
        "the time 0.5 must be after that of the row before",
        "steps.csv:4:1",
        "test \"the chuck is warm\"",
    ]);
    let times = finished
        .told
        .matches("must be after that of the row before");
    assert_eq!(times.count(), 1, "{}", finished.told);
}

#[test]
fn junit_has_each_test_and_why_it_failed() {
    let tests = format!(
        r#"
[[tests]]
name = "less < more & so on"
{EVENLY}
expect = [{{ of = "drift.Z", at = "1min", equals = "50 nm/min" }}]
"#
    );
    let scratch = Scratch::new("junit");
    let path = scratch.file("graph.toml", graph(&tests));
    let junit = scratch.path("junit.xml");
    athermal(&[&"test", &path, &"--junit", &junit]).ended(1);
    let xml = std::fs::read_to_string(junit).unwrap();
    for part in [
        "<testsuites name=\"athermal\" tests=\"1\" skipped=\"0\" failures=\"1\" errors=\"0\"",
        "<testcase name=\"less &lt; more &amp; so on\" classname=\"plain\"",
        "<failure message=\"drift.Z: equals: found 60",
    ] {
        assert!(xml.contains(part), "`{part}` is not in\n{xml}");
    }
    // `-` is standard output, which has no room for anything else then.
    let printed = athermal(&[&"test", &path, &"--junit", &"-"]).ended(1);
    assert!(printed.out.starts_with("<?xml") && printed.out.contains("</testsuites>"));
    assert!(!std::path::Path::new("-").exists());
    let both = athermal(&[&"test", &path, &"--junit", &"-", &"--format", &"json"]).ended(2);
    both.tells(&["--junit -", "cannot both go to standard output"]);
}

#[test]
fn a_filter_that_nothing_fits_is_a_wrong_request() {
    let graph = crate::workbench::graph("z-probe");
    let finished = athermal(&[&"test", &graph, &"--filter", &"no such thing"]).ended(2);
    finished.tells(&["no test has a name that contains `no such thing`"]);
}

#[test]
fn all_mistakes_in_tests_are_told_at_once_by_check_already() {
    let tests = r#"
[[tests]]
name = "wrong"
inputs = { "temperature.room" = { ramp = "1 nm/s", for = "20min", every = "0s" }, "drift.Z" = { constant = "1 nm", for = "1min", every = "1s" } }
faults = [{ channel = "temperature.room", kind = "mising" }, { channel = "temperature.rom", kind = "missing" }, { channel = "temperature.room", kind = "offset", size = "1 nm" }]
expect = [{ of = "drift.Z", rmse_below = "3 nm/min" }, { of = "zero.Z", valid_above = 1.5, beats = ["slopes"] }, { off = "x" }]
"#;
    let scratch = Scratch::new("mistakes");
    let path = scratch.file("graph.toml", graph(tests));
    let json = athermal(&[&"check", &path, &"--format", &"json"])
        .ended(2)
        .json();
    let mut found: Vec<(&str, u64, u64)> = json["diagnostics"]
        .as_array()
        .unwrap()
        .iter()
        .map(|of| {
            let number = |key: &str| of[key].as_u64().unwrap();
            (
                of["code"].as_str().unwrap(),
                number("line"),
                number("column"),
            )
        })
        .collect();
    found.sort_by_key(|&(_, line, column)| (line, column));
    let codes: Vec<&str> = found.iter().map(|(code, ..)| *code).collect();
    let wanted = [
        "A075", "A078", "A080", "A009", "A044", "A079", "A076", "A078", "A076", "A006",
    ];
    assert_eq!(codes, wanted, "{json:#}");
}

#[test]
fn samples_that_last_longer_than_time_reaches_are_a_mistake() {
    let scratch = Scratch::new("trials-endless");
    let tests = "[[tests]]\nname = \"endless\"\ninputs = { \"temperature.room\" = { samples = [\"1 Cel\", \"2 Cel\", \"3 Cel\"], \
                 every = \"100000d\" } }\nexpect = [{ of = \"zero\", valid_above = 0.0 }]\n";
    let file = scratch.file("graph.toml", graph(tests));
    let told = athermal(&[&"check", &file]).ended(2).told;
    assert!(
        told.contains("100000d for 3 samples") && told.contains("at most 292 years"),
        "{told}"
    );
}

#[test]
fn what_has_no_meaning_beside_a_constant_or_samples_is_a_mistake_whichever_key_it_is() {
    let scratch = Scratch::new("trials-shapes");
    for (shape, told) in [
        (
            "constant = \"1 Cel\", for = \"1min\", delay = \"10s\"",
            "`delay` has no meaning together with `constant`",
        ),
        (
            "constant = \"1 Cel\", for = \"1min\", period = \"10s\"",
            "`period` has no meaning without `sine`",
        ),
        (
            "samples = [\"1 Cel\"], delay = \"10s\"",
            "`delay` has no meaning together with `samples`",
        ),
        (
            "samples = [\"1 Cel\"], period = \"10s\"",
            "`period` has no meaning together with `samples`",
        ),
        (
            "start = \"1 Cel\", for = \"1min\", delay = \"10s\"",
            "`delay` has no meaning without `step`",
        ),
    ] {
        let tests = format!(
            "[[tests]]\nname = \"a\"\ninputs = {{ \"temperature.room\" = {{ every = \"1s\", {shape} }} }}\n\
             expect = [{{ of = \"temperature.room\", given_above = 0.5 }}]"
        );
        let file = scratch.file("graph.toml", graph(&tests));
        let told_of_all = athermal(&[&"check", &file]).ended(2);
        told_of_all.tells(&[told, "error[A077]"]);
    }
    let tests = "[[tests]]\nname = \"a\"\ninputs = { \"temperature.room\" = { every = \"1s\", for = \"1min\", ramp = \"1 K/s\", \
                 delay = \"10s\" } }\nexpect = [{ of = \"temperature.room\", given_above = 0.5 }]";
    let file = scratch.file("graph.toml", graph(tests));
    athermal(&[&"check", &file]).ended(0);
}
