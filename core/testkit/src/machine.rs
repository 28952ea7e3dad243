//! Decides what every simulated machine must do, whoever brought it, and checks it.

use std::fmt;

use super::compared::{none_of, same_bits};
use super::tried::{PANICS, tried};
use crate::document::is_name;
use crate::registry::{NotFound, all, find};
use crate::unit::Unit;
use athermal_trial::machine::{
    Channel, KnownMachine, LONGEST_DAYS, Machine, Row, Schedule, Setup, SetupError, Simulation,
};

/// How many days of a machine are looked at.
const DAYS: f64 = 0.5;

/// How many rows at most.
const ROWS: usize = 50_000;

/// The fewest characters that explain anything.
const WORDS: usize = 10;

/// A rule that a machine breaks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrokenMachine {
    /// The name of the machine.
    pub machine: String,
    /// What was tried: a name of one of the rules.
    pub rule: &'static str,
    /// What was found.
    pub found: String,
    advice: &'static str,
}

impl fmt::Display for BrokenMachine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = self.found.trim().replace('\n', "\n  ");
        writeln!(f, "`{}`, {}: {found}", self.machine, self.rule)?;
        let advice = if self.found.starts_with(PANICS) {
            "a machine answers with a `SetupError`, NaN or `false` where it cannot go on, and never panics; `RUST_BACKTRACE=1` shows where \
             it does"
        } else {
            self.advice
        };
        write!(f, "  to do: {advice}")
    }
}

/// A rule: its name, what is tried, and what to do where it is broken.
type MachineRule = (
    &'static str,
    fn(&dyn Machine) -> Result<(), String>,
    &'static str,
);

const RULES: [MachineRule; 6] = [
    (
        "described",
        described,
        "say in a line what the machine is; names are letters, digits, `_` and `-`, and no two the same; a unit is UCUM, `Cel` of a temperature \
         and `nm` of a position; a set point's default lies in its range",
    ),
    (
        "setups",
        setups,
        "begin `start` with `rows_of(self.name(), self.set_points(), setup, …)?`, which refuses what no machine takes, and run with \
         every set point from one end of its range to the other",
    ),
    (
        "rows",
        rows,
        "let `time_ns` rise from row to row, from 0 or more; give each channel a value now and then and each axis its `true_drift`, NaN \
         where there is none, and nothing infinite",
    ),
    (
        "repeats",
        repeats,
        "let all that is random come from `Prng::stream(setup.seed, …)`: no clock, no `static`, no order of a hash map",
    ),
    (
        "ends",
        ends,
        "answer `false` after the last row, as often as asked, and leave the row as it is",
    ),
    (
        "corrections",
        corrections,
        "in `correct`, leave an axis as it is where NaN is asked, clip what it cannot do, and write what is in force to all of `applied`; \
         `true_drift` is that of the machine without corrections",
    ),
];

/// All the rules that a machine breaks.
#[must_use]
pub fn broken_machine(machine: &dyn Machine) -> Vec<BrokenMachine> {
    let tell = |&(rule, check, advice): &MachineRule| {
        let found = tried(|| check(machine)).err()?;
        Some(BrokenMachine {
            machine: machine.name().to_owned(),
            rule,
            found,
            advice,
        })
    };
    RULES.iter().filter_map(tell).collect()
}

/// Fails with all that is wrong with the machines that a crate brings, if anything is.
///
/// A test of the crate calls it:
///
/// ```no_run
/// athermal_testkit::assert_every_machine_conforms(env!("CARGO_PKG_NAME"));
/// ```
///
/// # Panics
/// Where a rule is broken, or there is no machine of the crate.
pub fn assert_every_machine_conforms(package: &str) {
    let own = all::<KnownMachine>().filter(|known| known.package == package);
    let own: Vec<_> = own.collect();
    assert!(
        !own.is_empty(),
        "{package} registers no machine that this test program links"
    );
    let broken: Vec<String> = own
        .iter()
        .flat_map(|known| broken_machine(known.machine))
        .map(|broken| broken.to_string())
        .collect();
    assert!(
        broken.is_empty(),
        "{} of the rules that every machine keeps are broken\n\n{}\n",
        broken.len(),
        broken.join("\n\n")
    );
}

