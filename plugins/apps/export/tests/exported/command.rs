//! The command: what it writes, what it says, and states that go over to C and back.

use std::path::Path;
use std::sync::Arc;

use athermal_command::terminal::Options;
use athermal_command::{CommandKind, Failure, Terminal};
use athermal_core::engine::{Engine, fnv_1a};
use athermal_core::prng::Prng;
use athermal_core::registry::find;
use athermal_core::time::Duration;
use athermal_run::fit::{FitOptions, fit};
use athermal_run::model::{Card, Model};
use athermal_trial::machine::{KnownMachine, Setup, Simulated};

use crate::random::{events, graph};
use crate::shipped::second;
use crate::support::{Scratch, made_up, project, stepped};

fn export(words: &[&str]) -> Result<(), String> {
    let kind = find::<CommandKind>("export").unwrap();
    let matches = (kind.declare)().try_get_matches_from(["export"].iter().chain(words));
    let matches = matches.map_err(|error| error.to_string())?;
    let terminal = Terminal::new(&Options {
        format: "table".to_owned(),
        quiet: true,
    });
    match (kind.run)(&matches, &terminal) {
        Ok(_) => Ok(()),
        Err(Failure::Request(text) | Failure::Outside(text)) => Err(text),
        Err(other) => panic!("{other:?}"),
    }
}

/// A model of a random graph with a fit that is made up.
fn model(path: &Path) -> Model {
    let mut random = Prng::stream(11, "an exported graph");
    let graph_file = path.with_extension("toml");
    std::fs::write(&graph_file, graph(&mut random)).unwrap();
    let mut model = Model::load(&graph_file).unwrap();
    model.fitted = made_up(&model.plan, &mut random);
    std::fs::write(path, model.to_text().unwrap()).unwrap();
    model
}

#[test]
fn the_command_writes_all_files_and_carries_states_to_c_and_back() {
    let scratch = Scratch::new("command");
    let (path, folder) = (scratch.path("model.json"), scratch.path("out"));
    let model = model(&path);
    let words = |more: &[&str]| -> Vec<String> {
        let first = ["c", path.to_str().unwrap(), "-o", folder.to_str().unwrap()];
        first
            .iter()
            .chain(more)
            .map(|&word| word.to_owned())
            .collect()
    };
    let run = |more: &[&str]| {
        let words = words(more);
        export(&words.iter().map(String::as_str).collect::<Vec<_>>())
    };
    run(&["--rate", "240ms", "--rate", "position=480ms"]).unwrap();
    let files = [
        "athermal_rt.h",
        "athermal_rt.c",
        "random_graph.h",
        "random_graph.c",
        "Makefile",
        "CMakeLists.txt",
        "README.md",
        "example/main.c",
    ];
    assert!(files.iter().all(|file| folder.join(file).exists()));
    let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
    assert!(!readme.contains("@name@") && !readme.contains("@rows@"));
    assert!(
        readme.contains("| `position.X` | nm | 0.48 s |"),
        "{readme}"
    );

    run(&["--rate", "240ms", "--rate", "position=480ms", "--fast"]).unwrap();
    let header = std::fs::read_to_string(folder.join("random_graph.h")).unwrap();
    assert!(header.contains("(1u << AT_FAST)"), "{header}");

    let mut engine = Engine::new(Arc::clone(&model.plan), &model.fitted).unwrap();
    let events = events(&mut Prng::stream(12, "events"), &model.plan, 2_000);
    stepped(&mut engine, &events[..1_500]);
    let state = scratch.path("machine.state");
    std::fs::write(&state, engine.snapshot()).unwrap();
    run(&["--rate", "240ms", "--state", state.to_str().unwrap()]).unwrap();
    let of_c = folder.join("random_graph.state");
    run(&["--rate", "240ms", "--state-back", of_c.to_str().unwrap()]).unwrap();
    let mut other = Engine::new(Arc::clone(&model.plan), &model.fitted).unwrap();
    other
        .restore(&std::fs::read(folder.join("run.state")).unwrap())
        .unwrap();
    assert_eq!(
        stepped(&mut other, &events[1_500..]),
        stepped(&mut engine, &events[1_500..])
    );

    // What NAME_save writes before NAME_init: zeros.
    let saved = std::fs::read(&of_c).unwrap();
    let mut zeros = saved[..saved.len() - 8].to_vec();
    zeros[40..].fill(0);
    let checksum = fnv_1a(&zeros);
    zeros.extend(checksum.to_le_bytes());
    let of_nothing = scratch.path("zeros.state");
    std::fs::write(&of_nothing, zeros).unwrap();
    let error = run(&[
        "--rate",
        "240ms",
        "--state-back",
        of_nothing.to_str().unwrap(),
    ])
    .unwrap_err();
    let expected = "it was saved before `random_graph_init` was called";
    assert!(error.contains(expected), "{error}");

    let error = run(&["--rate", "fast"]).unwrap_err();
    assert!(error.contains("--rate fast"), "{error}");
    let error = run(&["--rate", "nothing=1s"]).unwrap_err();
    assert!(error.contains("no signal `nothing`"), "{error}");
    // Room for another rate is another state.
    let error = run(&["--rate", "1s", "--state-back", of_c.to_str().unwrap()]).unwrap_err();
    assert!(error.contains("another length"), "{error}");
}

