//! `--from` and `--to`: a stretch of time of data is as good as a file that has no other rows.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::workbench::{Finished, Scratch, athermal, athermal_on, graph, simulated};

/// The graph and what was fitted, as a model has them.
pub fn learned(model: &Path) -> String {
    let text = std::fs::read_to_string(model).unwrap();
    let from = text.find("\"graph\":").unwrap();
    text[from..].to_owned()
}

fn card(model: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(model).unwrap();
    serde_json::from_str::<serde_json::Value>(&text).unwrap()["card"].clone()
}

/// Two days of a machine, and the rows from 30,000 s to before 150,000 s alone.
fn logs(scratch: &Scratch) -> (PathBuf, PathBuf) {
    let whole = simulated(scratch, "whole.csv", "linear-axis", 2.0, 1);
    let text = std::fs::read_to_string(&whole).unwrap();
    let (header, lines) = text.split_once('\n').unwrap();
    let time = |line: &str| line.split(',').next().unwrap().parse::<f64>().unwrap();
    let cut = lines
        .lines()
        .filter(|line| (30_000.0..150_000.0).contains(&time(line)));
    let cut: Vec<&str> = cut.collect();
    assert!(cut.iter().any(|line| time(line) == 30_000.0));
    let cut = scratch.file("cut.csv", format!("{header}\n{}\n", cut.join("\n")));
    (whole, cut)
}

const STRETCH: [&str; 4] = ["--from", "30000", "--to", "150000"];

fn on(command: &str, of: &Path, data: &Path, more: &[&str]) -> Finished {
    let more: Vec<&dyn AsRef<OsStr>> = more.iter().map(|word| word as _).collect();
    athermal_on(command, of, data, &more)
}

#[test]
fn a_fit_and_all_that_is_read_of_a_stretch_of_time_is_that_of_a_file_that_was_cut_by_hand() {
    let scratch = Scratch::new("stretches");
    let ((whole, cut), graph) = (logs(&scratch), graph("linear-axis"));
    let [one, other] = ["one", "other"].map(|name| scratch.path(&format!("{name}.json")));
    let fit = |data: &Path, model: &Path, more: &[&str]| {
        let more = [&["-o", model.to_str().unwrap()], more].concat();
        on("fit", &graph, data, &more).ended(0)
    };
    let said = fit(&whole, &one, &STRETCH);
    fit(&cut, &other, &[]);
    assert!(learned(&one) == learned(&other));
    // The next command is about what comes after that stretch.
    assert!(said.told.contains("--from 150000"), "{}", said.told);
    assert!(!said.told.contains("--to"), "{}", said.told);
    for command in ["evaluate", "diagnose"] {
        let words = ["--format", "json"];
        let of_stretch = on(command, &one, &whole, &[&STRETCH[..], &words].concat());
        let of_cut = on(command, &one, &cut, &words);
        let rest = |of: &Finished| {
            let mut facts = of.json();
            facts.as_object_mut().unwrap().remove("data");
            facts
        };
        assert_eq!(of_stretch.status, of_cut.status, "{}", of_stretch.told);
        assert_eq!(rest(&of_stretch), rest(&of_cut), "{command}");
    }
    let page = |data: &Path, more: &[&str]| {
        let path = scratch.path("page.html");
        let more = [more, &["-o", path.to_str().unwrap()]].concat();
        on("report", &one, data, &more).ended(0);
        std::fs::read_to_string(&path).unwrap()
    };
    let of_cut = page(&cut, &[]).replace("cut.csv", "whole.csv");
    assert!(page(&whole, &STRETCH) == of_cut);
    let scores = |data: &Path, more: &[&str]| {
        let scored = ["--on", cut.to_str().unwrap(), "--format", "json"];
        let compared = on("compare", &graph, data, &[more, &scored].concat());
        compared.ended(0).json()["comparisons"].clone()
    };
    assert_eq!(scores(&whole, &STRETCH), scores(&cut, &[]));
}

