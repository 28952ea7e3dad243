//! Decides what a column of a log measures, by its name and its values: unit, kind, and whether it is what drifts.

use athermal::core::unit::Unit;
use athermal::files::Description;
use serde_json::{Value, json};

use super::Told;
use super::name::{POSITIONS, unit_in, words};

/// What a column is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A temperature that may explain a drift.
    Temperature,
    /// What drifts.
    Drifting,
    /// Something else that may explain a drift, such as the power of a heater.
    Drive,
    /// Left out.
    Unused,
}

/// A column of a log.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name in the log.
    pub name: String,
    /// Its unit, as UCUM writes it.
    pub unit: String,
    /// What it is for.
    pub kind: Kind,
    /// Why it was taken so.
    why: String,
    /// What else the user should know of it.
    warnings: Vec<String>,
    unit_known: bool,
    guess: Guess,
    /// What its name alone says.
    named: Guess,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Guess {
    Temperature,
    Position,
    Drive,
    Other,
    Unused,
}

const SET_POINTS: [&str; 5] = ["target", "setpoint", "set", "sp", "goal"];
const TEMPERATURES: [&str; 4] = ["t", "temp", "temperature", "tc"];
const FACTORS: [&str; 6] = ["scale", "gain", "factor", "ratio", "coefficient", "coeff"];
const DRIVES: [&str; 11] = [
    "drive", "voltage", "heater", "lamp", "power", "current", "duty", "pwm", "input", "speed",
    "rpm",
];

impl Column {
    /// What was guessed, for people.
    #[must_use]
    pub fn remark(&self) -> Option<String> {
        let what = match self.kind {
            Kind::Temperature => "temperature",
            Kind::Drifting => "drifts",
            Kind::Drive => "input",
            Kind::Unused => return Some(format!("{}: left out, {}", self.name, self.why)),
        };
        let unit = if self.unit_known { "" } else { " (a guess)" };
        let warnings = self.warnings.iter().map(|warning| format!("; {warning}"));
        Some(format!(
            "{}: {what}, in {}{unit}; {}{}",
            self.name,
            self.unit,
            self.why,
            warnings.collect::<String>()
        ))
    }

    /// What was guessed, for programs.
    #[must_use]
    pub fn facts(&self) -> Value {
        let taken_as = match self.kind {
            Kind::Temperature => "temperature",
            Kind::Drifting => "drifting",
            Kind::Drive => "input",
            Kind::Unused => "left_out",
        };
        let used = self.kind != Kind::Unused;
        json!({
            "column": self.name,
            "taken_as": taken_as,
            "unit": used.then_some(&self.unit),
            "unit_known": used.then_some(self.unit_known),
            "why": self.why,
        })
    }

    /// Tells the user something of it.
    pub fn warn(&mut self, what: String) {
        self.warnings.push(what);
    }

    /// Whether its unit is stated by its name.
    #[must_use]
    pub fn unit_known(&self) -> bool {
        self.unit_known
    }

    /// Whether it is a temperature, whatever it is for.
    #[must_use]
    pub fn is_temperature(&self) -> bool {
        Unit::parse(&self.unit).is_ok_and(|unit| unit.measures_same(&Unit::kelvin()))
    }

    /// Leaves it out.
    pub fn leave_out(&mut self, why: impl Into<String>) {
        self.guess = Guess::Unused;
        self.kind = Kind::Unused;
        self.why = why.into();
    }
}

/// The columns of a log other than its time, with a first guess of what each is.
#[must_use]
pub fn columns(described: &Description, time: &[String]) -> Vec<Column> {
    let columns = described.columns.iter();
    columns
        .filter(|name| !time.contains(name))
        .map(|name| guess(name, described.unit(name)))
        .collect()
}

/// The guess of a column by its name and by what stands for its unit below it.
fn guess(name: &str, below: &str) -> Column {
    let parts = words(name);
    let by_name = unit_in(name);
    let below = Unit::in_words(below);
    let unit = below.as_ref().or(by_name.as_ref());
    let lower: Vec<String> = parts.iter().map(|word| word.to_lowercase()).collect();
    let has = |known: &[&str]| {
        lower
            .iter()
            .any(|word| known.contains(&word.trim_end_matches(|c: char| c.is_ascii_digit())))
    };
    let measures = |what: &str| {
        Unit::parse(what)
            .ok()
            .zip(unit)
            .is_some_and(|(what, unit)| unit.measures_same(&what))
    };
    let temp_named = has(&TEMPERATURES) || lower.iter().any(|word| word.contains("temp"));
    let (guess, why) = if has(&SET_POINTS) {
        (
            Guess::Unused,
            "a set point, which says what was asked for and not what was",
        )
    } else if measures("K") {
        (Guess::Temperature, "by its unit")
    } else if measures("m") {
        (Guess::Position, "a length")
    } else if temp_named {
        (Guess::Temperature, "by its name")
    } else if has(&DRIVES) {
        (Guess::Drive, "by its name")
    } else if unit.is_none() && has(&POSITIONS) && !has(&FACTORS) {
        (Guess::Position, "by its name")
    } else {
        (Guess::Other, "neither a temperature nor a length")
    };
    let fallback = match guess {
        Guess::Temperature => "Cel",
        Guess::Position => "um",
        _ => "1",
    };
    Column {
        name: name.to_owned(),
        unit: unit.map_or(fallback, Unit::text).to_owned(),
        kind: Kind::Unused,
        why: match (&below, &by_name) {
            (Some(below), Some(by_name)) if below.text() != by_name.text() => {
                format!(
                    "{why}, as the row below its name says, though the name says {}",
                    by_name.text()
                )
            }
            _ => why.to_owned(),
        },
        warnings: Vec::new(),
        unit_known: unit.is_some(),
        guess,
        named: guess,
    }
}

