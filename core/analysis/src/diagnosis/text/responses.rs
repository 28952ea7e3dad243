//! The responses of estimators to their sensors as tables for a terminal.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use athermal_core::unit::Unit;

use super::instances::{axis_of, grouped, name_of};
use crate::diagnosis::response::{Response, Responses};
use crate::figures::{TimeUnit, matrix, number};

/// By how much answers to a step up and down differ at least where it is worth a word.
const BENT: f64 = 0.005;

/// The tables of all estimators, node by node.
#[must_use]
pub fn responses(shown: &[&Responses]) -> String {
    let nodes = grouped(shown.iter().copied(), |of| name_of(&of.node).to_owned());
    let nodes = nodes.into_iter().filter_map(Node::of);
    nodes.map(|node| node.text()).collect()
}

/// What the columns of instances are called: by what they predict, or by the instances where several predict the same.
fn columns(instances: &[&Responses]) -> Vec<String> {
    let by = |name: fn(&Responses) -> &str| instances.iter().map(move |of| axis_of(name(of)));
    let truths: BTreeSet<String> = by(|of| &of.truth).collect();
    if truths.len() == instances.len() {
        by(|of| &of.truth).collect()
    } else {
        by(|of| &of.node).collect()
    }
}

/// The instances of a node, each a column.
struct Node<'a> {
    name: &'a str,
    instances: Vec<&'a Responses>,
    columns: Vec<String>,
    /// The first answer to each sensor that any of them answers: a row each.
    sensors: Vec<&'a Response>,
}

impl<'a> Node<'a> {
    /// None where no sensor is answered.
    fn of(instances: Vec<&'a Responses>) -> Option<Self> {
        let mut sensors: Vec<&Response> = Vec::new();
        for sensor in instances.iter().flat_map(|of| &of.sensors) {
            if !sensors.iter().any(|known| known.sensor == sensor.sensor) {
                sensors.push(sensor);
            }
        }
        Some(Self {
            name: name_of(&sensors.first().and(instances.first())?.node),
            columns: columns(&instances),
            instances,
            sensors,
        })
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for alike in grouped(self.sensors.iter().copied(), |of| of.sensor_unit.clone()) {
            // One instance may answer for good what comes back to nothing in another: that sensor is in both tables.
            let lasts = |of: &&&Response| self.any(of, |of| of.gain.is_some());
            let ends = |of: &&&Response| self.any(of, |of| of.total.is_some()) || !lasts(of);
            let come_back: Vec<_> = alike.iter().filter(ends).copied().collect();
            let last: Vec<_> = alike.iter().filter(lasts).copied().collect();
            text.push_str(&self.totals(&come_back));
            text.push_str(&self.gains(&last));
        }
        text.push_str(&self.settled());
        text.push_str(&self.bent());
        text
    }

    /// Whether something is true of any answer to a sensor.
    fn any(&self, sensor: &Response, is: fn(&Response) -> bool) -> bool {
        let mut all = self.all().filter(|of| of.sensor == sensor.sensor);
        all.any(is)
    }