#[test]
fn the_card_of_a_model_has_the_rows_that_were_taken_and_their_times_and_what_is_fitted_anew_takes_them()
 {
    let scratch = Scratch::new("stretch-card");
    let ((whole, cut), graph) = (logs(&scratch), graph("linear-axis"));
    let model = scratch.path("model.json");
    let fit = |data: &Path, more: &[&str]| {
        let more = [&["-o", model.to_str().unwrap()], more].concat();
        on("fit", &graph, data, &more).ended(0);
        card(&model)["data"].clone()
    };
    let of_stretch = fit(&whole, &STRETCH);
    let of_cut = fit(&cut, &[]);
    let of_all = fit(&cut, &["--from", "0"]);
    assert_eq!(of_stretch.as_array().unwrap().len(), 1);
    let (taken, all) = (&of_stretch[0], &of_all[0]);
    assert_eq!(taken["rows"], of_cut[0]["rows"]);
    assert_eq!(
        (&taken["from"], &taken["to"]),
        (&"30000".into(), &"150000".into())
    );
    assert_eq!(taken["path"], whole.to_str().unwrap());
    // The checksum is of the rows: from whichever file they come.
    assert_eq!(
        (&taken["hash"], &taken["bytes"]),
        (&all["hash"], &all["bytes"])
    );
    assert!(taken["hash"] != of_cut[0]["hash"] && of_cut[0]["from"].is_null());
    // Scores on the other rows of the file are no scores of the fit; those on all of it are in part.
    fit(&whole, &["--to", "80000"]);
    let scored = |more: &[&str]| on("evaluate", &model, &whole, more).told;
    let rest = scored(&["--from", "80000"]);
    assert!(!rest.contains("how well it fits"), "{rest}");
    let all = scored(&[]);
    assert!(
        all.contains("how well it fits") && all.contains("from 0 s to 799"),
        "{all}"
    );
}

#[test]
fn of_logs_that_are_merged_each_has_a_card_or_where_one_cannot_be_read_alone_all_rows_have() {
    let scratch = Scratch::new("stretch-merged");
    let ((whole, _), graph) = (logs(&scratch), graph("linear-axis"));
    let text = std::fs::read_to_string(&whole).unwrap();
    let split = |name: &str, time: &str, is_wanted: &dyn Fn(&str) -> bool| {
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        let wanted: Vec<usize> = (1..header.len())
            .filter(|&of| is_wanted(header[of]))
            .collect();
        let some = |first: String, cells: &[&str]| {
            let cells = wanted.iter().map(|&of| cells[of]);
            format!("{first},{}\n", cells.collect::<Vec<_>>().join(","))
        };
        let mut all = some(time.to_owned(), &header);
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let at = cells[0].parse::<f64>().unwrap() + 1.7e9;
            all += &some(at.to_string(), &cells);
        }
        scratch.file(name, all)
    };
    let is_temperature = |name: &str| name.ends_with("degC");
    let temperatures = split("temperatures.csv", "time_s", &is_temperature);
    let model = scratch.path("model.json");
    let fit = |others: &Path| {
        let more: [&dyn AsRef<OsStr>; 7] = [
            &others,
            &"--from",
            &"1700030000",
            &"--to",
            &"1700150000",
            &"-o",
            &model,
        ];
        athermal_on("fit", &graph, &temperatures, &more).ended(0);
        (learned(&model), card(&model)["data"].clone())
    };
    let (of_both, cards) = fit(&split("others.csv", "time_s", &|name| {
        !is_temperature(name)
    }));
    let paths: Vec<_> = cards
        .as_array()
        .unwrap()
        .iter()
        .map(|of| &of["path"])
        .collect();
    assert!(
        paths.len() == 2 && paths.iter().all(|of| of.is_string()),
        "{cards}"
    );
    assert_eq!(cards[0]["rows"], cards[1]["rows"]);
    let (of_own_time, all) = fit(&split("timed.csv", "stamp_s", &|name| {
        !is_temperature(name)
    }));
    assert!(of_own_time == of_both);
    assert_eq!(all.as_array().unwrap().len(), 1, "{all}");
    assert_eq!(
        (&all[0]["rows"], all[0].get("path")),
        (&cards[0]["rows"], None)
    );
}

