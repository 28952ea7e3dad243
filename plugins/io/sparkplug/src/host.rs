//! What a host knows of edge nodes: which metrics have which aliases, and whether it has all that was published.

use std::collections::{BTreeMap, HashMap};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::{Duration, Instant};
use athermal_serve::connector::LeftOut;
use srad_types::payload::{Message as _, Metric, Payload, metric, property_value};

/// How long data are held that came before a birth.
const HELD: Wait = Wait::from_secs(5);
/// How many of them, of an edge node.
const HELD_MESSAGES: usize = 1000;
/// An edge node is asked for a rebirth no more often than this, whatever it does.
const ASK: Wait = Wait::from_secs(5);
/// How long what is live waits behind the first birth for a primary host, and behind what was stored for it: a stamp that is not after the
/// last one would be left out.
const HISTORY: Wait = Wait::from_secs(1);
/// How many samples wait so, of an edge node.
const LIVE: usize = 10_000;
/// By what some edge nodes say that the payload is packed, which the specification does not know.
const PACKED: &str = "SPBV1.0_COMPRESSED";

/// What comes of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Out {
    /// A sample of a channel; NaN where there is none any more.
    Sample(usize, Instant, f64),
    /// Something that is no sample, of a channel or of none.
    Dropped(Option<usize>, LeftOut),
    /// How a channel is.
    State(usize, String),
    /// An edge node is to be asked for a rebirth.
    Rebirth(String),
    /// Something for people.
    Remark(String),
}

/// An edge node.
#[derive(Debug, Default)]
struct Edge {
    /// The number of the last message; none where it is not born, or something is missing.
    sequence: Option<u8>,
    is_born: bool,
    /// The number of its birth, by which a death is told from an older one.
    birth: Option<u64>,
    /// By device, "" for itself: by alias the name, and by name the type.
    devices: HashMap<String, Names>,
    /// What came before a birth, and when.
    held: Vec<(Clock, String, Vec<u8>, Instant)>,
    /// When it was asked for a rebirth, and whether that is to be done again.
    asked: Option<Clock>,
    is_owed: bool,
    live: Live,
    /// Its newest time, and when that came.
    newest: Option<(Instant, Clock)>,
    /// Since when a death that may be an older one has not been contradicted.
    doubted: Option<Clock>,
}

/// Samples that are live, behind those that an edge node had stored.
#[derive(Debug, Default)]
struct Live {
    /// Whether they wait from the next birth on.
    is_due: bool,
    /// Until when they wait, where nothing more of those comes; none where they do not wait.
    until: Option<Clock>,
    samples: Vec<(Instant, usize, f64)>,
    /// What was given last, by channel.
    last: HashMap<usize, (Instant, f64)>,
}

impl Live {
    fn take(
        &mut self,
        sample: (Instant, usize, f64),
        is_stored: bool,
        now: Clock,
        out: &mut Vec<Out>,
    ) {
        match &mut self.until {
            None => self.give(sample, out),
            Some(until) if is_stored => {
                *until = now + HISTORY;
                let (stamp, channel, value) = sample;
                out.push(Out::Sample(channel, stamp, value));
            }
            Some(_) => {
                self.samples.push(sample);
                if self.samples.len() >= LIVE {
                    self.release(out);
                }
            }
        }
    }

    /// Gives them, in the order of their stamps.
    fn release(&mut self, out: &mut Vec<Out>) {
        self.until = None;
        self.samples.sort_by_key(|of| of.0);
        for sample in std::mem::take(&mut self.samples) {
            self.give(sample, out);
        }
    }

    /// Stamps have milliseconds, and what is not after the last one would be left out: another value within one, such as the first after a
    /// birth, is a nanosecond later.
    fn give(&mut self, (mut stamp, channel, value): (Instant, usize, f64), out: &mut Vec<Out>) {
        if let Some((last, is)) = self.last.get(&channel)
            && (0..1_000_000).contains(&(last.as_ns() - stamp.as_ns()))
        {
            let is_another = value.to_bits() != is.to_bits();
            stamp = *last + Duration::from_ns(is_another.into());
        }
        self.last.insert(channel, (stamp, value));
        out.push(Out::Sample(channel, stamp, value));
    }
}

#[derive(Debug, Default)]
struct Names {
    aliases: HashMap<u64, String>,
    types: HashMap<String, u32>,
}

/// A host.
#[derive(Debug)]
pub struct Host {
    group: String,
    /// Whether edge nodes that store wait for it.
    is_primary: bool,
    edges: BTreeMap<String, Edge>,
    /// By edge node, device and metric: the channel.
    channels: HashMap<(String, String, String), usize>,
}

