//! What a newcomer does first, with the program as it is built: demo, simulate, init, show.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::workbench::Folder;
use athermal::Model;
use athermal::core::registry::{all, find};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::score::{ScoreOptions, score};
use athermal::trial::machine::{KnownMachine, Setup, Simulated};

impl Folder {
    /// Runs and expects success; gives standard output and standard error.
    fn fine(&self, arguments: &[&str]) -> (String, String) {
        let output = self.run(arguments);
        let [out, err] =
            [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        assert!(output.status.success(), "{arguments:?}\n{out}\n{err}");
        (out, err)
    }

    /// Runs and expects a request to be refused, in one line.
    fn refused(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}\n{told}");
        assert_eq!(told.trim_end().lines().count(), 1, "{told}");
        told
    }
}

fn graph(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("graphs")
        .join(name)
}

#[test]
fn the_demo_fits_scores_and_names_commands_that_run() {
    let folder = Folder::new("demo");
    let (out, err) = folder.fine(&["demo"]);
    let figures = |name: &str| -> Vec<f64> {
        let line = out.lines().find(|line| line.starts_with(name)).unwrap();
        let cells = line[name.len()..].split_whitespace();
        cells.map(|cell| cell.parse().unwrap()).collect()
    };
    let (nothing, vote) = (figures("no model"), figures("vote of the three"));
    assert_eq!((nothing.len(), vote.len()), (6, 6));
    assert!(
        nothing
            .iter()
            .zip(&vote)
            .all(|(nothing, vote)| vote < nothing)
    );
    for line in out.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    let (_, commands) = err.split_once("Try next:\n").unwrap();
    let (commands, _) = commands.split_once("and with a log").unwrap();
    let script = format!("set -e\n{commands}");
    let mut shell = Command::new("sh");
    let ran = shell.args(["-c", &script]).current_dir(&folder.0).output();
    let ran = ran.unwrap();
    let said = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{script}\n{said}");
}

#[test]
fn the_demo_comes_again_to_its_own_folder_but_never_over_work_in_it() {
    let folder = Folder::new("again");
    folder.fine(&["demo", "d", "--quiet"]);
    folder.fine(&["demo", "d", "--quiet"]);
    let edited = folder.0.join("d/die-tester.toml");
    let text = std::fs::read_to_string(&edited).unwrap() + "# mine\n";
    std::fs::write(&edited, &text).unwrap();
    let told = folder.refused(&["demo", "d"]);
    assert!(
        told.contains("has been changed since a demo wrote it"),
        "{told}"
    );
    assert_eq!(std::fs::read_to_string(&edited).unwrap(), text);
}

#[test]
fn the_machines_of_this_program_are_these() {
    let names: Vec<&str> = all::<KnownMachine>().map(|of| of.name).collect();
    assert_eq!(names, ["die-tester", "linear-axis"]);
}

#[test]
fn a_simulation_has_the_same_bytes_in_a_file_and_in_a_pipe() {
    let folder = Folder::new("simulate");
    let asked = [
        "simulate",
        "linear-axis",
        "--days",
        "0.05",
        "--seed",
        "3",
        "--truth",
    ];
    let (piped, _) = folder.fine(&[&asked[..], &["-o", "-"]].concat());
    folder.fine(&[&asked[..], &["-o", "a.csv"]].concat());
    let written = std::fs::read_to_string(folder.0.join("a.csv")).unwrap();
    assert_eq!(piped, written);
    assert!(
        written
            .lines()
            .next()
            .unwrap()
            .ends_with("Z_drift_true_nm_per_min")
    );
    let (other, _) = folder.fine(&["simulate", "linear-axis", "--days", "0.05", "--truth"]);
    assert_ne!(other, written);
}

#[test]
fn csv_and_json_lines_of_a_simulation_say_the_same() {
    let folder = Folder::new("formats");
    for file in ["a.csv", "a.jsonl"] {
        folder.fine(&["simulate", "die-tester", "--days", "0.01", "-o", file]);
    }
    let csv = std::fs::read_to_string(folder.0.join("a.csv")).unwrap();
    let json = std::fs::read_to_string(folder.0.join("a.jsonl")).unwrap();
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let mut values = 0;
    for (row, object) in csv.lines().skip(1).zip(json.lines()) {
        let object: serde_json::Value = serde_json::from_str(object).unwrap();
        for (name, cell) in header.iter().zip(row.split(',')) {
            assert_eq!(object[name].as_f64(), cell.parse().ok(), "{name} {row}");
            values += usize::from(!cell.is_empty());
        }
    }
    assert_eq!(csv.lines().count() - 1, json.lines().count());
    assert!(values > 500);
}

