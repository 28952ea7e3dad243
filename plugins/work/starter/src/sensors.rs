//! Decides what the columns of files are called that each have one sensor, under the same names. Not whether they are read together.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use athermal_core::unit::Unit;
use athermal_files::Dataset;

use super::column::{self, says_nothing};
use super::name::{ends_in_unit, words};
use super::undecided::period;
use super::{Log, NoStarter};

/// What a column with the unit of the rows is called, in small letters.
const UNITS: &str = "unit units einheit unité unidad uom";

/// What a column that counts rows is called, in small letters.
const COUNTERS: &str = "# no nr n index sample record row id";

/// Gives the columns of files with the same columns and overlapping times names by their files, and says so.
///
/// # Errors
/// Their files have one name too.
pub fn named_apart(logs: &mut [Log], data: &Dataset) -> Result<Option<String>, NoStarter> {
    let paths = data.paths();
    let mut alike: BTreeMap<BTreeSet<String>, Vec<usize>> = BTreeMap::new();
    for (nth, log) in logs.iter().enumerate() {
        let columns = log.described.columns.iter().cloned().collect();
        alike.entry(columns).or_default().push(nth);
    }
    let mut remarks = Vec::new();
    for of in alike.into_values().filter(|of| of.len() > 1) {
        let values = values(&logs[of[0]]);
        if values.is_empty() || column::is_whole(&logs[of[0]].described, &values) {
            continue;
        }
        let sensors: Vec<Sensor> = of.iter().map(|nth| Sensor::of(&paths[*nth])).collect();
        let periods = of
            .iter()
            .map(|nth| (&paths[*nth], &logs[*nth].clock))
            .map(|(path, clock)| period(path, data.tables(), clock, &clock.form));
        let periods: Vec<Option<(i64, i64)>> = periods.collect();
        let overlap = |one: usize, other: usize| match (periods[one], periods[other]) {
            (Some(a), Some(b)) => a.0 < b.1 && b.0 < a.1,
            _ => false,
        };
        let pairs = (0..of.len()).flat_map(|one| (0..one).map(move |other| (other, one)));
        let mut beside = pairs
            .filter(|(one, other)| overlap(*one, *other))
            .peekable();
        if beside.peek().is_none() {
            continue;
        }
        if let Some((one, other)) =
            beside.find(|(one, other)| sensors[*one].name == sensors[*other].name)
        {
            return Err(NoStarter::Unfit(format!(
                "{} and {} have the same columns ({}) and overlapping times: they are several sensors, and their files have one name. Name each \
                 file by its sensor, as `spindle_degC.csv`",
                logs[of[one]].name,
                logs[of[other]].name,
                values.join(", "),
            )));
        }
        for (nth, sensor) in of.iter().zip(&sensors) {
            let log = &mut logs[*nth];
            log.pattern.clone_from(&sensor.pattern);
            let unit = unit_beside(log);
            let nameless = values.iter().filter(|of| says_nothing(of)).count();
            for value in &values {
                let is_alone = values.len() == 1 || nameless == 1 && says_nothing(value);
                let unit = unit.as_ref().map(|(_, unit)| &**unit);
                let name = sensor.name_of(value, is_alone, unit);
                let columns = log.described.columns.iter_mut();
                columns
                    .filter(|of| *of == value)
                    .for_each(|of| of.clone_from(&name));
                log.described.table.rename.insert(value.clone(), name);
            }
            let counters = log.described.columns.iter().filter(|of| is_counter(of));
            log.aside
                .extend(counters.cloned().chain(unit.map(|(column, _)| column)));
        }
        let named = of.iter().map(|nth| {
            let renamed = logs[*nth].described.table.rename.iter();
            let renamed =
                renamed.map(|(from, to)| format!("`{from}` of {} is `{to}`", logs[*nth].name));
            renamed.collect::<Vec<_>>().join(", ")
        });
        let named: Vec<String> = named.collect();
        remarks.push(format!(
            "several sensors, a file for each: they have the same columns and overlapping times, so their columns are named by their files, in \
             `[[table.files]]`: {}",
            named.join(", ")
        ));
    }
    Ok((!remarks.is_empty()).then(|| remarks.join("; ")))
}

/// Whether a column is called as one that counts rows.
fn is_counter(name: &str) -> bool {
    let name = name.to_lowercase();
    COUNTERS
        .split(' ')
        .any(|of| of == name.trim_end_matches('.'))
}

/// The columns of numbers, other than the time and what counts rows.
fn values(log: &Log) -> Vec<String> {
    let described = &log.described;
    let columns = described.columns.iter().enumerate();
    let columns =
        columns.filter(|(_, name)| !name.is_empty() && !log.clock.columns.names().contains(name));
    let is_number = |at: usize| {
        let mut cells = described.rows.iter().filter_map(|row| row.get(at));
        cells.any(|cell| {
            athermal_files::with_decimal_point(cell.trim())
                .parse::<f64>()
                .is_ok()
        })
    };
    let columns = columns.filter(|(at, name)| is_number(*at) && !is_counter(name));
    columns.map(|(_, name)| name.clone()).collect()
}

