//! What a message says of channels: pure, so that any payload can be tried on it. Nothing that a machine sends stops it.

use std::collections::HashMap;
use std::fmt;

use athermal_core::time::Instant;
use jiff::Timestamp;
use serde_json::{Number, Value};

/// A longer payload is not looked at.
pub const LONGEST: usize = 1 << 20;
/// JSON that is nested deeper is not looked at.
const DEEPEST: usize = 128;
const SECOND_NS: i64 = 1_000_000_000;

/// Where and how a message says what.
#[derive(Debug, Clone)]
pub struct Form {
    /// Its time.
    pub time: Time,
    /// Where it has a number that grows by one with each message.
    pub sequence: Option<String>,
    /// How it says that a value is good.
    pub quality: Option<Quality>,
    /// Its values.
    pub values: Values,
    /// The channels, by their numbers, that say from when on a planned value applies: written as the time is, read in seconds.
    pub instants: Box<[usize]>,
    /// The channels, by their numbers, of unit 1: `true` is 1 of them, and no number of any other.
    pub flags: Box<[usize]>,
}

/// Where the time of a value stands.
#[derive(Debug, Clone, PartialEq)]
pub enum Time {
    /// Nowhere: it is that of the arrival.
    Arrival,
    /// There, as a number of units of so many nanoseconds, or in words of RFC 3339 without.
    At(String, Option<i64>),
}

/// How a message says that a value is good.
#[derive(Debug, Clone)]
pub struct Quality {
    /// Where it says so.
    pub at: String,
    /// What it says of good ones.
    pub good: Vec<Value>,
}

/// Where the values of a message stand; channels by their number.
#[derive(Debug, Clone)]
pub enum Values {
    /// The message is a number.
    Plain(usize),
    /// One value, there.
    One(String, usize),
    /// One value each, there.
    Fields(Vec<(String, usize)>),
    /// A list of objects, each with a name and a value.
    Each {
        /// Where the list stands.
        list: String,
        /// Where in an object its name stands.
        name: String,
        /// Where in an object its value stands.
        value: String,
        /// The channel of each name.
        channels: HashMap<String, usize>,
    },
}

/// A value of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The number of the channel.
    pub channel: usize,
    /// Of when it is.
    pub stamp: Instant,
    /// The value.
    pub value: f64,
}

/// Why something is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Reason {
    /// It is empty.
    Empty,
    /// It is longer than [`LONGEST`].
    TooLong,
    /// It is not UTF-8.
    NotText,
    /// It is not JSON.
    NotJson,
    /// It is nested deeper than 128.
    TooDeep,
    /// It has no value where one is expected.
    NotThere,
    /// The value is null.
    Null,
    /// The value is no number.
    NotANumber,
    /// The value is true or false, and the channel has a unit.
    Truth,
    /// The value is not finite.
    NotFinite,
    /// It has no time where one is expected.
    NoTime,
    /// Its time cannot be read.
    WrongTime,
    /// The quality is not good.
    Bad,
    /// It has no name where one is expected.
    NoName,
    /// Its name is of no channel.
    UnknownName,
    /// It was retained, and is not fresh.
    Retained,
    /// Nothing is asked of its topic.
    NoMapping,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "it is empty",
            Self::TooLong => "it is longer than 1 MiB",
            Self::NotText => "it is not UTF-8",
            Self::NotJson => "it is not JSON",
            Self::TooDeep => "it is nested deeper than 128",
            Self::NotThere => "it has no value where one is expected",
            Self::Null => "the value is null",
            Self::NotANumber => "the value is no number",
            Self::Truth => {
                "true or false is a number only of a channel whose signal has `unit = \"1\"`"
            }
            Self::NotFinite => "the value is not finite",
            Self::NoTime => "it has no time where one is expected",
            Self::WrongTime => "its time cannot be read",
            Self::Bad => "the quality is not good",
            Self::NoName => "it has no name where one is expected",
            Self::UnknownName => "its name is of no channel",
            Self::Retained => "it is a retained message, and not a fresh one",
            Self::NoMapping => "nothing is asked of its topic",
        })
    }
}

/// What is left out, with what shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Why.
    pub reason: Reason,
    /// What, cut short.
    pub what: String,
    /// The number of the channel that lacks it; none where it is not known, or all of a message do.
    pub channel: Option<usize>,
}

