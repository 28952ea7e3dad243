//! Decides what a column of a log measures, by its name and its values: unit, kind, and whether it is what drifts.

use athermal_core::unit::Unit;
use athermal_files::Description;
use serde_json::{Value, json};

use super::Request;
use super::name::{POSITIONS, is_among, is_count, measures, unit_in, words};

/// What a column is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A temperature that may explain a drift.
    Temperature,
    /// What drifts.
    Drifting,
    /// Something else that may explain a drift, such as the power of a heater.
    Drive,
    /// What a correction applied to what drifts.
    Applied,
    /// Left out.
    Unused,
}

/// A column of a log.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name in the log.
    pub name: String,
    /// Which of the log's columns it is, from 1.
    place: usize,
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
    /// The column, by number, of what a correction applied to it.
    pub applied: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Guess {
    Temperature,
    Position,
    Drive,
    /// What a correction applied.
    Applied,
    /// The air or the pressure around it.
    Ambient,
    Other,
    Unused,
}

const SET_POINTS: &str =
    "target setpoint set sp goal cmd command commanded demand demanded requested soll sollwert";
const TEMPERATURES: &str = "t temp temperature tc";
const FACTORS: &str = "scale gain factor ratio coefficient coeff";
const DRIVES: &str = "drive voltage heater lamp power current duty pwm input speed rpm bat batt battery batterie vbat supply akku";
const AMBIENT: &str = "hum rh %rh rh% pressure press pres baro barometer druck rf";
/// What is an angle where its unit is a degree.
const ANGLES: &str = "tilt angle inc incl inclination pitch roll yaw rot azimuth theta phi winkel";
const MASSES: &str = "mass weight wt masse gewicht load";
const ACCELERATIONS: &str = "acc accel acceleration vib";
/// What stands in brackets without being a unit: how a value was found among several.
const STATISTICS: &str = "min max avg mean std raw";
/// The same within a word: `Luftfeuchte`, `airhumidity`, `Luftdruck`.
const WITHIN: &str = "humid feucht luftdruck airpressure";

impl Column {
    /// What was guessed, for people.
    #[must_use]
    pub fn remark(&self) -> Option<String> {
        let what = match self.kind {
            Kind::Temperature => "temperature",
            Kind::Drifting => "drifts",
            Kind::Drive => "input",
            Kind::Applied => "applied",
            Kind::Unused => return Some(format!("{}: left out, {}", self.called(), self.why)),
        };
        let unit = if self.unit_known { "" } else { " (a guess)" };
        let warnings = self.warnings.iter().map(|warning| format!("; {warning}"));
        Some(format!(
            "{}: {what}, in {}{unit}; {}{}",
            self.called(),
            self.unit,
            self.why,
            warnings.collect::<String>()
        ))
    }

    /// Its name, or which it is if it has none.
    fn called(&self) -> String {
        if !self.name.is_empty() {
            return self.name.clone();
        }
        let ending = match (self.place % 10, self.place % 100) {
            (1..=3, 11..=13) => "th",
            (1, _) => "st",
            (2, _) => "nd",
            (3, _) => "rd",
            _ => "th",
        };
        format!("the {}{ending} column, which has no name", self.place)
    }

