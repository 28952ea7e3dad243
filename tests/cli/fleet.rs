//! A fleet: each machine is fitted by a process of its own as it would be by itself, and what fails or is killed takes no other with it.

mod data;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::workbench::{Finished, Graph, Scratch, athermal};

fn thermal() -> Graph {
    Graph::of_die_tester("fleet", "plate1 holder1 room")
}

/// A graph and machines, a folder with a log for each.
struct Fleet {
    scratch: Scratch,
    graph: PathBuf,
    pattern: String,
    models: PathBuf,
}

impl Fleet {
    fn new(test: &str, machines: &[&str]) -> Self {
        let scratch = Scratch::new(test);
        let graph = scratch.file("graph.toml", thermal());
        let fleet = Self {
            graph,
            pattern: scratch.path("logs/machine=*/*.csv").display().to_string(),
            models: scratch.path("models"),
            scratch,
        };
        for (nth, machine) in machines.iter().enumerate() {
            fleet.simulate(machine, nth + 1, &[]);
        }
        fleet
    }

    fn log(&self, machine: &str) -> PathBuf {
        self.scratch
            .path(&format!("logs/machine={machine}/log.csv"))
    }

    fn simulate(&self, machine: &str, seed: usize, more: &[&str]) {
        let (log, seed) = (self.log(machine), seed.to_string());
        fs::create_dir_all(log.parent().unwrap()).unwrap();
        let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"simulate", &"die-tester", &"--seed", &seed, &"-o", &log];
        if !more.contains(&"--days") {
            words.extend([&"--days" as &dyn AsRef<std::ffi::OsStr>, &"0.3"]);
        }
        words.extend(more.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
        athermal(&words).ended(0);
    }