fn described(machine: &dyn Machine) -> Result<(), String> {
    let mut found = Vec::new();
    let mut check = |wrong: bool, text: &dyn Fn() -> String| {
        if wrong {
            found.push(text());
        }
    };
    let unknown = find::<KnownMachine>(machine.name()).err();
    check(unknown.is_some(), &|| {
        unknown.as_ref().map_or_else(String::new, NotFound::message)
    });
    let summary = machine.summary();
    check(summary.len() < WORDS, &|| {
        "the machine has no summary".to_owned()
    });
    let (channels, set_points) = (machine.channels(), machine.set_points());
    check(channels.is_empty(), &|| {
        "the machine measures nothing".to_owned()
    });
    let names = channels
        .iter()
        .flat_map(|channel| [channel.signal, channel.name]);
    let settings = set_points.iter().map(|set_point| set_point.name);
    for name in std::iter::once(machine.name()).chain(names).chain(settings) {
        check(!is_name(name, false), &|| {
            format!("`{name}` is not a letter followed by letters, digits, `_` and `-`")
        });
    }
    for (nth, channel) in channels.iter().enumerate() {
        let name = channel.reference();
        let twice = channels[..nth]
            .iter()
            .any(|other| other.reference() == name);
        check(twice, &|| format!("the channel `{name}` is there twice"));
        let unit = wrong_unit(channel);
        check(unit.is_some(), &|| unit.clone().unwrap_or_default());
    }
    for (nth, set_point) in set_points.iter().enumerate() {
        let (name, default, [low, high]) = (set_point.name, set_point.default, set_point.range);
        let twice = set_points[..nth].iter().any(|other| other.name == name);
        check(twice, &|| format!("the set point `{name}` is there twice"));
        let is_range = low < high && (high - low).is_finite();
        check(!is_range || !(low..=high).contains(&default), &|| {
            format!(
                "the set point `{name}` is {default} by default, which is not in a range from {low} to {high}"
            )
        });
    }
    none_of(found)
}

fn wrong_unit(channel: &Channel) -> Option<String> {
    let wrong = |what: &str| {
        let (reference, unit) = (channel.reference(), channel.unit);
        Some(format!(
            "the channel `{reference}` is in `{unit}`, which is {what}"
        ))
    };
    let Ok(unit) = Unit::parse(channel.unit) else {
        return wrong("no unit");
    };
    let nm = Unit::parse("nm").ok()?;
    match channel.signal {
        "position" if !unit.measures_same(&nm) => wrong("no length"),
        "temperature" if !unit.is_temperature_point() => wrong("no temperature"),
        _ => None,
    }
}

fn setups(machine: &dyn Machine) -> Result<(), String> {
    for days in [0.0, -1.0, f64::NAN, f64::INFINITY, 2.0 * LONGEST_DAYS] {
        match machine.start(&of_days(days)) {
            Err(SetupError::Days { .. }) => {}
            Err(other) => return Err(format!("a recording of {days} days is refused by: {other}")),
            Ok(_) => return Err(format!("a recording of {days} days is begun")),
        }
    }
    let foreign = "none_of_its_own";
    let setup = Setup {
        schedule: Some(Schedule::cycle(foreign, &[20.0], 600)),
        ..Setup::default()
    };
    if !matches!(
        machine.start(&setup),
        Err(SetupError::UnknownSetPoint { .. })
    ) {
        return Err(format!(
            "a schedule of `{foreign}`, which it does not have, is taken"
        ));
    }
    if recorded(machine, &of_days(1e-9))?.is_empty() {
        return Err("the shortest recording has no row".to_owned());
    }
    for set_point in machine.set_points() {
        let setup = Setup {
            schedule: Some(Schedule::cycle(set_point.name, &set_point.range, 3600)),
            ..of_days(DAYS)
        };
        let rows = recorded(machine, &setup)?;
        infinite(machine, &rows).map_err(|found| {
            let [low, high] = set_point.range;
            format!(
                "with `{}` now at {low} and now at {high}, {found}",
                set_point.name
            )
        })?;
    }
    Ok(())
}

fn rows(machine: &dyn Machine) -> Result<(), String> {
    let rows = recorded(machine, &of_days(DAYS))?;
    infinite(machine, &rows)?;
    let first = rows.first().map_or(0, |row| row.time_ns);
    if first < 0 {
        return Err(format!("the first row is {} ns before the start", -first));
    }
    for pair in rows.windows(2) {
        let [last, next] = [pair[0].time_ns, pair[1].time_ns];
        if next <= last {
            return Err(format!("a row at {next} ns follows one at {last} ns"));
        }
    }
    for (nth, channel) in machine.channels().iter().enumerate() {
        if rows.iter().all(|row| row.values[nth].is_nan()) {
            let name = channel.reference();
            return Err(format!("`{name}` has no value in {} rows", rows.len()));
        }
    }
    let axes = machine
        .channels()
        .iter()
        .filter(|channel| channel.is_axis());
    for (nth, axis) in axes.enumerate() {
        if rows.iter().all(|row| row.true_drift[nth].is_nan()) {
            let name = axis.reference();
            return Err(format!("`{name}` has no true drift in {} rows", rows.len()));
        }
    }
    Ok(())
}

/// Nothing infinite, and rows as wide as the channels.
fn infinite(machine: &dyn Machine, rows: &[Row]) -> Result<(), String> {
    let whole = Row::empty(machine.channels());
    for row in rows {
        let widths = |row: &Row| (row.values.len(), row.true_drift.len());
        if widths(row) != widths(&whole) {
            return Err(format!("the row at {} ns has another width", row.time_ns));
        }
        let mut values = row.values.iter().chain(&row.true_drift);
        if let Some(value) = values.find(|value| value.is_infinite()) {
            return Err(format!(
                "the row at {} ns has the value {value}",
                row.time_ns
            ));
        }
    }
    Ok(())
}