    fn all(&self) -> impl Iterator<Item = &'a Response> {
        self.instances.iter().flat_map(|of| &of.sensors)
    }

    fn unit(&self) -> &'a str {
        &self.instances[0].unit
    }

    /// A row for each sensor.
    fn rows(
        &self,
        sensors: &[&Response],
        cell: impl Fn(&Response) -> String,
    ) -> Vec<(String, Vec<String>)> {
        let row = |sensor: &&Response| {
            let cells = self.instances.iter().map(|of| {
                let mut answers = of.sensors.iter();
                let found = answers.find(|of| of.sensor == sensor.sensor);
                found.map_or("-".to_owned(), &cell)
            });
            (sensor.sensor.clone(), cells.collect())
        };
        sensors.iter().map(row).collect()
    }

    /// What comes of steps of sensors of one unit whose answers come back to nothing.
    fn totals(&self, sensors: &[&Response]) -> String {
        let Some(first) = sensors.first() else {
            return String::new();
        };
        let (unit, factor) = in_the_end(self.unit());
        let in_unit = |total: Option<f64>| or_no_end(total.map(|total| factor * total));
        let mut rows = self.rows(sensors, |of| in_unit(of.total));
        if sensors.len() > 1 {
            // Sensors that measure the same share an effect, so that their sum means more than each part.
            let together = self
                .instances
                .iter()
                .map(|of| together(of, sensors, in_unit));
            rows.push(("all together".to_owned(), together.collect()));
        }
        format!(
            "{}: how far a step of {} moves what it predicts in the end, in {}\n{}",
            self.name,
            one(&first.sensor_unit),
            unit,
            matrix("sensor", &self.columns, &rows)
        )
    }

    /// The same of those that are answered for as long as they stay where they are.
    fn gains(&self, sensors: &[&Response]) -> String {
        let Some(first) = sensors.first() else {
            return String::new();
        };
        let rows = self.rows(sensors, |of| or_no_end(of.gain.or(of.total.map(|_| 0.0))));
        format!(
            "{}: how far a step of {} moves what it predicts for good, in {}\n{}",
            self.name,
            one(&first.sensor_unit),
            self.unit(),
            matrix("sensor", &self.columns, &rows)
        )
    }

    fn settled(&self) -> String {
        let longest = self.all().filter_map(|of| of.settled_s).fold(0.0, f64::max);
        let unit = TimeUnit::of(longest);
        let rows = self.rows(&self.sensors, |of| {
            or_no_end(of.settled_s.map(|settled_s| settled_s / unit.seconds))
        });
        format!(
            "{}: time from which on it stays within a tenth of that, in {}\n{}",
            self.name,
            unit.symbol,
            matrix("sensor", &self.columns, &rows)
        )
    }

    fn bent(&self) -> String {
        let largest = self.all().map(|of| of.asymmetry).fold(0.0, f64::max);
        let mut text = String::new();
        if largest >= BENT {
            let _ = writeln!(
                text,
                "  it is not linear: steps up and down differ by up to {:.0} %",
                100.0 * largest
            );
        }
        text
    }
}

/// The sum of what an instance makes of the sensors; it may answer none of them.
fn together(of: &Responses, sensors: &[&Response], cell: impl Fn(Option<f64>) -> String) -> String {
    let among = |one: &&Response| sensors.iter().any(|other| other.sensor == one.sensor);
    let answers: Vec<&Response> = of.sensors.iter().filter(among).collect();
    if answers.is_empty() {
        return "-".to_owned();
    }
    cell(answers.iter().map(|of| of.total).sum())
}

fn or_no_end(value: Option<f64>) -> String {
    value.map_or("no end".to_owned(), number)
}

/// One of a unit; of a number without a unit, which is in units of 1, the number alone.
fn one(unit: &str) -> String {
    match unit {
        "1" => unit.to_owned(),
        unit => format!("1 {unit}"),
    }
}