    fn fit(&self, more: &[&str]) -> Finished {
        let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![
            &"fleet",
            &"fit",
            &self.graph,
            &"--data",
            &self.pattern,
            &"-o",
            &self.models,
            &"--jobs",
            &"2",
        ];
        words.extend(more.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
        athermal(&words)
    }

    fn counts(&self) -> [u64; 3] {
        let found = self.fit(&["--format", "json"]).json();
        ["fitted", "unchanged", "failed"].map(|key| found[key].as_u64().unwrap())
    }

    fn model(&self, machine: &str) -> String {
        fs::read_to_string(self.models.join(format!("{machine}.json"))).unwrap()
    }

    fn manifest(&self) -> Value {
        let text = fs::read_to_string(self.models.join("_fleet.json"));
        text.map_or(Value::Null, |text| serde_json::from_str(&text).unwrap())
    }
}

/// What stands behind the card of a model: graph and fit.
fn graph_and_fit(model: &str) -> &str {
    &model[model.find("\n  \"graph\"").unwrap()..]
}

#[test]
fn each_machine_of_a_fleet_has_the_bytes_of_a_fit_by_itself_and_is_fitted_once() {
    let fleet = Fleet::new("fleet-bytes", &["a", "b", "c"]);
    let first = fleet.fit(&[]).ended(0);
    first.tells(&["3 machines fitted, 0 unchanged, 0 failed"]);
    assert!(
        first.out.lines().next().unwrap().starts_with("machine"),
        "{}",
        first.out
    );
    for machine in ["a", "b", "c"] {
        let single = fleet.scratch.path("single.json");
        athermal(&[
            &"fit",
            &fleet.graph,
            &"--data",
            &fleet.log(machine),
            &"-o",
            &single,
        ])
        .ended(0);
        let (single, of_fleet) = (fs::read_to_string(&single).unwrap(), fleet.model(machine));
        assert_eq!(graph_and_fit(&single), graph_and_fit(&of_fleet));
        let card: Value = serde_json::from_str(&of_fleet).unwrap();
        let data = &card["card"]["data"][0];
        assert!(
            data["path"].is_null() && data["rows"].as_u64() > Some(1000),
            "{data}"
        );
        assert_eq!(
            data["hash"],
            fleet.manifest()["machines"][machine]["rows"]["hash"]
        );
    }
    assert_ne!(
        graph_and_fit(&fleet.model("a")),
        graph_and_fit(&fleet.model("b"))
    );
    assert_eq!(fleet.counts(), [0, 3, 0]);
    // The same rows in a file that is new, in two files, and other rows.
    let text = fs::read_to_string(fleet.log("b")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let (head, tail) = lines.split_at(lines.len() / 2);
    fs::write(fleet.log("b"), head.join("\n") + "\n").unwrap();
    fs::write(
        fleet.log("b").with_file_name("more.csv"),
        format!("{}\n{}\n", lines[0], tail.join("\n")),
    )
    .unwrap();
    assert_eq!(fleet.counts(), [0, 3, 0]);
    fs::remove_file(fleet.log("b").with_file_name("more.csv")).unwrap();
    assert_eq!(fleet.counts(), [1, 2, 0]);
    fs::write(
        &fleet.graph,
        thermal().replace(
            "windows = [\"5min\"]\nunit = \"mK/min\"",
            "windows = [\"6min\"]\nunit = \"mK/min\"",
        ),
    )
    .unwrap();
    assert_eq!(fleet.counts(), [3, 0, 0]);
}

#[test]
fn a_machine_that_fails_is_reported_and_stops_no_other() {
    let fleet = Fleet::new("fleet-fails", &["a", "b"]);
    let broken = fleet.log("broken");
    fs::create_dir_all(broken.parent().unwrap()).unwrap();
    fs::write(&broken, "time_s,plate1_degC\n0,1\n").unwrap();
    let done = fleet.fit(&[]).ended(1);
    done.tells(&[
        "broken failed: ",
        "holder1_degC",
        "2 machines fitted, 0 unchanged, 1 failed",
    ]);
    assert_eq!(fleet.manifest()["machines"]["broken"]["outcome"], "failed");
    assert!(fleet.models.join("a.json").is_file() && !fleet.models.join("broken.json").exists());
    // What failed is tried again.
    fleet.simulate("broken", 3, &[]);
    assert_eq!(fleet.counts(), [1, 2, 0]);
}

#[test]
fn files_of_no_machine_and_patterns_of_no_file_are_refused() {
    let fleet = Fleet::new("fleet-nameless", &["a"]);
    let fit = |data: &str, more: &str| {
        athermal(&[
            &"fleet",
            &"fit",
            &fleet.graph,
            &"--data",
            &data,
            &"-o",
            &fleet.models,
            &"--by",
            &more,
        ])
    };
    fit(&fleet.pattern, "unit").ended(2).tells(&[
        "which machine is it of?",
        "`unit=…`",
        "{machine}",
    ]);
    fit("nowhere/*.csv", "machine")
        .ended(2)
        .tells(&["nowhere/*.csv: no file is of that name"]);
    let named = fleet.pattern.replace("machine=*", "machine={machine}");
    fit(&named, "unit").ended(0);
    assert!(fleet.models.join("a.json").is_file());
}

#[test]
fn a_fleet_is_scored_reported_and_compared_and_the_sensor_that_is_off_is_found() {
    let machines = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let fleet = Fleet::new("fleet-compared", &machines);
    fleet.simulate("f", 6, &["--fault", "temperature.plate1=offset,size=20 K"]);
    fleet.fit(&[]).ended(0);
    let evaluated = athermal(&[
        &"fleet",
        &"evaluate",
        &fleet.models,
        &"--data",
        &fleet.pattern,
        &"--format",
        &"json",
    ]);
    let evaluated = evaluated.ended(0);
    evaluated.tells(&["fitted on these rows"]);
    let scores = evaluated.json();
    assert_eq!(scores["machines"].as_array().unwrap().len(), machines.len());
    let of_a = scores["machines"]
        .as_array()
        .unwrap()
        .iter()
        .find(|of| of["machine"] == "a")
        .unwrap();
    let model = fleet.models.join("a.json");
    let single = athermal(&[
        &"evaluate",
        &model,
        &"--data",
        &fleet.log("a"),
        &"--format",
        &"json",
    ])
    .ended(0)
    .json();
    assert_eq!(of_a["scores"][0]["rmse"], single["scores"][0]["rmse"]);
    assert_eq!(
        of_a["scores"][0]["no_model"],
        single["scores"][0]["baseline_zero"]
    );

    let plot = fleet.scratch.path("unlike.svg");
    let compared = athermal(&[&"fleet", &"compare", &fleet.models, &"--plot", &plot]).ended(1);
    let named: Vec<&str> = compared
        .out
        .lines()
        .filter(|line| line.len() == 1)
        .collect();
    assert_eq!(named, ["f"], "{}", compared.out);
    assert!(compared.out.contains("plate1"), "{}", compared.out);
    assert!(fs::read_to_string(plot).unwrap().starts_with("<svg"));

    let page = fleet.scratch.path("fleet.html");
    athermal(&[
        &"fleet",
        &"report",
        &fleet.models,
        &"--data",
        &fleet.pattern,
        &"-o",
        &page,
    ])
    .ended(0);
    let page = fs::read_to_string(page).unwrap();
    assert!(
        !page.contains("<script") && !page.contains("http-equiv"),
        "{page}"
    );
    for machine in machines {
        assert!(
            page.contains(&format!("<details id=\"m-{machine}\">")),
            "{machine}"
        );
    }
    assert!(
        page.contains("Unlike the others")
            && page.contains("response of thermal to gradients.plate1")
    );
}

#[test]
fn a_quiet_fit_that_ends_with_1_says_why() {
    let fleet = Fleet::new("fleet-quiet", &["a"]);
    let text = thermal().replace(
        "[outputs]",
        "[nodes.other]\ntype = \"ar\"\ninputs.truth = \"drift.Z1\"\nahead = \"5min\"\nlags = [\"12h\"]\n[outputs]\nother = \"other\"",
    );
    fs::write(&fleet.graph, text).unwrap();
    fleet
        .fit(&["-q"])
        .ended(1)
        .tells(&["a: other.Z1 is constant"]);
}

#[test]
fn of_few_machines_none_is_said_to_be_unlike_the_others() {
    let fleet = Fleet::new("fleet-few", &["a", "b"]);
    fleet.fit(&[]).ended(0);
    athermal(&[&"fleet", &"compare", &fleet.models])
        .ended(2)
        .tells(&["of fewer than 5 no spread is known"]);
    let nothing = fleet.scratch.path("logs");
    athermal(&[&"fleet", &"compare", &nothing])
        .ended(2)
        .tells(&["no model in this folder"]);
}

#[cfg(target_os = "linux")]
mod killed {
    use std::process::{Child, Command, Stdio};
    use std::time::Duration;

    use super::*;

    /// A fit of machines of which the log of one, `z`, is a pipe in which nothing comes: its worker waits for it.
    fn waiting(fleet: &Fleet) -> Child {
        let log = fleet.log("z");
        fs::create_dir_all(log.parent().unwrap()).unwrap();
        assert!(Command::new("mkfifo").arg(&log).status().unwrap().success());
        Command::new(env!("CARGO_BIN_EXE_athermal"))
            .args(["fleet", "fit"])
            .arg(&fleet.graph)
            .args(["--data", &fleet.pattern, "--jobs", "1", "-o"])
            .arg(&fleet.models)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    #[track_caller]
    fn until<T>(mut found: impl FnMut() -> Option<T>) -> T {
        for _ in 0..1500 {
            if let Some(found) = found() {
                return found;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("it does not come about");
    }

    /// The process that another has started.
    fn worker_of(parent: u32) -> Option<u32> {
        let of = |entry: fs::DirEntry| {
            let process: u32 = entry.file_name().to_str()?.parse().ok()?;
            let stat = fs::read_to_string(entry.path().join("stat")).ok()?;
            let behind_name: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
            (behind_name.get(1)? == &parent.to_string()).then_some(process)
        };
        fs::read_dir("/proc").unwrap().flatten().find_map(of)
    }

    /// Waits until the worker of `z` is at its log, which comes last.
    fn until_at_the_pipe(fleet: &Fleet, others: usize) {
        until(|| {
            let machines = fleet.manifest()["machines"]
                .as_object()
                .map_or(0, |of| of.len());
            (machines == others).then_some(())
        });
    }

    fn put_a_log_in_place(fleet: &Fleet) {
        let log = fleet.log("z");
        fleet.simulate("y", 9, &[]);
        fs::rename(fleet.log("y"), &log).unwrap();
        fs::remove_dir(fleet.log("y").parent().unwrap()).unwrap();
    }

    fn kill(process: u32) {
        let killed = Command::new("kill")
            .args(["-9", &process.to_string()])
            .status();
        assert!(killed.unwrap().success());
    }

    #[test]
    fn a_worker_that_is_killed_is_reported_and_its_machine_is_tried_once_more() {
        let fleet = Fleet::new("fleet-worker-killed", &["a", "b"]);
        let fit = waiting(&fleet);
        until_at_the_pipe(&fleet, 2);
        let worker = until(|| worker_of(fit.id()));
        put_a_log_in_place(&fleet);
        kill(worker);
        let done = fit.wait_with_output().unwrap();
        let said = String::from_utf8(done.stderr).unwrap();
        assert!(
            said.contains("z: its worker was killed by signal 9; it is tried once more"),
            "{said}"
        );
        assert!(done.status.success(), "{said}");
        assert!(
            said.contains("3 machines fitted, 0 unchanged, 0 failed"),
            "{said}"
        );
    }

    #[test]
    fn a_machine_whose_workers_are_killed_each_time_fails() {
        let fleet = Fleet::new("fleet-workers-killed", &["a"]);
        let fit = waiting(&fleet);
        until_at_the_pipe(&fleet, 1);
        let first = until(|| worker_of(fit.id()));
        kill(first);
        let second = until(|| worker_of(fit.id()).filter(|other| *other != first));
        kill(second);
        let done = fit.wait_with_output().unwrap();
        let said = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(1), "{said}");
        assert!(
            said.contains("z failed: its worker was killed by signal 9, 2 times"),
            "{said}"
        );
    }

    #[test]
    fn a_fit_that_is_killed_goes_on_where_it_was_with_the_same_date() {
        let fleet = Fleet::new("fleet-killed", &["a", "b"]);
        let mut fit = waiting(&fleet);
        until_at_the_pipe(&fleet, 2);
        let worker = until(|| worker_of(fit.id()));
        kill(fit.id());
        fit.wait().unwrap();
        let manifest = fleet.manifest();
        assert_eq!(manifest["finished"], false);
        let before = fleet.model("a");
        // Its worker waits still; it ends once there is something, and nobody reads its answer.
        drop(
            fs::File::options()
                .write(true)
                .open(fleet.log("z"))
                .unwrap(),
        );
        until(|| (!Path::new(&format!("/proc/{worker}")).exists()).then_some(()));
        put_a_log_in_place(&fleet);
        assert_eq!(fleet.counts(), [1, 2, 0]);
        assert_eq!(fleet.model("a"), before);
        let dates = ["a", "z"].map(|machine| {
            let model: Value = serde_json::from_str(&fleet.model(machine)).unwrap();
            model["card"]["created"].clone()
        });
        assert_eq!(dates[0], manifest["created"]);
        assert_eq!(dates[0], dates[1]);
        assert_eq!(fleet.manifest()["finished"], true);
    }
}

#[test]
fn a_fleet_on_kept_blocks_has_the_bytes_of_fits_on_blocks_of_the_rows() {
    let fleet = Fleet::new("fleet-blocks", &[]);
    for (nth, machine) in ["a", "b"].into_iter().enumerate() {
        fleet.simulate(machine, nth + 1, &["--days", "1.4"]);
    }
    let folder = fleet.scratch.path("blocks");
    let fit = |more: &[&str]| {
        let kept = ["--blocks", "day", "--keep-blocks", folder.to_str().unwrap()];
        fleet.fit(&[&kept, more].concat()).ended(0)
    };
    let alone = |machine: &str, blocks: &[&str]| {
        let (log, model) = (fleet.log(machine), fleet.scratch.path("single.json"));
        let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"fit", &fleet.graph, &"--data", &log, &"-o", &model];
        words.extend(
            blocks
                .iter()
                .map(|word| word as &dyn AsRef<std::ffi::OsStr>),
        );
        athermal(&words).ended(0);
        fs::read_to_string(model).unwrap()
    };
    let of_days = |machine: &str| {
        ["1970-01-01.json", "1970-01-02.json"]
            .map(|day| fs::metadata(folder.join(machine).join(day)).unwrap())
            .map(|of| of.modified().unwrap())
    };
    fit(&[]).tells(&["2 machines fitted"]);
    let made = ["a", "b"].map(of_days);
    fit(&[]).tells(&["0 machines fitted, 2 unchanged"]);
    // What is fitted to the rows of a day may change: the sums stay.
    for alpha in ["1.0", "3.0"] {
        let solver = format!("solver = {{ type = \"ridge\", alpha = {alpha} }}\n[outputs]");
        fs::write(&fleet.graph, thermal().replace("[outputs]", &solver)).unwrap();
        fit(&[]).tells(&["2 machines fitted"]);
        for machine in ["a", "b"] {
            let of_rows = alone(machine, &["--blocks", "day"]);
            assert_eq!(
                graph_and_fit(&of_rows),
                graph_and_fit(&fleet.model(machine))
            );
        }
    }
    assert_eq!(["a", "b"].map(of_days), made);
    // Beside a fit on the rows.
    let coefficients = |text: &str| -> Vec<f64> {
        let model: Value = serde_json::from_str(text).unwrap();
        let of = &model["fitted"]["thermal"];
        let all = of["coefficients"].as_array().unwrap().iter();
        all.chain([&of["intercept"]])
            .map(|of| of.as_f64().unwrap())
            .collect()
    };
    let (rows, blocks) = (
        coefficients(&alone("b", &[])),
        coefficients(&fleet.model("b")),
    );
    assert!(rows.len() == 4 && blocks.len() == 4);
    let size = rows.iter().fold(0.0_f64, |size, b| size.max(b.abs()));
    for (rows, blocks) in rows.iter().zip(&blocks) {
        assert!((rows - blocks).abs() <= 1e-9 * size, "{rows} {blocks}");
    }
    // The manifest knows how rows were cut, and rows that come are added.
    fleet.fit(&[]).ended(0).tells(&["2 machines fitted"]);
    let more = fleet.log("a").with_file_name("more.csv");
    let text = fs::read_to_string(fleet.log("a")).unwrap();
    let day = text.lines().skip(1).map(|row| {
        let (time, values) = row.split_once(',').unwrap();
        format!("{},{values}\n", time.parse::<f64>().unwrap() + 200_000.0)
    });
    let head = text.lines().next().unwrap();
    fs::write(more, format!("{head}\n{}", day.collect::<String>())).unwrap();
    fit(&[]).tells(&["2 machines fitted"]);
    assert_eq!(of_days("a")[0], made[0][0]);
    assert!(folder.join("a/1970-01-03.json").is_file());
    assert!(!folder.join("b/1970-01-03.json").exists());
}
