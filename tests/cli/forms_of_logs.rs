//! Forms in which loggers of the trade write: what `init` takes each for, and that its graph reads it. What is right of each stands
//! beside the logs; here it is compared.

use std::path::PathBuf;

use serde_json::Value;

use crate::workbench::{Finished, Scratch, athermal, athermal_on, data};

/// A log of a family of forms, or nothing, with a remark, where this machine lacks it.
fn case(file: &str) -> Option<PathBuf> {
    let path = data()?.with_file_name("cases").join(file);
    if !path.is_file() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

/// What `init` makes of a log, and what its graph predicts of it.
struct Started {
    facts: Value,
    graph: String,
    fit: Finished,
    scores: Value,
}

impl Started {
    /// What a column is taken for and its unit.
    fn column(&self, name: &str) -> (String, String) {
        let mut columns = self.facts["columns"].as_array().unwrap().iter();
        let column = columns.find(|column| column["column"] == name);
        let column = column.unwrap_or_else(|| panic!("{name} in {}", self.facts));
        let text = |key: &str| column[key].as_str().unwrap_or_default().to_owned();
        (text("taken_as"), text("unit"))
    }

    fn window_s(&self) -> f64 {
        self.facts["windows"][0]["window_s"].as_f64().unwrap()
    }

    /// What is scored of a node.
    fn score(&self, node: &str, figure: &str) -> f64 {
        let mut scores = self.scores["scores"].as_array().unwrap().iter();
        let score = scores.find(|score| score["node"] == node);
        score.unwrap_or_else(|| panic!("{node} in {}", self.scores))[figure]
            .as_f64()
            .unwrap()
    }

    /// The log of the stage that most of these are: 5 min, whose slopes have an RMS of 247.5 nm/min over all, 251 of those scored.
    #[track_caller]
    fn is_of_the_stage(&self) {
        assert_eq!(self.window_s(), 300.0, "{}", self.graph);
        let none = self.score("next/thermal", "baseline_zero");
        assert!((250.5..252.5).contains(&none), "{none}\n{}", self.graph);
        let r2 = self.score("next/thermal", "r2_zero");
        assert!((0.97..0.99).contains(&r2), "{r2}");
    }
}

/// Calls `init`, `check --strict`, `fit` and `evaluate` one after the other; all of them end well.
#[track_caller]
fn started(file: &str) -> Option<Started> {
    let log = case(file)?;
    let scratch = Scratch::new(&file.replace(['/', '.'], "-"));
    let (graph, model) = (scratch.path("graph.toml"), scratch.path("model.json"));
    let facts = athermal(&[&"init", &log, &"-o", &graph, &"--format", &"json"]).ended(0);
    athermal(&[&"check", &"--strict", &graph]).ended(0);
    let fit = athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let scores = athermal_on("evaluate", &model, &log, &[&"--format", &"json"]).ended(0);
    Some(Started {
        facts: facts.json(),
        graph: std::fs::read_to_string(&graph).unwrap(),
        fit,
        scores: scores.json(),
    })
}

/// A log that `init` refuses with these words.
#[track_caller]
fn refused(file: &str, words: &[&str]) {
    if let Some(log) = case(file) {
        let graph = Scratch::new(&file.replace(['/', '.'], "-")).path("graph.toml");
        let finished = athermal(&[&"init", &log, &"-o", &graph]).ended(2);
        let told: Vec<&str> = finished.told.split_whitespace().collect();
        let told = told.join(" ");
        for part in words {
            assert!(told.contains(part), "`{part}` is not in:\n{told}");
        }
    }
}

#[test]
fn a_column_that_counts_rows_neither_drifts_nor_explains() {
    let Some(with) = started("counter-column/logger.csv") else {
        return;
    };
    assert_eq!(with.column("No").0, "left_out");
    assert_eq!(with.column("Bridge_mV"), ("drifting".into(), "mV".into()));
    assert_eq!(with.window_s(), 300.0);
    let without = started("counter-column/without.csv").unwrap();
    for figure in ["baseline_zero", "r2_zero"] {
        let both = [&with, &without].map(|of| of.score("next/thermal", figure));
        assert_eq!(both[0], both[1], "{figure}");
    }
    assert!((2.67..2.69).contains(&with.score("next/thermal", "baseline_zero")));
    assert!((0.866..0.868).contains(&with.score("next/thermal", "r2_zero")));
}

#[test]
fn the_unit_of_a_time_is_that_of_its_name_or_of_its_size() {
    for (file, unit) in [
        ("time-units-in-names/reference.csv", ""),
        ("time-units-in-names/millis.csv", "unit = \"ms\""),
        ("time-units-in-names/minutes.csv", "unit = \"min\""),
        ("time-units-in-names/hours.csv", "unit = \"h\""),
        ("julian-dates/jd.csv", "unit = \"jd\""),
        ("julian-dates/mjd.csv", "unit = \"mjd\""),
    ] {
        let Some(started) = started(file) else {
            return;
        };
        started.is_of_the_stage();
        assert!(started.graph.contains(unit), "{file}");
    }
}

#[test]
fn elapsed_hours_go_beyond_a_day() {
    let Some(started) = started("elapsed-hours-beyond-a-day/elapsed.csv") else {
        return;
    };
    assert_eq!(started.window_s(), 300.0);
    assert!(started.graph.contains("unit = \"h:min:s\""));
    assert!(
        started.graph.contains("1,800 rows over 30 h"),
        "{}",
        started.graph
    );
}

#[test]
fn a_zone_beside_the_time_is_taken() {
    let Some(hobo) = started("a-zone-beside-the-time/hobo.csv") else {
        return;
    };
    hobo.is_of_the_stage();
    assert!(hobo.graph.contains("\nzone = \"-07:00\""), "{}", hobo.graph);
    assert!(
        !hobo.fit.told.contains("taken for UTC"),
        "{}",
        hobo.fit.told
    );
    let feed = started("a-zone-beside-the-time/feed.csv").unwrap();
    feed.is_of_the_stage();
    assert_eq!(feed.column("entry_id").0, "left_out");
    assert!(
        !feed.fit.told.contains("taken for UTC"),
        "{}",
        feed.fit.told
    );
}

#[test]
fn windows_that_do_not_fit_between_gaps_give_a_graph_of_levels() {
    let Some(nights) = started("nights-of-a-telescope/focus.csv") else {
        return;
    };
    assert!(
        nights.facts["remarks"]
            .to_string()
            .contains("no window fits")
    );
    // numpy.polyfit: residual 19.69 steps, R² 0.920 against the mean.
    let rmse = nights.score("level", "rmse");
    assert!((19.6..19.8).contains(&rmse), "{rmse}");
    let r2 = nights.score("level", "r2_mean");
    assert!((0.919..0.921).contains(&r2), "{r2}");
}

#[test]
fn a_value_a_day_has_windows_of_days_and_months() {
    let Some(short) = started("one-value-a-day/daily-140.csv") else {
        return;
    };
    let days = short.window_s() / 86_400.0;
    assert!((4.0..=5.0).contains(&days), "{days}");
    let long = started("one-value-a-day/daily.csv").unwrap();
    let widths = long.facts["windows"][0]["widths"].as_array().unwrap();
    let month = widths.iter().find(|of| of["window_s"] == 30.0 * 86_400.0);
    let ratio = month.unwrap()["ratio"].as_f64().unwrap();
    assert!((8.5..9.5).contains(&ratio), "{ratio}");
    assert!(long.score("next/thermal", "r2_zero") > 0.8);
}

#[test]
fn rows_may_lack_their_last_cells() {
    let Some(logger) = started("rows-without-trailing-cells/logger.csv") else {
        return;
    };
    logger.is_of_the_stage();
    assert_eq!(logger.column("No").0, "left_out");
    assert!(!logger.graph.contains("lenient"), "{}", logger.graph);
    logger.fit.tells(&["600 × row without its last cells"]);
    let padded = started("rows-without-trailing-cells/padded.csv").unwrap();
    for figure in ["rmse", "r2_zero"] {
        let both = [&logger, &padded].map(|of| of.score("next/thermal", figure));
        assert_eq!(both[0], both[1], "{figure}");
    }
}

#[test]
fn a_name_that_stands_twice_is_read_by_its_number_and_refused_without() {
    let Some(two) = started("two-columns-of-one-name/two.csv") else {
        return;
    };
    two.is_of_the_stage();
    for name in ["Temp, °C[1]", "Temp, °C[2]"] {
        assert_eq!(two.column(name).0, "temperature");
    }
    let folder = "two-columns-of-one-name";
    let [graph, unused] =
        ["graph.toml", "unused.csv"].map(|file| case(&format!("{folder}/{file}")).unwrap());
    let scratch = Scratch::new("names-twice");
    let model = scratch.path("m.json");
    athermal_on("fit", &graph, &unused, &[&"-o", &model]).ended(0);
    let reads = std::fs::read_to_string(&graph).unwrap();
    let reads = reads
        .replace("{channel}_degC", "Status")
        .replace("\"bed\"", "\"status\"");
    let graph = scratch.file("status.toml", reads);
    let refused = athermal_on("fit", &graph, &unused, &[&"-o", &model]).ended(2);
    refused
        .tells(&["the name `Status` stands at columns 4 and 5; write `Status[1]` or `Status[2]`"]);
}

#[test]
fn rows_of_units_and_marks_below_the_names_are_no_data() {
    let Some(toa5) = started("toa5/table.dat") else {
        return;
    };
    assert_eq!(toa5.window_s(), 300.0);
    assert_eq!(toa5.column("RECORD").0, "left_out");
    assert_eq!(
        toa5.column("Spindle_Avg"),
        ("temperature".into(), "Cel".into())
    );
    assert_eq!(toa5.column("Z_LVDT"), ("drifting".into(), "um".into()));
    assert!(!toa5.graph.contains("lenient"), "{}", toa5.graph);
    let graphtec = started("a-sign-apart-and-a-second-row-of-names/logger.csv").unwrap();
    assert_eq!(graphtec.window_s(), 300.0);
    assert_eq!(graphtec.column("CH1"), ("temperature".into(), "Cel".into()));
    assert_eq!(graphtec.column("CH3"), ("drifting".into(), "um".into()));
    assert_eq!(graphtec.column("Number").0, "left_out");
    assert!(!graphtec.graph.contains("lenient"), "{}", graphtec.graph);
}

#[test]
fn decimal_commas_in_quotes_are_no_thousands() {
    let Some(sheet) = started("decimal-commas-in-quotes/sheet.csv") else {
        return;
    };
    sheet.is_of_the_stage();
    assert!(sheet.graph.contains("decimal = \",\""), "{}", sheet.graph);
}

#[test]
fn a_serial_number_in_a_name_is_no_unit() {
    let Some(rh) = started("serial-number-for-a-unit/rh.csv") else {
        return;
    };
    rh.is_of_the_stage();
    assert!(!rh.fit.told.contains("A069"), "{}", rh.fit.told);
}

#[test]
fn a_name_states_units_that_are_not_of_machines() {
    for (file, column, taken_as, unit) in [
        ("afm", "Y [Å]", "drifting", "Å"),
        ("tilt", "INC [deg]", "drifting", "deg"),
        ("kelvin", "T (Kelvin)", "temperature", "K"),
        ("ambient", "press", "input", "1"),
        ("ambient", "Ambient RH%", "input", "%"),
        ("ambient", "Cell_V", "drifting", "V"),
    ] {
        let Some(of) = started(&format!("units-that-names-state/{file}.csv")) else {
            return;
        };
        assert_eq!(of.column(column), (taken_as.into(), unit.into()), "{file}");
        assert_eq!(of.window_s(), 300.0);
    }
}

#[test]
fn commas_in_a_note_part_no_cells_that_tabs_part() {
    let Some(classic) = started("tabs-and-commas-in-a-note/classic.txt") else {
        return;
    };
    classic.is_of_the_stage();
    assert!(classic.graph.contains("separator = \"\\t\""));
    assert!(
        classic.facts["remarks"]
            .to_string()
            .contains("with a note behind them")
    );
}

#[test]
fn a_measurement_file_of_labview_is_read_below_its_headers() {
    let Some(stage) = started("labview-measurement-file/stage.lvm") else {
        return;
    };
    stage.is_of_the_stage();
    assert!(!stage.fit.told.contains("warning"), "{}", stage.fit.told);
}

#[test]
fn what_is_packed_is_read_and_what_is_no_table_is_named() {
    let Some(packed) = started("what-is-no-table/log.csv.gz") else {
        return;
    };
    packed.is_of_the_stage();
    refused(
        "what-is-no-table/log.json",
        &["a JSON array begins here", "jq -c '.[]'"],
    );
    refused(
        "what-is-no-table/columns-of-spaces.txt",
        &["parted by spaces", "commas"],
    );
    refused(
        "what-is-no-table/no-names.csv",
        &["first line holds numbers", "no names"],
    );
    let scratch = Scratch::new("no-tables");
    for (name, bytes, words) in [
        (
            "log.parquet",
            &b"PAR1\x15\x04\x15"[..],
            // A program that reads Parquet says what is wrong with this file.
            match cfg!(feature = "parquet") {
                true => "a file of Parquet that was not ended",
                false => "is Parquet, which is not read",
            },
        ),
        (
            "log.csv.zst",
            &[0x28, 0xb5, 0x2f, 0xfd, 4],
            "is compressed with zstd",
        ),
    ] {
        let log = scratch.file(name, bytes);
        let finished = athermal(&[&"init", &log, &"-o", &scratch.path("g.toml")]);
        assert_ne!(finished.status, 0);
        finished.tells(&[words]);
    }
}

#[test]
fn a_long_layout_is_read_one_entity_after_the_other() {
    let folder = "long-format-one-entity-after-the-other";
    for (file, name, value) in [
        ("history", "entity_id", "state"),
        ("annotated", "_field", "_value"),
    ] {
        let Some(long) = started(&format!("{folder}/{file}.csv")) else {
            return;
        };
        for (key, column) in [("layout", "long"), ("name", name), ("value", value)] {
            let line = format!("{key} = \"{column}\"");
            assert!(long.graph.contains(&line), "{}", long.graph);
        }
        assert_eq!(long.window_s(), 300.0);
        let r2 = long.score("next/thermal", "r2_zero");
        assert!((0.97..0.99).contains(&r2), "{r2}");
    }
}

#[test]
fn a_second_table_with_other_columns_is_named() {
    refused(
        "long-format-one-entity-after-the-other/two-tables.csv",
        &["at line 729 another table begins, with the columns", "z_um"],
    );
}

#[test]
fn a_time_beside_each_channel_is_refused_with_a_way_out() {
    refused(
        "a-time-beside-each-channel/scope.csv",
        &[
            "each column has a time of its own",
            "export it with one time for all columns",
        ],
    );
}
