//! The same model on a processor without fused multiplication: glibc then computes `exp`, `ln` and `pow` by another way, and what runs
//! may not depend on it. A journal is replayed on the engineer's own machine.

use std::fmt::Write;
use std::process::Command;

use crate::workbench::{Graph, Scratch, athermal};

/// Nodes that compute exponentials, logarithms and powers at ticks.
fn of_other_processors() -> Graph {
    Graph::named("other-processors")
        .time("time_s")
        .signal("x", "K", "wanders apart", "1s")
        .signal("y", "nm", "y", "1s")
        .node("masses", "first_order", "x")
        .with("time_constants = ['7s', '1min']")
        .model("plain", "linear", "x", "y.y", "0s")
        .model("level", "kalman", "x", "y.y", "0s")
        .with(
            "noises = { observation = '0.1 nm', level = '0.3 nm', per = '1min', returns = '47s' }",
        )
        .vote("steady", "hedge", "plain level", "y.y")
        .vote("recent", "hedge", "plain level", "y.y")
        .with("half_life = '37s'")
        .vote("weighted", "auto_weighted", "plain level", "y.y")
        .with("memory = { half_life = '37s' }; power = 3")
        .outputs("masses = 'masses'; level = 'level'; steady = 'steady'; recent = 'recent'")
        .with("weighted = 'weighted'")
}

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
    let graph = scratch.file("graph.toml", of_other_processors());
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
