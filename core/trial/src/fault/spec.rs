//! Decides how a fault is written, in a graph file and on the command line; not what it does to a value.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Fault, FaultError, FaultKind};
use crate::diagnostic::nearest;
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

/// A fault of a channel that is named, not numbered.
///
/// In a graph file: `{ channel = "temperature.plate1", kind = "missing", from = "6h", for = "12h" }`; as one text, on the command line:
/// `temperature.plate1=missing,from=6h,for=12h` or `temperature.room=drift,size=0.5 K/h`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FaultSpec {
    /// The measured channel, such as `temperature.plate1`, or a signal for each of its channels.
    pub channel: String,
    /// What is wrong with it.
    pub kind: FaultKind,
    /// When it starts, counted from the first row.
    #[serde(default = "at_once")]
    pub from: Duration,
    /// How long it lasts; to the end if not given.
    #[serde(default, rename = "for", skip_serializing_if = "Option::is_none")]
    pub lasting: Option<Duration>,
    /// How large it is, such as "1 K", and for `drift` per time, such as "0.5 K/h"; there is a usual size for temperatures and lengths.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<Quantity>,
}

fn at_once() -> Duration {
    Duration::ZERO
}

impl FaultSpec {
    /// The fault of one of `channels`, given by name and unit, in the order of the rows; or of each channel of the signal that is
    /// named.
    ///
    /// # Errors
    /// No channel and no signal has the name; the size does not fit a unit; or there is none, and no usual one.
    pub fn resolve(&self, channels: &[(&str, &Unit)]) -> Result<Vec<Fault>, FaultError> {
        let names = || channels.iter().map(|(name, _)| *name);
        let signal = |name| str::split_once(name, '.').map(|(signal, _)| signal);
        let meant: Vec<_> = match names().position(|name| name == self.channel) {
            Some(channel) => vec![channel],
            None => {
                let meant = |channel: &usize| signal(channels[*channel].0) == Some(&*self.channel);
                (0..channels.len()).filter(meant).collect()
            }
        };
        if meant.is_empty() {
            return Err(FaultError::UnknownChannel {
                channel: self.channel.clone(),
                nearest: nearest(&self.channel, names().chain(names().filter_map(signal)))
                    .map(str::to_owned),
                known: names().map(str::to_owned).collect(),
            });
        }
        let of = |channel: usize| {
            Ok(Fault {
                channel,
                kind: self.kind,
                from_ns: self.from.as_ns(),
                for_ns: self.lasting.map_or(i64::MAX, Duration::as_ns),
                size: self.size_in(channels[channel].1)?,
            })
        };
        meant.into_iter().map(of).collect()
    }

    fn size_in(&self, unit: &Unit) -> Result<f64, FaultError> {
        if !self.kind.has_size() {
            return Ok(0.0);
        }
        let Some(size) = &self.size else {
            return self
                .kind
                .usual_size(unit)
                .ok_or_else(|| FaultError::NoSize {
                    channel: self.channel.clone(),
                    kind: self.kind,
                    unit: Box::new(unit.clone()),
                });
        };
        let difference = unit.difference();
        let wanted = if self.kind == FaultKind::Drift {
            Unit::parse(&format!("{difference}/h")).unwrap_or_else(|_| difference.clone())
        } else {
            difference
        };
        size.as_difference(&wanted)
            .ok_or_else(|| FaultError::SizeUnit {
                channel: self.channel.clone(),
                found: Box::new(size.unit.clone()),
                wanted: Box::new(wanted),
            })
    }
}

impl FromStr for FaultSpec {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let wrong = |part: &str, reason: &str| FaultError::Text {
            part: part.to_owned(),
            reason: reason.to_owned(),
        };
        let mut parts = parts(text).into_iter();
        let first = parts.next().unwrap_or_default();
        let (channel, kind) = first.split_once('=').ok_or_else(|| {
            wrong(
                first,
                "expected CHANNEL=KIND, such as temperature.plate1=missing,from=6h,for=12h",
            )
        })?;
        let kind = FaultKind::named(kind.trim()).ok_or_else(|| {
            let names: Vec<_> = FaultKind::ALL.iter().map(|kind| kind.name()).collect();
            wrong(kind, &format!("the kinds are {}", names.join(", ")))
        })?;
        let mut spec = Self {
            channel: channel.trim().to_owned(),
            kind,
            from: Duration::ZERO,
            lasting: None,
            size: None,
        };
        for part in parts {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| wrong(part, "expected from=6h, for=12h or size=\"1 K\""))?;
            let value = value.trim();
            match key.trim() {
                "from" => spec.from = value.parse().map_err(|e| wrong(part, &format!("{e}")))?,
                "for" => {
                    let lasting = value.parse().map_err(|e| wrong(part, &format!("{e}")))?;
                    spec.lasting = Some(lasting);
                }
                "size" => {
                    let size = value.parse().map_err(|e| wrong(part, &format!("{e}")))?;
                    spec.size = Some(size);
                }
                _ => return Err(wrong(part, "expected `from`, `for` or `size`")),
            }
        }
        Ok(spec)
    }
}

