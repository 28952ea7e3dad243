//! A simulation as a comma-separated table. Decides names, order and spelling of its columns, not their values.

use std::io::{self, Write};

use athermal_core::time::Duration;
use athermal_trial::machine::{Announcements, Channel, Machine, Row, SECOND_NS, Setup, Simulation};

use crate::recorder::{DRIFT_DECIMALS, PERIOD_S};

/// The names of the columns after the time: one per channel (`plate1_degC`, `Z1_nm`), and with `truth` one per axis with its
/// true drift (`Z1_drift_true_nm_per_min`).
#[must_use]
pub fn table_columns(channels: &[Channel], truth: bool) -> Vec<String> {
    let axes = channels.iter().filter(|channel| channel.is_axis());
    let drifts = axes.map(|axis| format!("{}_drift_true_nm_per_min", axis.name));
    let columns = channels.iter().map(Channel::column);
    columns.chain(drifts.filter(|_| truth)).collect()
}

/// Writes the line of names and all rows that are left; gives the number of rows.
///
/// The first column is `time_s`, the others are [`table_columns`]. An empty cell is no value. What is read back has the same bits.
///
/// # Errors
/// Those of `out`.
pub fn write_table(
    channels: &[Channel],
    simulation: &mut dyn Simulation,
    truth: bool,
    out: &mut dyn Write,
) -> io::Result<u64> {
    let mut line = Vec::with_capacity(256);
    line.extend_from_slice(b"time_s");
    for column in table_columns(channels, truth) {
        line.push(b',');
        line.extend_from_slice(column.as_bytes());
    }
    line.push(b'\n');
    out.write_all(&line)?;

    let mut row = Row::empty(channels);
    let mut count = 0;
    while simulation.next(&mut row) {
        line.clear();
        push_time(&mut line, row.time_ns);
        for (value, channel) in row.values.iter().zip(channels) {
            line.push(b',');
            push_number(&mut line, *value, channel.decimals);
        }
        for drift in row.true_drift.iter().filter(|_| truth) {
            line.push(b',');
            push_number(&mut line, *drift, DRIFT_DECIMALS);
        }
        line.push(b'\n');
        out.write_all(&line)?;
        count += 1;
    }
    Ok(count)
}

/// How long before it applies a set point stands in a plan, in s.
const KNOWN_AHEAD_S: i64 = 1800;

/// What the schedule of a machine plans, as a table: a row as of when each set point is known, half an hour before it applies or at the
/// beginning. Its columns are `time_s` and for each set point `chuck_set_degC` and `chuck_applies_at_s`.
#[must_use]
pub fn write_set_points(machine: &dyn Machine, setup: &Setup) -> String {
    let set_points = machine.set_points().iter();
    let names: Vec<&str> = set_points.map(|of| of.name).collect();
    let ahead = Duration::from_ns(KNOWN_AHEAD_S * SECOND_NS);
    let plan = |name: &&str| Announcements::ahead(machine, setup, name, ahead);
    let mut plans: Vec<_> = names.iter().filter_map(plan).collect();
    let columns = names
        .iter()
        .map(|name| format!(",{name}_set_degC,{name}_applies_at_s"));
    let mut text = format!("time_s{}\n", columns.collect::<String>());
    let end_s = (setup.days * 86_400.0) as i64;
    for time_s in (0..end_s.max(1)).step_by(PERIOD_S as usize) {
        let rows = plans.iter_mut().map(|plan| plan.next(time_s * SECOND_NS));
        let row: Vec<_> = rows.collect();
        if row.iter().all(Option::is_none) {
            continue;
        }
        let cells = row.iter().map(|cell| match cell {
            Some((set_point, from_s)) => format!(",{set_point:?},{from_s:?}"),
            None => ",,".to_owned(),
        });
        text += &format!("{time_s}.0{}\n", cells.collect::<String>());
    }
    text
}

/// Seconds with one decimal place, or as many as they need.
fn push_time(line: &mut Vec<u8>, time_ns: i64) {
    push_fixed(line, time_ns / (SECOND_NS / 10), 1);
    let rest = time_ns % (SECOND_NS / 10);
    if rest != 0 {
        let digits = format!("{:08}", rest.abs());
        line.extend_from_slice(digits.trim_end_matches('0').as_bytes());
    }
}

/// A number with fixed decimal places; nothing for NaN; the shortest exact form where a fault has left the resolution.
fn push_number(line: &mut Vec<u8>, value: f64, decimals: u32) {
    if value.is_nan() {
        return;
    }
    let scale = 10_i64.pow(decimals);
    let scaled = (value * scale as f64).round();
    // Beyond 2⁵³ neighbouring integers are not distinct.
    let exact = scaled.abs() < (1_u64 << 53) as f64 && scaled / scale as f64 == value;
    if exact {
        push_fixed(line, scaled as i64, decimals);
    } else {
        line.extend_from_slice(value.to_string().as_bytes());
    }
}

fn push_fixed(line: &mut Vec<u8>, scaled: i64, decimals: u32) {
    let mut digits = [0_u8; 32];
    let mut at = digits.len();
    let mut left = scaled.unsigned_abs();
    let mut placed = 0;
    while left > 0 || placed <= decimals {
        if placed == decimals && decimals > 0 {
            at -= 1;
            digits[at] = b'.';
        }
        at -= 1;
        digits[at] = b'0' + (left % 10) as u8;
        left /= 10;
        placed += 1;
    }
    if scaled < 0 {
        line.push(b'-');
    }
    line.extend_from_slice(&digits[at..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: f64, decimals: u32) -> String {
        let mut line = Vec::new();
        push_number(&mut line, value, decimals);
        String::from_utf8(line).unwrap()
    }

    #[test]
    fn numbers_have_their_decimal_places() {
        assert_eq!(number(21.5, 4), "21.5000");
        assert_eq!(number(-0.3, 1), "-0.3");
        assert_eq!(number(0.0, 1), "0.0");
        assert_eq!(number(-12.0, 0), "-12");
        assert_eq!(number(0.001, 3), "0.001");
        assert_eq!(number(f64::NAN, 3), "");
    }

    #[test]
    fn what_a_fault_has_left_between_the_places_is_written_exactly() {
        for value in [21.123_456_789_012_34, 1e17, f64::INFINITY] {
            assert_eq!(number(value, 4).parse::<f64>(), Ok(value));
        }
    }

    #[test]
    fn times_have_one_decimal_place_or_as_many_as_they_need() {
        let time = |ns| {
            let mut line = Vec::new();
            push_time(&mut line, ns);
            String::from_utf8(line).unwrap()
        };
        assert_eq!(time(0), "0.0");
        assert_eq!(time(604_790 * SECOND_NS), "604790.0");
        assert_eq!(time(1_250_000_000), "1.25");
        assert_eq!(time(1_000_000_001), "1.000000001");
    }
}