#[test]
fn a_schedule_and_a_fault_change_a_simulation() {
    let folder = Folder::new("faults");
    std::fs::write(folder.0.join("s.csv"), "time_min,chuck_degC\n0,25\n10,60\n").unwrap();
    let asked = ["simulate", "die-tester", "--days", "0.05", "-o", "-"];
    let fault = "temperature.room=missing,from=10min,for=5min";
    let (text, _) = folder.fine(&[&asked[..], &["--schedule", "s.csv", "--fault", fault]].concat());
    let rows: Vec<Vec<&str>> = text
        .lines()
        .skip(1)
        .map(|row| row.split(',').collect())
        .collect();
    // Rows are 10 s apart; `room` is the fifth temperature, `chuck` the sixth.
    let missing = rows.iter().filter(|row| row[5].is_empty()).count();
    assert_eq!(missing, 5 * 6);
    let chuck = |minute: usize| rows[minute * 6][6].parse::<f64>().unwrap();
    assert!(chuck(9) < 26.0 && chuck(20) > 50.0);
}

#[test]
fn a_disturbance_changes_a_simulation_while_it_lasts() {
    let folder = Folder::new("disturbed");
    let asked = ["simulate", "die-tester", "--days", "0.05", "-o", "-"];
    let loose = ["--disturb", "loose=chuck,from=20min,for=10min,size=0.5"];
    let (sound, _) = folder.fine(&asked);
    let (text, _) = folder.fine(&[&asked[..], &loose].concat());
    let others = sound.lines().zip(text.lines()).enumerate();
    let others = others.filter(|(_, (sound, loose))| sound != loose);
    let lines: Vec<usize> = others.map(|(line, _)| line).collect();
    // A line of names, then rows 10 s apart.
    assert_eq!(lines, (121..181).collect::<Vec<_>>());
    let wide = folder.run(&[&asked[..], &["--disturb", "door,size=99"]].concat());
    let told = String::from_utf8(wide.stderr).unwrap();
    assert_eq!(wide.status.code(), Some(2), "{told}");
    assert!(told.contains("`door,size=3`"), "{told}");
    let told = folder.refused(&[&asked[..], &["--disturb", "loose=room,size=0.5"]].concat());
    assert!(told.contains("these can come loose: plate1"), "{told}");
}

#[test]
fn what_cannot_be_simulated_is_refused_with_the_next_step() {
    let folder = Folder::new("refused");
    let told = folder.refused(&["simulate", "die-teser", "-o", "-"]);
    assert!(told.contains("did you mean `die-tester`?"), "{told}");
    let told = folder.refused(&["simulate", "die-tester", "--days", "0", "-o", "-"]);
    assert!(told.contains("must be above 0"), "{told}");
    let fault = ["--fault", "temperature.rom=stuck"];
    let told = folder.refused(&[&["simulate", "die-tester", "-o", "-"][..], &fault].concat());
    assert!(told.contains("did you mean `temperature.room`?"), "{told}");
}

#[test]
fn a_machine_is_a_recording_of_any_graph_that_measures_its_channels() {
    let known = find::<KnownMachine>("linear-axis").unwrap();
    let recording = |seed| {
        let setup = Setup {
            days: 1.0,
            seed,
            ..Setup::default()
        };
        Simulated::new(known.machine, setup)
    };
    let mut model = Model::load(graph("linear-axis-sensor.toml")).unwrap();
    let (fitted, _) = fit(
        &model.plan,
        &recording(1),
        &FitOptions::default(),
        &mut |_| {},
    )
    .unwrap();
    model.fitted = fitted;
    let options = ScoreOptions::default();
    let faults = vec!["temperature.t1=offset,size=100 mK,from=6h".parse().unwrap()];
    let rmse = |recording: &Simulated| {
        let scores = score(&model.plan, &model.fitted, recording, &options, &mut |_| {}).unwrap();
        let vote = scores.scores.iter().find(|score| score.output == "vote.X");
        let vote = vote.unwrap();
        (vote.rmse.unwrap(), vote.baseline_zero.unwrap())
    };
    let (sound, nothing) = rmse(&recording(2));
    assert!(sound < 0.6 * nothing, "{sound} of {nothing}");
    assert!(rmse(&recording(2).with_faults(faults)).0 > sound);
}

#[test]
fn a_graph_that_measures_something_else_is_told_what_the_machine_has() {
    let known = find::<KnownMachine>("linear-axis").unwrap();
    let model = Model::load(graph("z-probe.toml")).unwrap();
    let recording = Simulated::new(known.machine, Setup::default());
    let refused = fit(&model.plan, &recording, &FitOptions::default(), &mut |_| {});
    let told = refused.map(|_| ()).unwrap_err().to_string();
    assert!(
        told.contains("does not measure temperature.bed, temperature.chamber, temperature.extruder, position.z; it measures temperature.t1"),
        "{told}"
    );
}

