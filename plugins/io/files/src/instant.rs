//! A time cell as nanoseconds. Not whether time may step back there.

use jiff::Timestamp;
use jiff::fmt::temporal::DateTimeParser;
use jiff::tz::Offset;

use athermal_core::time::{Civil, Instant};

use crate::decimal::Decimal;
use crate::{TimeColumn, TimeForm};

/// A civil date is ten characters long; only behind it can a sign belong to an offset.
const DATE_LENGTH: usize = 10;

/// Behind a date and time these say that it is UTC.
const WORDS_OF_UTC: [&[u8]; 4] = [b" UTC", b" GMT", b"UTC", b" Z"];

impl TimeColumn {
    /// What a trimmed cell stands for, or `None` if it is not of this form. Where times come twice, `last` says which is meant: the
    /// instant before, with the time from one to the next in ns.
    #[must_use]
    pub fn read(&self, text: &[u8], last: Option<(Instant, i64)>) -> Option<Civil> {
        let Some(ns) = self.form.read(text) else {
            return self.form.is_beyond(text).then_some(Civil::Beyond);
        };
        let at = Instant::from_ns(ns);
        Some(match &self.zone {
            Some(zone) if self.form.is_zoned(text) == Some(false) => zone.instant(at, last),
            _ => Civil::At(at),
        })
    }
}

impl TimeColumn {
    /// An instant in this form, so that it reads back; empty where that is a decimal number of seconds, as [`Writer`](crate::Writer)
    /// writes by itself. A date without an offset is one by the clock of the zone.
    #[must_use]
    pub fn write(&self, at: Instant) -> String {
        match &self.form {
            form if *form == TimeForm::SECONDS => String::new(),
            TimeForm::Numbers { ns_per_unit } => number(i128::from(at.as_ns()), *ns_per_unit),
            TimeForm::Samples { step_ns } => number(i128::from(at.as_ns()), *step_ns),
            TimeForm::Since {
                ns_per_unit,
                origin_ns,
            } => number(i128::from(at.as_ns()) + origin_ns, *ns_per_unit),
            TimeForm::Elapsed => {
                let seconds = at.as_ns().unsigned_abs();
                let (minutes, ns) = (seconds / 60_000_000_000, seconds % 60_000_000_000);
                let sign = if at.as_ns() < 0 { "-" } else { "" };
                let (hours, minutes) = (minutes / 60, minutes % 60);
                let (seconds, ns) = (ns / 1_000_000_000, ns % 1_000_000_000);
                let text = format!("{sign}{hours}:{minutes:02}:{seconds:02}.{ns:09}");
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            }
            TimeForm::Rfc3339 => rfc3339(at),
            TimeForm::Format(format) => {
                let written = format.write(at, self.zone.as_ref());
                written.unwrap_or_else(|| rfc3339(at))
            }
        }
    }
}

fn rfc3339(at: Instant) -> String {
    let at = Timestamp::from_nanosecond(i128::from(at.as_ns()));
    at.map_or_else(|_| String::new(), |at| at.to_string())
}

/// A quotient in decimals, exact up to 18 of them.
fn number(ns: i128, unit: i64) -> String {
    let unit = i128::from(unit.max(1));
    let sign = if ns < 0 { "-" } else { "" };
    let (whole, mut rest) = (ns.abs() / unit, ns.abs() % unit);
    let mut text = format!("{sign}{whole}");
    if rest > 0 {
        text.push('.');
        for _ in 0..18 {
            rest *= 10;
            text.push_str(&(rest / unit).to_string());
            rest %= unit;
            if rest == 0 {
                break;
            }
        }
    }
    text
}

impl TimeForm {
    /// The instant in ns that a trimmed cell stands for, or `None` if it is not of this form or does not fit into 64 bits. A date and
    /// time that has no offset is one of UTC.
    #[must_use]
    pub fn read(&self, text: &[u8]) -> Option<i64> {
        match *self {
            Self::Numbers { ns_per_unit } => Decimal::parse(text)?.times(ns_per_unit),
            Self::Samples { step_ns } => {
                let number = Decimal::parse(text)?;
                number.is_whole().then(|| number.times(step_ns))?
            }
            Self::Rfc3339 => i64::try_from(timestamp(text)?.as_nanosecond()).ok(),
            Self::Elapsed => i64::try_from(elapsed(text)?).ok(),
            Self::Since {
                ns_per_unit,
                origin_ns,
            } => {
                let since = Decimal::parse(text)?.product(ns_per_unit)?;
                i64::try_from(since.checked_sub(origin_ns)?).ok()
            }
            Self::Format(ref format) => i64::try_from(format.read(text)?).ok(),
        }
    }

    /// Whether a cell is of this form, and its instant does not fit into 64 bits.
    fn is_beyond(&self, text: &[u8]) -> bool {
        let is_of_form = match self {
            Self::Format(format) => format.read(text).is_some(),
            Self::Numbers { .. } | Self::Since { .. } => Decimal::parse(text).is_some(),
            Self::Elapsed => elapsed(text).is_some(),
            Self::Samples { .. } => Decimal::parse(text).is_some_and(Decimal::is_whole),
            Self::Rfc3339 => timestamp(text).is_some(),
        };
        is_of_form && self.read(text).is_none()
    }

