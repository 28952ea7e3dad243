//! Decides whether a node keeps its answers when what it reads comes in other units.

use super::super::case::Given;
use super::super::fixture::Fixture;
use super::Subject;
use crate::recording::Table;
use crate::unit::Unit;

/// How far outputs may be apart, as a share of their largest.
const ROUNDING: f64 = 1e-7;

pub(super) fn units(subject: &Subject<'_>) -> Result<(), String> {
    let given: Vec<Given> = subject
        .given
        .iter()
        .map(|given| {
            let mut ports = (subject.kind.inputs)().iter();
            let stated = ports.any(|port| port.name == given.port && port.unit.is_some());
            in_another_unit(given, stated)
        })
        .collect();
    if given
        .iter()
        .zip(&subject.given)
        .all(|(new, old)| new.unit == old.unit)
    {
        return Ok(());
    }
    let units: Vec<_> = given
        .iter()
        .zip(&subject.given)
        .filter(|(new, old)| new.unit != old.unit)
        .map(|(new, old)| format!("{} in {} rather than {}", new.port, new.unit, old.unit))
        .collect();
    let units = units.join(", ");
    let fixture = Fixture::new(subject.kind, &subject.parameters, &given)
        .map_err(|error| format!("with {units} the graph is refused: {error}"))?;
    let table = converted(&subject.table, &subject.given, &given)?;
    let other = subject.fed(given, fixture, table).fitted();
    let other = other.map_err(|found| format!("with {units}, {found}"))?;
    let (one, two) = (subject.usual(), other.usual());
    for (number, slot) in subject.fixture.slots().enumerate() {
        let unit = &subject.fixture.plan.channels[slot].channel.unit;
        let other_unit = &other.fixture.plan.channels[slot].channel.unit;
        let largest = one
            .values(number)
            .filter(|value| value.is_finite())
            .fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let pairs = one
            .instants()
            .zip(one.values(number).zip(two.values(number)));
        for (now, (expected, found)) in pairs {
            let found = if found.is_nan() {
                Some(found)
            } else {
                other_unit.convert(found, unit)
            };
            let Some(found) = found else {
                return Err(format!(
                    "with {units}, `{}` is in {other_unit} rather than {unit}",
                    subject.name(number)
                ));
            };
            let close = (expected - found).abs() <= ROUNDING * largest;
            if !(close || (expected.is_nan() && found.is_nan())) {
                return Err(format!(
                    "with {units}, `{}` is {found} {unit} rather than {expected} {unit} at {now} s",
                    subject.name(number)
                ));
            }
        }
    }
    Ok(())
}

/// The same input in a unit of the same kind, where there is one. A port with a stated unit takes those
/// alone that a factor turns into it, which no point on a scale is.
fn in_another_unit(given: &Given, stated: bool) -> Given {
    let Ok(unit) = Unit::parse(&given.unit) else {
        return given.clone();
    };
    let other = ["m", "k"]
        .map(|prefix| format!("{prefix}{}", given.unit))
        .into_iter()
        .chain(OTHERS.map(str::to_owned))
        .filter_map(|text| Some((Unit::parse(&text).ok()?, text)))
        .find(|(other, _)| {
            let is_point = unit.is_temperature_point() || other.is_temperature_point();
            let is_taken = !stated || !is_point;
            let differs = unit.convert(1.0, other).is_some_and(|one| one != 1.0);
            other.measures_same(&unit) && is_taken && differs
        });
    let (low, high) = given.range();
    match other {
        Some((other, text)) => Given {
            unit: text,
            range: unit.convert(low, &other).zip(unit.convert(high, &other)),
            ..given.clone()
        },
        None => given.clone(),
    }
}

/// Units to choose from where a prefix alone makes no unit.
const OTHERS: [&str; 13] = [
    "K", "um", "mm", "nm/s", "um/min", "mK/min", "K/s", "B", "%", "min", "mV", "kW", "[degF]",
];

fn converted(table: &Table, from: &[Given], to: &[Given]) -> Result<Table, String> {
    let mut units = Vec::new();
    for (from, to) in from.iter().zip(to) {
        let unit = |given: &Given| Unit::parse(&given.unit).map_err(|error| error.reason());
        let pair = (unit(from)?, unit(to)?);
        units.extend(std::iter::repeat_n(pair, from.channels));
    }
    let mut table = table.clone();
    for (_, row) in table.events_mut() {
        for (value, (from, to)) in row.iter_mut().zip(&units) {
            if !value.is_nan() {
                *value = from.convert(*value, to).unwrap_or(*value);
            }
        }
    }
    Ok(table)
}