impl LeftOut {
    fn new(reason: Reason, what: impl fmt::Display) -> Self {
        let what = what.to_string();
        let mut shown: String = what.chars().take(60).collect();
        if shown.len() < what.len() {
            shown.push('…');
        }
        let what = shown.escape_debug().to_string();
        Self {
            reason,
            what,
            channel: None,
        }
    }

    fn of(channel: usize) -> impl Fn(Self) -> Self {
        move |of| Self {
            channel: Some(channel),
            ..of
        }
    }
}

/// What a message says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Readings {
    /// Values of channels.
    pub given: Vec<Reading>,
    /// What cannot be used.
    pub left_out: Vec<LeftOut>,
    /// Its number among the messages of its topic.
    pub sequence: Option<i64>,
    /// The newest time that stands in it, also of a value that is left out.
    pub newest: Option<Instant>,
}

impl Form {
    /// The channels that every message gives; none where it names them.
    #[must_use]
    pub fn channels(&self) -> Vec<usize> {
        match &self.values {
            Values::Plain(channel) | Values::One(_, channel) => vec![*channel],
            Values::Fields(fields) => fields.iter().map(|(_, channel)| *channel).collect(),
            Values::Each { .. } => Vec::new(),
        }
    }

    /// What a payload says that came at some instant.
    #[must_use]
    pub fn read(&self, payload: &[u8], arrival: Instant) -> Readings {
        let mut readings = Readings::default();
        if let Err(left_out) = self.read_into(payload, arrival, &mut readings) {
            readings.left_out.push(left_out);
        }
        readings
    }

    fn read_into(
        &self,
        payload: &[u8],
        arrival: Instant,
        into: &mut Readings,
    ) -> Result<(), LeftOut> {
        if payload.is_empty() {
            return Err(LeftOut::new(Reason::Empty, ""));
        }
        if payload.len() > LONGEST {
            let what = format_args!("{} bytes", payload.len());
            return Err(LeftOut::new(Reason::TooLong, what));
        }
        if let Values::Plain(channel) = self.values {
            let text = text_of(payload)?;
            into.newest = Some(arrival);
            let value = match text.trim().parse() {
                Ok(is) => self.truth(is, channel)?,
                Err(_) => number_of_text(text)?,
            };
            into.given.push(Reading {
                channel,
                stamp: arrival,
                value,
            });
            return Ok(());
        }
        let message = json(payload)?;
        let sequence = self.sequence.as_ref().and_then(|at| message.pointer(at));
        into.sequence = sequence.and_then(Value::as_i64);
        match &self.values {
            Values::Plain(_) => {}
            Values::One(at, channel) => {
                let stamp = self.stamp(&message, &message, arrival)?;
                into.newest = Some(stamp);
                self.is_good(&message, &message)?;
                let channel = *channel;
                if let Some(value) = self.value_at(&message, at, channel)? {
                    into.given.push(Reading {
                        channel,
                        stamp,
                        value,
                    });
                }
            }
            Values::Fields(fields) => {
                let stamp = self.stamp(&message, &message, arrival)?;
                into.newest = Some(stamp);
                self.is_good(&message, &message)?;
                let mut left_out = Vec::new();
                for (at, channel) in fields {
                    match self.value_at(&message, at, *channel) {
                        Ok(Some(value)) => into.given.push(Reading {
                            channel: *channel,
                            stamp,
                            value,
                        }),
                        Ok(None) => {}
                        Err(of) => left_out.push(of),
                    }
                }
                // A message need not have all of its values each time.
                let is_value = |of: &Reading| !self.instants.contains(&of.channel);
                if into.given.iter().any(is_value) {
                    left_out.retain(|of| !matches!(of.reason, Reason::NotThere | Reason::Null));
                }
                into.left_out.extend(left_out);
            }
            Values::Each { list, .. } => {
                let Some(items) = message.pointer(list).and_then(Value::as_array) else {
                    let what = format_args!("no list at \"{list}\"");
                    return Err(LeftOut::new(Reason::NotThere, what));
                };
                for item in items {
                    match self.item(item, &message, arrival, &mut into.newest) {
                        Ok(reading) => into.given.extend(reading),
                        Err(left_out) => into.left_out.push(left_out),
                    }
                }
            }
        }
        Ok(())
    }

