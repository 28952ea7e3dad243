//! A simulated machine under the correction of a graph, and what is left of its drift. Decides what must hold at every tick.

use std::path::Path;

use athermal::core::registry::find;
use athermal::run::fit::{FitOptions, fit};
use athermal::trial::machine::{
    ClosedLoop, KnownMachine, Machine, Row, SECOND_NS, Schedule, Setup, Simulated, Simulation,
};
use athermal::{Engine, Model};

/// The number in `why` of a correction without a valid prediction.
const INVALID: f64 = 1.0;

/// A machine and the graph that corrects it.
pub struct Looped {
    pub machine: &'static dyn Machine,
    pub axes: Vec<&'static str>,
    pub model: Model,
    /// What the graph allows itself.
    pub range_nm: f64,
    pub slew_nm_per_s: f64,
}

impl Looped {
    /// Fits a graph on three days of a machine.
    pub fn new(name: &str, graph: &Path, range_nm: f64, slew_nm_per_s: f64) -> Self {
        let machine = find::<KnownMachine>(name).unwrap().machine;
        let mut model = Model::load(graph).unwrap();
        let setup = Setup {
            days: 3.0,
            seed: 1,
            ..Setup::default()
        };
        let recording = Simulated::new(machine, setup);
        model.fitted = fit(&model.plan, &recording, &FitOptions::default(), &mut |_| {})
            .unwrap()
            .0;
        let channels = machine.channels().iter();
        Self {
            machine,
            axes: channels.filter(|c| c.is_axis()).map(|c| c.name).collect(),
            model,
            range_nm,
            slew_nm_per_s,
        }
    }

    pub fn started(
        &self,
        days: f64,
        seed: u64,
        schedule: Option<&Schedule>,
        fault: Option<&str>,
    ) -> ClosedLoop {
        let setup = Setup {
            days,
            seed,
            schedule: schedule.cloned(),
            ..Setup::default()
        };
        let faults = fault.iter().flat_map(|faults| faults.split(' '));
        let faults = faults.map(|fault| fault.parse().unwrap()).collect();
        let simulation = Simulated::new(self.machine, setup.clone())
            .with_faults(faults)
            .start()
            .unwrap();
        let engine = self.model.engine().unwrap();
        ClosedLoop::new(self.machine, &setup, simulation, engine).unwrap()
    }

    /// A day under correction, with sensor faults as the command line takes them, one after the other.
    pub fn run(&self, schedule: Option<&Schedule>, seed: u64, fault: Option<&str>) -> Run {
        let mut simulation = self.started(1.0, seed, schedule, fault);
        let channels = self.machine.channels();
        let temperatures = channels.len() - self.axes.len();
        let mut row = Row::empty(channels);
        let mut run = Run::default();
        let mut before = vec![0.0; self.axes.len()];
        while simulation.next(&mut row) {
            let time_s = row.time_ns as f64 / SECOND_NS as f64;
            for (axis, name) in self.axes.iter().enumerate() {
                let asked = simulation.asked()[axis];
                let step = (asked - before[axis]).abs();
                assert!(
                    asked.abs() <= self.range_nm,
                    "{fault:?}: {asked} nm on {name}"
                );
                assert!(
                    step <= self.slew_nm_per_s * 10.0 + 1e-6,
                    "{fault:?}: a step of {step} nm on {name}"
                );
                run.largest_step = run.largest_step.max(step);
                if output(simulation.engine(), &format!("why.{name}")) == INVALID {
                    run.invalid += usize::from(time_s > 7200.0);
                    assert!(
                        step == 0.0,
                        "{fault:?}: {name} moved by {step} nm without a prediction at {time_s} s"
                    );
                }
                before[axis] = asked;
            }
            let positions = &row.values[temperatures..];
            if positions.iter().any(|position| !position.is_nan()) {
                run.aligned.push((time_s, positions.to_vec()));
            }
            if !row.true_drift[0].is_nan() {
                run.true_drift.push((time_s, row.true_drift.clone()));
            }
        }
        run
    }
}

/// What an output of the graph is.
pub fn output(engine: &Engine, name: &str) -> f64 {
    let outputs = &engine.plan().outputs;
    let place = outputs.iter().position(|output| output.name == name);
    engine.outputs()[place.unwrap()]
}

/// A run under correction.
#[derive(Default)]
pub struct Run {
    /// Instants in s and positions of each alignment.
    pub aligned: Vec<(f64, Vec<f64>)>,
    /// Ticks of all axes without a valid prediction, once the windows are full.
    pub invalid: usize,
    pub largest_step: f64,
    pub true_drift: Vec<(f64, Vec<f64>)>,
}

impl Run {
    /// Root mean square in nm/min of the drift over five minutes that an axis still has between two instants in h.
    pub fn left(&self, axis: usize, from_h: f64, to_h: f64) -> f64 {
        let inside = |time_s: f64| (from_h * 3600.0..to_h * 3600.0).contains(&time_s);
        let mut squares = Vec::new();
        for (nth, (time_s, _)) in self.aligned.iter().enumerate() {
            if !inside(*time_s) {
                continue;
            }
            let window: Vec<(f64, f64)> = self.aligned[nth.saturating_sub(5)..=nth]
                .iter()
                .filter(|(t, p)| *t > time_s - 300.0 && !p[axis].is_nan())
                .map(|(t, p)| (t / 60.0, p[axis]))
                .collect();
            if window.len() < 3 {
                continue;
            }
            let count = window.len() as f64;
            let mean = window
                .iter()
                .fold((0.0, 0.0), |m, w| (m.0 + w.0 / count, m.1 + w.1 / count));
            let above: f64 = window.iter().map(|w| (w.0 - mean.0) * (w.1 - mean.1)).sum();
            let below: f64 = window.iter().map(|w| (w.0 - mean.0).powi(2)).sum();
            squares.push((above / below).powi(2));
        }
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    pub fn true_rms(&self, axis: usize, from_h: f64, to_h: f64) -> f64 {
        let inside = |time_s: f64| (from_h * 3600.0..to_h * 3600.0).contains(&time_s);
        let squares: Vec<f64> = self
            .true_drift
            .iter()
            .filter(|d| inside(d.0))
            .map(|d| d.1[axis].powi(2))
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }
}
