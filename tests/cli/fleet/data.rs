//! How the files of machines are read, and what is reported of that.

use super::*;

#[test]
fn what_was_left_out_while_reading_is_reported_by_machine_and_a_fit_of_all_says_how_many_they_are()
{
    let fleet = Fleet::new("fleet-doubts", &["a", "b"]);
    let text = fs::read_to_string(fleet.log("a")).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    lines.insert(500, lines[499]);
    lines.insert(900, "not a time,,,,,,,,,,,,");
    fs::write(fleet.log("a"), lines.join("\n") + "\n").unwrap();
    let again = "row whose time is that of the row before, left out";
    let table = fleet.fit(&["--lenient"]).ended(0).out;
    for words in [again, "unreadable row, left out"] {
        assert!(table.contains(words), "{table}");
    }
    let manifest = fleet.manifest();
    let of = |machine: &str| manifest["machines"][machine]["doubts"].clone();
    assert!(of("b").is_null(), "{}", of("b"));
    let found = of("a");
    let counts = ["time_unreadable", "time_again"].map(|fault| {
        let mut all = found.as_array().unwrap().iter();
        all.find(|of| of["fault"] == fault).unwrap()["count"].as_u64()
    });
    assert_eq!(counts, [Some(1), Some(1)]);
    let evaluate = |more: &str| {
        athermal(&[
            &"fleet",
            &"evaluate",
            &fleet.models,
            &"--lenient",
            &"--data",
            &fleet.pattern,
            &"--format",
            &more,
        ])
        .ended(0)
    };
    let table = evaluate("table").out;
    assert!(table.contains(again), "{table}");
    let scored = evaluate("json").json();
    let of_a = scored["machines"]
        .as_array()
        .unwrap()
        .iter()
        .find(|of| of["machine"] == "a");
    assert!(of_a.unwrap()["doubts"].to_string().contains("time_again"));
    let page = fleet.scratch.path("fleet.html");
    athermal(&[&"fleet", &"report", &fleet.models, &"-o", &page]).ended(0);
    assert!(fs::read_to_string(page).unwrap().contains(again));
    // One fit of a whole lake.
    let (lake, model) = (fleet.scratch.path("logs"), fleet.scratch.path("all.json"));
    athermal(&[
        &"fit",
        &fleet.graph,
        &"--lenient",
        &"--segments",
        &"--data",
        &lake,
        &"-o",
        &model,
    ])
    .ended(0)
    .tells(&[
        "the data are of 2 machines",
        "`athermal fleet fit` fits each",
    ]);
}

#[test]
fn an_offset_is_that_of_each_machine_and_one_of_no_file_is_refused() {
    let fleet = Fleet::new("fleet-offsets", &["a", "b"]);
    fleet
        .fit(&["--offset", "nowhere.csv=1s"])
        .ended(2)
        .tells(&["--offset nowhere.csv: this is none of the files"]);
    fleet.fit(&[]).ended(0);
    let rows = |machine: &str| fleet.manifest()["machines"][machine]["rows"]["hash"].clone();
    let before = [rows("a"), rows("b")];
    let log = fleet.log("a");
    let name = log.file_name().unwrap().to_str().unwrap();
    fleet.fit(&["--offset", &format!("{name}=5s")]).ended(0);
    assert_ne!(rows("a"), before[0]);
}
