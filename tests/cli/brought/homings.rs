//! Positions that are never zeroed: recorded and simulated ones, of which none is taken for one that is.

use std::path::Path;

use athermal::Model;
use athermal::diagnosis::watch::{FaultWatch, Purpose};
use athermal::files::{Dataset, Options};
use athermal::run::recording::Table;

use crate::workbench::{Scratch, data, graph, simulated};

#[test]
fn no_recorded_or_simulated_position_is_taken_for_one_that_is_zeroed() {
    let scratch = Scratch::new("homings");
    let mut logs = Vec::new();
    for (of, files) in [
        ("die-tester", &["train.csv", "test.csv"][..]),
        ("linear-axis", &["train.csv", "test.csv"]),
        (
            "z-probe",
            &[
                "GX-H12A-covered.csv",
                "GX-H12A.csv",
                "N3F-H4NB.csv",
                "TL-Q5MC2-Z.csv",
                "superpinda-covered.csv",
                "superpinda.csv",
            ],
        ),
    ] {
        let folder = data().map(|data| data.join(of));
        let files = folder
            .iter()
            .flat_map(|folder| files.iter().map(|file| folder.join(file)));
        logs.extend(files.map(|file| (of, file)));
    }
    for (machine, seeds) in [("die-tester", [1, 2]), ("linear-axis", [3, 4])] {
        for seed in seeds {
            let name = format!("{machine}-{seed}.csv");
            logs.push((machine, simulated(&scratch, &name, machine, 2.0, seed)));
        }
    }
    for (of, log) in &logs {
        let leaping = leaping(of, log);
        assert!(leaping.is_empty(), "{}: {leaping:?}", log.display());
    }
    // One of these whose X is zeroed every six hours is.
    let text = std::fs::read_to_string(&logs[logs.len() - 1].1).unwrap();
    let (mut zeroed, mut zero, mut homed) = (String::new(), 0.0, 0);
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let (Ok(at), Ok(x)) = (cells[0].parse::<f64>(), cells[5].parse::<f64>()) {
            if (at / 21_600.0) as u32 > homed {
                (zero, homed) = (x, homed + 1);
            }
            cells[5] = (x - zero).to_string();
        }
        zeroed += &(cells.join(",") + "\n");
    }
    let found = leaping("linear-axis", &scratch.file("zeroed.csv", zeroed));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].starts_with("position.X leaps"), "{found:?}");
}

/// The positions of a log that leap, as `fit` finds them.
fn leaping(of: &str, log: &Path) -> Vec<String> {
    let model = Model::load(graph(of)).unwrap();
    let dataset = Dataset::new(vec![log.to_path_buf()], Options::default());
    let watch = FaultWatch::new(&dataset, Purpose::Fit);
    let table = Table::read(&watch, &model.plan).unwrap();
    assert!(table.events().len() > 500, "{}", log.display());
    let found = watch.found().into_iter().filter(|of| of.of_truth);
    let leaping = found.filter_map(|of| Some(format!("{} {}", of.channel, of.leaps?)));
    leaping.collect()
}
