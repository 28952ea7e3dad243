//! A loop of one's own around the engine, as a machine's controller would have it.
//!
//! One day of a spindle is logged, a graph is fitted on it and written as a model; the next day the controller reads the
//! model and steps it with every measurement. Nothing is needed for it but `cargo run --example embed`.

use std::error::Error;
use std::sync::Arc;

use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Table;
use athermal::{Instant, Model};

const GRAPH: &str = r#"
schema = 1
name = "spindle"

[signals.temperature]
unit = "Cel"
channels = ["spindle", "room"]
max_age = "1min"

[signals.position]
unit = "um"
channels = ["z"]
max_age = "3min"

[nodes.drift]                       # what happened over the last five minutes
type = "slope"
inputs.signal = "position"
windows = ["5min"]
unit = "nm/min"

[nodes.gradients]
type = "slope"
inputs.signal = "temperature"
windows = ["150s", "5min", "10min", "20min"]
unit = "mK/min"

[nodes.thermal]                     # what will happen over the next five
type = "linear"
inputs.features = "gradients"
inputs.truth = "drift"
ahead = "5min"

[outputs]
predicted = "thermal"
drift = "drift"
"#;

const STEP_S: i64 = 10;
const DAY: i64 = 86_400 / STEP_S;
const AHEAD: i64 = 300 / STEP_S;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::temp_dir().join("athermal-embed");
    std::fs::create_dir_all(&folder)?;
    let (graph, model) = (folder.join("spindle.toml"), folder.join("spindle.json"));

    std::fs::write(&graph, GRAPH)?;
    let mut fitting = Model::load(&graph)?;
    let mut log = Table::default();
    let mut spindle = Spindle::default();
    for _ in 0..DAY {
        let (time, samples) = spindle.measure();
        log.push(time, &samples);
    }
    let plan = Arc::clone(&fitting.plan);
    let (fitted, report) = fit(&plan, &log, &FitOptions::default(), &mut |_| ())?;
    if let Some((node, error)) = report.failed().next() {
        return Err(format!("{node} could not be fitted: {error}").into());
    }
    fitting.fitted = fitted;
    std::fs::write(&model, fitting.to_text()?)?;

    // From here on, all that a controller needs.
    let mut engine = Model::load(&model)?.engine()?;
    let mut forecast = None;
    println!("   time  predicted  measured 5 min later (nm/min)");
    for tick in 0..DAY {
        let (time, samples) = spindle.measure();
        // Samples are in the order of the plan's sources; outputs in that of its outputs; NaN is "no value".
        let &[predicted, drift] = engine.step(time, &samples)? else {
            return Err("the graph has two outputs".into());
        };
        if let Some((from, value)) = forecast
            && tick >= from + AHEAD
            && !drift.is_nan()
        {
            let minutes = from * STEP_S / 60;
            println!(
                "  {:02}:{:02}  {value:9.1}  {drift:8.1}",
                minutes / 60,
                minutes % 60
            );
            forecast = None;
        }
        if tick > 0 && tick % (DAY / 14) == 0 {
            forecast = Some((tick, predicted));
        }
    }
    Ok(())
}

/// A spindle that is warmed by its motor, and a column that follows it and grows.
#[derive(Default)]
struct Spindle {
    tick: i64,
    /// Kelvin above the mean of the room.
    spindle: f64,
    column: f64,
}

impl Spindle {
    /// Ten seconds later: the instant, and temperatures in Celsius and the position in micrometres, which is measured only
    /// every minute.
    fn measure(&mut self) -> (Instant, [f64; 3]) {
        let time_s = self.tick * STEP_S;
        let room = 0.6 * (time_s as f64 / 9_000.0).sin() + 0.3 * (time_s as f64 / 2_300.0).sin();
        let motor_on = time_s / 5_400 % 2 == 1;
        let motor = if motor_on { 9.0 } else { 0.0 };
        self.spindle += (room + motor - self.spindle) * STEP_S as f64 / 1_200.0;
        self.column += (self.spindle - self.column) * STEP_S as f64 / 900.0;
        let position = if self.tick % 6 == 0 {
            1.3 * self.column
        } else {
            f64::NAN
        };
        self.tick += 1;
        let time = Instant::from_ns(time_s * 1_000_000_000);
        (time, [21.0 + self.spindle, 21.0 + room, position])
    }
}