    /// Whether a date and time of this form says how far it is from UTC; nothing where the form is none of dates.
    pub(crate) fn is_zoned(&self, text: &[u8]) -> Option<bool> {
        match self {
            Self::Rfc3339 => Some(has_zone(text)),
            Self::Format(format) => Some(format.has_offset()),
            Self::Numbers { .. } | Self::Samples { .. } | Self::Elapsed | Self::Since { .. } => {
                None
            }
        }
    }

    /// What a cell should look like, for a message.
    pub(crate) fn expected(&self) -> String {
        match self {
            Self::Numbers { .. } | Self::Since { .. } => "a decimal number".to_owned(),
            Self::Elapsed => "hours, minutes and seconds such as 29:59:00".to_owned(),
            Self::Samples { .. } => "a whole sample number".to_owned(),
            Self::Rfc3339 => "a date and time such as 2013-07-04T00:00:00Z".to_owned(),
            Self::Format(format) => format!("a date and time as `{format}` says"),
        }
    }
}

/// Whether a date and time says how far it is from UTC. The name of a region in brackets does not: twice a year it says two things.
#[must_use]
pub fn has_zone(text: &[u8]) -> bool {
    if is_in_utc(text).is_some() {
        return true;
    }
    let behind_date = text.iter().skip(DATE_LENGTH);
    let mut clock = behind_date.take_while(|b| **b != b'[');
    clock.any(|b| matches!(b, b'Z' | b'z' | b'+' | b'-'))
}

/// Whether a text has hours and minutes in it.
#[must_use]
pub fn has_clock(text: &str) -> bool {
    let mut around = text.as_bytes().windows(3);
    around.any(|of| of[1] == b':' && of[0].is_ascii_digit() && of[2].is_ascii_digit())
}

/// Whether a text is a time of day such as `12:00:00,5` or `12:00 PM`, without a date.
#[must_use]
pub fn is_time_of_day(text: &str) -> bool {
    let halves = ["am", "pm", "AM", "PM"];
    let half = halves.iter().find_map(|half| text.strip_suffix(half));
    let clock = half.map_or(text, str::trim_end);
    let is_part = |b: u8| b.is_ascii_digit() || b":.,".contains(&b);
    has_clock(clock) && clock.bytes().all(is_part)
}

/// The date and time before a word that says UTC.
fn is_in_utc(text: &[u8]) -> Option<&[u8]> {
    let last = text.last()?;
    if !b"CTZ".contains(last) {
        return None;
    }
    let mut words = WORDS_OF_UTC.iter();
    words.find_map(|word| text.strip_suffix(*word))
}

/// The time in ns that hours, minutes and seconds say, with days before them or without.
fn elapsed(text: &[u8]) -> Option<i128> {
    let text = std::str::from_utf8(text).ok()?;
    let (sign, text) = match text.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, text),
    };
    let (before, clock) = match text.rsplit_once(' ') {
        Some((days, clock)) => {
            let (number, word) = days.split_once(' ').unwrap_or((days, "d"));
            let is_day = ["d", "day", "days", "day,", "days,"].contains(&word);
            (is_day.then_some(number)?, clock)
        }
        None => match text.split_once(':')?.0.split_once('.') {
            Some((days, _)) => (days, &text[days.len() + 1..]),
            None => ("0", text),
        },
    };
    let whole = |part: &str| {
        let digits = !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        digits.then(|| part.parse::<i64>().ok())?.map(i128::from)
    };
    let mut parts = clock.splitn(3, ':');
    let (hours, minutes) = (whole(parts.next()?)?, whole(parts.next()?)?);
    let seconds = parts.next().unwrap_or("0");
    let begins = seconds.starts_with(|first: char| first.is_ascii_digit());
    let seconds = Decimal::parse(seconds.as_bytes()).filter(|_| begins)?;
    let seconds = seconds.product(1_000_000_000)?;
    let is_clock = minutes < 60 && (0..60_000_000_000).contains(&seconds);
    let minutes = (whole(before)? * 24 + hours) * 60 + minutes;
    is_clock.then_some(sign * (minutes * 60_000_000_000 + seconds))
}

