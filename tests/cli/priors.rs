//! A prior in a graph: it is read with the graph, becomes a part of its models, and what is wrong with it is reported where it stands.

use std::sync::Arc;

use crate::workbench::{Folder, compiled, graph};
use athermal::core::registry::find;
use athermal::run::fit::{FitOptions, fit};
use athermal::trial::machine::{Individual, KnownMachine, Setup, Simulated};
use athermal_estimators::Pooling;

/// A prior of five machines, six hours of each.
fn prior() -> String {
    let tester = find::<KnownMachine>("die-tester").unwrap().machine;
    let text = std::fs::read_to_string(graph("die-tester-fleet")).unwrap();
    let text = text.replace(
        "extends = \"die-tester.toml\"",
        &format!("extends = '{}'", graph("die-tester").display()),
    );
    let plan = Arc::new(compiled(&text).unwrap_or_else(|problems| panic!("{problems}")));
    let mut pooling = Pooling::new(5, "2h".parse().unwrap());
    for seed in 1..=5 {
        let individual = Individual {
            spread: "30%".parse().unwrap(),
            seed,
        };
        let setup = Setup {
            days: 0.25,
            seed,
            individual,
            ..Setup::default()
        };
        let watch = pooling.watched(&plan).unwrap();
        let recording = Simulated::new(tester, setup);
        fit(&watch.plan, &recording, &FitOptions::default(), &mut |_| {}).unwrap();
        pooling.add(&seed.to_string(), watch);
    }
    serde_json::to_string(&pooling.finish().0).unwrap()
}

fn new_machine(more: &str) -> String {
    format!(
        "schema = 1\nextends = '{}'\nname = \"new\"\n{more}\n[nodes.expansion.solver]\nprior = \"type.json\"\n",
        graph("die-tester-fleet").display()
    )
}

fn ran(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String) {
    let output = folder.run(arguments);
    let texts = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    (output.status.code(), texts.concat())
}

#[test]
fn a_fit_towards_a_prior_needs_its_file_once_and_its_model_holds_it() {
    let folder = Folder::new("prior");
    let write = |name: &str, text: &str| std::fs::write(folder.0.join(name), text).unwrap();
    let prior = prior();
    write("type.json", &prior);
    write("new.toml", &new_machine(""));
    let simulate = "simulate die-tester -o hours.csv --days 0.0834 --spread 30% --machine-seed 50";
    let simulate: Vec<&str> = simulate.split(' ').collect();
    let (status, text) = ran(&folder, &simulate);
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains("machine 50 of spread 30%"), "{text}");
    let fit = |graph: &str, model: &str| {
        let (status, text) = ran(
            &folder,
            &[
                "fit",
                graph,
                "--data",
                "hours.csv",
                "-o",
                model,
                "--format",
                "json",
            ],
        );
        assert_eq!(status, Some(0), "{text}");
        let model = std::fs::read_to_string(folder.0.join(model)).unwrap();
        serde_json::from_str::<serde_json::Value>(&model).unwrap()
    };
    let model = fit("new.toml", "model.json");
    let held = &model["graph"]["nodes"]["expansion"]["solver"]["prior"];
    let whole: serde_json::Value = serde_json::from_str(&prior).unwrap();
    assert_eq!(*held, whole);
    let report = &model["card"]["estimators"][0];
    assert!(
        report
            .to_string()
            .contains("towards the prior of 5 machines"),
        "{report}"
    );
    // All of its regressors are the prior's, so that how far they are from the fleet's is known.
    assert!(model["fitted"]["expansion.Z1"]["novelty"].is_object());
    assert!(model["fitted"]["expansion.Z1"]["variance"].is_object());
    std::fs::remove_file(folder.0.join("type.json")).unwrap();
    let again = fit("model.json", "again.json");
    assert_eq!(again["fitted"], model["fitted"]);
    assert_eq!(again["graph"], model["graph"]);
    // One that counts less gives another fit.
    write("type.json", &prior);
    write(
        "weak.toml",
        &format!("{}prior_weight = 1e-3\n", new_machine("")),
    );
    assert_ne!(fit("weak.toml", "weak.json")["fitted"], model["fitted"]);
}