/// An address such as `EDGE:METRIC` or `EDGE/DEVICE:METRIC`.
///
/// # Errors
/// When it is none.
pub fn address(text: &str) -> Result<(String, String, String), String> {
    let wrong =
        || format!("\"{text}\" names no metric: write \"EDGE:METRIC\", or \"EDGE/DEVICE:METRIC\"");
    let (place, metric) = text.split_once(':').ok_or_else(wrong)?;
    let (edge, device) = place.split_once('/').unwrap_or((place, ""));
    let is_level = |of: &str| !of.contains(['/', '+', '#']);
    let is_right = !edge.is_empty() && is_level(edge) && is_level(device) && !metric.is_empty();
    is_right
        .then(|| (edge.to_owned(), device.to_owned(), metric.to_owned()))
        .ok_or_else(wrong)
}

impl Host {
    /// One of a group, for channels by their addresses, which is a primary host or none.
    pub fn new(
        group: &str,
        is_primary: bool,
        channels: impl Iterator<Item = (String, String, String)>,
    ) -> Self {
        let channels: HashMap<_, _> = channels.enumerate().map(|(nth, of)| (of, nth)).collect();
        let edges = channels
            .keys()
            .map(|(edge, ..)| (edge.clone(), Edge::default()));
        Self {
            group: group.to_owned(),
            is_primary,
            edges: edges.collect(),
            channels,
        }
    }

    /// The topics that it listens to.
    pub fn topics(&self) -> Vec<String> {
        let edges = self.edges.keys();
        let group = &self.group;
        let of = |kind: &str, edge: &String| format!("spBv1.0/{group}/{kind}/{edge}");
        let topics = edges.flat_map(|edge| {
            let own = ["NBIRTH", "NDATA", "NDEATH"].map(|kind| of(kind, edge));
            let devices = ["DBIRTH", "DDATA", "DDEATH"].map(|kind| of(kind, edge) + "/+");
            own.into_iter().chain(devices)
        });
        topics.collect()
    }

    /// A new connection: what was published meanwhile without a store is lost, so that all are asked anew.
    pub fn connected(&mut self, now: Clock, out: &mut Vec<Out>) {
        for (name, edge) in &mut self.edges {
            let was_born = edge.is_born;
            edge.live.release(out);
            *edge = Edge::default();
            edge.live.is_due = self.is_primary;
            edge.rebirth(name, now, out);
            if was_born {
                out.push(Out::Remark(format!(
                    "gap: what edge node `{name}` published while the connection was away is lost, unless it stores it"
                )));
            }
        }
    }

    /// Takes a message.
    pub fn take(
        &mut self,
        topic: &str,
        payload: &[u8],
        now: Clock,
        mut at: Instant,
        out: &mut Vec<Out>,
    ) {
        let mut levels = topic.split('/').skip(2);
        let (kind, name) = (
            levels.next().unwrap_or_default(),
            levels.next().unwrap_or_default(),
        );
        let device = levels.next().unwrap_or_default();
        let Self {
            edges, channels, ..
        } = self;
        let Some(edge) = edges.get_mut(name) else {
            return out.push(Out::Dropped(None, LeftOut::NoSuchName));
        };
        let read = Payload::decode(payload).ok();
        let Some(read) = read.filter(|of| of.uuid.as_deref() != Some(PACKED)) else {
            return out.push(Out::Dropped(None, LeftOut::Unreadable));
        };
        if kind.ends_with("DEATH") {
            at = edge.death(read.timestamp, now, at);
        } else if let Some(time) = time(read.timestamp)
            && edge.newest.is_none_or(|(newest, _)| time > newest)
        {
            edge.newest = Some((time, now));
        }
        if kind != "NDEATH" {
            edge.doubted = None;
        }
        match kind {
            "NBIRTH" => {
                if std::mem::take(&mut edge.live.is_due) {
                    edge.live.until = Some(now + HISTORY);
                }
                edge.is_born = true;
                edge.devices.clear();
                edge.birth = birth(&read);
                edge.sequence = read.seq.and_then(|of| u8::try_from(of).ok());
                edge.is_owed = false;
            }
            "NDEATH" => {
                // A broker may publish that of a connection before the one that stands.
                if edge.birth.is_none() || birth(&read).is_none() || edge.birth == birth(&read) {
                    edge.die(channels, name, at, out);
                } else {
                    // Who lives answers.
                    edge.doubted = Some(now);
                    edge.rebirth(name, now, out);
                }
                return;
            }
            _ if !edge.is_born || kind == "DDATA" && !edge.devices.contains_key(device) => {
                if edge.held.len() < HELD_MESSAGES {
                    edge.held
                        .push((now, topic.to_owned(), payload.to_vec(), at));
                }
                return edge.rebirth(name, now, out);
            }
            _ => edge.count(name, &read, now, out),
        }
        match kind {
            "DDEATH" => {
                edge.devices.remove(device);
                edge.live.release(out);
                return dead(channels, name, Some(device), at, out);
            }
            "NBIRTH" | "DBIRTH" => {
                edge.devices.insert(device.to_owned(), Names::of(&read));
            }
            _ => {}
        }
        // What was held for it comes before it.
        if matches!(kind, "NBIRTH" | "DBIRTH") {
            let held = std::mem::take(&mut edge.held);
            for (came, topic, payload, at) in held {
                if topic.split('/').nth(4).unwrap_or_default() != device {
                    edge.held.push((came, topic, payload, at));
                } else if now.duration_since(came) <= HELD
                    && let Ok(read) = Payload::decode(&*payload)
                {
                    // Its number was looked at when it came.
                    edge.values(channels, (name, device), &read, (now, at), out);
                }
            }
        }
        let is_known = edge.values(channels, (name, device), &read, (now, at), out);
        if !is_known {
            edge.rebirth(name, now, out);
        }
    }

