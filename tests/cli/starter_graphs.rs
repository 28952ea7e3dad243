//! Starter graphs of logs as machines write them: fast, sparse, with flags, with mistakes.

use std::fmt::Write as _;

use crate::workbench::Folder;

impl Folder {
    /// What `init` says of a log, its lines joined.
    fn init(&self, name: &str, log: &str) -> (bool, String) {
        let graph = format!("{name}.toml");
        std::fs::write(self.0.join(name), log).unwrap();
        let output = self.run(&["init", name, "-o", &graph]);
        let told = String::from_utf8(output.stderr).unwrap();
        let words: Vec<&str> = told.split_whitespace().collect();
        (output.status.success(), words.join(" "))
    }

    /// What `init` says of a log whose graph it writes; the graph checks.
    fn started(&self, name: &str, log: &str) -> String {
        let (fine, told) = self.init(name, log);
        assert!(fine, "{name}: {told}");
        let checked = self.run(&["check", &format!("{name}.toml")]);
        let said = String::from_utf8(checked.stderr).unwrap();
        assert!(checked.status.success(), "{name}: {said}");
        told
    }

    fn graph(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(format!("{name}.toml"))).unwrap()
    }
}

/// Numbers between -1 and 1 that look random, the same ones every time.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A sample of a machine that grinds now and then: instant in s, temperature in °C, whether it grinds, position in µm.
type Sample = (f64, f64, bool, f64);

/// A machine that grinds for 25 minutes of every 70, and warms by it with 40 minutes.
fn grinding(samples: usize, interval_s: f64) -> Vec<Sample> {
    let mut noise = Noise(1);
    let mut warm = 0.0;
    let sample = |number: usize| {
        let time_s = number as f64 * interval_s;
        let grinds = time_s % 4200.0 >= 2700.0;
        warm += interval_s / 2400.0 * (f64::from(u8::from(grinds)) - warm);
        let degc = 20.0 + 4.0 * warm + 0.01 * noise.next();
        (time_s, degc, grinds, 12.0 * warm + 0.05 * noise.next())
    };
    (0..samples).map(sample).collect()
}

/// A log of it with flags as they are written by `flag`.
fn log_of(samples: &[Sample], mut flag: impl FnMut(usize, bool) -> String) -> String {
    let mut text = "time_s,plate_degC,grinding,Z_um\n".to_owned();
    for (number, (time_s, degc, grinds, z)) in samples.iter().enumerate() {
        let grinds = flag(number, *grinds);
        let _ = writeln!(text, "{time_s},{degc:.4},{grinds},{z:.4}");
    }
    text
}

fn digit(on: bool) -> String {
    u8::from(on).to_string()
}

#[test]
fn a_flag_that_is_logged_on_change_does_not_widen_the_drift_window() {
    let folder = Folder::new("on-change");
    let samples = grinding(5000, 30.0);
    let window = |told: &str| {
        let (_, rest) = told.split_once("drift window: ").unwrap();
        rest.split_once(" (").unwrap().0.to_owned()
    };
    let always = folder.started("always.csv", &log_of(&samples, |_, on| digit(on)));
    let mut last = None;
    let on_change = log_of(&samples, |_, on| match last.replace(on) == Some(on) {
        true => String::new(),
        false => digit(on),
    });
    let told = folder.started("change.csv", &on_change);
    assert_eq!(window(&told), window(&always), "{told}");
    assert!(
        told.contains("grinding: its values are too far apart"),
        "{told}"
    );
    let graph = folder.graph("change.csv");
    assert!(
        graph.contains("sensors = [\"gradients\", \"masses\", \"input\"]"),
        "{graph}"
    );
    let fitted = folder.run(&[
        "fit",
        "change.csv.toml",
        "--data",
        "change.csv",
        "-o",
        "m.json",
    ]);
    let said = String::from_utf8(fitted.stderr).unwrap();
    assert!(fitted.status.success(), "{said}");
    let scored = folder.run(&[
        "evaluate",
        "m.json",
        "--data",
        "change.csv",
        "--format",
        "json",
    ]);
    let facts: serde_json::Value = serde_json::from_slice(&scored.stdout).unwrap();
    let scores = facts["scores"].as_array().unwrap();
    let thermal = scores.iter().find(|score| score["node"] == "next/thermal");
    let thermal = thermal.unwrap();
    let figure = |name: &str| thermal[name].as_f64().unwrap();
    assert!(figure("rmse") < 0.5 * figure("baseline_zero"), "{thermal}");
}