fn repeats(machine: &dyn Machine) -> Result<(), String> {
    let first = recorded(machine, &of_days(DAYS))?;
    let again = recorded(machine, &of_days(DAYS))?;
    let other = Setup {
        seed: 2,
        ..of_days(DAYS)
    };
    let (mut one, mut beside) = (started(machine, &of_days(DAYS))?, started(machine, &other)?);
    let (mut row, mut unread) = (
        Row::empty(machine.channels()),
        Row::empty(machine.channels()),
    );
    let mut interleaved = Vec::new();
    while interleaved.len() < ROWS && one.next(&mut row) {
        interleaved.push(row.clone());
        beside.next(&mut unread);
    }
    for (rows, which) in [
        (again, "again"),
        (interleaved, "beside one of another seed"),
    ] {
        if let Some(at) = difference(&first, &rows) {
            return Err(format!(
                "simulated {which}, the same seed gives other rows {at}"
            ));
        }
    }
    Ok(())
}

fn ends(machine: &dyn Machine) -> Result<(), String> {
    let setup = of_days(1e-3);
    let mut simulation = started(machine, &setup)?;
    let mut row = Row::empty(machine.channels());
    let (mut last, mut count) = (row.clone(), 0);
    while simulation.next(&mut row) {
        last.clone_from(&row);
        count += 1;
        if count > ROWS {
            return Err(format!(
                "{} days go on for more than {ROWS} rows",
                setup.days
            ));
        }
    }
    let mut again = (0..3).map(|_| simulation.next(&mut row));
    if again.any(|more| more) {
        return Err("another row comes after the last".to_owned());
    }
    if same(&row, &last) {
        Ok(())
    } else {
        Err("the row is changed though there is none any more".to_owned())
    }
}

fn corrections(machine: &dyn Machine) -> Result<(), String> {
    let free = recorded(machine, &of_days(DAYS))?;
    let axes = Row::empty(machine.channels()).true_drift.len();
    let mut simulation = started(machine, &of_days(DAYS))?;
    let mut row = Row::empty(machine.channels());
    let mut applied = vec![f64::NAN; axes];
    let mut asked = (0..).map(|nth| ASKED[nth % ASKED.len()]);
    let mut in_force = vec![0.0; axes];
    for free in &free {
        if !simulation.next(&mut row) {
            return Err("corrected, it has fewer rows".to_owned());
        }
        infinite(machine, std::slice::from_ref(&row))?;
        let drifts = row.true_drift.iter().zip(&free.true_drift);
        if drifts.into_iter().any(|(one, two)| !same_bits(*one, *two)) {
            return Err(format!(
                "corrected, its true drift at {} ns is another",
                row.time_ns
            ));
        }
        let ask = asked.next().unwrap_or(f64::NAN);
        applied.fill(f64::NAN);
        simulation.correct(&vec![ask; axes], &mut applied);
        if let Some(value) = applied.iter().find(|value| !value.is_finite()) {
            return Err(format!("asked for {ask} nm it applies {value}"));
        }
        if ask.is_nan() && applied != in_force {
            return Err(format!(
                "asked for nothing it applies {applied:?} after {in_force:?}"
            ));
        }
        in_force.copy_from_slice(&applied);
    }
    Ok(())
}

/// What the axes are asked for in turn, in nm.
const ASKED: [f64; 7] = [f64::NAN, 100.0, f64::NAN, -1e300, f64::NAN, 1e12, 0.0];

fn of_days(days: f64) -> Setup {
    Setup {
        days,
        ..Setup::default()
    }
}

fn started(machine: &dyn Machine, setup: &Setup) -> Result<Box<dyn Simulation>, String> {
    let days = setup.days;
    let started = machine.start(setup);
    started.map_err(|error| format!("{days} days do not begin: {error}"))
}

fn recorded(machine: &dyn Machine, setup: &Setup) -> Result<Vec<Row>, String> {
    let mut simulation = started(machine, setup)?;
    let (mut row, mut rows) = (Row::empty(machine.channels()), Vec::new());
    while rows.len() < ROWS && simulation.next(&mut row) {
        rows.push(row.clone());
    }
    Ok(rows)
}

/// Where two recordings part.
fn difference(one: &[Row], two: &[Row]) -> Option<String> {
    let mut pairs = one.iter().zip(two);
    if let Some((row, _)) = pairs.find(|(one, two)| !same(one, two)) {
        return Some(format!("at {} ns", row.time_ns));
    }
    (one.len() != two.len()).then(|| format!("after {} of them", one.len().min(two.len())))
}

fn same(one: &Row, two: &Row) -> bool {
    let values = |row: &Row| [row.values.as_slice(), &row.true_drift].concat();
    let (one_values, two_values) = (values(one), values(two));
    let mut pairs = one_values.iter().zip(&two_values);
    one.time_ns == two.time_ns
        && one_values.len() == two_values.len()
        && pairs.all(|(one, two)| same_bits(*one, *two))
}
