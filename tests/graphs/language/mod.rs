//! The rules of the graph language that bear on what a graph computes, each with tests that fail when the rule is broken:
//! truth and horizon, lags, ages, cold windows, segments, samples, delays, fitting. Decides nothing about how mistakes in a
//! file are told, beyond leaks and loops.

mod ages;
mod combiners;
mod delays;
mod embargo;
mod encoders;
mod fitting;
mod kinds;
mod lags;
mod parameters;
mod samples;
mod segments;
mod stacking;
mod windows;

use crate::workbench::Graph;

/// The beginning of a graph of one position and two temperatures, as samples; nodes and outputs follow.
fn samples() -> Graph {
    Graph::new()
        .time("t")
        .signal("temperature", "Cel", "room chuck", "1min")
        .with("range = ['-20 Cel', '200 Cel']")
        .signal("position", "nm", "Z", "3min")
}

/// The same with the slopes of both signals, as the shipped graphs have them.
fn slopes() -> Graph {
    samples()
        .slope("drift", "position", "5min", "nm/min")
        .slope("gradients", "temperature", "150s", "mK/min")
}
