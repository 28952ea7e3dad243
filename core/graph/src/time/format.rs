//! Dates and times in the form of one's own choice; which file has which is decided elsewhere.

use std::fmt;
use std::str::FromStr;

use jiff::Timestamp;
use jiff::civil::{DateTime, date};
use jiff::fmt::strtime::{self, BrokenDownTime};
use jiff::tz::{Offset, TimeZone};

use super::{Instant, Zone};

/// How dates and times are written, in the letters of `strptime` (POSIX.1-2017, and `%f` for fractions of a second):
/// `%d.%m.%Y %H:%M:%S`.
///
/// A time without its offset from UTC (`%z`) is UTC.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct TimeFormat(String);

/// A time of whose parts no two are alike, so that a format which leaves one out does not give it back.
const PROBE: DateTime = date(2031, 10, 28).at(17, 46, 39, 0);

impl TimeFormat {
    /// Nanoseconds since 1970-01-01T00:00:00Z; none for a text of another form.
    #[must_use]
    pub fn read(&self, text: &[u8]) -> Option<i128> {
        let parts = BrokenDownTime::parse(&self.0, text).ok()?;
        if parts.iana_time_zone().is_some() {
            // The name of a region is ambiguous twice a year.
            return None;
        }
        let offset = parts.offset().unwrap_or(Offset::UTC);
        let civil = parts.to_datetime().ok()?;
        Some(offset.to_timestamp(civil).ok()?.as_nanosecond())
    }

    /// An instant in this form, by the clock of a zone, or of UTC without; none beyond the years that have four digits.
    #[must_use]
    pub fn write(&self, at: Instant, zone: Option<&Zone>) -> Option<String> {
        let at = Timestamp::from_nanosecond(i128::from(at.as_ns())).ok()?;
        let zone = zone.map_or(TimeZone::UTC, Zone::time_zone);
        strtime::format(&self.0, &at.to_zoned(zone)).ok()
    }

    /// Whether times of this format have their offset from UTC.
    #[must_use]
    pub fn has_offset(&self) -> bool {
        ["%z", "%:z", "%::z", "%:::z"]
            .iter()
            .any(|offset| self.0.contains(offset))
    }

    /// The format as written.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    fn probe(&self) -> Result<(), TimeFormatError> {
        let probe = PROBE.to_zoned(TimeZone::UTC);
        let probe = probe.map_err(|_| TimeFormatError::Incomplete)?;
        let unknown = |error: jiff::Error| {
            let (text, formatting) = (error.to_string(), "strftime formatting failed: ");
            TimeFormatError::Unknown(text.strip_prefix(formatting).unwrap_or(&text).to_owned())
        };
        let written = strtime::format(&self.0, &probe).map_err(unknown)?;
        let to_the_minute = |ns: i128| ns.div_euclid(60_000_000_000);
        let read = self.read(written.as_bytes()).map(to_the_minute);
        if read == Some(to_the_minute(probe.timestamp().as_nanosecond())) {
            Ok(())
        } else {
            Err(TimeFormatError::Incomplete)
        }
    }
}

impl FromStr for TimeFormat {
    type Err = TimeFormatError;

    fn from_str(text: &str) -> Result<Self, TimeFormatError> {
        let format = Self(text.to_owned());
        format.probe().map(|()| format)
    }
}

impl fmt::Display for TimeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Why a text is no format of dates and times.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TimeFormatError {
    /// It has a letter that is not known.
    Unknown(String),
    /// What is written by it cannot be read back to the minute.
    Incomplete,
}

impl fmt::Display for TimeFormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(reason) => write!(f, "{reason}; ")?,
            Self::Incomplete => write!(f, "it does not give a whole date and time; ")?,
        }
        write!(
            f,
            "write year, month, day, hour and minute as strptime does, e.g. \"%d.%m.%Y %H:%M:%S\""
        )
    }
}

impl std::error::Error for TimeFormatError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2026-03-01T12:00:00Z.
    const NOON: i128 = 1_772_366_400_000_000_000;

    #[test]
    fn dates_and_times_are_read_as_the_format_says() {
        for (format, text, after_noon_ns) in [
            ("%d.%m.%Y %H:%M:%S", "01.03.2026 12:00:00", 0),
            (
                "%d.%m.%Y %H:%M:%S%.f",
                "01.03.2026 12:00:00.25",
                250_000_000,
            ),
            ("%d.%m.%Y %H:%M:%S%.f", "01.03.2026 12:00:00", 0),
            (
                "%m/%d/%Y %I:%M:%S %p",
                "3/1/2026 12:00:01 PM",
                1_000_000_000,
            ),
            ("%d-%b-%y %H:%M", "01-Mar-26 12:00", 0),
            ("%Y%m%d%H%M%S", "20260301120000", 0),
            ("%d.%m.%Y %H:%M %z", "01.03.2026 14:00 +0200", 0),
        ] {
            let format: TimeFormat = format.parse().unwrap();
            let read = format.read(text.as_bytes());
            assert_eq!(read, Some(NOON + after_noon_ns), "{text}");
        }
    }

    #[test]
    fn a_text_of_another_form_is_no_time() {
        let format: TimeFormat = "%d.%m.%Y %H:%M:%S".parse().unwrap();
        for text in ["", "12.5", "2026-03-01 12:00:00", "31.02.2026 12:00:00"] {
            assert_eq!(format.read(text.as_bytes()), None, "{text}");
        }
        assert_eq!(format.read(b"\xff"), None);
    }

    #[test]
    fn a_format_that_leaves_the_instant_open_is_refused() {
        for format in ["", "%H:%M:%S", "%d.%m.%Y", "%d.%m. %H:%M", "%d.%m.%Y %I:%M"] {
            let refused = format.parse::<TimeFormat>();
            assert_eq!(refused, Err(TimeFormatError::Incomplete), "{format}");
        }
        for format in ["%d.%m.%Y %H:%M %Q", "DD.MM.YYYY hh:mm"] {
            assert!(format.parse::<TimeFormat>().is_err(), "{format}");
        }
        let unknown = "%d.%m.%Y %K".parse::<TimeFormat>().unwrap_err();
        assert!(matches!(unknown, TimeFormatError::Unknown(_)));
        assert!(unknown.to_string().contains("directive `K`"), "{unknown}");
    }
}