    /// What was guessed, for programs.
    #[must_use]
    pub fn facts(&self) -> Value {
        let taken_as = match self.kind {
            Kind::Temperature => "temperature",
            Kind::Drifting => "drifting",
            Kind::Drive => "input",
            Kind::Applied => "applied",
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

    /// Adds a warning about it.
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

    /// Whether its unit is that of a temperature or a length.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        let unit = Unit::parse(&self.unit).ok().filter(|_| self.unit_known);
        unit.is_some_and(|unit| measures(&unit, "K") || measures(&unit, "m"))
    }

    /// Whether its unit is that of a length, an angle or a number, so that it may be another reading of a position.
    #[must_use]
    pub fn may_be_a_reading(&self) -> bool {
        let unit = Unit::parse(&self.unit).ok();
        unit.is_some_and(|unit| ["m", "rad", "1"].iter().any(|of| measures(&unit, of)))
    }

    /// How little its name and unit speak for a position: lengths come before what is called one, that before what has a unit, as a
    /// voltage or an angle has, that before what has none, and what mostly drives or flows only before shares.
    fn hardly_drifts(&self) -> u8 {
        let unit = Unit::parse(&self.unit).ok();
        let measures = |what: &str| unit.as_ref().is_some_and(|unit| measures(unit, what));
        let is_position = |word: &&str| {
            let word = word.split('/').next().unwrap_or_default().to_lowercase();
            is_among(POSITIONS, &word)
        };
        if measures("m") {
            0
        } else if words(&self.name).iter().any(is_position) {
            1
        } else if self.unit == "%" {
            5
        } else if ["A", "W", "s", "m3/s", "m/s"].into_iter().any(measures)
            || measures("Hz") && !self.unit.ends_with("Hz")
        {
            4
        } else {
            2 + u8::from(!self.unit_known)
        }
    }

    /// Whether it may measure the same as another. Of numbers without a dimension that is so in the same unit alone: shares, steps and
    /// what no unit is known of are no one quantity.
    fn is_same_quantity(&self, other: &Self) -> bool {
        let units = Unit::parse(&self.unit)
            .ok()
            .zip(Unit::parse(&other.unit).ok());
        units.is_some_and(|(own, others)| {
            let is_same = self.unit == other.unit && self.unit_known == other.unit_known;
            own.measures_same(&others) && (is_same || !own.measures_same(&Unit::one()))
        })
    }

    /// Takes it for an input of which the last value is held.
    pub fn hold(&mut self) {
        self.kind = Kind::Drive;
        self.why
            .push_str(", and measured far more rarely than the others");
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
    let columns = described.columns.iter().enumerate();
    columns
        .filter(|(_, name)| !time.contains(name))
        .map(|(index, name)| Column {
            place: index + 1,
            ..guess(name, described.unit(name))
        })
        .collect()
}

/// Whether a name says neither what a column measures nor that it drifts.
pub fn says_nothing(name: &str) -> bool {
    let unit_aside = guess(name, "");
    unit_aside.named == Guess::Other
}

/// Whether columns of these names have both a temperature and what may drift.
pub fn is_whole(described: &Description, names: &[String]) -> bool {
    let guess = |name: &String| guess(name, described.unit(name)).guess;
    let has = |of: &[Guess]| names.iter().any(|name| of.contains(&guess(name)));
    has(&[Guess::Temperature]) && has(&[Guess::Position, Guess::Other])
}

/// Letters of tags in plants (ISA-5.1): a temperature and a position, each as an element, an indicator or a transmitter.
const TEMPERATURE_TAGS: &str = "TT TE TI TIT TIR";
const POSITION_TAGS: &str = "ZT ZE ZI ZIT ZIR";

/// The letters of a tag such as `TT101`, `TI-3101.PV` or `21ZT004`; nothing of another name.
fn tag_of(name: &str) -> &str {
    let tag = name.split(['.', ' ', '/']).next().unwrap_or_default();
    let tag = tag.trim_start_matches(|c: char| c.is_ascii_digit() || c == '-' || c == '_');
    let letters = tag
        .find(|c: char| !c.is_ascii_uppercase())
        .unwrap_or(tag.len());
    let number = tag[letters..].trim_start_matches(['-', '_']);
    let is_tag = number.len() >= 2
        && number
            .trim_end_matches(char::is_alphabetic)
            .bytes()
            .all(|b| b.is_ascii_digit());
    if is_tag { &tag[..letters] } else { "" }
}

/// The guess of a column by its name and by what stands for its unit below it.
fn guess(name: &str, below: &str) -> Column {
    let parts = words(name);
    let by_name = unit_in(name);
    let below = Unit::in_words(below);
    let lower: Vec<String> = parts.iter().map(|word| word.to_lowercase()).collect();
    let has = |known: &str| lower.iter().any(|word| is_among(known, word));
    let within = |parts: &str| {
        let mut parts = parts.split(' ');
        parts.any(|part| lower.iter().any(|word| word.contains(part)))
    };
    let tag = tag_of(name);
    let is_position_tag = is_among(POSITION_TAGS, tag);
    let temp_named = has(TEMPERATURES) || within("temp") || is_among(TEMPERATURE_TAGS, tag);
    // The degrees of a temperature are no angle.
    let is_of_temperature = |unit: &&Unit| {
        let mut known = ["K", "K/s", "V", "A", "Ohm"].into_iter();
        known.any(|known| measures(unit, known))
    };
    let by_name_alone = by_name.as_ref();
    let by_name_alone = by_name_alone.filter(|unit| !temp_named || is_of_temperature(unit));
    // What is a degree of either kind, or a gram or what falls with one, the quantity says.
    let stated = name.rsplit_once(['[', '(']).map_or("", |(_, text)| text);
    let stated = stated.trim_end().trim_end_matches([']', ')']).trim();
    let last = lower.last().map_or("", String::as_str);
    let by_quantity = match stated {
        "deg" | "°" | "Deg" if !temp_named => Some("deg"),
        "g" if has(ACCELERATIONS) => Some("[g]"),
        "g" if name.contains('[') || has(MASSES) => Some("g"),
        _ if last == "deg" && has(ANGLES) => Some("deg"),
        _ if last == "g" && has(MASSES) => Some("g"),
        _ => None,
    };
    let by_quantity = by_quantity.and_then(|unit| Unit::parse(unit).ok());
    let unit = below.as_ref().or(by_name_alone).or(by_quantity.as_ref());
    let unit = unit.filter(|unit| !(temp_named && measures(unit, "rad")));
    // A unit that is not known still says that it is no length.
    let is_code = |text: &str| {
        let letters = text.chars().any(char::is_alphabetic);
        let is_word = (2..=8).contains(&text.len()) && !text.contains(char::is_whitespace);
        letters && is_word && !is_among(STATISTICS, &text.to_lowercase())
    };
    let is_other = unit.is_none() && name.trim_end().ends_with(']') && is_code(stated);
    let is_no_position = unit.is_some_and(|unit| unit.text() == "km" || unit.text().contains('/'));
    let measures = |what: &str| unit.is_some_and(|unit| measures(unit, what));
    let is_number = unit.is_none_or(is_count);
    let may_be_applied = unit.is_none_or(is_count) || measures("m") || measures("rad");
    let (guess, why) = if has("applied") && may_be_applied && !temp_named {
        (Guess::Applied, "what a correction applied")
    } else if has(SET_POINTS) {
        (
            Guess::Unused,
            "a set point, which says what was asked for and not what was",
        )
    } else if measures("K") {
        (Guess::Temperature, "by its unit")
    } else if measures("m") && is_no_position {
        (Guess::Drive, "a way, or a length per something")
    } else if measures("m") {
        (Guess::Position, "a length")
    } else if measures("Pa") {
        (Guess::Ambient, "a pressure")
    } else if temp_named {
        (Guess::Temperature, "by its name")
    } else if has(DRIVES) {
        (Guess::Drive, "by its name")
    } else if has(AMBIENT) || within(WITHIN) {
        (Guess::Ambient, "by its name")
    } else if is_number && !is_other && (has(POSITIONS) || is_position_tag) && !has(FACTORS) {
        (Guess::Position, "by its name")
    } else {
        (Guess::Other, "neither a temperature nor a length")
    };
    let fallback = match guess {
        Guess::Temperature => "Cel",
        Guess::Position | Guess::Applied => "um",
        _ => "1",
    };
    Column {
        name: name.to_owned(),
        place: 1,
        unit: unit.map_or(fallback, spelt).to_owned(),
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
        applied: None,
    }
}

/// A unit as people write it, where that is in a graph too.
fn spelt(unit: &Unit) -> &str {
    match unit.text() {
        "Ao" => "\u{c5}",
        "''" => "arcsec",
        "10*-3.''" => "mas",
        text => text,
    }
}

/// Settles which columns drift and which may explain it.
///
/// # Errors
/// A text that says what is missing.
pub fn assign(columns: &mut [Column], request: &Request) -> Result<(), String> {
    let named = [&request.drifting, &request.keep, &request.applied];
    for name in named.into_iter().flatten() {
        let Some(column) = columns.iter_mut().find(|column| column.name == *name) else {
            let known: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
            return Err(format!(
                "there is no column `{name}`; there are {}",
                known.join(", ")
            ));
        };
        if column.guess == Guess::Unused && request.drifting.contains(name) {
            return Err(format!("`{name}` cannot drift: {}", column.why));
        }
        if request.applied.contains(name) {
            (column.guess, column.why) = (Guess::Applied, "as you say".to_owned());
        }
    }
    let has = |columns: &[Column], guess| columns.iter().any(|column| column.guess == guess);
    let (drifting, why) = if has(columns, Guess::Position) {
        (Guess::Position, "")
    } else if has(columns, Guess::Other) {
        (Guess::Other, ", so it is taken as what drifts")
    } else if has(columns, Guess::Drive)
        && (has(columns, Guess::Temperature) || !has(columns, Guess::Ambient))
    {
        (
            Guess::Temperature,
            "; no position is there, so it is taken as what drifts",
        )
    } else if has(columns, Guess::Ambient) {
        (
            Guess::Ambient,
            "; nothing else could drift, so it is taken as what does",
        )
    } else {
        (Guess::Position, "")
    };
    for column in columns.iter_mut() {
        let drifts = if request.drifting.is_empty() {
            column.guess == drifting
        } else {
            request.drifting.contains(&column.name)
        };
        column.kind = match column.guess {
            Guess::Unused => Kind::Unused,
            _ if drifts => Kind::Drifting,
            Guess::Temperature => Kind::Temperature,
            Guess::Drive | Guess::Ambient | Guess::Other => Kind::Drive,
            Guess::Position | Guess::Applied => Kind::Unused,
        };
        if drifts && request.drifting.is_empty() {
            column.why.push_str(why);
        } else if drifts {
            column.why = "as you say".to_owned();
        } else if column.guess == Guess::Applied {
            column.why = format!("{}, and to no position that drifts", column.why);
        } else if column.guess == Guess::Position {
            column.why = "you say that something else drifts".to_owned();
        } else if column.kind == Kind::Drive {
            column.why.push_str(", may explain the drift");
        }
    }
    one_quantity(columns, request)?;
    pair_applied(columns, request)?;
    let names = |kind| -> Vec<&str> {
        let of_kind = columns.iter().filter(|column| column.kind == kind);
        of_kind.map(|column| column.name.as_str()).collect()
    };
    let causes = [names(Kind::Temperature), names(Kind::Drive)].concat();
    let drifting = names(Kind::Drifting);
    use Guess::{Ambient, Drive, Position, Temperature};
    let (lost, named, without) = match (drifting.is_empty(), causes.is_empty()) {
        (false, false) => return Ok(()),
        (true, false) => (
            "nothing is left that drifts",
            &[Position][..],
            format!(
                "nothing in it drifts: {} may explain a drift, and there is no position or other quantity to be explained; log a \
                 position beside, give a log of one as well, or name the column that drifts with --drifts",
                causes.join(", ")
            ),
        ),
        (false, true) => (
            "nothing is left that could explain a drift",
            &[Temperature, Drive, Ambient][..],
            format!(
                "nothing in it could explain the drift of {}: there is no temperature, by name or by unit; log one beside, or name the \
                 column that drifts, for which the others are then taken as causes: --drifts \"{}\"",
                drifting.join(", "),
                drifting.last().unwrap_or(&"")
            ),
        ),
        (true, true) => (
            "neither what drifts nor what could explain it is left",
            &[Temperature, Position][..],
            "no column is a temperature or a position; names such as `plate_degC` and `Z_nm` say so"
                .to_owned(),
        ),
    };
    let left_out = columns
        .iter()
        .filter(|column| column.kind == Kind::Unused && named.contains(&column.named));
    let left_out: Vec<String> = left_out.filter_map(Column::remark).collect();
    match left_out.is_empty() {
        true => Err(without),
        false => Err(format!("{lost}: {}", left_out.join("; "))),
    }
}

/// What drifts must be one quantity, since one node takes its slopes in one unit.
fn one_quantity(columns: &mut [Column], request: &Request) -> Result<(), String> {
    let drifts = |column: &&Column| column.kind == Kind::Drifting;
    let mut drifting = columns.iter().filter(drifts);
    let first = match request.drifting.is_empty() {
        true => drifting.min_by_key(|column| column.hardly_drifts()),
        false => drifting.next(),
    };
    let Some(first) = first.cloned() else {
        return Ok(());
    };
    let drifting = columns
        .iter_mut()
        .filter(|column| column.kind == Kind::Drifting);
    for column in drifting.filter(|column| !column.is_same_quantity(&first)) {
        if request.drifting.is_empty() {
            column.kind = Kind::Drive;
            column.why = format!("another quantity than `{}`, may explain it", first.name);
            continue;
        }
        let unit = |of: &Column| match of.unit_known {
            true => format!("`{}` is in {}", of.name, of.unit),
            false => format!("what unit `{}` is in, its name does not say", of.name),
        };
        return Err(format!(
            "`{}` and `{}` are different quantities ({}; {}); write a graph for each",
            first.name,
            column.name,
            unit(&first),
            unit(column),
        ));
    }
    Ok(())
}

/// The words of a name that say of which axis it is.
fn axis_of(name: &str) -> Vec<String> {
    let is_aside = |word: &String| word == "applied" || Unit::parse(word).is_ok();
    let words = words(name).into_iter().map(|word| word.to_lowercase());
    words.filter(|word| !is_aside(word)).collect()
}

/// Finds to what a correction was applied: by the rest of the name, or where one axis drifts and one was corrected.
fn pair_applied(columns: &mut [Column], request: &Request) -> Result<(), String> {
    let of = |columns: &[Column], is_one: &dyn Fn(&Column) -> bool| -> Vec<usize> {
        (0..columns.len())
            .filter(|&nth| is_one(&columns[nth]))
            .collect()
    };
    let drifting = of(columns, &|of| of.kind == Kind::Drifting);
    let applied = of(columns, &|of| of.guess == Guess::Applied);
    for &nth in &drifting {
        let axis = axis_of(&columns[nth].name);
        let same = applied
            .iter()
            .find(|&&of| axis_of(&columns[of].name) == axis);
        let only = applied
            .first()
            .filter(|_| drifting.len() == 1 && applied.len() == 1);
        let Some(&found) = same.or(only) else {
            continue;
        };
        let name = columns[nth].name.clone();
        if !columns[found].is_same_quantity(&columns[nth])
            && columns[found].unit_known
            && columns[nth].unit_known
        {
            return Err(format!(
                "`{}` is in {} and cannot have been applied to `{name}`, in {}; name what was with --applied",
                columns[found].name, columns[found].unit, columns[nth].unit
            ));
        }
        if !columns[found].unit_known {
            columns[found].unit = columns[nth].unit.clone();
        }
        columns[nth].applied = Some(found);
        columns[found].kind = Kind::Applied;
        columns[found].why = format!(
            "what a correction applied to {name}, which is taken as it would have been without"
        );
    }
    let lost = request.applied.iter().find(|name| {
        columns
            .iter()
            .any(|of| of.name == **name && of.kind != Kind::Applied)
    });
    match lost {
        Some(name) => Err(format!(
            "to which of {} `{name}` was applied its name does not say; rename it, such as to `{}_applied`",
            drifting
                .iter()
                .map(|&of| &*columns[of].name)
                .collect::<Vec<_>>()
                .join(", "),
            drifting.first().map_or("X", |&of| &columns[of].name)
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
