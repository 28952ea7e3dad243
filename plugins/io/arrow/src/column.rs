//! Columns of Arrow as numbers, instants and texts.

use std::fmt::Display;
use std::io::Write;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, ArrowTimestampType, Date32Type, Date64Type, Decimal32Type, Decimal64Type,
    Decimal128Type, Decimal256Type, DecimalType, DurationMicrosecondType, DurationMillisecondType,
    DurationNanosecondType, DurationSecondType, Float16Type, Float32Type, Float64Type, Int8Type,
    Int16Type, Int32Type, Int64Type, Time32MillisecondType, Time32SecondType,
    Time64MicrosecondType, Time64NanosecondType, TimestampMicrosecondType,
    TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type,
    UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, PrimitiveArray};
use arrow_schema::{DataType, TimeUnit};
use athermal_files::{number, text_of};

use crate::stamp::Stamp;

/// The powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

const DAY_NS: i64 = 86_400_000_000_000;

fn ns_in(unit: TimeUnit) -> i64 {
    match unit {
        TimeUnit::Second => 1_000_000_000,
        TimeUnit::Millisecond => 1_000_000,
        TimeUnit::Microsecond => 1_000,
        TimeUnit::Nanosecond => 1,
    }
}

/// Refuses a column that has no numbers.
pub(crate) fn check_numbers(name: &str, data_type: &DataType) -> Result<(), String> {
    let what = match data_type {
        DataType::Null
        | DataType::Boolean
        | DataType::Utf8
        | DataType::LargeUtf8
        | DataType::Utf8View => return Ok(()),
        of if of.is_numeric() => return Ok(()),
        DataType::Dictionary(_, values) => return check_numbers(name, values),
        DataType::Duration(_) => "has durations",
        of if of.is_temporal() => "has times",
        DataType::Struct(_) | DataType::Map(..) | DataType::Union(..) => {
            "has several values in a row"
        }
        of if of.is_nested() => "has lists",
        _ => "has no numbers",
    };
    Err(format!(
        "the column `{name}` {what} ({data_type}); a channel is read from a column of numbers"
    ))
}

/// Puts the numbers of a column, by their rows; a row that is passed over has none. A text that is no number is refused.
pub(crate) fn numbers(
    array: &ArrayRef,
    put: &mut impl FnMut(usize, f64),
    refuse: &mut impl FnMut(usize, String),
) {
    let DataType::Dictionary(..) = array.data_type() else {
        return plain(array, put, refuse);
    };
    let dictionary = array.as_any_dictionary();
    let values = dictionary.values();
    if values.is_empty() {
        return;
    }
    let mut known = vec![f64::NAN; values.len()];
    let mut strange = vec![None; values.len()];
    plain(
        values,
        &mut |at, value| known[at] = value,
        &mut |at, text| strange[at] = Some(text),
    );
    for (row, at) in dictionary.normalized_keys().into_iter().enumerate() {
        if dictionary.keys().is_null(row) {
            continue;
        }
        put(row, known[at]);
        if let Some(text) = &strange[at] {
            refuse(row, text.clone());
        }
    }
}

/// The same of a column that is no dictionary.
fn plain(
    array: &ArrayRef,
    put: &mut impl FnMut(usize, f64),
    refuse: &mut impl FnMut(usize, String),
) {
    match array.data_type() {
        DataType::Float64 => primitive::<Float64Type>(array, |value| value, put),
        DataType::Float32 => primitive::<Float32Type>(array, f64::from, put),
        DataType::Float16 => primitive::<Float16Type>(array, |value| value.to_f64(), put),
        DataType::Int8 => primitive::<Int8Type>(array, f64::from, put),
        DataType::Int16 => primitive::<Int16Type>(array, f64::from, put),
        DataType::Int32 => primitive::<Int32Type>(array, f64::from, put),
        DataType::Int64 => primitive::<Int64Type>(array, |value| value as f64, put),
        DataType::UInt8 => primitive::<UInt8Type>(array, f64::from, put),
        DataType::UInt16 => primitive::<UInt16Type>(array, f64::from, put),
        DataType::UInt32 => primitive::<UInt32Type>(array, f64::from, put),
        DataType::UInt64 => primitive::<UInt64Type>(array, |value| value as f64, put),
        DataType::Decimal32(precision, scale) => {
            let value =
                |value| decimal::<Decimal32Type>(value, i128::from(value), *precision, *scale);
            primitive::<Decimal32Type>(array, value, put);
        }
        DataType::Decimal64(precision, scale) => {
            let value =
                |value| decimal::<Decimal64Type>(value, i128::from(value), *precision, *scale);
            primitive::<Decimal64Type>(array, value, put);
        }
        DataType::Decimal128(precision, scale) => {
            let value = |value| decimal::<Decimal128Type>(value, value, *precision, *scale);
            primitive::<Decimal128Type>(array, value, put);
        }
        DataType::Decimal256(precision, scale) => {
            // Beyond what is exact in any case: its text is read.
            let value = |value| decimal::<Decimal256Type>(value, i128::MAX, *precision, *scale);
            primitive::<Decimal256Type>(array, value, put);
        }
        DataType::Boolean => {
            let flags = array.as_boolean();
            for (row, flag) in flags.iter().enumerate() {
                put(row, flag.map_or(f64::NAN, f64::from));
            }
        }
        DataType::Utf8 => texts(array.as_string::<i32>().iter(), put, refuse),
        DataType::LargeUtf8 => texts(array.as_string::<i64>().iter(), put, refuse),
        DataType::Utf8View => texts(array.as_string_view().iter(), put, refuse),
        // Refused before.
        _ => {}
    }
}