/// The unit of a sum over minutes, and how many of it a sum of one is: that of a position, where the truth is its drift per time.
fn in_the_end(unit: &str) -> (String, f64) {
    let of_position = || {
        let (position, _) = unit.rsplit_once('/')?;
        let per_minute = Unit::parse(&format!("{position}/min")).ok()?;
        let factor = Unit::parse(unit).ok()?.factor_to(&per_minute)?;
        Some((position.to_owned(), factor))
    };
    of_position().unwrap_or_else(|| (format!("{unit}·min"), 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(sensor: &str, total: Option<f64>, settled_s: f64) -> Response {
        Response {
            sensor: format!("temperature.{sensor}"),
            sensor_unit: "K".to_owned(),
            time_s: Vec::new(),
            step: Vec::new(),
            impulse: Vec::new(),
            total,
            gain: None,
            peak_s: 0.0,
            peak: 1.0,
            settled_s: Some(settled_s),
            asymmetry: 0.0,
        }
    }

    fn instance(axis: &str, unit: &str, sensors: Vec<Response>) -> Responses {
        Responses {
            node: format!("thermal.{axis}"),
            truth: format!("drift.{axis}"),
            unit: unit.to_owned(),
            sensors,
        }
    }

    #[test]
    fn a_drift_per_minute_ends_as_a_length() {
        assert_eq!(in_the_end("nm/min"), ("nm".to_owned(), 1.0));
        assert_eq!(in_the_end("um/h"), ("um".to_owned(), 1.0 / 60.0));
        assert_eq!(in_the_end("W/m2"), ("W/m2·min".to_owned(), 1.0));
    }

    #[test]
    fn a_step_of_a_number_without_a_unit_is_one() {
        let share = Response {
            sensor_unit: "1".to_owned(),
            gain: Some(3.0),
            ..answer("open", None, 60.0)
        };
        for (of, step) in [
            (share, "a step of 1 moves"),
            (answer("a", Some(2.0), 60.0), "a step of 1 K moves"),
        ] {
            let table = responses(&[&instance("X", "nm/min", vec![of])]);
            assert!(table.contains(step), "{table}");
        }
    }

    #[test]
    fn an_instance_that_answers_no_sensor_of_a_unit_has_no_sum_of_them() {
        let heater = Response {
            sensor_unit: "W".to_owned(),
            ..answer("heater", Some(5.0), 60.0)
        };
        let both = vec![answer("a", Some(2.0), 60.0), answer("b", Some(1.0), 60.0)];
        let endless = vec![answer("a", Some(2.0), 60.0), answer("b", None, 60.0)];
        let of = [
            instance("X", "nm/min", both),
            instance("Y", "nm/min", vec![heater]),
            instance("Z", "nm/min", endless),
        ];
        let table = responses(&of.iter().collect::<Vec<_>>());
        let together = table.lines().find(|line| line.contains("all together"));
        let cells: Vec<&str> = together.unwrap().split("  ").collect();
        let cells: Vec<&str> = cells.into_iter().map(str::trim).collect();
        let cells: Vec<&str> = cells.into_iter().filter(|cell| !cell.is_empty()).collect();
        assert_eq!(cells, ["all together", "3.00", "-", "no end"], "{table}");
    }

    #[test]
    fn a_sensor_that_one_instance_answers_for_good_and_another_does_not_is_in_both_tables() {
        let stays = Response {
            gain: Some(3.0),
            ..answer("a", None, 60.0)
        };
        let of = [
            instance("X", "nm", vec![stays]),
            instance("Z", "nm", vec![answer("a", Some(2.0), 60.0)]),
        ];
        let table = responses(&of.iter().collect::<Vec<_>>());
        let lines = table.lines().filter(|line| line.contains("temperature.a"));
        let cells = lines.map(|line| line.split_once("temperature.a").map(|of| of.1.trim()));
        let cells: Vec<Vec<&str>> = cells
            .map(|row| row.unwrap_or_default().split("  ").map(str::trim).collect())
            .map(|row: Vec<&str>| row.into_iter().filter(|cell| !cell.is_empty()).collect())
            .collect();
        assert_eq!(cells[..2], [["no end", "2.00"], ["3.00", "0"]], "{table}");
    }

    #[test]
    fn settling_is_told_in_the_unit_in_which_the_longest_is_read_best() {
        for (settled_s, unit, number) in [(90.0, "s", "90.00"), (43_200.0, "h", "12.00")] {
            let of = instance("X", "nm/min", vec![answer("a", Some(2.0), settled_s)]);
            let table = responses(&[&of]);
            assert!(
                table.contains(&format!("a tenth of that, in {unit}\n")),
                "{table}"
            );
            assert!(table.trim_end().ends_with(number), "{table}");
        }
    }
}
