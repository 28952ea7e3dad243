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

/// The beginning of a graph of one position and two temperatures, as samples; nodes and outputs follow.
const SAMPLES: &str = r#"
schema = 1
[time]
column = "t"
[signals.temperature]
unit = "Cel"
channels = ["room", "chuck"]
range = ["-20 Cel", "200 Cel"]
max_age = "1min"
[signals.position]
unit = "nm"
channels = ["Z"]
max_age = "3min"
"#;

/// The slopes of both signals, as the shipped graphs have them, for after [`SAMPLES`].
const SLOPES: &str = r#"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
unit = "nm/min"
[nodes.gradients]
type = "slope"
inputs.signal = "temperature"
windows = ["150s"]
unit = "mK/min"
"#;