fn timestamp(text: &[u8]) -> Option<Timestamp> {
    static PARSER: DateTimeParser = DateTimeParser::new();
    if let Some(civil) = is_in_utc(text) {
        let civil = PARSER.parse_datetime(civil.trim_ascii_end()).ok();
        return civil.and_then(|civil| Offset::UTC.to_timestamp(civil).ok());
    }
    // Some write the offset apart.
    if let Some(at) = text.iter().rposition(|byte| *byte == b' ')
        && at > DATE_LENGTH
        && matches!(text.get(at + 1), Some(b'+' | b'-'))
    {
        let whole = [&text[..at], &text[at + 1..]].concat();
        return PARSER.parse_timestamp(&whole).ok();
    }
    if has_zone(text) {
        return PARSER.parse_timestamp(text).ok();
    }
    if text.contains(&b'[') {
        // The parser passes over the name, and the time is not the one of UTC.
        return None;
    }
    let civil = PARSER.parse_datetime(text).ok()?;
    Offset::UTC.to_timestamp(civil).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2013-07-04T00:00:00Z: 15,890 days after 1970-01-01.
    const DAY: i64 = 15_890 * 86_400 * 1_000_000_000;

    #[test]
    fn text_without_a_zone_is_utc() {
        for text in [
            "2013-07-04",
            "2013-07-04 00:00:00",
            "2013-07-04T00:00",
            "2013-07-04T00:00:00Z",
        ] {
            assert_eq!(TimeForm::Rfc3339.read(text.as_bytes()), Some(DAY), "{text}");
        }
    }

    #[test]
    fn a_word_or_an_offset_apart_says_the_zone() {
        let two_hours = 7_200_000_000_000;
        for (text, ns) in [
            ("2013-07-04 00:00:00 UTC", DAY),
            ("2013-07-04T00:00:00UTC", DAY),
            ("2013-07-04 00:00 GMT", DAY),
            ("2013-07-04 00:00:00 Z", DAY),
            ("2013-07-04 00:00:00 +02:00", DAY - two_hours),
            ("2013-07-04 00:00:00 -0200", DAY + two_hours),
        ] {
            assert_eq!(TimeForm::Rfc3339.read(text.as_bytes()), Some(ns), "{text}");
            assert!(has_zone(text.as_bytes()), "{text}");
        }
        assert_eq!(TimeForm::Rfc3339.read(b" UTC"), None);
        assert_eq!(TimeForm::Rfc3339.read(b"2013-07-04 00:00:00 CET"), None);
    }

    #[test]
    fn elapsed_times_go_beyond_a_day_and_other_times_have_origins_of_their_own() {
        let read = |text: &str| TimeForm::Elapsed.read(text.as_bytes());
        let hours = |hours: i64| Some(hours * 3_600_000_000_000);
        for (text, ns) in [
            ("29:00:00", hours(29)),
            ("1.05:00:00", hours(29)),
            ("1 05:00:00", hours(29)),
            ("1 day, 5:00:00", hours(29)),
            ("2 days 05:00:00.0", hours(53)),
            ("0:00:00.5", Some(500_000_000)),
            ("-1:00", hours(-1)),
            ("1:60:00", None),
            ("1:00:60", None),
            ("1 week 1:00:00", None),
            ("1::00", None),
            ("12", None),
            ("99999999999999999999:00:00", None),
        ] {
            assert_eq!(read(text), ns, "{text}");
        }
        for (ns_per_unit, origin_ns, text) in [
            (100, 11_644_473_600_000_000_000, "130173696000000000"),
            (100, 62_135_596_800_000_000_000, "635084928000000000"),
            (86_400_000_000_000, 210_866_760_000_000_000_000, "2456477.5"),
        ] {
            let form = TimeForm::Since {
                ns_per_unit,
                origin_ns,
            };
            assert_eq!(form.read(text.as_bytes()), Some(DAY), "{text}");
            assert_eq!(form.read(b"1e99"), None);
        }
    }

    #[test]
    fn an_offset_is_taken_into_account() {
        let two_hours = 7_200_000_000_000;
        assert_eq!(
            TimeForm::Rfc3339.read(b"2013-07-04T00:00:00.5+02:00"),
            Some(DAY - two_hours + 500_000_000)
        );
        assert_eq!(
            TimeForm::Rfc3339.read(b"2013-07-04 00:00:00-02:00"),
            Some(DAY + two_hours)
        );
    }

    #[test]
    fn a_region_without_an_offset_is_no_instant_and_is_not_taken_for_utc() {
        let read = |text: &str| TimeForm::Rfc3339.read(text.as_bytes());
        assert_eq!(read("2013-07-04T00:00:00[Europe/Berlin]"), None);
        assert_eq!(read("2013-07-04T00:00:00[America/Port-au-Prince]"), None);
        assert_eq!(read("2013-07-04T02:00:00+02:00[Europe/Berlin]"), Some(DAY));
    }

    #[test]
    fn sample_numbers_count_steps_and_must_be_whole() {
        let form = TimeForm::Samples {
            step_ns: 80_000_000,
        };
        assert_eq!(form.read(b"999"), Some(79_920_000_000));
        assert_eq!(form.read(b"3.0"), Some(240_000_000));
        assert_eq!(form.read(b"3.5"), None);
    }

    #[test]
    fn a_time_beyond_64_bits_of_nanoseconds_is_refused_and_told_from_what_is_none() {
        let seconds = TimeForm::SECONDS;
        for (form, text, beyond) in [
            (&TimeForm::Rfc3339, "2400-01-01T00:00:00Z", true),
            (&TimeForm::Rfc3339, "yesterday", false),
            (&seconds, "9223372046", true),
            (&seconds, "-1e300", true),
            (&seconds, "1h", false),
        ] {
            assert_eq!(form.read(text.as_bytes()), None, "{text}");
            assert_eq!(form.is_beyond(text.as_bytes()), beyond, "{text}");
        }
        assert!(!seconds.is_beyond(b"9223372036"));
    }
}