#[test]
fn a_temperature_that_bounds_the_drift_window_is_named() {
    let folder = Folder::new("bound");
    let samples = grinding(5000, 30.0);
    let mut text = "time_s,plate_degC,Z_um\n".to_owned();
    for (number, (time_s, degc, _, z)) in samples.iter().enumerate() {
        let degc = match number % 60 {
            0 => format!("{degc:.4}"),
            _ => String::new(),
        };
        let _ = writeln!(text, "{time_s},{degc},{z:.4}");
    }
    let told = folder.started("slow.csv", &text);
    let reason = "narrower ones were not tried: plate_degC has a value every 30 min";
    assert!(told.contains(reason), "{told}");
    assert!(folder.graph("slow.csv").contains(reason));
}

#[test]
fn a_starter_graph_of_a_fast_log_checks() {
    let folder = Folder::new("fast");
    for period_ms in [0.1, 0.5, 2.0, 10.0, 50.0, 100.0] {
        let mut noise = Noise(1);
        let mut text = "time_ms,a_degC,Z_nm\n".to_owned();
        for number in 0..5000 {
            let phase = f64::from(number) / 800.0;
            let (degc, z) = (20.0 + phase.sin(), 500.0 * phase.cos());
            let time_ms = f64::from(number) * period_ms;
            let _ = writeln!(
                text,
                "{time_ms:.1},{:.4},{:.3}",
                degc + 0.001 * noise.next(),
                z + noise.next()
            );
        }
        folder.started(&format!("{period_ms}.csv"), &text);
    }
}

#[test]
fn dates_as_they_are_written_elsewhere_are_read_as_they_are() {
    let folder = Folder::new("dated");
    let mut text = "Datum;plate_degC;Z_um\n".to_owned();
    for (time_s, degc, _, z) in grinding(3000, 30.0) {
        let (minutes, seconds) = (time_s as u64 / 60, time_s as u64 % 60);
        let (hours, minutes) = (minutes / 60, minutes % 60);
        let date = format!(
            "{:02}.03.2026 {:02}:{minutes:02}:{seconds:02}",
            1 + hours / 24,
            hours % 24
        );
        let values = format!("{degc:.4};{z:.4}").replace('.', ",");
        let _ = writeln!(text, "{date};{values}");
    }
    let told = folder.started("dated.csv", &text);
    assert!(told.contains("taken for UTC"), "{told}");
    let graph = folder.graph("dated.csv");
    assert!(
        graph.contains("format = \"%d.%m.%Y %H:%M:%S%.f\""),
        "{graph}"
    );
    assert!(graph.contains("3,000 rows over 25"), "{graph}");
}

#[test]
fn columns_whose_names_differ_in_signs_alone_have_channels_of_their_own() {
    let folder = Folder::new("alike");
    let mut text =
        "time_s,plate (C),plate [°C],plate_degC,plate_degF,{plate}_degC,Z_um,Z um,Z (um)\n"
            .to_owned();
    for (time_s, degc, _, z) in grinding(3000, 30.0) {
        let degf = 32.0 + 1.8 * degc;
        let _ = writeln!(
            text,
            "{time_s},{degc:.4},{degc:.3},{degc:.2},{degf:.3},{degc:.1},{z:.4},{z:.3},{z:.2}"
        );
    }
    let told = folder.started("alike.csv", &text);
    assert!(told.contains("{plate}_degC: left out"), "{told}");
}

#[test]
fn a_time_that_no_instant_fits_is_told_with_the_row() {
    let folder = Folder::new("beyond");
    let text = "stamp_d,plate_degC,Z_um\n1e300,20.1,1\n2e300,20.2,2\n3e300,20.3,3\n";
    let (fine, told) = folder.init("beyond.csv", text);
    assert!(!fine);
    assert!(told.contains("less than two rows with a time"), "{told}");
    assert!(told.contains("beyond.csv:2: "), "{told}");
    assert!(told.contains("more than 292 years"), "{told}");
}