#[test]
fn every_graph_of_the_project_is_shown_in_every_form() {
    let folder = Folder::new("show");
    let graphs = std::fs::read_dir(graph("")).unwrap();
    let mut shown = 0;
    for path in graphs.map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            continue;
        }
        let path = path.to_str().unwrap();
        for form in ["plan", "mermaid", "dot", "svg", "json", "memory"] {
            for expand in [&[][..], &["--expand"]] {
                // Of graphs with kinds that this program does not have, only the reason is shown.
                let output = folder.run(&[&["show", path, "--format", form][..], expand].concat());
                if output.status.success() {
                    assert!(output.stdout.len() > 100, "{path} {form}");
                    shown += 1;
                } else {
                    assert_eq!(output.status.code(), Some(2), "{path} {form}");
                }
            }
        }
    }
    assert!(shown >= 60, "{shown}");
}

#[test]
fn a_graph_says_what_an_engine_of_it_holds_at_a_rate() {
    let folder = Folder::new("holds");
    let graph = graph("die-tester.toml");
    let run = |rest: &[&str]| folder.run(&[&["show", graph.to_str().unwrap()][..], rest].concat());
    let shown = |rest: &[&str]| {
        let output = run(&[&["--format", "memory"][..], rest].concat());
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let total = |text: &str| -> f64 {
        let last = text.lines().last().unwrap();
        last.strip_prefix("in all").unwrap().trim().parse().unwrap()
    };
    let of_ten = shown(&["--rate", "10s", "--rate", "position=75s"]);
    assert!(
        of_ten.starts_with(
            "an engine once all windows are full, with temperature each 10s, position each 75s"
        ),
        "{of_ten}"
    );
    let window = of_ten.lines().find(|line| line.contains("1343.22257503s"));
    assert!(
        window.is_some_and(|line| line.contains("samples") && line.contains(" 135 ")),
        "{of_ten}"
    );
    let each_second = shown(&["--rate", "1s"]);
    assert!(total(&each_second) > 2.5 * total(&of_ten), "{each_second}");
    for (rest, told) in [
        (
            &["--format", "memory", "--rate", "nothing=1s"][..],
            "there is no signal `nothing`",
        ),
        (&["--format", "memory", "--rate", "fast"], "--rate fast"),
        (&["--rate", "1s"], "--format memory"),
    ] {
        let output = run(rest);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains(told), "{text}");
    }
}

#[test]
fn shells_get_their_completions() {
    let folder = Folder::new("completions");
    for shell in ["bash", "zsh", "fish"] {
        let (script, _) = folder.fine(&["completions", shell]);
        assert!(script.contains("simulate"), "{shell}");
        assert!(
            shell == "bash" || script.contains("Models - Fit"),
            "{script}"
        );
    }
}

#[test]
fn the_version_says_how_the_program_was_built_and_from_which_commit() {
    let folder = Folder::new("version");
    let (out, _) = folder.fine(&["--version"]);
    let version = env!("CARGO_PKG_VERSION");
    assert!(out.starts_with(&format!("athermal {version}\n")), "{out}");
    let line = |name: &str| out.lines().find_map(|line| line.strip_prefix(name));
    let features = line("features: ").unwrap();
    assert_eq!(features.contains("mqtt"), cfg!(feature = "mqtt"), "{out}");
    assert_eq!(features.contains("parquet"), cfg!(feature = "parquet"));
    assert!(
        line("target: ")
            .unwrap()
            .starts_with(std::env::consts::ARCH)
    );
    assert_eq!(line("commit: "), Some("not of a release"));
    assert_eq!(folder.fine(&["-V"]).0, format!("athermal {version}\n"));
}

#[test]
fn each_command_has_a_page_in_the_manual_with_what_its_help_says() {
    let folder = Folder::new("man");
    folder.fine(&["man", "pages/of/man1"]);
    let page = |name: &str| {
        let path = folder.0.join(format!("pages/of/man1/{name}.1"));
        std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let (models, runs) = page("athermal")
        .split_once(".SH RUN\n")
        .map(|(a, b)| (a.to_owned(), b.to_owned()))
        .unwrap();
    assert!(models.contains("athermal\\-fit(1)") && runs.contains("athermal\\-serve(1)"));
    let (help, _) = folder.fine(&["--help"]);
    let (_, commands) = help.split_once("\nBegin:\n").unwrap();
    let (commands, _) = commands.split_once("\nOptions:\n").unwrap();
    let commands = commands.lines().filter_map(|line| line.strip_prefix("  "));
    let commands = commands.filter_map(|line| line.split(' ').next());
    let commands: Vec<&str> = commands.filter(|name| !name.is_empty()).collect();
    assert!(commands.len() > 30, "{commands:?}");
    for command in commands {
        assert!(page(&format!("athermal-{command}")).contains("SYNOPSIS"));
    }
    assert!(page("athermal-fit").contains("\\-\\-data"));
    std::fs::write(folder.0.join("file"), "").unwrap();
    let output = folder.run(&["man", "file"]);
    assert_eq!(output.status.code(), Some(3));
}