/// The parts between commas; one between digits is meant for a decimal point, and parts nothing.
fn parts(text: &str) -> Vec<&str> {
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    let (mut parts, mut start) = (Vec::new(), 0);
    for (at, _) in text.match_indices(',') {
        let after = text[at + 1..].chars().next();
        if !(is_digit(text[..at].chars().next_back()) && is_digit(after)) {
            parts.push(text[start..at].trim());
            start = at + 1;
        }
    }
    parts.push(text[start..].trim());
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_resolved(text: &str) -> Result<Vec<Fault>, FaultError> {
        let (celsius, nanometre) = (Unit::parse("Cel").unwrap(), Unit::parse("nm").unwrap());
        let volt = Unit::parse("V").unwrap();
        text.parse::<FaultSpec>()?.resolve(&[
            ("temperature.room", &celsius),
            ("position.X1", &nanometre),
            ("position.Z1", &nanometre),
            ("supply", &volt),
        ])
    }

    fn resolved(text: &str) -> Result<Fault, FaultError> {
        let found = all_resolved(text)?;
        assert_eq!(found.len(), 1, "{text}");
        Ok(found[0].clone())
    }

    #[test]
    fn a_fault_of_a_signal_is_one_of_each_of_its_channels() {
        let found = all_resolved("position=offset,size=0.2 um").unwrap();
        let found = found.iter().map(|fault| (fault.channel, fault.size));
        assert_eq!(found.collect::<Vec<_>>(), [(1, 200.0), (2, 200.0)]);
    }

    #[test]
    fn sizes_are_converted_to_the_unit_of_the_channel() {
        assert_eq!(
            resolved("temperature.room=offset,size=20 mK").unwrap().size,
            0.02
        );
        assert_eq!(
            resolved("position.Z1=spike,size=1.5 um").unwrap().size,
            1500.0
        );
        let drift = resolved("temperature.room=drift,size=1 mK/min")
            .unwrap()
            .size;
        assert!((drift - 0.06).abs() < 1e-15, "{drift} K/h");
        assert_eq!(resolved("position.Z1=offset").unwrap().size, 100.0);
    }

    #[test]
    fn a_fault_without_an_end_lasts() {
        let fault = resolved("temperature.room=stuck,from=6h").unwrap();
        assert_eq!(
            (fault.from_ns, fault.for_ns),
            (21_600_000_000_000, i64::MAX)
        );
    }

    #[test]
    fn mistakes_say_what_to_write() {
        for (text, expected) in [
            (
                "temperature.rom=missing",
                "there is no channel `temperature.rom`, did you mean `temperature.room`?",
            ),
            (
                "=missing",
                "there is no channel ``; there are temperature.room, position.X1, position.Z1, supply",
            ),
            (
                "positon=missing",
                "there is no channel `positon`, did you mean `position`?",
            ),
            (
                "temperature.room",
                "fault `temperature.room`: expected CHANNEL=KIND, such as temperature.plate1=missing,from=6h,for=12h",
            ),
            (
                "temperature.room=broken",
                "fault `broken`: the kinds are missing, stuck, offset, spike, drift, noise",
            ),
            (
                "temperature.room=offset,size=1 nm",
                "the size of a fault of `temperature.room` is in nm; it must be in K",
            ),
            ("supply=noise", "a `noise` of `supply` needs a size in V"),
        ] {
            assert_eq!(resolved(text).unwrap_err().to_string(), expected);
        }
    }

    #[test]
    fn a_decimal_comma_in_a_size_or_a_time_is_told_to_be_one() {
        for (text, instead) in [
            ("t=drift,size=0,5 K/h,for=1h", "0.5 K/h"),
            ("t=drift,for=1,5h", "1.5h"),
        ] {
            let error = text.parse::<FaultSpec>().unwrap_err().to_string();
            let expected = format!("a number has a decimal point: \"{instead}\"");
            assert!(error.contains(&expected), "{error}");
        }
    }
}