#[test]
fn the_days_of_a_spreadsheet_are_days() {
    let folder = Folder::new("days");
    let mut text = "time;plate_degC;Z_um\n".to_owned();
    for (time_s, degc, _, z) in grinding(3000, 30.0) {
        let days = 46083.0 + time_s / 86_400.0;
        let row = format!("{days:.8};{degc:.4};{z:.4}");
        let _ = writeln!(text, "{}", row.replace('.', ","));
    }
    let told = folder.started("days.csv", &text);
    assert!(told.contains("taken for days"), "{told}");
    let graph = folder.graph("days.csv");
    assert!(graph.contains("3,000 rows over 25"), "{graph}");
    assert!(graph.contains("unit = \"d\""), "{graph}");
    let days = ["46083", "46084"];
    let (first, second) = text.split_at(text.len() / 3);
    let points = days.iter().fold(second.replace(',', "."), |text, day| {
        text.replace(&format!("{day}."), &format!("{day},"))
    });
    let mixed = first.to_owned() + &points;
    let (fine, told) = folder.init("mixed.csv", &mixed);
    assert!(!fine);
    let reason =
        "but the decimal mark of the others is `,`; write all numbers of a file with one mark";
    assert!(told.contains(reason), "{told}");
    // The clock may have a mark of its own.
    let apart = days.iter().fold(text, |text, day| {
        text.replace(&format!("{day},"), &format!("{day}."))
    });
    folder.started("apart.csv", &apart);
}

#[test]
fn a_flag_in_words_is_read_where_it_is_true_or_false_and_else_told_as_text() {
    let folder = Folder::new("flags");
    let samples = grinding(3000, 30.0);
    let logged = log_of(&samples, |_, on| {
        if on { "TRUE" } else { "False" }.to_owned()
    });
    let told = folder.started("words.csv", &logged);
    assert!(told.contains("grinding: input"), "{told}");
    let logged = log_of(&samples, |_, on| if on { "yes" } else { "no" }.to_owned());
    let told = folder.started("yes.csv", &logged);
    assert!(
        told.contains("grinding: left out, it is text, such as `no` in line 2; write numbers"),
        "{told}"
    );
}

#[test]
fn a_sensor_with_a_cell_that_cannot_be_read_is_kept() {
    let folder = Folder::new("corrupt");
    for row in [7, 2000] {
        let name = format!("{row}.csv");
        let logged = log_of(&grinding(3000, 30.0), |number, on| match number == row {
            true => "#\0EF".to_owned(),
            false => digit(on),
        });
        let told = folder.started(&name, &logged);
        let reason = format!(
            "1 cell of 3,000 cannot be read `#\u{fffd}EF` in line {}; taken as missing",
            row + 2
        );
        assert!(told.contains("grinding: input"), "{told}");
        assert!(told.contains(&reason), "{told}");
        assert!(folder.graph(&name).contains("lenient = true"));
    }
}

#[test]
fn columns_of_too_few_values_or_of_text_are_named_where_nothing_is_left() {
    let folder = Folder::new("short");
    let mut text = "time_s,plate_degC,Z_um,Y_mm\n".to_owned();
    for (number, (time_s, degc, _, z)) in grinding(60, 30.0).iter().enumerate() {
        let z = match number % 10 {
            0 => format!("{z:.4},0.{number}5"),
            _ => ",".to_owned(),
        };
        let _ = writeln!(text, "{time_s},{degc:.4},{z}");
    }
    let (fine, told) = folder.init("short.csv", &text);
    assert!(!fine);
    assert!(
        told.contains(
            "nothing is left that drifts: Z_um: left out, it has 6 values, and at least 10 are needed; Y_mm: left out"
        ),
        "{told}"
    );
    let logged = log_of(&grinding(300, 30.0), |_, on| digit(on)).replace("20.", "warm ");
    let (fine, told) = folder.init("text.csv", &logged.replace(",1,", ",0,"));
    assert!(!fine);
    assert!(
        told.contains("nothing is left that could explain a drift: plate_degC: left out, it is"),
        "{told}"
    );
}

