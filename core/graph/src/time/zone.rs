//! The zone that a clock on the wall is in, and which instant its time is; how that time is written is read elsewhere.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use jiff::fmt::temporal::DateTimeParser;
use jiff::tz::{AmbiguousOffset, Offset, TimeZone, TimeZoneDatabase};
use jiff::{Timestamp, civil};

use super::Instant;
use crate::diagnostic::nearest;

/// The zones of the tz database (RFC 6557) as it was when this program was built, so that what a log means does not depend on the
/// machine that reads it.
static ZONES: LazyLock<TimeZoneDatabase> = LazyLock::new(TimeZoneDatabase::bundled);

/// Where a clock on the wall is: a name of the tz database such as `Europe/Berlin`, or a constant offset from UTC such as `+01:00`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Zone {
    name: String,
    zone: TimeZone,
}

/// What a time by the clock on the wall stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Civil {
    /// An instant.
    At(Instant),
    /// Nothing: the clock was set forward over it. Before that it had this offset from UTC, in s.
    Skipped {
        /// Seconds east of UTC.
        offset_s: i32,
    },
    /// An instant that 64 bits of nanoseconds do not hold.
    Beyond,
}

impl Zone {
    /// The zone as written.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.name
    }

    pub(super) fn time_zone(&self) -> TimeZone {
        self.zone.clone()
    }

    /// The instant of a time by this clock, given as if the clock were one of UTC. A time that comes twice, since the clock was set
    /// back, is the first of the two until it would not be after `last`, the instant before it that is known with the time from one
    /// to the next in ns; then it is the one that is nearer to the next.
    #[must_use]
    pub fn instant(&self, as_utc: Instant, last: Option<(Instant, i64)>) -> Civil {
        let at = Timestamp::from_nanosecond(i128::from(as_utc.as_ns()));
        let Ok(civil) = at.map(|at| Offset::UTC.to_datetime(at)) else {
            return Civil::Beyond;
        };
        let by = |offset: Offset| in_64_bits(offset, civil);
        let first = match self.zone.to_ambiguous_timestamp(civil).offset() {
            AmbiguousOffset::Unambiguous { offset } => by(offset),
            AmbiguousOffset::Gap { before, .. } => {
                return Civil::Skipped {
                    offset_s: before.seconds(),
                };
            }
            AmbiguousOffset::Fold { before, after } => match (by(before), by(after), last) {
                (Some(first), Some(second), Some((last, step_ns))) if first <= last.as_ns() => {
                    let next = last.as_ns().saturating_add(step_ns);
                    let is_nearer = second.abs_diff(next) <= first.abs_diff(next);
                    Some(if is_nearer { second } else { first })
                }
                (first, ..) => first,
            },
        };
        first.map_or(Civil::Beyond, |ns| Civil::At(Instant::from_ns(ns)))
    }
}

fn in_64_bits(offset: Offset, civil: civil::DateTime) -> Option<i64> {
    let at = offset.to_timestamp(civil).ok()?;
    i64::try_from(at.as_nanosecond()).ok()
}

impl FromStr for Zone {
    type Err = UnknownZone;

    fn from_str(text: &str) -> Result<Self, UnknownZone> {
        static PARSER: DateTimeParser = DateTimeParser::new();
        // A rule of POSIX is none of both: in it `UTC+1` is an hour west of UTC, and whoever writes that means east.
        let zone = match text.starts_with(['+', '-']) {
            true => PARSER.parse_time_zone_with(&ZONES, text).ok(),
            false => ZONES.get(text).ok(),
        };
        let zone = zone.ok_or_else(|| UnknownZone {
            nearest: offset_meant(text).or_else(|| nearest_to(text).filter(|_| !is_offset(text))),
        })?;
        let name = text.to_owned();
        Ok(Self { name, zone })
    }
}

