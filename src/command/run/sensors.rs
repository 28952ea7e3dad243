//! Decides when a sensor that falls silent or stands still is told of by a run: at once where rows may never end, and again when it is
//! back; else at the end. What such a fault is, is decided elsewhere.

use athermal::core::compile::{Plan, SourceChannel};
use athermal::core::engine::SampleRange;
use athermal::diagnosis::{health_reasons, of_truths, silence, standstill};
use athermal::run::live::Feed;
use athermal::run::recording::{Event, Samples, Source, SourceError};

use serde_json::json;

use super::rejected::Ranged;
use crate::command::faults::{self, Looks, Purpose, of_standstill, places};
use crate::command::model::few;
use crate::message::Message;
use crate::terminal::Terminal;
use athermal_analysis::figures::{count, instant, number, seconds, time};

/// So long, in s, a sensor is silent before that is told.
const SILENT_S: f64 = 600.0;
/// The same for what a truth is made of, which a machine measures when it can, and for a sensor that has not had a sample yet.
const RARE_S: f64 = 3600.0;
/// Not within so long, in s of the data, is a fault of the same channel told again.
const AGAIN_S: f64 = 3600.0;

/// Rows as they are read, while the sensors of a graph are watched.
pub struct Sensors<'a> {
    source: &'a mut Ranged<'a>,
    terminal: Terminal,
    told: Told,
}

enum Told {
    AtEnd(Looks),
    /// In the order of a row's values; none of what the graph does not read.
    AtOnce(Vec<Option<Sensor>>),
}

impl<'a> Sensors<'a> {
    /// Watches the channels of a plan, whose values come first in a row.
    pub fn new(
        terminal: &Terminal,
        source: &'a mut Ranged<'a>,
        plan: &Plan,
        at_once: bool,
    ) -> Self {
        Self {
            source,
            terminal: *terminal,
            told: if at_once {
                Told::AtOnce(Sensor::of(plan).map(Some).collect())
            } else {
                Told::AtEnd(Looks::at(plan))
            },
        }
    }

    /// Goes on with the graph that has taken over, which reads its channels among those of a feed. `usual` is where samples lay in
    /// its fit.
    pub fn follow(&mut self, plan: &Plan, feed: &[Feed], usual: &[SampleRange]) {
        self.source.follow(plan, feed, usual);
        match &mut self.told {
            Told::AtEnd(looks) => looks.follow(plan, feed),
            Told::AtOnce(sensors) => {
                let mut before = std::mem::take(sensors);
                before.resize_with(feed.len(), || None);
                sensors.resize_with(feed.len(), || None);
                for (new, place) in Sensor::of(plan).zip(places(plan, feed)) {
                    if let Some(place) = place {
                        sensors[place] = Some(new.after(before[place].take()));
                    }
                }
            }
        }
    }

    /// Tells what is told at the end.
    pub fn end(self) {
        if let Told::AtEnd(looks) = self.told {
            faults::warn(&self.terminal, &looks.found(Purpose::Run));
        }
    }
}

impl Source for Sensors<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let event = self.source.next(samples)?;
        match (&mut self.told, event) {
            (Told::AtEnd(looks), Some(Event::Row(now))) => looks.row(now, &samples.values),
            (Told::AtEnd(looks), Some(Event::Segment)) => looks.interrupt(),
            (Told::AtOnce(sensors), Some(Event::Row(now))) => {
                let at_s = seconds(now);
                let mut is_news = false;
                for (sensor, &value) in sensors.iter_mut().zip(&samples.values) {
                    if let Some(sensor) = sensor {
                        is_news |= sensor.row(at_s, value);
                    }
                }
                if is_news {
                    tell(&self.terminal, sensors.iter().flatten(), at_s);
                }
            }
            (Told::AtOnce(sensors), Some(Event::Segment)) => {
                sensors.iter_mut().flatten().for_each(Sensor::interrupt);
            }
            (_, None) => {}
        }
        Ok(event)
    }
}

/// What is wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Silent { from_s: f64 },
    Stuck(standstill::Standstill),
}

/// What there is to tell of a sensor at a row.
#[derive(Debug, Clone, Copy, PartialEq)]
enum News {
    Fails(Fault),
    IsBack(Fault),
}