    /// Lets go of what was held too long or long enough, takes for dead what does not answer, and asks again.
    pub fn pass(&mut self, now: Clock, at: Instant, out: &mut Vec<Out>) {
        for (name, edge) in &mut self.edges {
            if edge.doubted.is_some_and(|of| now.duration_since(of) > HELD) {
                let at = edge.death(None, now, at);
                edge.die(&self.channels, name, at, out);
            }
            if edge.live.until.is_some_and(|of| now >= of) {
                edge.live.release(out);
            }
            if edge.is_owed {
                edge.rebirth(name, now, out);
            }
            let before = edge.held.len();
            edge.held
                .retain(|(came, ..)| now.duration_since(*came) <= HELD);
            for _ in edge.held.len()..before {
                out.push(Out::Dropped(None, LeftOut::NoSuchName));
            }
        }
    }
}

impl Edge {
    /// Asks for a rebirth; later, where that was asked a moment ago.
    fn rebirth(&mut self, name: &str, now: Clock, out: &mut Vec<Out>) {
        self.is_owed = self.asked.is_some_and(|of| now.duration_since(of) < ASK);
        if !self.is_owed {
            self.asked = Some(now);
            out.push(Out::Rebirth(name.to_owned()));
        }
    }

    /// When it died, by its own clock, so that what it sends in another life is later: as it says, where that is not what it said at the
    /// beginning of its connection; else the time since its last message is counted.
    fn death(&self, said: Option<u64>, now: Clock, at: Instant) -> Instant {
        let Some((newest, came)) = self.newest else {
            return at;
        };
        let since = i64::try_from(now.duration_since(came).as_nanos());
        let counted = newest + Duration::from_ns(since.unwrap_or(0));
        time(said).filter(|of| *of > newest).unwrap_or(counted)
    }

    /// Nothing is known of it any more.
    fn die(&mut self, channels: &Channels, name: &str, at: Instant, out: &mut Vec<Out>) {
        (self.is_born, self.sequence, self.doubted) = (false, None, None);
        self.is_owed = false;
        self.live.release(out);
        dead(channels, name, None, at, out);
    }

    /// Takes the values of a message. False where an alias is not known.
    fn values(
        &mut self,
        channels: &Channels,
        (edge, device): (&str, &str),
        read: &Payload,
        (now, at): (Clock, Instant),
        out: &mut Vec<Out>,
    ) -> bool {
        let names = self.devices.entry(device.to_owned()).or_default();
        let mut is_known = true;
        for of in &read.metrics {
            let by_alias = || names.aliases.get(&of.alias?).cloned();
            let Some(name) = of.name.clone().or_else(by_alias) else {
                is_known = false;
                out.push(Out::Dropped(None, LeftOut::NoSuchName));
                continue;
            };
            let datatype = of.datatype.or_else(|| names.types.get(&name).copied());
            let key = (edge.to_owned(), device.to_owned(), name);
            let Some(&channel) = channels.get(&key) else {
                continue;
            };
            let stamp = time(of.timestamp.or(read.timestamp));
            let is_stored = of.is_historical == Some(true);
            match (value(of, datatype), stamp) {
                (Ok(value), Some(stamp)) => {
                    self.live.take((stamp, channel, value), is_stored, now, out);
                    out.push(Out::State(channel, String::new()));
                }
                (Ok(_), None) => out.push(Out::Dropped(Some(channel), LeftOut::NoTime)),
                (Err(reason), stamp) => {
                    let sample = (stamp.unwrap_or(at), channel, f64::NAN);
                    self.live.take(sample, is_stored, now, out);
                    out.push(Out::Dropped(Some(channel), reason));
                    let words = format!("{}, and absent", reason.name().replace('_', " "));
                    out.push(Out::State(channel, words));
                }
            }
        }
        is_known
    }

