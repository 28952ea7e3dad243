//! The weights of votes against tables made with other libraries, and intervals against a plain implementation; `generate.py` in
//! each folder under `tests/oracles` says how.

use std::path::Path;

use athermal_combiners::{AutoWeighted, Conformal, Fading, Hedge, LastTruths, Memory, Weighting};
use athermal_core::node::{Combiner, Votes};
use athermal_core::time::{Duration, Instant};

/// The rows of a table; an empty cell is NaN.
fn table(file: &str) -> Vec<Vec<f64>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/oracles");
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    let number = |cell: &str| match cell {
        "" => f64::NAN,
        cell => cell.parse().unwrap(),
    };
    let row = |line: &str| line.split(',').map(number).collect();
    text.lines().skip(1).map(row).collect()
}

/// Follows the rows of the input and compares the weights before each truth with columns of a table.
fn compare(parameters: &dyn Combiner, file: &str, column: usize, tolerance: f64) {
    let expected = table(&format!("votes/{file}"));
    let mut running = parameters.build(3);
    let mut compared = 0;
    for (row, values) in table("votes/input.csv").iter().enumerate() {
        let arrived = Instant::from_ns((values[0] * 1e9) as i64);
        let votes = Votes(&values[2..]);
        running.advance(arrived);
        if let Some(expected) = expected.iter().find(|line| line[0] == row as f64) {
            let mut weights = [f64::NAN; 3];
            running.weights(votes, &mut weights);
            for (found, expected) in weights.iter().zip(&expected[column..]) {
                assert!(
                    (found - expected).abs() <= tolerance,
                    "{file}, row {row}: {weights:?} for {expected}"
                );
            }
            let vote: f64 = weights.iter().zip(votes.0).map(|(w, v)| w * v).sum();
            let found = running.combine(votes);
            assert!((found - vote).abs() <= 1e-11, "{found} for {vote}");
            compared += 1;
        }
        running.observe(votes, values[1], arrived);
    }
    assert_eq!(compared, expected.len());
    assert!(compared > 250);
}

fn vote(memory: Memory, shrinkage: f64, floor: f64) -> AutoWeighted {
    AutoWeighted {
        memory,
        power: None,
        weights: Weighting::InversePower,
        shrinkage,
        floor,
    }
}

/// The columns of the tables of memories: plain weights, shrunk, raised to a floor, both.
fn compare_memory(memory: Memory, file: &str, tolerance: f64) {
    compare(&vote(memory, 0.0, 0.0), file, 1, tolerance);
    compare(&vote(memory, 0.3, 0.0), file, 4, tolerance);
    compare(&vote(memory, 0.0, 0.15), file, 7, tolerance);
    compare(&vote(memory, 0.3, 0.2), file, 10, tolerance);
}

#[test]
fn oracle_of_a_memory_of_so_many_truths() {
    let memory = Memory::Truths(LastTruths { truths: 12 });
    compare_memory(memory, "truths.csv", 1e-10);
}

#[test]
fn oracle_of_a_memory_that_fades() {
    let half_life = Duration::from_ns(600_000_000_000);
    let memory = Memory::HalfLife(Fading { half_life });
    compare_memory(memory, "half_life.csv", 1e-10);
}

fn hedge(rate: Option<f64>) -> Hedge {
    Hedge {
        rate,
        half_life: None,
        floor: 0.0,
    }
}

#[test]
fn oracle_of_exponential_weights_at_a_stated_rate() {
    compare(&hedge(Some(0.8)), "hedge.csv", 1, 1e-11);
}

#[test]
fn oracle_of_exponential_weights_that_find_their_rate() {
    compare(&hedge(None), "hedge.csv", 4, 1e-9);
}

#[test]
fn oracle_of_intervals_that_allow_for_what_they_missed() {
    let memory = Duration::from_ns(60_000_000_000);
    let mut node = Conformal {
        coverage: 0.9,
        memory,
        gain: 0.2,
    }
    .build(1);
    let (mut compared, mut covered) = (0.0, 0.0);
    for (second, cells) in (0..).zip(table("conformal/expected.csv")) {
        let [prediction, truth, lower, upper] = cells[..] else {
            panic!("four cells")
        };
        let now = Instant::from_ns(second * 1_000_000_000);
        node.advance(now);
        let (found, extent) = (node.interval(Votes(&[prediction])), node.extent());
        assert_eq!(found[0].is_nan(), lower.is_nan(), "row {second}");
        if !lower.is_nan() {
            assert!((found[0] - lower).abs() < 1e-12 && (found[1] - upper).abs() < 1e-12);
            compared += 1.0;
            covered += f64::from(u8::from(found[0] <= truth && truth <= found[1]));
        }
        node.judge(found, extent, truth);
        node.observe(Votes(&[prediction]), truth, now);
    }
    assert!(compared > 900.0);
    // Gibbs and Candès 2021, proposition 4.1, where every set is as the source has it.
    let bound = (0.9 + 0.2) / (0.2 * compared);
    assert!((covered / compared - 0.9_f64).abs() <= bound);
}