    /// What one of a list says.
    fn item(
        &self,
        item: &Value,
        message: &Value,
        arrival: Instant,
        newest: &mut Option<Instant>,
    ) -> Result<Option<Reading>, LeftOut> {
        let Values::Each {
            name,
            value,
            channels,
            ..
        } = &self.values
        else {
            return Err(LeftOut::new(Reason::NoMapping, ""));
        };
        let Some(named) = item.pointer(name) else {
            return Err(LeftOut::new(Reason::NoName, item));
        };
        // A name may be a number.
        let found = match named {
            Value::String(text) => channels.get(text),
            other => channels.get(&other.to_string()),
        };
        let Some(&channel) = found else {
            return Err(LeftOut::new(Reason::UnknownName, named));
        };
        let of_channel = LeftOut::of(channel);
        let stamp = self.stamp(item, message, arrival).map_err(&of_channel)?;
        *newest = (*newest).max(Some(stamp));
        self.is_good(item, message).map_err(&of_channel)?;
        let value = self.value_at(item, value, channel)?;
        Ok(value.map(|value| Reading {
            channel,
            stamp,
            value,
        }))
    }

    /// The value of a channel in a part of a message. An instant from which on a planned value applies may be missing: it then applies
    /// at once.
    fn value_at(&self, part: &Value, at: &str, channel: usize) -> Result<Option<f64>, LeftOut> {
        let value = self.any_value_at(part, at, channel);
        value.map_err(LeftOut::of(channel))
    }

    fn any_value_at(&self, part: &Value, at: &str, channel: usize) -> Result<Option<f64>, LeftOut> {
        if !self.instants.contains(&channel) {
            let value = match part.pointer(at) {
                Some(Value::Bool(is)) => self.truth(*is, channel),
                _ => number_at(part, at),
            };
            return value.map(Some);
        }
        let Some(found) = part.pointer(at).filter(|found| !found.is_null()) else {
            return Ok(None);
        };
        let ns = match &self.time {
            Time::At(_, unit) => ns_of(found, *unit),
            // Nothing says how times are written.
            Time::Arrival => ns_of(found, None).or_else(|| ns_of(found, Some(SECOND_NS))),
        };
        let instant = ns.map(|ns| (Instant::from_ns(ns) - Instant::from_ns(0)).secs());
        let instant = instant.ok_or_else(|| LeftOut::new(Reason::WrongTime, found));
        instant.map(Some)
    }

    /// What true or false is as a value of a channel.
    fn truth(&self, is: bool, channel: usize) -> Result<f64, LeftOut> {
        match self.flags.contains(&channel) {
            true => Ok(f64::from(is)),
            false => Err(LeftOut::new(Reason::Truth, is)),
        }
    }

    /// The time of a part of a message: its own, or that of the message.
    fn stamp(&self, part: &Value, message: &Value, arrival: Instant) -> Result<Instant, LeftOut> {
        let Time::At(at, unit) = &self.time else {
            return Ok(arrival);
        };
        let found = part.pointer(at).or_else(|| message.pointer(at));
        let Some(found) = found.filter(|of| !of.is_null()) else {
            let what = format_args!("nothing at \"{at}\"");
            return Err(LeftOut::new(Reason::NoTime, what));
        };
        let stamp = ns_of(found, *unit).map(Instant::from_ns);
        stamp.ok_or_else(|| LeftOut::new(Reason::WrongTime, found))
    }

    fn is_good(&self, part: &Value, message: &Value) -> Result<(), LeftOut> {
        let Some(Quality { at, good }) = &self.quality else {
            return Ok(());
        };
        let found = part.pointer(at).or_else(|| message.pointer(at));
        let Some(found) = found else {
            let what = format_args!("nothing at \"{at}\"");
            return Err(LeftOut::new(Reason::Bad, what));
        };
        let is = |good: &Value| match (good.as_f64(), found.as_f64()) {
            (Some(good), Some(found)) => good == found,
            _ => good == found,
        };
        match good.iter().any(is) {
            true => Ok(()),
            false => Err(LeftOut::new(Reason::Bad, found)),
        }
    }
}

