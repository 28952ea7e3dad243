use super::*;

fn found(text: &'static str) -> Result<Clock, String> {
    find(
        &Description::of_read("log", text.as_bytes(), None, 10).unwrap(),
        None,
        None,
    )
}

#[test]
fn the_form_of_a_time_is_seen_from_its_name_and_cells() {
    for (text, column, form) in [
        ("room,time_s\n1,0\n1,10\n", "time_s", TimeForm::SECONDS),
        (
            "t_ms,a\n0,1\n250,2\n",
            "t_ms",
            TimeForm::Numbers {
                ns_per_unit: 1_000_000,
            },
        ),
        (
            "Timestamp;a\n2024-01-01T00:00:00Z;1\n2024-01-01T00:00:10Z;2\n",
            "Timestamp",
            TimeForm::Rfc3339,
        ),
        (
            "sample,a\n1,5\n2,5\n3,5\n",
            "sample",
            TimeForm::Samples { step_ns: SAMPLE_NS },
        ),
        (
            "time,a\n1700000000000,5\n1700000000100,5\n",
            "time",
            TimeForm::Numbers {
                ns_per_unit: 1_000_000,
            },
        ),
        (
            "when;a\n46083,00000000;5\n46083,00034722;5\n46083,00069444;5\n",
            "when",
            TimeForm::Numbers {
                ns_per_unit: 86_400_000_000_000,
            },
        ),
        (
            "time_s,a\n1772366400000,5\n1772366410000,5\n",
            "time_s",
            TimeForm::Numbers {
                ns_per_unit: 1_000_000,
            },
        ),
        (
            "time_ms,a\n0,5\n10,5\n20,5\n1e300,5\n",
            "time_ms",
            TimeForm::Numbers {
                ns_per_unit: 1_000_000,
            },
        ),
        (
            "stamp,a\n1772366400000000,5\n1772366410000000,5\n",
            "stamp",
            TimeForm::Numbers { ns_per_unit: 1_000 },
        ),
        (
            "a;Zeit\n1,5;01.03.2026 12:00:00,0\n1,5;01.03.2026 12:00:00,5\n",
            "Zeit",
            TimeForm::Format("%d.%m.%Y %H:%M:%S%.f".parse().unwrap()),
        ),
        (
            "time_s,a\n46083.00,5\n46083.01,5\n46083.02,5\n",
            "time_s",
            TimeForm::SECONDS,
        ),
        (
            "time,a\n46083,5\n46084,5\n46085,5\n",
            "time",
            TimeForm::SECONDS,
        ),
    ] {
        let clock = found(text).unwrap();
        assert_eq!((&*clock.columns.to_string(), clock.form), (column, form));
    }
}

#[test]
fn what_was_assumed_of_a_time_is_told() {
    let days = found("time,a\n46083.000,5\n46083.001,5\n").unwrap();
    let told = days.remark();
    assert!(told.contains("numbers from 46083 on"), "{told}");
    assert!(
        told.contains("taken for days") && told.contains("time_s"),
        "{told}"
    );
    for (second, zoned) in [
        ("2026-03-02 00:00:30", false),
        ("2026-03-02T00:00:30Z", true),
        ("2026-03-02T00:00:30-01:00", true),
    ] {
        let text = format!("time,a\n2026-03-02T00:00:00Z,1\n{second},2\n");
        let text = std::io::Cursor::new(text);
        let described = Description::of_read("log", text, None, 10).unwrap();
        let told = find(&described, None, None).unwrap().remark();
        assert_eq!(told.contains("without a zone"), !zoned, "{told}");
        assert_eq!(told.contains("taken for UTC"), !zoned, "{told}");
    }
}

#[test]
fn a_time_in_a_form_that_is_not_known_is_told_with_a_cell_and_read_by_a_format_that_is_named() {
    let text = "a,when\n1,12:00 on 01.03.2026\n2,12:01 on 01.03.2026\n";
    let described = Description::of_read("log", text.as_bytes(), None, 10).unwrap();
    for named in [None, Some("when")] {
        let refused = find(&described, named, None).unwrap_err();
        assert!(
            refused.contains("`when` has times such as `12:00 on 01.03.2026`")
                && refused.contains("--time-format"),
            "{refused}"
        );
    }
    let format: TimeFormat = "%H:%M on %d.%m.%Y".parse().unwrap();
    let clock = find(&described, None, Some(&format)).unwrap();
    assert_eq!(clock.columns, TimeColumns::one("when"));
    let other: TimeFormat = "%d.%m.%Y %H:%M".parse().unwrap();
    for named in [None, Some("when")] {
        let refused = find(&described, named, Some(&other)).unwrap_err();
        assert!(
            refused.contains("`when` has no time as `%d.%m.%Y %H:%M` says"),
            "{refused}"
        );
    }
    assert_eq!(clock.declared, Some(("format", format.to_string())));
    assert!(
        clock.remark().contains("taken for UTC"),
        "{}",
        clock.remark()
    );
}

#[test]
fn a_decimal_comma_is_one_in_seconds_behind_a_date_with_points() {
    let text = "when;a\n01.03.2026 12:00:00,4;1\n01.03.2026 12:00:10,4;2\n";
    let form = TimeForm::Format("%d.%m.%Y %H:%M:%S%.f".parse().unwrap());
    assert_eq!(found(text).unwrap().form, form);
}

#[test]
fn the_unit_of_a_time_may_stand_below_its_name() {
    let clock = found("Time;a\n[ms];\u{b0}C\n0;1\n250;2\n").unwrap();
    assert_eq!(clock.declared, Some(("unit", "ms".to_owned())));
    assert_eq!(clock.why, "numbers in ms, as the row below its name says");
}