fn primitive<T: ArrowPrimitiveType>(
    array: &ArrayRef,
    value: impl Fn(T::Native) -> f64,
    put: &mut impl FnMut(usize, f64),
) {
    let array: &PrimitiveArray<T> = array.as_primitive();
    if array.null_count() == 0 {
        for (row, of) in array.values().iter().enumerate() {
            put(row, value(*of));
        }
    } else {
        for (row, of) in array.iter().enumerate() {
            put(row, of.map_or(f64::NAN, &value));
        }
    }
}

/// A decimal as the nearest double, as its text is read: a quotient of two numbers that are exact is rounded once.
fn decimal<T: DecimalType>(value: T::Native, whole: i128, precision: u8, scale: i8) -> f64 {
    const EXACT: i128 = 1 << 53;
    let power = usize::try_from(scale).ok().and_then(|at| POWERS.get(at));
    match power {
        Some(power) if whole.abs() <= EXACT => whole as f64 / power,
        _ => number(T::format_decimal(value, precision, scale).as_bytes()).unwrap_or(f64::NAN),
    }
}

fn texts<'a>(
    all: impl Iterator<Item = Option<&'a str>>,
    put: &mut impl FnMut(usize, f64),
    refuse: &mut impl FnMut(usize, String),
) {
    for (row, text) in all.enumerate() {
        match text.map(|text| (text, number(text.as_bytes()))) {
            None => {}
            Some((_, Some(value))) => put(row, value),
            Some((text, None)) => refuse(row, text.to_owned()),
        }
    }
}

/// The instants of a batch, in ns since 1970; none where a row has none, or one beyond 64 bits.
pub(crate) struct Instants {
    ns: Vec<Option<i64>>,
    /// Whether they are of UTC, and not by a clock of which is not said where it stands.
    pub is_utc: bool,
}

impl Instants {
    /// Those of a column that has instants.
    pub fn of(array: &ArrayRef) -> Option<Self> {
        let (ns, is_utc) = match array.data_type() {
            DataType::Timestamp(unit, zone) => (stamps(array, *unit), zone.is_some()),
            DataType::Date32 => (scaled::<Date32Type>(array, DAY_NS, i64::from), false),
            DataType::Date64 => (scaled::<Date64Type>(array, 1_000_000, |ms| ms), false),
            _ => return None,
        };
        Some(Self { ns, is_utc })
    }

    /// That of a row.
    pub fn at(&self, row: usize) -> Option<i64> {
        self.ns.get(row).copied().flatten()
    }
}

fn stamps(array: &ArrayRef, unit: TimeUnit) -> Vec<Option<i64>> {
    fn of<T: ArrowTimestampType>(array: &ArrayRef) -> Vec<Option<i64>> {
        scaled::<T>(array, ns_in(T::UNIT), |value| value)
    }
    match unit {
        TimeUnit::Second => of::<TimestampSecondType>(array),
        TimeUnit::Millisecond => of::<TimestampMillisecondType>(array),
        TimeUnit::Microsecond => of::<TimestampMicrosecondType>(array),
        TimeUnit::Nanosecond => of::<TimestampNanosecondType>(array),
    }
}

fn scaled<T: ArrowPrimitiveType>(
    array: &ArrayRef,
    ns_per_unit: i64,
    value: impl Fn(T::Native) -> i64,
) -> Vec<Option<i64>> {
    let array: &PrimitiveArray<T> = array.as_primitive();
    let ns = |of| value(of).checked_mul(ns_per_unit);
    array.iter().map(|of| of.and_then(ns)).collect()
}

