//! What a run tells of sensors: at once beside a machine, at the end of a file.

use super::{csv, desk, rows};
use crate::workbench::{Finished, athermal, athermal_fed};

/// Rows of three hours and more, with what stands in the cells of the room and the position while these rows come.
fn log(rows_of: std::ops::Range<usize>, cells: impl Fn(usize, &mut [String])) -> String {
    let mut all = rows(0, 1200);
    for nth in rows_of {
        let mut of: Vec<String> = all[nth].split(',').map(str::to_owned).collect();
        cells(nth, &mut of[1..]);
        all[nth] = of.join(",");
    }
    csv(&all)
}

fn piped(test: &str, log: &str, more: &[&str]) -> Finished {
    let (_scratch, plain, _, _) = desk(test);
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"run", &plain, &"-i", &"-"];
    arguments.extend(more.iter().map(|more| more as &dyn AsRef<std::ffi::OsStr>));
    athermal_fed(&arguments, log.as_bytes()).ended(0)
}

#[track_caller]
fn tells_once(finished: &Finished, parts: &[&str]) {
    for part in parts {
        let times = finished.told.matches(part).count();
        assert_eq!(times, 1, "`{part}` in:\n{}", finished.told);
    }
}

#[test]
fn sensors_that_fall_silent_beside_a_machine_are_told_at_once_and_when_they_are_back() {
    let dead = log(300..800, |_, cells| {
        cells.iter_mut().for_each(String::clear);
    });
    let run = piped("silent", &dead, &[]);
    tells_once(
        &run,
        &[
            "temperature.room has no sample since 3000 s: did the sensor fail? What needs it predicts nothing",
            "position.Z has no sample since 3000 s",
            "temperature.room, position.Z have samples again, after 83.3 min",
        ],
    );
    let brief = piped("silent", &dead, &["-q"]);
    assert_eq!(brief.told.lines().count(), 2, "{}", brief.told);
}

#[test]
fn a_sensor_that_stands_still_beside_a_machine_is_told_at_once_and_when_it_is_back() {
    let stuck = log(300..800, |_, cells| "21.5".clone_into(&mut cells[0]));
    let run = piped("stuck", &stuck, &[]);
    tells_once(
        &run,
        &[
            "temperature.room is 21.50 in all of its last 20 samples, since 3000 s: is the sensor stuck?",
            "temperature.room changes again, after 83.3 min",
        ],
    );
    let setpoint = log(0..1200, |nth, cells| {
        cells[0] = if nth < 500 { "20" } else { "40" }.to_owned();
    });
    let run = piped("stuck", &setpoint, &[]);
    assert!(!run.told.contains("temperature"), "{}", run.told);
}

#[test]
fn a_sensor_that_comes_and_goes_is_told_at_most_once_an_hour() {
    let loose = log(0..1200, |nth, cells| {
        if nth % 100 >= 30 && nth > 200 {
            cells[0].clear();
        }
    });
    let run = piped("loose", &loose, &[]);
    let times = run.told.matches("temperature.room has no sample").count();
    assert!((2..=3).contains(&times), "{}", run.told);
}

#[test]
fn sensors_that_fail_in_a_file_are_told_at_its_end() {
    let (scratch, plain, _, _) = desk("failed");
    let dead = log(300..800, |_, cells| cells[0].clear());
    let run = athermal(&[&"run", &plain, &"-i", &scratch.file("dead.csv", dead)]).ended(0);
    tells_once(
        &run,
        &[
            "temperature.room has no sample in 500 of 1,200 rows, from 3000 s to 7990 s: did the sensor fail? What needs it predicts \
             nothing there",
        ],
    );
    let stuck = log(300..800, |_, cells| "21.5".clone_into(&mut cells[0]));
    let stuck = scratch.file("stuck.csv", stuck);
    let swap = format!("1h={}", plain.display());
    for more in [&[][..], &["--swap-at", &swap]] {
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"run", &plain, &"-i", &stuck];
        all.extend(more.iter().map(|more| more as &dyn AsRef<std::ffi::OsStr>));
        tells_once(
            &athermal(&all).ended(0),
            &[
                "temperature.room is 21.50 in 500 samples one after the other, from 3000 s to 7990 s",
            ],
        );
    }
}

#[test]
fn samples_out_of_range_are_told_again_after_an_hour_in_order() {
    let fails = |at: &'static [std::ops::Range<usize>]| {
        log(0..1200, |nth, cells| {
            if at.iter().any(|at| at.contains(&nth)) {
                "850".clone_into(&mut cells[0]);
            }
        })
    };
    let told = |log: &str| {
        let told = piped("again", log, &[]).told;
        told.matches("above the highest of its range").count()
    };
    assert_eq!(told(&fails(&[10..20, 200..210])), 1);
    assert_eq!(told(&fails(&[10..20, 500..510])), 2);
    let flapping = log(0..1200, |nth, cells| {
        if nth % 2 == 0 {
            "850".clone_into(&mut cells[0]);
        }
    });
    assert_eq!(told(&flapping), 1);
}

#[test]
fn sensors_are_watched_by_the_graph_that_has_taken_over() {
    let (scratch, plain, _, _) = desk("followed");
    let other = super::plain().replace("\"room\"", "\"hall\"");
    let other = scratch.file("other.toml", other);
    // The room is not measured once nothing needs it, and the hall fails long after it began to count.
    let all = rows(0, 1500).into_iter().enumerate().map(|(nth, row)| {
        let cells: Vec<&str> = row.split(',').collect();
        let room = if nth < 350 { cells[1] } else { "" };
        let hall = if nth < 700 { cells[1] } else { "" };
        format!("{},{room},{},{hall}", cells[0], cells[2])
    });
    let all: Vec<String> = all.collect();
    let log = csv(&all).replacen('\n', ",hall\n", 1);
    let swap = format!("3000={}", other.display());
    let streamed = [&"run" as &dyn AsRef<std::ffi::OsStr>, &plain, &"-i", &"-"];
    let streamed = [&streamed[..], &[&"--swap-at", &swap]].concat();
    let file = scratch.file("log.csv", &log);
    let recorded = athermal(&[&"run", &plain, &"-i", &file, &"--swap-at", &swap]).ended(0);
    for run in [athermal_fed(&streamed, log.as_bytes()).ended(0), recorded] {
        run.tells(&["took over", "temperature.hall has no sample"]);
        assert!(!run.told.contains("temperature.room"), "{}", run.told);
    }
}