#[test]
fn a_time_of_day_is_put_together_with_the_date_beside_it() {
    for (log, columns, declared) in [
        (
            "Date;a;Time\n01.03.2026;1;8:00:00,5\n01.03.2026;2;8:00:10,5\n",
            "{Date} {Time}",
            "%d.%m.%Y %H:%M:%S%.f",
        ),
        (
            "Uhrzeit;Datum;a\n08:00:00;01.03.26;1\n08:00:10;01.03.26;2\n",
            "{Datum} {Uhrzeit}",
            "%d.%m.%y %H:%M:%S%.f",
        ),
        (
            "a,Date,Time\n1,3/13/2026,8:00:00 AM\n2,3/13/2026,8:00:10 AM\n",
            "{Date} {Time}",
            "%m/%d/%Y %I:%M:%S%.f %p",
        ),
        (
            "Date,Time,a\n2026-03-01,08:00,1\n2026-03-01,08:01,2\n",
            "{Date} {Time}",
            "rfc3339",
        ),
        (
            "Date,Time,a\n2026-03-01,8:00:00,1\n2026-03-01,8:00:10,2\n",
            "{Date} {Time}",
            "%Y-%m-%d %H:%M:%S%.f",
        ),
        (
            "Date;Time;a\n20260301;08:00:00;1\n20260301;08:00:10;2\n",
            "{Date} {Time}",
            "rfc3339",
        ),
        (
            "Date;Time;a\n01 Mar 2026;08:00:00;1\n01 Mar 2026;08:00:10;2\n",
            "{Date} {Time}",
            "%d %b %Y %H:%M:%S%.f",
        ),
        // One row a day: the date alone advances too.
        (
            "Day,Clock,a\n2026-03-01,08:00,1\n2026-03-02,08:00,2\n2026-03-03,09:00,2\n",
            "{Day} {Clock}",
            "rfc3339",
        ),
        // What was calibrated once stands further away.
        (
            "calibrated;a;Date;Time\n01.01.2025;1;01.03.2026;08:00:00\n01.01.2025;2;01.03.2026;08:00:10\n",
            "{Date} {Time}",
            "%d.%m.%Y %H:%M:%S%.f",
        ),
    ] {
        let clock = found(log).unwrap();
        assert_eq!(clock.columns.to_string(), columns, "{log}");
        assert_eq!(clock.declared.unwrap().1, declared, "{log}");
    }
    assert_eq!(
        found("Time;a\n12:00:00,400;1\n12:00:10,400;2\n").unwrap_err(),
        "`Time` has times of day such as `12:00:00,400`, and no other column their dates: log these too"
    );
}

#[test]
fn columns_of_date_and_time_may_be_named_each_or_both_with_their_format() {
    let text = "D;T;other;a\n1.13.2026;08:00:00;12:00:00;1\n1.13.2026;08:00:10;12:00:00;2\n";
    let described = Description::of_read("log", text.as_bytes(), None, 10).unwrap();
    assert!(
        found(text).unwrap_err().contains(
            "`{D} {T}` has times such as `1.13.2026 08:00:00`, in a form that is not known"
        )
    );
    let format: TimeFormat = "%m.%d.%Y %H:%M:%S".parse().unwrap();
    for named in [None, Some("D"), Some("T"), Some("{D} {T}")] {
        let clock = find(&described, named, Some(&format)).unwrap();
        assert_eq!(clock.columns.to_string(), "{D} {T}", "{named:?}");
        let told = clock.remark();
        assert!(
            told.starts_with("time: `{D} {T}`, put together, dates and times as `%m.%d.%Y %H:%M:%S` without a zone"),
            "{told}"
        );
    }
    let told = |named| find(&described, Some(named), None).unwrap_err();
    assert!(told("{D} {x}").starts_with("there is no column `x`; there are D, T, other, a"));
    assert!(told("{D} {T").starts_with("--time \"{D} {T\": a brace is not closed in `{T`"));
}

#[test]
fn a_log_without_a_time_is_told_to_name_one() {
    let refused = found("a,b\n1,1\n0,0\n2,0\n").unwrap_err();
    assert!(refused.contains("--time"), "{refused}");
}

#[test]
fn the_last_fifth_begins_at_a_round_time_of_the_logs_own_form() {
    const DAY_NS: i64 = 86_400_000_000_000;
    let monday = 1_772_438_400_000_000_000;
    for (text, (first, length), expected) in [
        ("time_s,a\n0,1\n1,2\n", (0, 3 * DAY_NS), Some("207000")),
        ("t_ms,a\n0,1\n250,2\n", (0, DAY_NS / 8640), Some("8000")),
        ("t [d],a\n0,1\n0.25,2\n", (0, 9 * DAY_NS / 10), Some("0.72")),
        (
            "time,a\n2026-03-02T08:00:00Z,1\n2026-03-02T08:01:00Z,2\n",
            (monday, 5 * DAY_NS),
            Some("2026-03-06T08:00:00Z"),
        ),
        (
            "time,a\n02.03.2026 08:00:10,1\n02.03.2026 08:01:10,2\n13.03.2026 08:01:10,2\n",
            (monday + 10_000_000_000, DAY_NS / 2),
            Some("02.03.2026 17:36:00"),
        ),
        ("time_s,a\n0,1\n1,2\n", (5, 0), None),
    ] {
        let found = found(text).unwrap().last_fifth((first, first + length));
        assert_eq!(found.as_deref(), expected, "{text}");
    }
}
