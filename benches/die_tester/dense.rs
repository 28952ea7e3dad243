//! The die tester with two sensors more, eight windows of each, and models that use all 64 slopes: the most that a tick may cost.

use athermal::Model;
use athermal::core::prng::Prng;

use super::{AXES, Tick};

const NOISE: f64 = 1e-3;

/// Ticks as of the die tester, with a frame that follows the chuck within minutes and a stage that follows the first plate.
pub fn ticks(days: f64, seed: u64) -> Vec<Tick> {
    let mut ticks = super::ticks(days, seed);
    let mut followers = [(5, 60.0, f64::NAN), (0, 200.0, f64::NAN)];
    let mut noise = Prng::stream(seed, "sensors that the die tester lacks");
    for (_, values) in &mut ticks {
        let first_position = values.len() - AXES;
        for (nth, (leader, samples, follower)) in followers.iter_mut().enumerate() {
            let leader = values[*leader];
            if follower.is_nan() {
                *follower = leader;
            } else if !leader.is_nan() {
                *follower += (leader - *follower) / *samples;
            }
            values.insert(first_position + nth, *follower + NOISE * noise.normal());
        }
    }
    ticks
}

/// The graph, fitted on a week.
pub fn model() -> Model {
    super::fitted(&text(""), &ticks(7.0, 1))
}

/// The same in which all estimators go on learning, by stochastic gradients.
pub fn learning() -> Model {
    super::fitted(
        &text("\nlearn = true\nsolver = { type = \"sgd\" }"),
        &ticks(7.0, 1),
    )
}

/// The graph, with more keys for each estimator.
fn text(of_estimators: &str) -> String {
    let windows = "windows = [\"150s\", \"250s\", \"350s\", \"450s\", \"600s\", \"750s\", \"1000s\", \"1350s\"]";
    let shipped = super::text();
    let lines = shipped
        .lines()
        .filter(|line| !line.starts_with("selection") && !line.starts_with("solver"))
        .map(|line| match line.split_once("harmonics") {
            Some(_) => windows.to_owned(),
            None if line.starts_with("train.abs_truth") => format!("{line}{of_estimators}"),
            None => line.replace("\"chuck\"]", "\"chuck\", \"frame\", \"stage\"]"),
        });
    lines.collect::<Vec<_>>().join("\n")
}