#[test]
fn decimal_commas_are_read_between_tabs() {
    let folder = Folder::new("tabs");
    let logged = log_of(&grinding(3000, 30.0), |_, on| digit(on));
    let logged = logged.replace(',', "\t").replace('.', ",");
    let told = folder.started("tabs.tsv", &logged);
    assert!(told.contains("plate_degC: temperature"), "{told}");
    assert!(told.contains("Z_um: drifts"), "{told}");
}

#[test]
fn a_log_is_not_written_over_by_its_own_graph() {
    let folder = Folder::new("starter-own");
    let log = "time_s,room_degC,Z_nm\n0,20,1\n10,21,2\n";
    std::fs::write(folder.0.join("log.csv"), log).unwrap();
    let output = folder.run(&["init", "log.csv", "-o", "./log.csv", "--force"]);
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(told.contains("this is the same file as"), "{told}");
    let kept = std::fs::read_to_string(folder.0.join("log.csv")).unwrap();
    assert_eq!(kept, log);
}

#[test]
fn a_temperature_that_grows_is_no_time() {
    let folder = Folder::new("starter-growing");
    let mut log = "time_s,plate_degC,Z_nm\n".to_owned();
    for row in 0..600 {
        // Twenty rows within each second of a clock that tells whole ones.
        let warm = 20.0 + 0.01 * f64::from(row);
        writeln!(log, "{},{warm:.3},{:.1}", row / 20, 100.0 * warm).unwrap();
    }
    let (fine, told) = folder.init("log.csv", &log);
    assert!(!fine, "{told}");
    assert!(
        told.contains("no column advances from row to row as a time does"),
        "{told}"
    );
}

/// As a controller and a spreadsheet export a log: `sep=`, lines about the device, units below the names, decimal commas, and rows that
/// end in a delimiter.
#[test]
fn a_log_as_a_controller_exports_it_is_read_by_its_graph_as_it_is() {
    let folder = Folder::new("starter-exported");
    for (name, names, units, between) in [
        ("one.csv", "Time", "", " "),
        ("two.csv", "Datum;Uhrzeit", "TT.MM.JJJJ;hh:mm:ss", ";"),
    ] {
        let mut log = format!(
            "sep=;\r\nDevice;Controller 3000\r\nSerial;12345\r\n\r\n{names};Plate;Z\r\n{units};°C;nm\r\n"
        );
        for (time_s, degc, _, z) in grinding(1000, 10.0) {
            let (hour, minute, second) = (time_s / 3600.0, time_s / 60.0 % 60.0, time_s % 60.0);
            let (hour, minute) = (hour.floor(), minute.floor());
            let row = format!("{degc:.4};{z:.4};\r\n").replace('.', ",");
            write!(
                log,
                "01.03.2026{between}{hour:02}:{minute:02}:{second:02},400;{row}"
            )
            .unwrap();
        }
        let told = folder.started(name, &log);
        assert!(
            told.contains("Plate: temperature, in Cel; by its unit"),
            "{told}"
        );
        assert!(told.contains("Z: drifts, in nm; a length"), "{told}");
        let graph = folder.graph(name);
        assert!(!graph.contains("the names do not say"), "{graph}");
        if between == ";" {
            assert!(
                told.contains("time: `{Datum} {Uhrzeit}`, put together, dates and times as"),
                "{told}"
            );
            let time =
                "[time]\ncolumn = \"{Datum} {Uhrzeit}\"\nformat = \"%d.%m.%Y %H:%M:%S%.f\"\n";
            assert!(graph.contains(time), "{graph}");
        }
        let fitted = folder.run(&[
            "fit",
            &format!("{name}.toml"),
            "--data",
            name,
            "-o",
            "model.json",
        ]);
        let said = String::from_utf8(fitted.stderr).unwrap();
        assert!(
            fitted.status.success() && !said.contains("warning"),
            "{said}"
        );
        let evaluated = folder.run(&["evaluate", "model.json", "--data", name]);
        assert!(evaluated.status.success());
        let run = folder.run(&["run", "model.json", "--input", name, "--output", "-"]);
        let put_out = String::from_utf8(run.stdout).unwrap();
        assert_eq!(put_out.lines().count(), 1001, "{put_out}");
    }
}

