//! That a pipe or a device in the place of a file that must end is refused rather than waited for, and that what a shell opens is read.

#![cfg(unix)]

use std::path::PathBuf;
use std::process::Command;

use crate::workbench::{Scratch, athermal, athermal_fed};

const GRAPH: &str = "schema = 1\nname = \"plain\"\ntime.column = \"t\"\nsignals.room = { unit = \"Cel\", channels = [\"a\"], \
                     column = \"{channel}\", max_age = \"1min\" }\noutputs.room = \"room\"\n";

/// A folder with a pipe that nobody writes to, and paths of it and of an endless device.
fn desk(test: &str) -> (Scratch, [PathBuf; 2]) {
    let scratch = Scratch::new(&format!("not-files-{test}"));
    let pipe = scratch.path("pipe");
    assert!(
        Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    (scratch, [pipe, PathBuf::from("/dev/zero")])
}

#[test]
fn a_graph_that_another_extends_or_takes_a_module_from_is_a_file() {
    let (scratch, endless) = desk("graphs");
    for path in endless {
        for (name, text) in [
            ("extends.toml", format!("schema = 1\nextends = {path:?}\n")),
            (
                "module.toml",
                format!("schema = 1\nname = \"m\"\nmodules.m.from = {path:?}\n"),
            ),
        ] {
            let graph = scratch.file(name, text);
            let place = format!("{name}:");
            let told = "it is a pipe or a device, and must be a file";
            athermal(&[&"check", &graph])
                .ended(2)
                .tells(&[told, &place, "A002"]);
        }
    }
}

#[test]
fn a_state_and_a_schedule_are_files() {
    let (scratch, endless) = desk("others");
    let graph = scratch.file("graph.toml", GRAPH);
    let log = scratch.file("log.csv", "t,a\n0,21\n10,21\n");
    let out = scratch.path("out.csv");
    for path in endless {
        let told = format!(
            "{}: it is a pipe or a device, and must be a file",
            path.display()
        );
        athermal(&[&"run", &graph, &"-i", &log, &"-o", &out, &"--state", &path])
            .ended(2)
            .tells(&["--state", &told]);
        athermal(&[
            &"simulate",
            &"die-tester",
            &"--schedule",
            &path,
            &"-o",
            &out,
        ])
        .ended(2)
        .tells(&["--schedule", &told]);
    }
}

#[test]
fn a_graph_and_data_that_a_shell_has_opened_are_read() {
    let (scratch, _) = desk("opened");
    athermal_fed(&[&"check", &"/dev/stdin"], GRAPH.as_bytes()).ended(0);
    let graph = scratch.file("graph.toml", GRAPH);
    let run = athermal_fed(
        &[&"run", &graph, &"-i", &"/dev/stdin"],
        b"t,a\n0,21\n10,22\n",
    );
    assert_eq!(run.ended(0).out, "t,room.a\n0,21.0\n10,22.0\n");
}