/// Whether a text is an offset behind a name, however that is written.
fn is_offset(text: &str) -> bool {
    let upper = text.trim().to_uppercase();
    ["UTC", "GMT"].iter().any(|name| {
        let offset = upper.strip_prefix(name).map(str::trim_start);
        offset.is_some_and(|offset| offset.starts_with(['+', '-', '\u{2212}']))
    })
}

/// The offset that was meant: `+01:00` by `UTC+1`, `GMT+0100` or `+1`, and `+00:00` by `Z`.
fn offset_meant(text: &str) -> Option<String> {
    let upper = text.trim().to_uppercase();
    if upper == "Z" {
        return Some("+00:00".to_owned());
    }
    let half = upper.strip_suffix(".5").or(upper.strip_suffix(",5"));
    let upper = half.map_or_else(|| upper.clone(), |hours| format!("{hours}:30"));
    let named = ["UTC", "GMT"]
        .iter()
        .find_map(|name| upper.strip_prefix(name));
    let offset = named.unwrap_or(&upper).trim_start();
    let west = offset.strip_prefix(['-', '\u{2212}']);
    let (sign, clock) = match west {
        Some(clock) => ('-', clock),
        None => ('+', offset.strip_prefix('+')?),
    };
    let clock = clock.trim_start();
    let (hours, minutes) = match clock.split_once(':') {
        Some(parts) => parts,
        None if clock.len() > 2 => clock.split_at_checked(clock.len() - 2)?,
        None => (clock, "0"),
    };
    let [hours, minutes] = [hours.parse::<u8>().ok()?, minutes.parse().ok()?];
    (hours < 24 && minutes < 60).then(|| format!("{sign}{hours:02}:{minutes:02}"))
}

/// The zone that was meant, by its whole name or the city in it.
fn nearest_to(text: &str) -> Option<String> {
    let known: Vec<String> = ZONES.available().map(|name| name.to_string()).collect();
    let city = |name: &str| {
        name.rsplit_once('/')
            .map_or(name, |(_, city)| city)
            .to_lowercase()
    };
    let wanted = city(text);
    let of_city = known
        .iter()
        .find(|name| name.contains('/') && city(name) == wanted);
    let near = || nearest(text, known.iter().map(String::as_str)).map(str::to_owned);
    of_city.cloned().or_else(near)
}

impl fmt::Display for Zone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

/// A text that is no zone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownZone {
    /// The one that may be meant.
    pub nearest: Option<String>,
}

impl fmt::Display for UnknownZone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("there is no such time zone; ")?;
        let write = match &self.nearest {
            Some(nearest) => {
                write!(f, "did you mean \"{nearest}\"? ")?;
                "Write"
            }
            None => "write",
        };
        write!(
            f,
            "{write} one of the tz database such as \"Europe/Berlin\", or an offset such as \"+01:00\""
        )
    }
}