fn text_of(payload: &[u8]) -> Result<&str, LeftOut> {
    std::str::from_utf8(payload).map_err(|_| {
        LeftOut::new(
            Reason::NotText,
            String::from_utf8_lossy(&payload[..payload.len().min(60)]),
        )
    })
}

fn json(payload: &[u8]) -> Result<Value, LeftOut> {
    let text = text_of(payload)?;
    serde_json::from_str(text).map_err(|error| {
        let reason = match is_too_deep(text) {
            true => Reason::TooDeep,
            false => Reason::NotJson,
        };
        LeftOut::new(reason, format_args!("{error}: {}", start(text)))
    })
}

fn start(text: &str) -> &str {
    let end = text.char_indices().nth(40).map_or(text.len(), |(at, _)| at);
    &text[..end]
}

fn is_too_deep(text: &str) -> bool {
    let (mut depth, mut is_text, mut is_escaped) = (0_usize, false, false);
    text.bytes().any(|byte| {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' if is_text => is_escaped = true,
            b'"' => is_text = !is_text,
            b'[' | b'{' if !is_text => depth += 1,
            b']' | b'}' if !is_text => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth >= DEEPEST
    })
}

fn number_at(part: &Value, at: &str) -> Result<f64, LeftOut> {
    let Some(found) = part.pointer(at) else {
        let what = format_args!("nothing at \"{at}\"");
        return Err(LeftOut::new(Reason::NotThere, what));
    };
    match found {
        Value::Number(number) => finite(number.as_f64().unwrap_or(f64::NAN), found),
        Value::String(text) => number_of_text(text),
        Value::Null => Err(LeftOut::new(Reason::Null, at)),
        other => Err(LeftOut::new(Reason::NotANumber, other)),
    }
}

/// A number as text. Words such as `NaN` are numbers of no use.
fn number_of_text(text: &str) -> Result<f64, LeftOut> {
    let read = text.trim().parse::<f64>();
    let value = read.map_err(|_| LeftOut::new(Reason::NotANumber, text))?;
    finite(value, text)
}

fn finite(value: f64, what: impl fmt::Display) -> Result<f64, LeftOut> {
    let is_finite = value.is_finite();
    is_finite
        .then_some(value)
        .ok_or_else(|| LeftOut::new(Reason::NotFinite, what))
}

/// The nanoseconds that a time says: a number of units, or in words without one.
fn ns_of(found: &Value, unit: Option<i64>) -> Option<i64> {
    match (found, unit) {
        (Value::Number(number), Some(unit)) => ns_of_number(number, unit),
        (Value::String(text), Some(unit)) => exact_ns(text.trim(), unit),
        (Value::String(text), None) => ns_of_text(text),
        _ => None,
    }
}

fn ns_of_number(number: &Number, unit: i64) -> Option<i64> {
    match number.as_i64() {
        Some(count) => count.checked_mul(unit),
        // Its shortest digits are those that were sent.
        None => exact_ns(&number.to_string(), unit),
    }
}

/// Decimal digits times a unit, to the nearest nanosecond: a time in seconds with six decimals is not to become another.
fn exact_ns(text: &str, unit: i64) -> Option<i64> {
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let (sign, whole) = match whole.strip_prefix('-') {
        Some(whole) => (-1, whole),
        None => (1, whole),
    };
    let digits = format!("{whole}{fraction}");
    if digits.is_empty() || digits.len() > 27 || !digits.bytes().all(|of| of.is_ascii_digit()) {
        return None;
    }
    let count = digits.parse::<i128>().ok()?.checked_mul(unit.into())?;
    let power = exponent.checked_sub(fraction.len() as i32)?;
    let ns = match power {
        0.. => count.checked_mul(10_i128.checked_pow(power as u32)?)?,
        _ => match 10_i128.checked_pow(power.unsigned_abs()) {
            Some(by) => (count + by / 2) / by,
            None => 0,
        },
    };
    i64::try_from(sign * ns).ok()
}

fn ns_of_text(text: &str) -> Option<i64> {
    let stamp: Timestamp = text.trim().parse().ok()?;
    i64::try_from(stamp.as_nanosecond()).ok()
}

#[cfg(test)]
mod tests;
