//! What a value says: a number and when it was one, or why there is none.

use athermal_core::time::Instant;
use athermal_serve::connector::LeftOut;
use opcua::types::{DataValue, DateTime, StatusCode, Variant};
use schemars::JsonSchema;
use serde::Deserialize;

/// What becomes of values of uncertain quality.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Uncertain {
    /// There is none.
    #[default]
    Absent,
    /// They are taken as any other.
    Sample,
}

/// By which clock values are stamped.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Time {
    /// That of the device that measured.
    #[default]
    Source,
    /// That of the server.
    Server,
    /// That of this computer, when they arrive.
    Arrival,
}

/// A value, or why there is none.
pub type Reading = Result<f64, (LeftOut, String)>;

/// What a value says. A truth value is a number where that `is_plain`: of unit 1.
pub fn read(of: &DataValue, uncertain: Uncertain, is_plain: bool) -> Reading {
    let status = of.status.unwrap_or(StatusCode::Good);
    if status.is_bad() {
        return Err((LeftOut::BadQuality, code(status)));
    }
    if status.is_uncertain() && uncertain == Uncertain::Absent {
        return Err((LeftOut::Uncertain, code(status)));
    }
    let none = |what: &str| Err((LeftOut::NoNumber, format!("{what}, and no number")));
    match &of.value {
        None | Some(Variant::Empty) => none("nothing"),
        Some(Variant::Array(_)) => none("an array"),
        Some(Variant::String(_) | Variant::LocalizedText(_)) => none("a text"),
        Some(Variant::Boolean(value)) if is_plain => Ok(f64::from(u8::from(*value))),
        Some(Variant::Boolean(_)) => none("a truth value"),
        Some(other) => match other.as_f64() {
            Some(value) if value.is_finite() => Ok(value),
            Some(value) => none(&value.to_string()),
            None => none("a value of another type"),
        },
    }
}

/// The name of a code, without what else is said beside it.
pub fn code(status: StatusCode) -> String {
    status.sub_code().to_string()
}

/// When a value was one; none where that is not said.
pub fn stamp(of: &DataValue, time: Time, arrival: Instant) -> Option<Instant> {
    let said = match time {
        Time::Source => of.source_timestamp.or(of.server_timestamp),
        Time::Server => of.server_timestamp,
        Time::Arrival => return Some(arrival),
    };
    instant(said?)
}

/// Ticks of 100 ns from 1601 to 1970.
const TO_1970: i64 = 116_444_736_000_000_000;

fn instant(of: DateTime) -> Option<Instant> {
    let ticks = of.ticks().checked_sub(TO_1970).filter(|_| !of.is_null());
    Some(Instant::from_ns(ticks?.checked_mul(100)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(value: impl Into<Variant>, status: StatusCode) -> DataValue {
        DataValue {
            value: Some(value.into()),
            status: Some(status),
            ..DataValue::default()
        }
    }

    #[test]
    fn what_is_no_good_number_is_absent_and_says_why() {
        let (good, take) = (StatusCode::Good, Uncertain::Sample);
        let words = |of: &DataValue| read(of, Uncertain::Absent, false).unwrap_err();
        assert_eq!(read(&of(21.5, good), take, false), Ok(21.5));
        assert_eq!(read(&of(-3_i16, good), take, false), Ok(-3.0));
        assert_eq!(read(&of(true, good), take, true), Ok(1.0));
        let uncertain = of(1.0, StatusCode::UncertainLastUsableValue);
        assert_eq!(read(&uncertain, take, false), Ok(1.0));
        for (value, reason, why) in [
            (uncertain, LeftOut::Uncertain, "UncertainLastUsableValue"),
            (
                of(1.0, StatusCode::BadSensorFailure),
                LeftOut::BadQuality,
                "BadSensorFailure",
            ),
            (of(f64::NAN, good), LeftOut::NoNumber, "NaN, and no number"),
            (
                of(f64::INFINITY, good),
                LeftOut::NoNumber,
                "inf, and no number",
            ),
            (of("a", good), LeftOut::NoNumber, "a text, and no number"),
            (
                of(vec![1.0, 2.0], good),
                LeftOut::NoNumber,
                "an array, and no number",
            ),
            (
                of(true, good),
                LeftOut::NoNumber,
                "a truth value, and no number",
            ),
            (
                DataValue::default(),
                LeftOut::NoNumber,
                "nothing, and no number",
            ),
        ] {
            assert_eq!(words(&value), (reason, why.to_owned()));
        }
        assert_eq!(code(StatusCode::from(0x80ff_0000)), "Invalid");
    }

    fn date_time(at: Instant) -> DateTime {
        DateTime::from(at.as_ns() / 100 + TO_1970)
    }

    #[test]
    fn a_stamp_is_that_of_the_source_the_server_or_the_arrival() {
        let at = Instant::from_ns(1_764_279_677_123_456_700);
        let earlier = Instant::from_ns(1_000_000_000);
        let mut value = of(1.0, StatusCode::Good);
        assert_eq!(stamp(&value, Time::Source, at), None);
        assert_eq!(stamp(&value, Time::Arrival, at), Some(at));
        value.server_timestamp = Some(date_time(at));
        assert_eq!(stamp(&value, Time::Source, earlier), Some(at));
        value.source_timestamp = Some(date_time(earlier));
        assert_eq!(stamp(&value, Time::Source, at), Some(earlier));
        assert_eq!(stamp(&value, Time::Server, earlier), Some(at));
        for ticks in [0, i64::MAX] {
            value.source_timestamp = Some(DateTime::from(ticks));
            assert_eq!(stamp(&value, Time::Source, at), None);
        }
    }
}