#[test]
fn room_is_made_for_the_rate_of_the_data_of_the_fit_unless_another_is_given() {
    let scratch = Scratch::new("command-rates");
    let mut model = Model::load(project().join("graphs/die-tester.toml")).unwrap();
    let setup = Setup {
        days: 0.5,
        ..Setup::default()
    };
    let recording = Simulated::new(find::<KnownMachine>("die-tester").unwrap().machine, setup);
    let (fitted, report) =
        fit(&model.plan, &recording, &FitOptions::default(), &mut |_| {}).unwrap();
    model.fitted = fitted;
    let card = Card::of(&report, Vec::new(), None);
    println!("{:?}", card.rates);
    let usual = |signal: &str| Duration::from_secs_f64(card.rates[signal]).unwrap();
    let (temperature, position) = (usual("temperature"), usual("position"));
    // Gaps are no steps, nor are ticks without a sample.
    assert_eq!(temperature, second(10.0));
    model.card = Some(card);
    let path = scratch.path("model.json");
    std::fs::write(&path, model.to_text().unwrap()).unwrap();
    export(&["c", path.to_str().unwrap(), "--dry-run"]).unwrap();
    let folder = scratch.path("out");
    for (given, temperature, position) in [
        (&[][..], temperature, position),
        (&["--rate", "position=40s"], temperature, second(40.0)),
        (&["--rate", "2s"], second(2.0), second(2.0)),
        (
            &["--rate", "position=40s", "--rate", "2s"],
            second(2.0),
            second(40.0),
        ),
    ] {
        let words = ["c", path.to_str().unwrap(), "-o", folder.to_str().unwrap()];
        export(&[&words[..], given].concat()).unwrap();
        let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
        for (channel, rate) in [
            ("temperature.chuck` | Cel", temperature),
            ("position.X1` | nm", position),
        ] {
            let line = format!("| `{channel} | {} s |", rate.secs());
            assert!(readme.contains(&line), "{given:?}, {line}: {readme}");
        }
    }
}

#[test]
fn a_dry_run_writes_nothing_and_needs_no_folder() {
    let scratch = Scratch::new("command-dry");
    let path = scratch.path("model.json");
    model(&path);
    for target in ["c", "fmu", "st", "onnx"] {
        let words = [target, path.to_str().unwrap()];
        let error = export(&words).unwrap_err();
        assert!(error.contains("--output"), "{error}");
        export(&[&words[..], &["--dry-run", "--frozen"]].concat()).unwrap();
        let folder = scratch.path("out");
        let more = ["--dry-run", "--frozen", "-o", folder.to_str().unwrap()];
        export(&[&words[..], &more].concat()).unwrap();
        assert!(!folder.exists());
    }
    let error = export(&["c", path.to_str().unwrap(), "--dry-run", "--name", "at"]).unwrap_err();
    assert!(error.contains("`--name` calls them otherwise"), "{error}");
}

#[test]
fn onnx_and_units_for_co_simulation_take_no_state_and_no_single_precision() {
    let scratch = Scratch::new("command-targets");
    let path = scratch.path("model.json");
    model(&path);
    for (target, written) in [("onnx", "random_graph.onnx"), ("fmu", "random_graph.fmu")] {
        let folder = scratch.path(target);
        let first = [target, path.to_str().unwrap(), "-o"];
        let first = [&first[..], &[folder.to_str().unwrap()]].concat();
        let mut all = vec![&["--state", "a"][..], &["--state-back", "a"], &["--float"]];
        all.extend((target == "onnx").then_some(&["--fast"][..]));
        for words in all {
            let error = export(&[&first[..], words].concat()).unwrap_err();
            let begun = format!("`{}` is for `export c`", words[0]);
            assert!(error.contains(&begun), "{error}");
            assert!(!folder.exists());
        }
        // What learns has no place in ONNX.
        let found = export(&first);
        if target == "onnx" {
            let error = found.unwrap_err();
            assert!(
                error.contains("`learner.X`: it goes on learning"),
                "{error}"
            );
            export(&[&first[..], &["--frozen"]].concat()).unwrap();
        }
        assert!(folder.join(written).exists());
    }
}

#[test]
fn structured_text_is_written_with_its_runtime_and_takes_no_state() {
    let scratch = Scratch::new("command-st");
    let (path, folder) = (scratch.path("model.json"), scratch.path("out"));
    model(&path);
    let first = ["st", path.to_str().unwrap(), "-o", folder.to_str().unwrap()];
    let error = export(&[&first[..], &["--state", "a"]].concat()).unwrap_err();
    assert!(
        error.contains("programs in Structured Text have no place for it"),
        "{error}"
    );
    assert!(!folder.exists());
    export(&[&first[..], &["--rate", "10s"]].concat()).unwrap();
    for file in ["athermal_rt.st", "random_graph.st", "random_graph.xml"] {
        assert!(folder.join(file).exists(), "{file}");
    }
}
