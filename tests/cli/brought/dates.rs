//! In which order day, month and year of a log stand, in which zone its clock is, and what is said where that is not found.

use std::path::PathBuf;

use athermal::Instant;
use athermal::core::time::TimeFormat;

use super::cases::{Fitted, score};
use crate::workbench::{Scratch, athermal, case};

#[test]
fn days_before_months_on_a_clock_of_twelve_hours_are_read_as_such() {
    let mut found = Vec::new();
    for file in ["week.csv", "month.csv", "reference.csv"] {
        let Some(of) = Fitted::of("day-first-and-twelve-hours", &[file]) else {
            return;
        };
        assert!(!of.init.told.contains("cannot be read"), "{}", of.init.told);
        let form = "format = \"%d/%m/%Y %I:%M:%S%.f %p\"";
        assert_eq!(
            of.graph().contains(form),
            file != "reference.csv",
            "{}",
            of.graph()
        );
        let facts = of.scores(file);
        found.push([
            score(&facts, "now/thermal", "n"),
            score(&facts, "now/thermal", "baseline_zero"),
        ]);
    }
    assert_eq!(found[0], found[2]);
    assert!((found[2][1] - 79.11).abs() < 0.01, "{found:?}");
}

#[test]
fn a_zone_whose_sign_stands_apart_is_the_zone() {
    let Some(folder) = case("zone-with-a-blank") else {
        return;
    };
    let scratch = Scratch::new("zone-with-a-blank");
    let log = std::fs::read_to_string(folder.join("logger.csv")).unwrap();
    for (zone, expected) in [
        ("GMT +05:00", "zone = \"+05:00\" "),
        ("UTC +1", "zone = \"+01:00\" "),
        ("(UTC -03:30)", "zone = \"-03:30\" "),
        ("GMT", "zone = \"UTC\" "),
        ("GMT 05:00", "# zone = "),
    ] {
        let log = scratch.file("log.csv", log.replacen("GMT +05:00", zone, 1));
        let graph = scratch.path("g.toml");
        athermal(&[&"init", &log, &"-o", &graph, &"--force"]).ended(0);
        let graph = std::fs::read_to_string(graph).unwrap();
        assert!(graph.contains(&format!("\n{expected}")), "{zone}\n{graph}");
    }
}

#[test]
fn a_log_whose_days_are_months_beside_that_of_another_is_named() {
    let Some(folder) = case("year-day-month-beside-another-logger") else {
        return;
    };
    let files = ["temperatures.csv", "positions.csv"].map(|file| folder.join(file));
    let graph = Scratch::new("year-day-month").path("g.toml");
    let refused = athermal(&[&"init", &files[0], &files[1], &"-o", &graph]).ended(2);
    let told: Vec<&str> = refused.told.split_whitespace().collect();
    let told = told.join(" ");
    for part in [
        "day and month exchanged",
        "positions.csv overlap",
        "--time-format \"%Y-%d-%m %H:%M:%S%.f\"",
    ] {
        assert!(told.contains(part), "{part} is not in {told}");
    }
}

/// A log whose times stand as given: a value each hour of shifts by day, from a date on.
fn in_shifts(
    scratch: &Scratch,
    (from_s, days): (i64, i64),
    write: &dyn Fn(Instant) -> String,
) -> PathBuf {
    let mut rows = String::from("time,plate_degC,Z_um\n");
    for hour in (0..24 * days).filter(|hour| (6..20).contains(&(hour % 24))) {
        let plate = 20.0 + (hour as f64 / 5.0).sin();
        let at = Instant::from_ns((from_s + 3600 * hour) * 1_000_000_000);
        rows += &format!("{},{plate:.3},{:.3}\n", write(at), 3.0 * plate);
    }
    scratch.file("log.csv", rows)
}

/// The same in a form of dates and times.
fn dated(scratch: &Scratch, form: &str, period: (i64, i64)) -> PathBuf {
    let form: TimeFormat = form.parse().unwrap();
    in_shifts(scratch, period, &|at| form.write(at, None).unwrap())
}

/// Midnights in s since 1970: 2 March 2026, 28 March 2026, and 11 October 2012.
const MARCH: i64 = 1_772_409_600;
const LATE_MARCH: i64 = MARCH + 26 * 86_400;
const OCTOBER: i64 = 1_349_913_600;

#[test]
fn the_order_of_dates_is_that_by_which_nights_are_alike() {
    let scratch = Scratch::new("orders-of-dates");
    for (form, from) in [
        ("%d/%m/%y %I:%M:%S %p", MARCH),
        ("%d-%m-%Y %I:%M %p", MARCH),
        ("%m/%d/%Y %H:%M", MARCH),
        ("%y/%m/%d %H:%M:%S", OCTOBER),
        ("%y-%m-%d %H:%M", LATE_MARCH),
        ("%Y-%d-%m %H:%M:%S", MARCH),
        ("%Y/%d/%m %H:%M", MARCH),
        ("%Y-%m-%d %H:%M:%S", MARCH),
    ] {
        let log = dated(&scratch, form, (from, 12));
        let graph = scratch.path("g.toml");
        let init = athermal(&[&"init", &log, &"-o", &graph, &"--force"]);
        let text = std::fs::read_to_string(graph).unwrap_or_default();
        let form = form.replace("%S", "%S%.f");
        let declared = match form.starts_with("%Y-%m") {
            true => "unit = \"rfc3339\"".to_owned(),
            false => format!("format = \"{form}\""),
        };
        assert!(text.contains(&declared), "{form}\n{}\n{text}", init.told);
    }
}

#[test]
fn a_form_that_is_given_and_fits_few_or_fewer_than_another_is_refused_with_that_one() {
    let scratch = Scratch::new("forms-given");
    let log = dated(&scratch, "%d/%m/%Y %H:%M", (MARCH, 20));
    let graph = scratch.path("g.toml");
    for (given, status, part) in [
        ("%d/%m/%Y %H:%M", 0, ""),
        ("%m/%d/%Y %H:%M", 2, "%d/%m/%Y %H:%M"),
        ("%Y-%m-%d %H:%M", 2, "%d/%m/%Y %H:%M"),
    ] {
        let words: [&dyn AsRef<std::ffi::OsStr>; 7] = [
            &"init",
            &log,
            &"--force",
            &"-o",
            &graph,
            &"--time-format",
            &given,
        ];
        athermal(&words).ended(status).tells(&[part]);
    }
    for (form, cure) in [
        ("%d|%m|%Y %H:%M:%S", "--time-format \"%d|%m|%Y %H:%M:%S\""),
        ("%Y~%m~%d at %H:%M", "--time-format \"%Y~%m~%d at %H:%M\""),
        ("", "no form of --time-format fits them all"),
    ] {
        let log = match form {
            "" => in_shifts(&scratch, (MARCH, 20), &|at| {
                format!("d{}:{}h", at.as_ns() % 97, at.as_ns() % 89)
            }),
            form => dated(&scratch, form, (MARCH, 20)),
        };
        let refused = athermal(&[&"init", &log, &"--force", &"-o", &graph]).ended(2);
        let told: Vec<&str> = refused.told.split_whitespace().collect();
        assert!(told.join(" ").contains(cure), "{form}: {}", refused.told);
    }
}