/// The column that has the unit of all rows, and how a name says it.
fn unit_beside(log: &Log) -> Option<(String, String)> {
    let described = &log.described;
    let is_unit = |name: &String| UNITS.split(' ').any(|of| of == name.to_lowercase());
    let at = described.columns.iter().position(is_unit)?;
    let mut cells = described
        .rows
        .iter()
        .map(|row| row.get(at).map(|cell| cell.trim()));
    let first = cells.next()??;
    let unit = match first {
        "C" | "°C" | "c" => "degC",
        "F" | "°F" | "f" => "degF",
        other => Unit::in_name(other).map(|_| other)?,
    };
    let is_one = cells.all(|cell| cell == Some(first));
    is_one.then(|| (described.columns[at].clone(), unit.to_owned()))
}

/// What the name of a file says.
struct Sensor {
    /// Without its dates and its ending.
    name: String,
    /// The names of its files: a date may be another.
    pattern: String,
}

impl Sensor {
    fn of(path: &Path) -> Self {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        // `a.csv.gz` has two endings.
        let stem = stem.strip_suffix(".csv").unwrap_or(&stem);
        let (mut name, mut pattern) = (String::new(), String::new());
        let mut rest = stem;
        while !rest.is_empty() {
            let date = date_at(rest, name.ends_with(char::is_alphanumeric));
            if date > 0 {
                rest = &rest[date..];
                pattern.push('*');
                continue;
            }
            let first = rest.chars().next().map_or(1, char::len_utf8);
            name.push_str(&rest[..first]);
            pattern.push_str(&rest[..first]);
            rest = &rest[first..];
        }
        let name = name.trim_matches(|c: char| "_-. ".contains(c));
        if name.is_empty() {
            return Self {
                name: stem.to_owned(),
                pattern: file.into_owned(),
            };
        }
        pattern.push_str(&file[stem.len()..]);
        Self {
            name: name.to_owned(),
            pattern,
        }
    }

    /// What a column of it is called.
    fn name_of(&self, column: &str, is_alone: bool, unit: Option<&str>) -> String {
        let unit = match (is_alone, says_nothing(column)) {
            (true, _) if ends_in_unit(&self.name) => None,
            (true, true) if ends_in_unit(column) => words(column).last().copied(),
            (true, true) => unit,
            _ => {
                let between = if column.contains(' ') { " " } else { "_" };
                return format!("{}{between}{column}", self.name);
            }
        };
        unit.map_or_else(|| self.name.clone(), |unit| format!("{}_{unit}", self.name))
    }
}

/// How long a date is with which a text begins, with the time of day behind it; none within a word.
fn date_at(text: &str, is_within: bool) -> usize {
    let is_of_date = |c: char| c.is_ascii_digit() || "-_.T:hZ ".contains(c);
    let end = text.find(|c| !is_of_date(c)).unwrap_or(text.len());
    let span = text[..end].trim_end_matches(|c: char| !c.is_ascii_digit());
    let groups = span.split(|c: char| !c.is_ascii_digit());
    let groups: Vec<&str> = groups.collect();
    let is =
        |text: &str, from: u32, to: u32| text.parse().is_ok_and(|of| (from..=to).contains(&of));
    let is_date = |y: &str, m: &str, d: &str| is(y, 1990, 2100) && is(m, 1, 12) && is(d, 1, 31);
    let is_date = match *groups {
        [y, m, d, ..] if y.len() == 4 => is_date(y, m, d),
        [d, m, y, ..] if y.len() == 4 => is_date(y, m, d),
        [of, ..] if matches!(of.len(), 8 | 14) => is_date(&of[..4], &of[4..6], &of[6..8]),
        _ => false,
    };
    if is_date && !is_within { span.len() } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_is_called_as_its_file_without_dates_and_ending() {
        for (file, column, unit, name, pattern) in [
            (
                "spindle.csv",
                "Value",
                Some("degC"),
                "spindle_degC",
                "spindle.csv",
            ),
            (
                "spindle_degC.csv",
                "Value",
                Some("degC"),
                "spindle_degC",
                "spindle_degC.csv",
            ),
            ("TT101_2026-03-02.csv", "PV", None, "TT101", "TT101_*.csv"),
            (
                "101_20260302T0800.csv.gz",
                "value",
                None,
                "101",
                "101_*.csv.gz",
            ),
            ("02.03.2026 bed.txt", "temp", None, "bed_temp", "* bed.txt"),
            (
                "21345678.csv",
                "Temperature (°C)",
                None,
                "21345678 Temperature (°C)",
                "21345678.csv",
            ),
            ("20260302.csv", "value", None, "20260302", "20260302.csv"),
            ("8a.csv", "Value", None, "8a", "8a.csv"),
        ] {
            let sensor = Sensor::of(Path::new(file));
            assert_eq!(sensor.name_of(column, true, unit), name, "{file}");
            assert_eq!(sensor.pattern, pattern, "{file}");
        }
    }
}
