//! What a run tells of sensors: at once beside a machine, at the end of a file.

use super::workbench::{Finished, athermal_fed};
use super::{csv, desk, rows};

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