/// Settles which columns drift and which may explain it.
///
/// # Errors
/// A text that says what is missing.
pub fn assign(columns: &mut [Column], told: &Told) -> Result<(), String> {
    for name in &told.drifting {
        let Some(column) = columns.iter_mut().find(|column| column.name == *name) else {
            let known: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
            return Err(format!(
                "there is no column `{name}`; there are {}",
                known.join(", ")
            ));
        };
        if column.guess == Guess::Unused {
            return Err(format!("`{name}` cannot drift: {}", column.why));
        }
    }
    let has = |columns: &[Column], guess| columns.iter().any(|column| column.guess == guess);
    let (drifting, why) = if has(columns, Guess::Position) {
        (Guess::Position, "")
    } else if has(columns, Guess::Other) {
        (Guess::Other, ", so it is taken as what drifts")
    } else if has(columns, Guess::Drive) {
        (
            Guess::Temperature,
            "; no position is there, so it is taken as what drifts",
        )
    } else {
        (Guess::Position, "")
    };
    for column in columns.iter_mut() {
        let drifts = if told.drifting.is_empty() {
            column.guess == drifting
        } else {
            told.drifting.contains(&column.name)
        };
        column.kind = match column.guess {
            Guess::Unused => Kind::Unused,
            _ if drifts => Kind::Drifting,
            Guess::Temperature => Kind::Temperature,
            Guess::Drive | Guess::Other => Kind::Drive,
            Guess::Position => Kind::Unused,
        };
        if drifts && told.drifting.is_empty() {
            column.why.push_str(why);
        } else if drifts {
            column.why = "as you say".to_owned();
        } else if column.guess == Guess::Position {
            column.why = "you say that something else drifts".to_owned();
        } else if column.kind == Kind::Drive {
            column.why.push_str(", may explain the drift");
        }
    }
    one_quantity(columns, told)?;
    let names = |kind| -> Vec<&str> {
        let of_kind = columns.iter().filter(|column| column.kind == kind);
        of_kind.map(|column| column.name.as_str()).collect()
    };
    let causes = [names(Kind::Temperature), names(Kind::Drive)].concat();
    let left_out = |named: &[Guess]| -> Option<String> {
        let lost = columns
            .iter()
            .filter(|column| column.kind == Kind::Unused && named.contains(&column.named));
        let lost: Vec<String> = lost.filter_map(Column::remark).collect();
        (!lost.is_empty()).then(|| lost.join("; "))
    };
    let lost = match (names(Kind::Drifting).is_empty(), causes.is_empty()) {
        (false, false) => None,
        (true, false) => {
            left_out(&[Guess::Position]).map(|lost| ("nothing is left that drifts", lost))
        }
        (false, true) => left_out(&[Guess::Temperature, Guess::Drive])
            .map(|lost| ("nothing is left that could explain a drift", lost)),
        (true, true) => left_out(&[Guess::Temperature, Guess::Position]).map(|lost| {
            (
                "neither what drifts nor what could explain it is left",
                lost,
            )
        }),
    };
    if let Some((what, lost)) = lost {
        return Err(format!("{what}: {lost}"));
    }
    match (names(Kind::Drifting).is_empty(), causes.is_empty()) {
        (false, false) => Ok(()),
        (true, false) => Err(format!(
            "nothing in it drifts: {} {}, and there is no position or other quantity to be explained; log a \
             position beside, or name the column that drifts with --drifts",
            causes.join(", "),
            if causes.len() == 1 {
                "is a temperature"
            } else {
                "are temperatures"
            },
        )),
        (false, true) => Err(format!(
            "nothing in it could explain the drift of {}: there is no temperature",
            names(Kind::Drifting).join(", ")
        )),
        (true, true) => Err(
            "no column is a temperature or a position; names such as `plate_degC` and `Z_nm` say so"
                .to_owned(),
        ),
    }
}

