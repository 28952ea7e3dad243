//! The times of predictions as a column like that of the data. Not what a time means.

use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowTimestampType, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType,
};
use arrow_array::{ArrayRef, Float64Array, Int64Array, PrimitiveArray, StringArray};
use arrow_schema::{DataType, TimeUnit};
use athermal::Instant;

/// The times of rows, in the order of the rows.
pub enum Stamps {
    /// Whole numbers.
    Whole(Vec<Option<i64>>),
    /// Other numbers.
    Numbers(Vec<Option<f64>>),
    /// Instants in ns since 1970, by UTC or by the clock of the data, for a column of this unit and zone.
    Instants(Vec<Option<i64>>, TimeUnit, Option<Arc<str>>),
    /// Texts.
    Texts(Vec<String>),
}

impl Stamps {
    /// No times yet, like those of a column of this type; texts where several columns give the time.
    pub fn like(data_type: Option<&DataType>) -> Self {
        match data_type {
            Some(DataType::Timestamp(unit, zone)) => {
                Self::Instants(Vec::new(), *unit, zone.clone())
            }
            Some(of) if of.is_integer() => Self::Whole(Vec::new()),
            Some(of) if of.is_floating() => Self::Numbers(Vec::new()),
            _ => Self::Texts(Vec::new()),
        }
    }

    /// Adds the time of a row, as it was written and as it was understood.
    pub fn push(&mut self, text: &str, time: Instant) {
        match self {
            Self::Whole(all) => all.push(text.parse().ok()),
            Self::Numbers(all) => all.push(text.parse().ok()),
            Self::Instants(all, _, Some(_)) => all.push(Some(time.as_ns())),
            Self::Instants(all, _, None) => all.push(civil_ns(text)),
            Self::Texts(all) => all.push(text.to_owned()),
        }
    }

    /// The column.
    pub fn finish(self) -> ArrayRef {
        fn scaled<T: ArrowTimestampType>(
            all: Vec<Option<i64>>,
            zone: Option<Arc<str>>,
        ) -> ArrayRef {
            let per = ns_in(T::UNIT);
            let all = all.into_iter().map(|ns| Some(ns?.div_euclid(per)));
            let all: PrimitiveArray<T> = all.collect();
            Arc::new(all.with_timezone_opt(zone))
        }
        match self {
            Self::Whole(all) => Arc::new(Int64Array::from(all)),
            Self::Numbers(all) => Arc::new(Float64Array::from(all)),
            Self::Texts(all) => Arc::new(StringArray::from(all)),
            Self::Instants(all, unit, zone) => match unit {
                TimeUnit::Second => scaled::<TimestampSecondType>(all, zone),
                TimeUnit::Millisecond => scaled::<TimestampMillisecondType>(all, zone),
                TimeUnit::Microsecond => scaled::<TimestampMicrosecondType>(all, zone),
                TimeUnit::Nanosecond => scaled::<TimestampNanosecondType>(all, zone),
            },
        }
    }
}

fn ns_in(unit: TimeUnit) -> i64 {
    match unit {
        TimeUnit::Second => 1_000_000_000,
        TimeUnit::Millisecond => 1_000_000,
        TimeUnit::Microsecond => 1_000,
        TimeUnit::Nanosecond => 1,
    }
}

/// What a unit is called.
pub fn called(unit: TimeUnit) -> &'static str {
    match unit {
        TimeUnit::Second => "s",
        TimeUnit::Millisecond => "ms",
        TimeUnit::Microsecond => "us",
        TimeUnit::Nanosecond => "ns",
    }
}

/// What a clock showed, as if it were that of UTC.
fn civil_ns(text: &str) -> Option<i64> {
    let civil: jiff::civil::DateTime = text.parse().ok()?;
    let zoned = civil.to_zoned(jiff::tz::TimeZone::UTC).ok()?;
    i64::try_from(zoned.timestamp().as_nanosecond()).ok()
}

/// The instants of a column in ns.
pub fn ns_of(array: &ArrayRef, unit: TimeUnit) -> Vec<Option<i64>> {
    fn of<T: ArrowTimestampType>(array: &ArrayRef) -> Vec<Option<i64>> {
        let per = ns_in(T::UNIT);
        let all = array.as_primitive::<T>().iter();
        all.map(|at| at?.checked_mul(per)).collect()
    }
    match unit {
        TimeUnit::Second => of::<TimestampSecondType>(array),
        TimeUnit::Millisecond => of::<TimestampMillisecondType>(array),
        TimeUnit::Microsecond => of::<TimestampMicrosecondType>(array),
        TimeUnit::Nanosecond => of::<TimestampNanosecondType>(array),
    }
}
