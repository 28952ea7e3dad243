//! When a sensor falls silent or freezes, and when it is back. Reported as soon as it is clear.

use super::super::Feed;
use super::{Finding, Monitor, places, silence, standstill};
use crate::compile::origins::{health_reasons, of_truths};
use crate::compile::{Plan, SourceChannel};
use crate::engine::SampleRange;
use crate::time::Instant;

/// A sensor is silent for so long, in s, before that is reported.
const SILENT_S: f64 = 600.0;
/// The same for what a truth is made of, which a machine measures when it can, and for a sensor that has not had a sample yet.
const RARE_S: f64 = 3600.0;
/// Within so long, in s of the data, a channel is not reported again.
const AGAIN_S: f64 = 3600.0;

/// Watches the sensors of a graph.
#[derive(Debug)]
pub struct SensorMonitor {
    /// In the order of a row's values; none of what the graph does not read.
    sensors: Vec<Option<Sensor>>,
}

impl SensorMonitor {
    /// Watches the channels of a plan, whose values come first in a row.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let sensors = Sensor::of(plan).map(Some).collect();
        Self { sensors }
    }

    /// Those that have been reported and go on failing.
    pub fn faults(&self) -> impl Iterator<Item = (&str, SensorFault)> {
        let sensors = self.sensors.iter().flatten();
        sensors.filter_map(|of| Some((&*of.source.name, of.fault?)))
    }
}

impl Monitor for SensorMonitor {
    fn row(&mut self, now: Instant, values: &[f64], found: &mut Vec<Finding>) {
        let at_s = now.as_ns() as f64 / 1e9;
        let mut any = false;
        for (sensor, &value) in self.sensors.iter_mut().zip(values) {
            if let Some(sensor) = sensor {
                any |= sensor.row(at_s, value);
            }
        }
        if any {
            let change = |sensor: &Sensor| {
                let (fault, is_over) = sensor.change?;
                Some(SensorChange {
                    channel: sensor.source.name.clone(),
                    of_truth: sensor.of_truth,
                    fault,
                    is_over,
                })
            };
            let sensors = self.sensors.iter().flatten();
            found.push(Finding::Sensors(sensors.filter_map(change).collect()));
        }
    }

    fn segment(&mut self) {
        let sensors = self.sensors.iter_mut().flatten();
        sensors.for_each(Sensor::interrupt);
    }

    fn follow(&mut self, plan: &Plan, feed: &[Feed], _: &[SampleRange], _: &mut Vec<Finding>) {
        let mut before = std::mem::take(&mut self.sensors);
        before.resize_with(feed.len(), || None);
        self.sensors.resize_with(feed.len(), || None);
        for (new, place) in Sensor::of(plan).zip(places(plan, feed)) {
            if let Some(place) = place {
                self.sensors[place] = Some(new.after(before[place].take()));
            }
        }
    }
}

/// What is wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SensorFault {
    /// It has no samples since this time, in s.
    Silent {
        /// When the first sample was missing.
        from_s: f64,
    },
    /// It gives the same value again and again.
    Stuck(standstill::Standstill),
}

/// What happened to a sensor at a row.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorChange {
    /// The channel: `temperature.plate1`.
    pub channel: String,
    /// Whether a truth is made of it.
    pub of_truth: bool,
    /// What is wrong, or was.
    pub fault: SensorFault,
    /// Whether it is in order again.
    pub is_over: bool,
}

#[derive(Debug)]
struct Sensor {
    source: SourceChannel,
    of_truth: bool,
    silent: silence::Finder,
    /// None where a node takes out what is stuck.
    stuck: Option<standstill::Finder>,
    /// The fault that has been reported and goes on.
    fault: Option<SensorFault>,
    /// When one was last reported.
    reported_s: Option<f64>,
    /// The fault that begins at this row, or is over.
    change: Option<(SensorFault, bool)>,
}

impl Sensor {
    fn of(plan: &Plan) -> impl Iterator<Item = Self> + '_ {
        let watched = health_reasons(plan);
        let channels = plan.sources.iter().zip(of_truths(plan)).enumerate();
        let sensor = move |(slot, (source, of_truth)): (usize, (&SourceChannel, bool))| Self {
            source: source.clone(),
            of_truth,
            silent: silence::Finder::default(),
            stuck: (!watched.contains_key(&slot)).then(Default::default),
            fault: None,
            reported_s: None,
            change: None,
        };
        channels.map(sensor)
    }

    /// The same of a graph that has taken over, after what the one before knew of the channel.
    fn after(self, before: Option<Self>) -> Self {
        let Some(before) = before else {
            return self;
        };
        // What is stuck is not reported where a node takes it out from here on.
        let reports_stuck = self.stuck.is_some();
        let goes_on =
            |fault: &SensorFault| reports_stuck || !matches!(fault, SensorFault::Stuck(_));
        Self {
            stuck: self.stuck.map(|new| before.stuck.unwrap_or(new)),
            fault: before.fault.filter(goes_on),
            silent: before.silent,
            reported_s: before.reported_s,
            ..self
        }
    }

    /// Takes the sample of a row, if it is one; whether something changed.
    fn row(&mut self, at_s: f64, value: f64) -> bool {
        if self.source.rests() {
            return false;
        }
        let is_sample = self.source.admits(value);
        let is_over = is_sample
            && match self.fault {
                Some(SensorFault::Silent { .. }) => true,
                Some(SensorFault::Stuck(stuck)) => stuck.value != value,
                None => false,
            };
        self.change = self.fault.take_if(|_| is_over).map(|of| (of, true));
        self.push(at_s, value, is_sample);
        let may_report = |last_s: f64| at_s - last_s >= AGAIN_S || at_s < last_s;
        if self.fault.is_none() && self.reported_s.is_none_or(may_report) {
            self.fault = self.fails();
            if let Some(fault) = self.fault {
                self.reported_s = Some(at_s);
                self.change = Some((fault, false));
            }
        }
        self.change.is_some()
    }

    fn push(&mut self, at_s: f64, value: f64, is_sample: bool) {
        if is_sample && self.silent.goes_on(self.least_s()).is_some() {
            self.silent.forget();
        }
        self.silent.push(at_s, is_sample);
        if let Some(stuck) = self.stuck.as_mut().filter(|_| is_sample) {
            if stuck.goes_on().is_some_and(|now| now.value != value) {
                stuck.forget();
            }
            stuck.push(at_s, value);
        }
    }

    /// The fault that goes on now.
    fn fails(&self) -> Option<SensorFault> {
        // A position that was never measured is none that is missing.
        let counts = self.silent.had_samples() || !self.of_truth;
        let silent = self.silent.goes_on(self.least_s()).filter(|_| counts);
        let silent = silent.map(|silent| SensorFault::Silent {
            from_s: silent.from_s,
        });
        let stuck = || self.stuck.as_ref()?.goes_on().map(SensorFault::Stuck);
        silent.or_else(stuck)
    }

    fn least_s(&self) -> f64 {
        if self.of_truth || !self.silent.had_samples() {
            RARE_S
        } else {
            SILENT_S
        }
    }

    /// What follows is not set against what was.
    fn interrupt(&mut self) {
        self.silent.interrupt();
        if let Some(stuck) = &mut self.stuck {
            if stuck.goes_on().is_some() {
                stuck.forget();
            }
            stuck.interrupt();
        }
    }
}