#[test]
fn times_that_start_again_where_a_column_changes_are_segments_by_it() {
    let folder = Folder::new("starter-segments");
    let mut log = "run,time_s,plate_degC,Z_um\n".to_owned();
    for (nth, run) in ["A", "B", "C"].into_iter().enumerate() {
        for row in 0..1200_u32 {
            let wave = (f64::from(row) / 150.0 + nth as f64).sin();
            let _ = writeln!(
                log,
                "{run},{},{:.3},{:.4}",
                60 * row,
                21.0 + wave,
                10.0 * wave
            );
        }
    }
    let told = folder.started("days.csv", &log);
    assert!(
        told.contains("the times start again where `run` changes, 3 in all"),
        "{told}"
    );
    assert!(!told.contains("out of order"), "{told}");
    let graph = folder.graph("days.csv");
    assert!(graph.contains("segment = \"run\""), "{graph}");
    let by_segments = "folds = { type = \"segments\", count = 3 }";
    assert!(graph.contains(by_segments), "{graph}");
    let fit = |graph: &str| {
        let fitted = folder.run(&[
            "fit", graph, "--data", "days.csv", "-o", "m.json", "--format", "json",
        ]);
        let said = String::from_utf8(fitted.stderr).unwrap();
        assert!(fitted.status.success(), "{said}");
        serde_json::from_slice::<serde_json::Value>(&fitted.stdout).unwrap()
    };
    fit("days.csv.toml");
    // More parts than segments are none.
    let selected = graph.split("[nodes.drift]").next().unwrap().to_owned()
        + "[nodes.level]\ntype = \"linear\"\ninputs.features = \"temperature\"\ninputs.truth = \"position.Z\"\nahead = \"0s\"\n\
           selection = { method = \"forward\", folds = { type = \"segments\", count = 8 } }\n\
           [outputs]\nnow = \"level\"\n";
    std::fs::write(folder.0.join("level.toml"), selected).unwrap();
    let facts = fit("level.toml");
    let folds = &facts["estimators"][0]["selection"][0]["folds"];
    assert_eq!(folds.as_array().unwrap().len(), 3, "{facts:#}");
}

#[test]
fn a_log_in_long_format_gives_a_graph_that_reads_it() {
    let folder = Folder::new("starter-long");
    let row = |second: u32| {
        let wave = (f64::from(second) / 40.0).sin();
        format!(
            "{second},plate_degC,{:.3}\n{second},Z_nm,{:.2}\n",
            21.5 + wave,
            80.0 * wave
        )
    };
    let log = "time,tag,value\n".to_owned() + &(0..500).map(row).collect::<String>();
    let told = folder.started("log.csv", &log);
    assert!(
        told.contains("a long layout: `tag` says of each row what its `value` is"),
        "{told}"
    );
    let graph = folder.graph("log.csv");
    assert!(graph.contains("layout = \"long\""), "{graph}");
}

#[test]
fn of_columns_in_several_units_the_drift_is_told_in_a_unit_of_its_own_size() {
    let folder = Folder::new("starter-mixed-units");
    let row = |nth: u32| {
        let time = f64::from(10 * nth);
        let drift = 80.0 * (time / 700.0).sin();
        let plate = 20.0 + 0.5 * (time / 700.0).cos();
        format!(
            "{time},{plate:.4},{:.6},{:.2}\n",
            drift / 1000.0,
            1.3 * drift
        )
    };
    let rows: String = (0..2000).map(row).collect();
    let log = format!("time_s,plate_degC,X_um,Z_nm\n{rows}");
    folder.started("mix.csv", &log);
    let text = folder.graph("mix.csv");
    assert!(text.contains("unit = \"nm/min\""), "{text}");
}
