//! Data that lie far outside of those of the fit.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::{csv, desk, rows};
use crate::workbench::{Finished, Scratch, athermal, athermal_fed};

/// A model of a room between 20 and 26 °C, its data, and data of a room that is warmer by so many degrees, with positions in
/// thousandths.
fn desk_and_far(test: &str, warmer: f64) -> (Scratch, PathBuf, PathBuf, PathBuf) {
    let (scratch, _, data, model) = desk(test);
    let far = |row: String| {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        format!("{},{:.3},{}", cells[0], cells[1] + warmer, cells[2] * 1e3)
    };
    let far: Vec<String> = rows(0, 60).into_iter().map(far).collect();
    let far = scratch.file("far.csv", csv(&far));
    (scratch, data, model, far)
}

fn on(command: &str, model: &Path, data: &Path, more: &[&dyn AsRef<OsStr>]) -> Finished {
    let input = if command == "run" {
        "--input"
    } else {
        "--data"
    };
    let mut arguments: Vec<&dyn AsRef<OsStr>> = vec![&command, &model, &input, &data];
    arguments.extend(more);
    athermal(&arguments).ended(0)
}

#[test]
fn data_far_outside_of_those_of_the_fit_are_told_by_whatever_reads_them() {
    let (scratch, data, model, far) = desk_and_far("beyond", 20.0);
    let output = scratch.path("out.csv");
    let commands: [(&str, &[&dyn AsRef<OsStr>]); 3] = [
        ("evaluate", &[]),
        ("run", &[&"--output", &output]),
        ("diagnose", &[&"--no-fit"]),
    ];
    for (command, more) in commands {
        on(command, &model, &far, more).tells(&[
            "temperature.room is between 40",
            ", and was between 20",
            "in the data of the fit: the fit learned nothing of values so far outside",
            "position.Z is between 200",
            "is it in the unit of the fit?",
        ]);
        let told = on(command, &model, &data, more).told;
        assert!(!told.contains("in the data of the fit"), "{told}");
    }
    let json = on("evaluate", &model, &far, &[&"--format", &"json"]).json();
    let outside = &json["outside_fit"][0];
    assert_eq!(outside["channel"], "temperature.room");
    assert_eq!(
        (&outside["lowest"], &outside["lowest_in_fit"]),
        (&40.0.into(), &20.0.into())
    );
    let graph = scratch.path("fitted.toml");
    let compared = athermal(&[&"compare", &graph, &"--data", &data, &"--on", &far]).ended(0);
    compared.tells(&["temperature.room is between 40"]);
    let times = compared.told.matches("temperature.room is between").count();
    assert_eq!(times, 1, "{}", compared.told);
}

#[test]
fn data_somewhat_outside_of_those_of_the_fit_are_not_told_of() {
    let (_scratch, _, model, far) = desk_and_far("somewhat-beyond", 4.0);
    let told = on("evaluate", &model, &far, &[]).told;
    assert!(!told.contains("temperature.room"), "{told}");
}

#[test]
fn a_pipe_tells_the_first_sample_far_outside_of_those_of_the_fit() {
    let (_scratch, _, model, far) = desk_and_far("beyond-in-a-pipe", 20.0);
    let far = std::fs::read(far).unwrap();
    let run = athermal_fed(&[&"run", &model, &"--input", &"-"], &far).ended(0);
    run.tells(&["temperature.room at 0: 40.00, and was between 20.00 and"]);
    assert_eq!(run.told.matches("temperature.room").count(), 1);
}