impl std::error::Error for UnknownZone {}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: i64 = 3_600_000_000_000;
    /// 2026-10-25T00:00:00Z, when it is two o'clock of summer time in Berlin; an hour later the clocks go back to two.
    const AUTUMN: i64 = 1_792_886_400_000_000_000;
    /// 2026-03-29T00:00:00Z; an hour later the clocks go forward from two to three.
    const SPRING: i64 = 1_774_742_400_000_000_000;

    fn berlin() -> Zone {
        "Europe/Berlin".parse().unwrap()
    }

    #[test]
    fn a_log_through_the_hour_that_comes_twice_is_read_at_its_own_instants() {
        let zone = berlin();
        for step_ns in [HOUR / 3600, HOUR / 60, HOUR / 4, HOUR / 2, HOUR, 2 * HOUR] {
            let mut last: Option<(Instant, i64)> = None;
            for at in (AUTUMN - 6 * HOUR..AUTUMN + 6 * HOUR).step_by(step_ns as usize) {
                let summer = at < AUTUMN + HOUR;
                let civil = Instant::from_ns(at + if summer { 2 } else { 1 } * HOUR);
                let at = Instant::from_ns(at);
                assert_eq!(zone.instant(civil, last), Civil::At(at), "{step_ns} {at:?}");
                last = Some((at, step_ns));
            }
        }
    }

    #[test]
    fn a_row_that_is_written_twice_or_out_of_order_is_not_taken_for_one_of_an_hour_later() {
        let zone = berlin();
        let half_past = Instant::from_ns(AUTUMN + HOUR / 2);
        let last = Some((half_past, 10_000_000_000));
        for back_s in [0, 10, 60, 600] {
            let at = Instant::from_ns(half_past.as_ns() - back_s * 1_000_000_000);
            let civil = Instant::from_ns(at.as_ns() + 2 * HOUR);
            assert_eq!(zone.instant(civil, last), Civil::At(at));
        }
    }

    #[test]
    fn an_hour_that_was_skipped_is_no_time() {
        let at = |hours: i64| berlin().instant(Instant::from_ns(SPRING + hours * HOUR), None);
        assert_eq!(at(1), Civil::At(Instant::from_ns(SPRING)));
        assert_eq!(at(2), Civil::Skipped { offset_s: 3600 });
        assert_eq!(at(3), Civil::At(Instant::from_ns(SPRING + HOUR)));
    }

    #[test]
    fn a_constant_offset_has_no_hour_twice() {
        let zone: Zone = "+05:30".parse().unwrap();
        let at = Instant::from_ns(AUTUMN);
        let civil = Instant::from_ns(AUTUMN + 11 * HOUR / 2);
        assert_eq!(zone.instant(civil, Some((at, HOUR))), Civil::At(at));
        assert_eq!(zone.to_string(), "+05:30");
    }

    #[test]
    fn the_ends_of_time_are_no_instants() {
        let zone: Zone = "-01:00".parse().unwrap();
        assert_eq!(
            zone.instant(Instant::from_ns(i64::MAX), None),
            Civil::Beyond
        );
    }

    #[test]
    fn a_zone_that_is_not_there_is_told_with_the_one_that_may_be_meant() {
        let error = |text: &str| text.parse::<Zone>().unwrap_err().to_string();
        assert!(error("Europe/Berlim").contains("did you mean \"Europe/Berlin\"?"));
        assert!(error("berlin").contains("did you mean \"Europe/Berlin\"?"));
        assert!(error("").starts_with("there is no such time zone; write one"));
    }

    #[test]
    fn an_offset_behind_a_name_is_no_zone_and_is_told_as_an_offset_alone() {
        for (text, meant) in [
            ("UTC+1", "+01:00"),
            ("UTC+01:00", "+01:00"),
            ("utc +5:30", "+05:30"),
            ("GMT-5", "-05:00"),
            ("GMT+0100", "+01:00"),
            ("UTC\u{2212}3", "-03:00"),
            ("+1", "+01:00"),
            ("UTC+5,5", "+05:30"),
            ("Z", "+00:00"),
        ] {
            let error = text.parse::<Zone>().unwrap_err().to_string();
            let expected = format!("did you mean \"{meant}\"? Write one of");
            assert!(error.contains(&expected), "{text}: {error}");
            assert!(meant.parse::<Zone>().is_ok(), "{meant}");
        }
        for rule in ["CET-1CEST", "<+03>-3", "UTC+99", "GMT+1:75", "UTC+", "+"] {
            assert!(rule.parse::<Zone>().is_err(), "{rule}");
        }
    }

    #[test]
    fn zones_of_the_database_keep_their_meaning_whatever_is_in_their_names() {
        let at = Instant::from_ns(AUTUMN);
        for (name, east_of_utc) in [("Etc/GMT+1", -1), ("GMT+0", 0), ("UTC", 0), ("-05", -5)] {
            let zone: Zone = name.parse().unwrap();
            let civil = Instant::from_ns(AUTUMN + east_of_utc * HOUR);
            assert_eq!(zone.instant(civil, None), Civil::At(at), "{name}");
        }
    }
}