#[test]
fn a_stretch_that_cannot_be_taken_is_refused_with_what_to_do() {
    let scratch = Scratch::new("stretch-refused");
    let ((whole, _), graph) = (logs(&scratch), graph("linear-axis"));
    let model = scratch.path("model.json");
    let fit = |more: &[&str]| {
        let more = [&["-o", model.to_str().unwrap()], more].concat();
        on("fit", &graph, &whole, &more).ended(2)
    };
    fit(&["--from", "yesterday"]).tells(&["--from yesterday", "2026-03-01T06:00:00Z", "`time_s`"]);
    fit(&["--from", "300", "--to", "200"]).tells(&["--from 300 --to 200", "earlier `--from`"]);
    fit(&["--from", "2026-03-01"]).tells(&[
        "--from 2026-03-01",
        "no row",
        "whole.csv",
        "from `0` to `172",
    ]);
    fit(&["--to", "-5"]).tells(&["--to -5", "no row"]);
    let blocks = scratch.path("blocks");
    let kept = ["--blocks", "day", "--keep-blocks", blocks.to_str().unwrap()];
    fit(&[&kept[..], &["--to", "5"]].concat()).tells(&["--keep-blocks", "--to"]);
    assert!(!model.exists() && !blocks.exists());
}

#[test]
fn of_a_fleet_a_stretch_of_time_is_fitted_and_scored_and_another_is_fitted_anew() {
    let scratch = Scratch::new("stretch-fleet");
    let ((whole, cut), graph) = (logs(&scratch), graph("linear-axis"));
    for (of, data) in [("whole", &whole), ("cut", &cut)] {
        let folder = scratch.path(&format!("{of}/machine=m"));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::copy(data, folder.join("log.csv")).unwrap();
    }
    let fleet = |words: &[&str], of: &str, models: &str, more: &[&str]| {
        let data = format!("{}/machine=*/*.csv", scratch.path(of).display());
        let models = scratch.path(models);
        let mut all: Vec<&dyn AsRef<OsStr>> = vec![&"fleet", &words[0]];
        match words[0] {
            "fit" => all.extend([&graph as &dyn AsRef<OsStr>, &"-o", &models]),
            _ => all.push(&models),
        }
        all.extend(
            [&"--date" as &dyn AsRef<OsStr>, &"2026-01-01T00:00:00Z"]
                .iter()
                .filter(|_| words[0] == "fit"),
        );
        all.extend([&"--data" as &dyn AsRef<OsStr>, &data]);
        all.extend(more.iter().map(|word| word as &dyn AsRef<OsStr>));
        athermal(&all)
    };
    let model = |folder: &str| learned(&scratch.path(&format!("{folder}/m.json")));
    fleet(&["fit"], "whole", "models", &[]).ended(0);
    let of_all = model("models");
    fleet(&["fit"], "whole", "models", &STRETCH).ended(0);
    fleet(&["fit"], "cut", "others", &[]).ended(0);
    assert!(model("models") != of_all && model("models") == model("others"));
    let scores = |of: &str, more: &[&str]| {
        let more = [more, &["--format", "json"]].concat();
        fleet(&["evaluate"], of, "models", &more).ended(0).json()
    };
    assert_eq!(scores("whole", &STRETCH), scores("cut", &[]));
    let wrong = fleet(&["fit"], "whole", "models", &["--from", "yesterday"]);
    wrong.ended(2).tells(&["--from yesterday"]);
}
