//! A graph that corrects a simulated machine: what it sees, what it asks for, when that acts.

use super::planned::Announced;
use super::recording::unit_of;
use super::{Machine, MachineError, Row, Setup, Simulation, plans};
use crate::engine::Engine;
use crate::recording::{Event, Samples, Steps};
use crate::time::Instant;
use crate::unit::Unit;

/// A simulated machine under the correction of a graph.
///
/// At every row the graph sees what was measured and, as the signal `applied`, the correction that was in force while it
/// was. Its outputs `correction.AXIS` are then asked of the machine, which may clip them; what it applies acts until
/// the next row. An axis without such an output keeps its correction. A planned channel `set_point.chuck` is the set point of that name,
/// each step of the schedule announced as long before as it is known.
pub struct ClosedLoop {
    simulation: Box<dyn Simulation>,
    engine: Engine,
    /// For each measured channel of the graph: where it comes from, and the units on the way.
    feeds: Vec<Option<Feed>>,
    /// Which output asks for which axis, and how many nm its unit has.
    asks: Vec<(usize, usize, f64)>,
    announced: Vec<Announced>,
    samples: Samples,
    asked: Vec<f64>,
    /// In force while the last row was measured, and from then on.
    applied: Vec<f64>,
    next: Vec<f64>,
}

struct Feed {
    from: Origin,
    machine: Unit,
    graph: Unit,
}

enum Origin {
    Channel(usize),
    Applied(usize),
}

impl ClosedLoop {
    /// `simulation`, which is one of `machine` set up so, corrected by the graph of `engine`.
    ///
    /// # Errors
    /// A channel of the graph that the machine lacks, or a graph that asks for no correction of an axis.
    pub fn new(
        machine: &dyn Machine,
        setup: &Setup,
        simulation: Box<dyn Simulation>,
        engine: Engine,
    ) -> Result<Self, MachineError> {
        let channels = machine.channels();
        let axes: Vec<&str> = channels
            .iter()
            .filter(|channel| channel.is_axis())
            .map(|channel| channel.name)
            .collect();
        let nm = unit_of("nm")?;
        let plan = engine.plan();
        let (mut feeds, mut missing) = (Vec::new(), Vec::new());
        let mut announced = Vec::new();
        for (source, planned) in plan.sources.iter().zip(&plan.channels) {
            let of = (feeds.len(), source);
            announced.extend(Announced::of(machine, setup, of, &planned.channel.unit)?);
            if plans(machine, source) {
                feeds.push(None);
                continue;
            }
            let measured = channels
                .iter()
                .position(|channel| channel.reference() == source.name);
            let applied = source
                .name
                .strip_prefix("applied.")
                .and_then(|axis| axes.iter().position(|known| *known == axis));
            let (from, unit) = match (measured, applied) {
                (Some(nth), _) => (Origin::Channel(nth), unit_of(channels[nth].unit)?),
                (None, Some(nth)) => (Origin::Applied(nth), nm.clone()),
                (None, None) => {
                    if !source.optional {
                        missing.push(source.name.clone());
                    }
                    feeds.push(None);
                    continue;
                }
            };
            if !unit.measures_same(&planned.channel.unit) {
                return Err(MachineError::Unit {
                    channel: source.name.clone(),
                    machine: Box::new(unit),
                    graph: Box::new(planned.channel.unit.clone()),
                });
            }
            feeds.push(Some(Feed {
                from,
                machine: unit,
                graph: planned.channel.unit.clone(),
            }));
        }
        if !missing.is_empty() {
            return Err(MachineError::Missing {
                machine: machine.name(),
                missing,
                known: channels.iter().map(super::Channel::reference).collect(),
            });
        }
        let ask = |(output, planned): (usize, &crate::compile::PlannedOutput)| {
            let axis = planned.name.strip_prefix("correction.")?;
            let axis = axes.iter().position(|known| *known == axis)?;
            let factor = plan.channels[planned.slot].channel.unit.factor_to(&nm)?;
            Some((output, axis, factor))
        };
        let asks: Vec<_> = plan.outputs.iter().enumerate().filter_map(ask).collect();
        if asks.is_empty() {
            return Err(MachineError::NoCorrection {
                axes: axes.iter().map(ToString::to_string).collect(),
            });
        }
        Ok(Self {
            simulation,
            samples: Samples::default(),
            announced,
            feeds,
            asks,
            engine,
            asked: vec![f64::NAN; axes.len()],
            applied: vec![0.0; axes.len()],
            next: vec![0.0; axes.len()],
        })
    }

    /// The corrections in nm that were in force while the last row was measured, one per axis.
    #[must_use]
    pub fn applied(&self) -> &[f64] {
        &self.applied
    }

    /// What the graph asked for after the last row, in nm, one per axis.
    #[must_use]
    pub fn asked(&self) -> &[f64] {
        &self.asked
    }

    /// The graph at work.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        &self.engine
    }
}

impl Simulation for ClosedLoop {
    fn next(&mut self, row: &mut Row) -> bool {
        self.applied.copy_from_slice(&self.next);
        if !self.simulation.next(row) {
            return false;
        }
        let sample = |feed: &Option<Feed>| {
            let Some(feed) = feed else { return f64::NAN };
            let value = match feed.from {
                Origin::Channel(nth) => row.values[nth],
                Origin::Applied(nth) => self.applied[nth],
            };
            feed.machine.convert(value, &feed.graph).unwrap_or(f64::NAN)
        };
        self.samples.values.clear();
        self.samples.values.extend(self.feeds.iter().map(sample));
        for plan in &mut self.announced {
            plan.put(row.time_ns, &mut self.samples.values);
        }
        let event = Event::Row(Instant::from_ns(row.time_ns));
        // A row that the engine refuses leaves everything as it is, as on a machine.
        if let Ok(true) = self.engine.take(event, &self.samples) {
            for &(output, axis, factor) in &self.asks {
                self.asked[axis] = self.engine.outputs()[output] * factor;
            }
            self.simulation.correct(&self.asked, &mut self.next);
        }
        true
    }
}