/// A channel whose faults are told.
#[derive(Debug)]
struct Sensor {
    source: SourceChannel,
    of_truth: bool,
    silent: silence::Finder,
    /// None where a node takes out what is stuck.
    stuck: Option<standstill::Finder>,
    /// The fault that has been told and goes on.
    fault: Option<Fault>,
    /// When one was last told.
    told_s: Option<f64>,
    news: Option<News>,
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
            told_s: None,
            news: None,
        };
        channels.map(sensor)
    }

    /// The same of a graph that has taken over, after what the one before knew of the channel.
    fn after(self, before: Option<Self>) -> Self {
        let Some(before) = before else {
            return self;
        };
        // A node that takes out what is stuck from here on has nothing told of it.
        let tells_stuck = self.stuck.is_some();
        let is_told = |fault: &Fault| tells_stuck || !matches!(fault, Fault::Stuck(_));
        Self {
            stuck: self.stuck.map(|new| before.stuck.unwrap_or(new)),
            fault: before.fault.filter(is_told),
            silent: before.silent,
            told_s: before.told_s,
            ..self
        }
    }

    /// Takes the sample of a row, if it is one; whether there is something to tell then.
    fn row(&mut self, at_s: f64, value: f64) -> bool {
        if self.source.optional {
            return false;
        }
        let is_sample = self.source.admits(value);
        let is_over = is_sample
            && match self.fault {
                Some(Fault::Silent { .. }) => true,
                Some(Fault::Stuck(stuck)) => stuck.value != value,
                None => false,
            };
        self.news = self.fault.take_if(|_| is_over).map(News::IsBack);
        self.push(at_s, value, is_sample);
        let may_tell = |told_s: f64| at_s - told_s >= AGAIN_S || at_s < told_s;
        if self.fault.is_none() && self.told_s.is_none_or(may_tell) {
            self.fault = self.fails();
            if let Some(fault) = self.fault {
                self.told_s = Some(at_s);
                self.news = Some(News::Fails(fault));
            }
        }
        self.news.is_some()
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
    fn fails(&self) -> Option<Fault> {
        // A position that was never measured is none that is missing.
        let counts = self.silent.had_samples() || !self.of_truth;
        let silent = self.silent.goes_on(self.least_s()).filter(|_| counts);
        let silent = silent.map(|silent| Fault::Silent {
            from_s: silent.from_s,
        });
        let stuck = || self.stuck.as_ref()?.goes_on().map(Fault::Stuck);
        silent.or_else(stuck)
    }

    fn least_s(&self) -> f64 {
        if self.of_truth || !self.silent.had_samples() {
            RARE_S
        } else {
            SILENT_S
        }
    }

    /// What happened to it, from when to when.
    fn event(&self, name: &'static str, from_s: f64, to_s: f64, words: String) -> Message {
        let times = json!({ "from_s": from_s, "to_s": to_s });
        Message::new(
            name,
            faults::facts(&self.source.name, self.of_truth, &times),
            words,
        )
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

/// Tells what there is to tell at a row; people are told of many that fail or come back together in one sentence, as when a logger is
/// unplugged.
fn tell<'a>(terminal: &Terminal, sensors: impl Iterator<Item = &'a Sensor>, at_s: f64) {
    let (mut silent, mut back) = (Vec::new(), Vec::new());
    for sensor in sensors {
        let name = &sensor.source.name;
        match sensor.news {
            Some(News::Fails(Fault::Silent { from_s })) => silent.push((sensor, from_s)),
            Some(News::Fails(Fault::Stuck(stuck))) => {
                let words = format!(
                    "{name} is {} in all of its last {} samples, since {}: {}",
                    number(stuck.value),
                    count(stuck.samples),
                    instant(stuck.from_s),
                    of_standstill(sensor.of_truth, Purpose::Run)
                );
                let facts = faults::facts(name, sensor.of_truth, &stuck);
                terminal.warning(Message::new("stuck", facts, words));
            }
            Some(News::IsBack(Fault::Silent { from_s })) => back.push((sensor, from_s)),
            Some(News::IsBack(Fault::Stuck(stuck))) => {
                let after = time(at_s - stuck.from_s);
                let words = format!("{name} changes again, after {after}");
                terminal.note(sensor.event("changes_again", stuck.from_s, at_s, words));
            }
            None => {}
        }
    }
    // Programs are told of each.
    let at_once = if terminal.events { 1 } else { usize::MAX };
    for silent in silent.chunks(at_once) {
        let (names, since_s) = together(silent);
        let (has, the_sensor, it) = match silent.len() {
            1 => ("has", "the sensor", "it"),
            _ => ("have", "the sensors", "them"),
        };
        let words = format!(
            "{names} {has} no sample since {}: did {the_sensor} fail? What needs {it} predicts nothing",
            instant(since_s)
        );
        terminal.warning(silent[0].0.event("silent", since_s, at_s, words));
    }
    for back in back.chunks(at_once) {
        let (names, since_s) = together(back);
        let has = if back.len() == 1 { "has" } else { "have" };
        let words = format!(
            "{names} {has} samples again, after {}",
            time(at_s - since_s)
        );
        terminal.note(back[0].0.event("has_samples_again", since_s, at_s, words));
    }
}

/// The names of sensors, and since when the first of them has failed.
fn together(all: &[(&Sensor, f64)]) -> (String, f64) {
    let names: Vec<String> = all.iter().map(|(of, _)| of.source.name.clone()).collect();
    let since_s = all.iter().map(|(_, from_s)| *from_s);
    (few(&names), since_s.fold(f64::INFINITY, f64::min))
}