/// Writes a cell as a text, as a log would have it; nothing where there is none.
pub(crate) fn write(array: &ArrayRef, row: usize, stamp: &mut Stamp, cell: &mut Vec<u8>) {
    if array.is_null(row) {
        return;
    }
    match array.data_type() {
        of @ (DataType::Timestamp(..) | DataType::Date32 | DataType::Date64) => {
            let instants = Instants::of(&array.slice(row, 1));
            let at = instants.and_then(|of| Some((of.at(0)?, of.is_utc)));
            let text = at.map_or("", |(ns, is_utc)| stamp.write(ns, is_utc));
            let date = text.get(..10).filter(|_| *of == DataType::Date32);
            cell.extend_from_slice(date.unwrap_or(text).as_bytes());
        }
        DataType::Utf8 => cell.extend_from_slice(array.as_string::<i32>().value(row).as_bytes()),
        DataType::LargeUtf8 => {
            cell.extend_from_slice(array.as_string::<i64>().value(row).as_bytes());
        }
        DataType::Utf8View => {
            cell.extend_from_slice(array.as_string_view().value(row).as_bytes());
        }
        DataType::Boolean => {
            whole(array.as_boolean().value(row), cell);
        }
        DataType::Dictionary(..) => {
            let one = array.slice(row, 1);
            let dictionary = one.as_any_dictionary();
            // Keys are whole numbers of any width, put in order all at once.
            for at in dictionary.normalized_keys() {
                write(dictionary.values(), at, stamp, cell);
            }
        }
        DataType::Decimal128(..) => {
            let text = array.as_primitive::<Decimal128Type>().value_as_string(row);
            cell.extend_from_slice(text.as_bytes());
        }
        DataType::Int64 => whole(array.as_primitive::<Int64Type>().value(row), cell),
        DataType::UInt64 => whole(array.as_primitive::<UInt64Type>().value(row), cell),
        DataType::Time32(TimeUnit::Second) => {
            clock(
                i64::from(array.as_primitive::<Time32SecondType>().value(row)),
                TimeUnit::Second,
                cell,
            );
        }
        DataType::Time32(_) => {
            clock(
                i64::from(array.as_primitive::<Time32MillisecondType>().value(row)),
                TimeUnit::Millisecond,
                cell,
            );
        }
        DataType::Time64(TimeUnit::Microsecond) => {
            clock(
                array.as_primitive::<Time64MicrosecondType>().value(row),
                TimeUnit::Microsecond,
                cell,
            );
        }
        DataType::Time64(_) => {
            clock(
                array.as_primitive::<Time64NanosecondType>().value(row),
                TimeUnit::Nanosecond,
                cell,
            );
        }
        DataType::Duration(unit) => {
            let value = match unit {
                TimeUnit::Second => array.as_primitive::<DurationSecondType>().value(row),
                TimeUnit::Millisecond => array.as_primitive::<DurationMillisecondType>().value(row),
                TimeUnit::Microsecond => array.as_primitive::<DurationMicrosecondType>().value(row),
                TimeUnit::Nanosecond => array.as_primitive::<DurationNanosecondType>().value(row),
            };
            seconds(i128::from(value) * i128::from(ns_in(*unit)), cell);
        }
        _ => {
            let mut value = f64::NAN;
            numbers(
                &array.slice(row, 1),
                &mut |_, of| value = of,
                &mut |_, _| {},
            );
            cell.extend_from_slice(text_of(value, &mut zmij::Buffer::new()).as_bytes());
        }
    }
}

// Writing to a `Vec` cannot fail.

fn whole(value: impl Display, cell: &mut Vec<u8>) {
    let _ = write!(cell, "{value}");
}

fn clock(value: i64, unit: TimeUnit, cell: &mut Vec<u8>) {
    let ns = value.saturating_mul(ns_in(unit));
    let (seconds, ns) = (ns / 1_000_000_000, ns % 1_000_000_000);
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    let _ = write!(cell, "{hours:02}:{minutes:02}:{seconds:02}.{ns:09}");
}

fn seconds(ns: i128, cell: &mut Vec<u8>) {
    let sign = if ns < 0 { "-" } else { "" };
    let ns = ns.abs();
    let _ = write!(
        cell,
        "{sign}{}.{:09}",
        ns / 1_000_000_000,
        ns % 1_000_000_000
    );
}
