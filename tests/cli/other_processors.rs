//! The same model on a processor without fused multiplication: glibc then computes `exp`, `ln` and `pow` by another way, and what runs
//! may not depend on it. A journal is replayed on the engineer's own machine.

use std::fmt::Write;
use std::process::Command;

use crate::workbench::{Scratch, athermal};

/// Nodes that compute exponentials, logarithms and powers at ticks.
const GRAPH: &str = r#"
schema = 1
name = "other-processors"
time.column = "time_s"
signals.x = { unit = "K", channels = ["wanders", "apart"], max_age = "1s" }
signals.y = { unit = "nm", channels = ["y"], max_age = "1s" }

[nodes.masses]
type = "first_order"
inputs.signal = "x"
time_constants = ["7s", "1min"]

[nodes.plain]
type = "linear"
inputs = { features = "x", truth = "y.y" }
ahead = "0s"

[nodes.level]
type = "kalman"
inputs = { features = "x", truth = "y.y" }
ahead = "0s"
noises = { observation = "0.1 nm", level = "0.3 nm", per = "1min", returns = "47s" }

[nodes.steady]
type = "hedge"
inputs = { voters = ["plain", "level"], truth = "y.y" }

[nodes.recent]
type = "hedge"
inputs = { voters = ["plain", "level"], truth = "y.y" }
half_life = "37s"

[nodes.weighted]
type = "auto_weighted"
inputs = { voters = ["plain", "level"], truth = "y.y" }
memory = { half_life = "37s" }
power = 3

[outputs]
masses = "masses"
level = "level"
steady = "steady"
recent = "recent"
weighted = "weighted"
"#;

fn rows() -> String {
    let mut text = "time_s,wanders,apart,y\n".to_owned();
    for second in 0..600 {
        let t = f64::from(second);
        let (wanders, apart) = ((0.11 * t).sin() + (0.37 * t).cos(), (0.23 * t).sin());
        let y = 3.0 * wanders - apart + 0.3 * (0.017 * t * t).sin();
        writeln!(text, "{t},{wanders},{apart},{y}").unwrap();
    }
    text
}

#[test]
fn what_runs_gives_the_same_bits_on_a_processor_without_fused_multiplication() {
    let scratch = Scratch::new("other-processors");
    let graph = scratch.file("graph.toml", GRAPH);
    let log = scratch.file("log.csv", rows());
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &log, &"-o", &model]).ended(0);
    let run = |tunables: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_athermal"));
        let output = command
            .env("GLIBC_TUNABLES", tunables)
            .args(["--quiet", "run"])
            .args([model.as_os_str(), "--input".as_ref(), log.as_os_str()])
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let (here, there) = (run(""), run("glibc.cpu.hwcaps=-FMA,-AVX2"));
    assert_eq!(here.lines().count(), 601);
    for (here, there) in here.lines().zip(there.lines()) {
        assert_eq!(here, there);
    }
    // Each column has values that are no round numbers, and they change.
    let columns = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let (one, other) = (here.lines().nth(300), here.lines().nth(500));
    for (one, other) in columns(one.unwrap()).iter().zip(columns(other.unwrap())) {
        assert!(!one.is_empty() && *one != other);
    }
}