/// What drifts must be one quantity, since one node takes its slopes in one unit.
fn one_quantity(columns: &mut [Column], told: &Told) -> Result<(), String> {
    let unit = |column: &Column| Unit::parse(&column.unit).ok();
    let mut drifting = columns
        .iter_mut()
        .filter(|column| column.kind == Kind::Drifting);
    let Some((first, quantity)) = drifting
        .next()
        .and_then(|first| Some((first.name.clone(), unit(first)?)))
    else {
        return Ok(());
    };
    for column in drifting {
        if unit(column).is_some_and(|unit| unit.measures_same(&quantity)) {
            continue;
        }
        if !told.drifting.is_empty() {
            return Err(format!(
                "`{first}` and `{}` are different quantities; write a graph for each",
                column.name
            ));
        }
        column.kind = Kind::Drive;
        column.why = format!("another quantity than `{first}`, may explain it");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(header: &'static str) -> Result<Vec<(String, Kind, String)>, String> {
        let described = Description::of_read("log", header.as_bytes(), None, 10).unwrap();
        let mut columns = columns(&described, &["time_s".to_owned()]);
        assign(&mut columns, &Told::default())?;
        Ok(columns
            .into_iter()
            .map(|column| (column.name, column.kind, column.unit))
            .collect())
    }

    #[test]
    fn names_say_what_columns_are() {
        for (header, expected) in [
            (
                "time_s,plate1_degC,X1_nm\n",
                [(Kind::Temperature, "Cel"), (Kind::Drifting, "nm")],
            ),
            (
                "time_s,t_wall_degC,heatflow_y_Wm2\n",
                [(Kind::Temperature, "Cel"), (Kind::Drifting, "W/m2")],
            ),
            (
                "time_s,lamp_drive_V,t_plate_degC\n",
                [(Kind::Drive, "V"), (Kind::Drifting, "Cel")],
            ),
            (
                "time_s,heater_voltage_V,t_outlet_air_V\n",
                [(Kind::Drive, "V"), (Kind::Drifting, "V")],
            ),
            (
                "time_s,spindle_load_pct,z_um\n",
                [(Kind::Drive, "%"), (Kind::Drifting, "um")],
            ),
            (
                "time_s,temp1,z\n",
                [(Kind::Temperature, "Cel"), (Kind::Drifting, "um")],
            ),
        ] {
            let found = kinds(header).unwrap();
            assert_eq!(found.len(), 2);
            for ((name, kind, unit), expected) in found.iter().zip(expected) {
                assert_eq!((*kind, unit.as_str()), expected, "{name}");
            }
        }
    }

    #[test]
    fn brackets_and_degree_signs_are_units_too() {
        assert_eq!(guess("Temp Plate [°F]", "").unit, "[degF]");
        assert_eq!(guess("Pos Z (µm)", "").unit, "um");
        assert_eq!(guess("Probe Z [mm]", "").guess, Guess::Position);
    }

    #[test]
    fn inches_and_units_behind_a_slash_are_read_where_nothing_else_can_be_meant() {
        for (name, unit) in [
            ("X_inch", "[in_i]"),
            ("X_in", "[in_i]"),
            ("Gap [in]", "[in_i]"),
            ("X_mil", "[mil_i]"),
            ("X_thou", "[mil_i]"),
            ("X_micron", "um"),
            ("X/mm", "mm"),
            ("Probe 1/µm", "um"),
            ("Plate/°C", "Cel"),
            ("T_in", "Cel"),
            ("power_in", "1"),
            ("Z_nm/min", "um"),
        ] {
            assert_eq!(guess(name, "").unit, unit, "{name}");
        }
    }

    #[test]
    fn units_in_a_row_below_the_names_are_those_of_the_columns() {
        let found = kinds("time_s;Plate;Z;Load;Gap_mm\n;°C;nm;%;µm\n0;1;2;3;4\n").unwrap();
        let told = found.iter().map(|(_, kind, unit)| (*kind, &**unit));
        assert_eq!(
            told.collect::<Vec<_>>(),
            [
                (Kind::Temperature, "Cel"),
                (Kind::Drifting, "nm"),
                (Kind::Drive, "%"),
                (Kind::Drifting, "um"),
            ]
        );
    }

    #[test]
    fn a_unit_that_the_name_contradicts_is_told() {
        let column = guess("Z_nm", "mm");
        assert_eq!(column.unit, "mm");
        assert_eq!(
            column.why,
            "a length, as the row below its name says, though the name says nm"
        );
    }

    #[test]
    fn a_log_of_temperatures_alone_is_told_that_nothing_drifts() {
        let refused = kinds("time_s,t_machine_degF\n").unwrap_err();
        assert!(refused.starts_with("nothing in it drifts: t_machine_degF is a temperature"));
    }

    #[test]
    fn a_factor_of_an_axis_is_no_position_of_it() {
        for factor in ["scale_x", "gain_x", "x_factor"] {
            assert_eq!(guess(factor, "").guess, Guess::Other, "{factor}");
        }
        let found = kinds("time_s,plate_degC,X_um,scale_x\n").unwrap();
        assert_eq!(found[1].1, Kind::Drifting);
        assert_eq!(found[2].1, Kind::Drive);
        // A scale may be a glass scale too: it drifts where nothing else could.
        let found = kinds("time_s,plate_degC,scale_x\n").unwrap();
        assert_eq!(found[1].1, Kind::Drifting);
    }

    #[test]
    fn set_points_are_left_out() {
        let found = kinds("time_s,z_mm,t_bed_degC,bed_target_degC\n").unwrap();
        assert_eq!(found[2].1, Kind::Unused);
    }
}