#[test]
fn a_fleet_that_is_pooled_gives_the_prior_that_new_machines_are_fitted_towards() {
    let folder = Folder::new("pooled");
    for seed in ["1", "2", "3", "4", "5"] {
        let of_machine = folder.0.join(format!("logs/machine=m{seed}"));
        std::fs::create_dir_all(&of_machine).unwrap();
        let log = format!("logs/machine=m{seed}/log.csv");
        let simulate = format!(
            "simulate die-tester -o {log} --days 0.25 --spread 30% --machine-seed {seed} --seed {seed}"
        );
        let simulate: Vec<&str> = simulate.split(' ').collect();
        assert_eq!(ran(&folder, &simulate).0, Some(0));
    }
    // One more, whose positions are in µm under a name that says nm.
    std::fs::create_dir_all(folder.0.join("logs/machine=um")).unwrap();
    let log = std::fs::read_to_string(folder.0.join("logs/machine=m5/log.csv")).unwrap();
    let (header, rows) = log.split_once('\n').unwrap();
    let in_um = rows.lines().map(|row| {
        let cells = row
            .split(',')
            .enumerate()
            .map(|(nth, cell)| match cell.parse::<f64>() {
                Ok(nm) if nth > 6 => format!("{}", nm / 1000.0),
                _ => cell.to_owned(),
            });
        cells.collect::<Vec<_>>().join(",") + "\n"
    });
    let in_um = format!("{header}\n{}", in_um.collect::<String>());
    std::fs::write(folder.0.join("logs/machine=um/log.csv"), in_um).unwrap();
    let graph = graph("die-tester-fleet").display().to_string();
    let pool = |data: &str| {
        let pool = [
            "fleet",
            "fit",
            &graph,
            "--data",
            data,
            "--pooled",
            "-o",
            "type.json",
        ];
        ran(&folder, &pool)
    };
    let (status, text) = pool("logs/machine=m1/*.csv");
    assert_ne!(status, Some(0), "{text}");
    assert!(!folder.0.join("type.json").exists());
    let (status, text) = pool("logs/machine=*/*.csv");
    assert_eq!(status, Some(1), "{text}");
    for word in [
        "um failed: position.",
        "is it in another unit? The machine is left out",
    ] {
        assert!(text.contains(word), "{text}");
    }
    let file = std::fs::read_to_string(folder.0.join("type.json")).unwrap();
    let of = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
    let (found, expected) = (of(&file), of(&prior()));
    for axis in ["X1", "Y1", "Z1", "X2", "Y2", "Z2"] {
        let of =
            |prior: &serde_json::Value| prior["estimators"][format!("expansion.{axis}")].clone();
        let (found, expected) = (of(&found), of(&expected));
        assert_eq!(found["machines"], 5);
        // The same recordings, by way of files.
        assert_eq!(found, expected, "{axis}");
    }
}

#[test]
fn what_is_wrong_with_a_prior_is_reported_at_its_place() {
    let folder = Folder::new("wrong-prior");
    let write = |name: &str, text: &str| std::fs::write(folder.0.join(name), text).unwrap();
    let prior = prior();
    let check = |more: &str, prior: Option<&str>| {
        let _ = std::fs::remove_file(folder.0.join("type.json"));
        if let Some(text) = prior {
            write("type.json", text);
        }
        write("new.toml", &new_machine(more));
        ran(&folder, &["check", "new.toml"])
    };
    assert_eq!(check("", Some(&prior)).0, Some(0));
    let changed = |from: &str, to: &str| {
        assert!(prior.contains(from), "{from}");
        prior.replace(from, to)
    };
    let cases = [
        ("", None, "cannot read \"type.json\": there is no such file"),
        (
            "",
            Some("mean,1\n".to_owned()),
            "cannot use \"type.json\": no JSON",
        ),
        (
            "",
            Some(changed("expansion.", "thermal.")),
            "it has nothing for node `expansion`; it has thermal.X1",
        ),
        (
            "",
            Some(changed("expansion.Z2", "expansion.Z3")),
            "the prior has nothing for `expansion.Z2`",
        ),
        (
            "",
            Some(changed("\"nm/min\"", "\"mK/min\"")),
            "the prior of `expansion.X1` predicts in mK/min, and the node in nm/min",
        ),
        (
            "",
            Some(changed("\"unit\":\"mK/min\"", "\"unit\":\"nm\"")),
            "has `gradients.plate1@150s` in nm, and the node in mK/min",
        ),
        (
            "",
            Some(changed("gradients.", "slopes.")),
            "knows none of the node's regressors: it has `slopes.plate1@150s`",
        ),
        (
            "nodes.expansion.ahead = \"0s\"",
            Some(prior.clone()),
            "predicts 5min ahead, and the node 0s",
        ),
        (
            "",
            Some(changed("\"athermal_prior\":1", "\"athermal_prior\":2")),
            "the prior has format 2, and this version reads 1",
        ),
        (
            "",
            Some(changed("\"covariance\":[", "\"covariance\":[-")),
            "has a covariance that is not positive definite",
        ),
    ];
    for (more, prior, expected) in cases {
        let (status, text) = check(more, prior.as_deref());
        let joined = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(status, Some(2), "{text}");
        assert!(joined.contains(expected), "{expected} is not in:\n{text}");
        assert!(joined.contains("prior = \"type.json\""), "{text}");
    }
}