    /// Each message has the next number.
    fn count(&mut self, name: &str, read: &Payload, now: Clock, out: &mut Vec<Out>) {
        let number = read.seq.and_then(|of| u8::try_from(of).ok());
        if let (Some(last), Some(number)) = (self.sequence, number) {
            let missing = number.wrapping_sub(last).wrapping_sub(1);
            if missing > 0 {
                out.push(Out::Remark(format!(
                    "gap: {missing} messages of edge node `{name}` are missing by their numbers; it is asked for a rebirth"
                )));
                self.rebirth(name, now, out);
            }
        }
        self.sequence = number.or(self.sequence);
    }
}

impl Names {
    fn of(read: &Payload) -> Self {
        let mut names = Self::default();
        for of in &read.metrics {
            let Some(name) = &of.name else { continue };
            if let Some(alias) = of.alias {
                names.aliases.insert(alias, name.clone());
            }
            names.types.insert(name.clone(), of.datatype.unwrap_or(0));
        }
        names
    }
}

fn time(ms: Option<u64>) -> Option<Instant> {
    let ns = i64::try_from(ms?).ok()?.checked_mul(1_000_000)?;
    Some(Instant::from_ns(ns))
}

fn birth(of: &Payload) -> Option<u64> {
    let found = of
        .metrics
        .iter()
        .find(|of| of.name.as_deref() == Some("bdSeq"))?;
    match found.value {
        Some(metric::Value::LongValue(number)) => Some(number),
        Some(metric::Value::IntValue(number)) => Some(number.into()),
        _ => None,
    }
}

type Channels = HashMap<(String, String, String), usize>;

/// What is dead is absent: the channels of a device, or of all.
fn dead(channels: &Channels, edge: &str, device: Option<&str>, at: Instant, out: &mut Vec<Out>) {
    let mut all: Vec<_> = channels
        .iter()
        .filter(|((of, own, _), _)| of == edge && device.is_none_or(|of| of == own))
        .map(|(_, channel)| *channel)
        .collect();
    all.sort_unstable();
    for channel in all {
        out.push(Out::Sample(channel, at, f64::NAN));
        out.push(Out::State(
            channel,
            "dead, until it is born again".to_owned(),
        ));
    }
}

/// The good quality of the specification.
const GOOD: u32 = 192;

fn value(of: &Metric, datatype: Option<u32>) -> Result<f64, LeftOut> {
    let properties = of
        .properties
        .iter()
        .flat_map(|of| of.keys.iter().zip(&of.values));
    let quality = properties
        .filter(|(key, _)| *key == "Quality")
        .map(|(_, of)| &of.value);
    for of in quality {
        if !matches!(of, Some(property_value::Value::IntValue(GOOD))) {
            return Err(LeftOut::BadQuality);
        }
    }
    if of.is_null == Some(true) {
        return Err(LeftOut::NoNumber);
    }
    let value = match (&of.value, datatype) {
        (Some(metric::Value::DoubleValue(value)), _) => *value,
        (Some(metric::Value::FloatValue(value)), _) => f64::from(*value),
        (Some(metric::Value::BooleanValue(value)), _) => f64::from(u8::from(*value)),
        // Numbers with a sign are sent as if they had none: types 1, 2 and 3, and 4 of the long ones.
        (Some(metric::Value::IntValue(value)), Some(1)) => f64::from(*value as i8),
        (Some(metric::Value::IntValue(value)), Some(2)) => f64::from(*value as i16),
        (Some(metric::Value::IntValue(value)), Some(3)) => f64::from(*value as i32),
        (Some(metric::Value::IntValue(value)), _) => f64::from(*value),
        (Some(metric::Value::LongValue(value)), Some(4)) => *value as i64 as f64,
        (Some(metric::Value::LongValue(value)), _) => *value as f64,
        _ => return Err(LeftOut::NoNumber),
    };
    value.is_finite().then_some(value).ok_or(LeftOut::NoNumber)
}

#[cfg(test)]
mod tests;
