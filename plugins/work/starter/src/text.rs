//! Decides how the starter graph is written: every guess beside its reason, so that it can be corrected.

mod corrected;
mod unit;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use athermal_core::document::TableBase;
use athermal_core::unit::Unit;

use super::clock::Clock;
use super::column::{Column, Kind};
use super::group::{Group, groups};
use super::layout::lay_out;
use super::range;
use super::survey::Survey;
use super::window::{Choice, ENOUGH};
use athermal_analysis::figures::count;

/// Voters on halves of the sensors take at least so many.
const FEWEST_SENSORS: usize = 4;

/// Of two sensors that differ, neither is known to be wrong.
const FEWEST_CHECKED: usize = 3;

/// What learns speaks after twenty windows of truth at the earliest. A log of fewer windows than so many is too short for it, and for the past
/// of the drift as a voter.
const FEWEST_WINDOWS_TO_LEARN: f64 = 100.0;

/// Of more segments, neighbours make up one fold.
const MOST_FOLDS: u64 = 10;

/// The text of the graph.
pub fn graph(
    paths: &[PathBuf],
    (clock, tables): (&Clock, &TableBase),
    columns: &[Column],
    survey: &Survey,
    choice: &Choice,
) -> String {
    let names: Vec<String> = paths.iter().map(|path| file_name(path)).collect();
    let file = match &*names {
        [first, _, _, _, ..] => format!("{first} and {} more files", names.len() - 1),
        few => few.join(", "),
    };
    let file = file.replace(char::is_control, " ");
    let stem = paths[0].file_stem().unwrap_or_default().to_string_lossy();
    let writer = Writer {
        clock,
        columns,
        survey,
        choice,
        temperatures: groups(columns, Kind::Temperature, "temperature"),
        drives: groups(columns, Kind::Drive, "input"),
        drifting: groups(columns, Kind::Drifting, drifting_name(columns)),
        applied: groups(columns, Kind::Applied, "applied"),
    };
    let mut text = String::new();
    let _ = writeln!(
        text,
        "# A starter graph, written from {file}: {} rows over {}.\n\
         # Everything in it is a guess from names and values; what each follows from stands beside it.",
        count(survey.rows),
        clock.about(survey.duration_s),
    );
    text.push_str("\nschema = 1\n");
    let _ = writeln!(text, "name = {}", toml_string(&stem));
    writer.sets(&mut text);
    writer.time(&mut text);
    lay_out("[table]", &tables.base, &mut text);
    for (pattern, table) in &tables.files {
        let heading = format!(
            "[[table.files]]\nmatch = {}",
            toml_string(&pattern.to_string())
        );
        lay_out(&heading, table, &mut text);
    }
    writer.signals(&mut text);
    writer.uncorrected(&mut text);
    match &choice.levels {
        Some(why) => writer.levels(why, &mut text),
        None => {
            writer.features(&mut text);
            writer.estimators(&mut text);
        }
    }
    text
}

fn drifting_name(columns: &[Column]) -> &'static str {
    let length = |column: &Column| {
        let (unit, metre) = (Unit::parse(&column.unit).ok()?, Unit::parse("m").ok()?);
        Some(unit.measures_same(&metre))
    };
    let mut drifting = columns
        .iter()
        .filter(|column| column.kind == Kind::Drifting);
    if drifting.all(|column| length(column) == Some(true)) {
        "position"
    } else {
        "response"
    }
}

struct Writer<'a> {
    clock: &'a Clock,
    columns: &'a [Column],
    survey: &'a Survey,
    choice: &'a Choice,
    temperatures: Vec<Group>,
    drives: Vec<Group>,
    drifting: Vec<Group>,
    applied: Vec<Group>,
}

impl Writer<'_> {
    /// The channels that drift, as one node's outputs name them.
    fn axes(&self) -> Vec<&str> {
        let channels = self.drifting.iter().flat_map(|group| &group.channels);
        channels.map(String::as_str).collect()
    }

    fn many(&self) -> bool {
        self.axes().len() > 1
    }

    /// Whether the values of a signal are too far apart for slopes over the drift window.
    fn is_rare(&self, group: &Group) -> bool {
        let mut columns = group.columns.iter();
        columns.any(|index| self.choice.rare.contains(index))
    }

    /// What may explain the drift by how it changes.
    fn sloping(&self) -> impl Iterator<Item = &Group> {
        let causes = self.temperatures.iter().chain(&self.drives);
        causes.filter(|group| !self.is_rare(group))
    }

    /// Whether a sensor that contradicts the others of its signal can be known: where temperatures follow each other, and are three.
    fn is_checked(&self, group: &Group) -> bool {
        let is_temperature = self.temperatures.iter().any(|of| of.signal == group.signal);
        is_temperature && group.channels.len() >= FEWEST_CHECKED && !self.is_rare(group)
    }

    fn sets(&self, text: &mut String) {
        if self.many() {
            let axes: Vec<String> = self.axes().iter().map(|axis| toml_string(axis)).collect();
            let _ = writeln!(
                text,
                "\n[sets]                             # what nodes with `each = \"axis\"` stand for, one by one\n\
                 axis = [{}]",
                axes.join(", ")
            );
        }
    }

    fn time(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "\n[time]\ncolumn = {}",
            toml_string(&self.clock.columns.to_string())
        );
        if let Some((key, value)) = &self.clock.declared {
            let _ = write!(text, "{key} = {}", toml_string(value));
            if self.clock.counts_samples() {
                text.push_str("                        # the log does not say how long a sample takes: state it here");
            }
            text.push('\n');
        }
        if let Some(zone) = &self.clock.zone {
            let line = format!("zone = {}", toml_string(zone));
            let _ = writeln!(text, "{}", beside(&line, "as the log states"));
        }
        if self.clock.lacks_zone {
            text.push_str(
                "# zone = \"Europe/Berlin\"                # whose clock this is; without it UTC\n",
            );
        }
    }

    fn signals(&self, text: &mut String) {
        for group in self
            .temperatures
            .iter()
            .chain(&self.drives)
            .chain(&self.drifting)
            .chain(&self.applied)
        {
            let members = || {
                group
                    .columns
                    .iter()
                    .map(|&index| &self.survey.series[index])
            };
            let interval = members().filter_map(|s| s.interval_s()).fold(0.0, f64::max);
            let longest = members().filter_map(|s| s.gap(1.0)).fold(0.0, f64::max);
            let low = members()
                .map(|s| s.extremes().0)
                .fold(f64::INFINITY, f64::min);
            let high = members()
                .map(|s| s.extremes().1)
                .fold(f64::NEG_INFINITY, f64::max);
            let names: Vec<String> = group
                .channels
                .iter()
                .map(|name| toml_string(name))
                .collect();
            let mut columns = group.columns.iter();
            let known = columns.all(|&index| self.columns[index].unit_known());
            let new = if members().any(|s| s.changes) {
                "new "
            } else {
                ""
            };
            let _ = writeln!(
                text,
                "\n{}",
                beside(
                    &format!("[signals.{}]", group.signal),
                    &format!(
                        "a {new}value every {}; longest gap {}",
                        self.clock.about(interval),
                        self.clock.about(longest)
                    )
                )
            );
            let _ = writeln!(
                text,
                "unit = {}{}",
                toml_string(&group.unit),
                if known {
                    ""
                } else {
                    "   # a guess: the names do not say"
                }
            );
            let _ = writeln!(text, "channels = [{}]", names.join(", "));
            let _ = writeln!(text, "column = {}", toml_string(&group.pattern));
            let _ = writeln!(
                text,
                "{}",
                beside(
                    &format!("max_age = \"{}\"", self.clock.length(self.max_age(group))),
                    if self.is_rare(group) {
                        "how long a value counts: its values are rare, so as long as the longest gap"
                    } else {
                        "how long a value counts: a few intervals"
                    }
                )
            );
            let members = group.columns.iter();
            let nothing = members.filter_map(|&index| self.survey.series[index].placeholder);
            let nothing: Vec<f64> = nothing.collect();
            text.push_str(&range::line(&group.unit, (low, high), &nothing));
        }
    }

    /// Long enough for the usual gaps between values: three times what nine in ten do not exceed; of rare values, which may
    /// be written only when they change, for all gaps.
    fn max_age(&self, group: &Group) -> f64 {
        let members = group
            .columns
            .iter()
            .map(|&index| &self.survey.series[index]);
        let (share, times) = if self.is_rare(group) {
            (1.0, 1.0)
        } else {
            (0.9, 3.0)
        };
        let gaps = members.filter_map(|series| series.gap(share));
        let age = times * gaps.fold(0.0, f64::max);
        // To whole seconds, or where that is too coarse to whole milliseconds.
        let step = if age > 2.0 { 1.0 } else { 1e-3 };
        step * (age / step).ceil()
    }

    /// What drifts as it stands, from the values of what may explain it.
    fn levels(&self, why: &str, text: &mut String) {
        let causes = self.temperatures.iter().chain(&self.drives);
        let causes: Vec<String> = causes.map(|group| toml_string(&group.signal)).collect();
        let _ = writeln!(text, "\n# {why}.\n# So levels are predicted, not slopes.");
        let many = self.drifting.len() > 1;
        for group in &self.drifting {
            let is_corrected = |nth: &usize| self.columns[*nth].applied.is_some();
            let signal = match group.columns.iter().all(is_corrected) {
                true => "uncorrected",
                false => &group.signal,
            };
            let (node, each, truth) = match group.channels.as_slice() {
                [one] if !many => ("level".to_owned(), "", format!("{signal}.{one}")),
                [one] => (format!("level-{one}"), "", format!("{signal}.{one}")),
                _ => (
                    "level".to_owned(),
                    "each = \"axis\"\n",
                    format!("{signal}.{{axis}}"),
                ),
            };
            let _ = writeln!(
                text,
                "{}\ntype = \"linear\"\n{each}inputs.features = {}\ninputs.truth = \"{truth}\"\n{}",
                beside(
                    &format!("\n[nodes.{node}]"),
                    &format!("from {}", causes.join(", ").replace('"', ""))
                ),
                list(&causes),
                beside("ahead = \"0s\"", "the value of now: a virtual sensor"),
            );
        }
        let nodes = self
            .drifting
            .iter()
            .map(|group| match group.channels.as_slice() {
                [one] if many => toml_string(&format!("level-{one}")),
                _ => toml_string("level"),
            });
        let _ = writeln!(
            text,
            "\n[outputs]\nnow = {}",
            list(&nodes.collect::<Vec<_>>())
        );
    }

    fn features(&self, text: &mut String) {
        let width = self.clock.length(self.choice.drift_s);
        let _ = writeln!(
            text,
            "\n# Drift window: signal to noise (its standard error) of the slope of {}, by width:",
            self.axes().join(", ")
        );
        let shown = self
            .choice
            .candidates
            .iter()
            .filter(|(width_s, _)| *width_s <= 6.0 * self.choice.drift_s);
        for (width_s, ratios) in shown {
            let ratios: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:.1}")).collect();
            let mark = match (*width_s == self.choice.drift_s, self.choice.enough) {
                (false, _) => String::new(),
                _ if self.choice.weighed.better_s.is_some() => {
                    "  <- chosen: its fit explains most".to_owned()
                }
                (_, true) => format!("  <- chosen: the narrowest with {ENOUGH} on half of them"),
                (_, false) => format!("  <- chosen: the highest, though below {ENOUGH}"),
            };
            let _ = writeln!(
                text,
                "#   {:>10}  {}{mark}",
                self.clock.length(*width_s),
                ratios.join("  ")
            );
        }
        let more = self.choice.explains(self.clock);
        let bound = self.choice.bound.iter().map(|of| of.text(self.clock));
        for remark in more.into_iter().chain(bound) {
            let _ = writeln!(text, "# ({remark})");
        }
        let _ = writeln!(
            text,
            "{}\n\
             type = \"slope\"\ninputs.signal = {}\nwindows = [\"{width}\"]\nunit = {}",
            beside(
                "[nodes.drift]",
                &format!("what is predicted: the slope over the last {width}")
            ),
            self.drifts(),
            toml_string(&self.drift_unit()),
        );
        for group in self.temperatures.iter().filter(|of| self.is_checked(of)) {
            let _ = writeln!(
                text,
                "\n{}\n\
                 type = \"cross_check\"\ninputs.signal = {}\ninputs.truth = \"drift.{}\"\n\
                 ahead = \"{}\"\nlag = \"{lag}\"\nafter = \"{}\"\nrecover = \"{lag}\"\n\
                 hindsight = true",
                beside(
                    &format!("[nodes.{}]", of_signal(group, "trusted")),
                    "a sensor that contradicts the others is absent, like a dead one"
                ),
                toml_string(&group.signal),
                self.axes().first().unwrap_or(&"*"),
                self.clock.length(0.0),
                self.clock.length(0.2 * self.choice.drift_s),
                lag = self.clock.length(2.0 * self.choice.drift_s),
            );
        }
        for (number, group) in self.sloping().enumerate() {
            let signal = if self.is_checked(group) {
                of_signal(group, "trusted")
            } else {
                group.signal.clone()
            };
            let why = match number {
                0 => "short windows see the fast part of the drift, long ones the slow",
                _ => "the same of another signal",
            };
            let lagged = "how far it is ahead of masses that follow it: first-order lags";
            let _ = writeln!(
                text,
                "\n{}\n\
                 type = \"slope\"\ninputs.signal = {signal}\n\
                 windows = {{ dynamic_range = \"{width}\", shortest = \"{}\", steps = 4, harmonics = {} }}\n\
                 \n{}\n\
                 type = \"first_order\"\ninputs.signal = {signal}\n\
                 time_constants = {{ from = \"{}\", to = \"{}\", steps = 3 }}",
                beside(&format!("[nodes.{}]", of_signal(group, "gradients")), why),
                self.clock.length(self.choice.shortest_s),
                self.choice.harmonics,
                beside(&format!("[nodes.{}]", of_signal(group, "masses")), lagged),
                self.clock.length(0.5 * self.choice.drift_s),
                self.clock.length(4.0 * self.choice.drift_s),
                signal = toml_string(&signal),
            );
        }
    }

    /// What is made of the channels for which `is_of` holds, by their number among all that may explain the drift.
    fn regressors(&self, is_of: impl Fn(usize) -> bool) -> String {
        // What a heater does follows from how strong it is and not only from how it changes.
        let has_levels = self.temperatures.is_empty();
        let temperatures = self.temperatures.iter().map(|group| (group, false));
        let drives = self.drives.iter();
        let drives = drives.map(|group| (group, has_levels || self.is_rare(group)));
        let (mut number, mut regressors) = (0, Vec::new());
        for (group, has_level) in temperatures.chain(drives) {
            let own = (number..).zip(&group.channels);
            let own = own.filter(|(number, _)| is_of(*number));
            let own: Vec<&str> = own.map(|(_, name)| name.as_str()).collect();
            number += group.channels.len();
            let (channels, windows) = match own.as_slice() {
                [] => continue,
                own if own.len() == group.channels.len() => (String::new(), ""),
                [one] => (format!(".{one}"), "@*"),
                several => (format!(".{{{}}}", several.join(",")), "@*"),
            };
            let made =
                ["gradients", "masses"].map(|node| of_signal(group, node) + &channels + windows);
            let made = made.into_iter().filter(|_| !self.is_rare(group));
            let level = has_level.then(|| format!("{}{channels}", group.signal));
            regressors.extend(made.chain(level).map(|name| toml_string(&name)));
        }
        list(&regressors)
    }

    fn estimators(&self, text: &mut String) {
        let drift_s = self.choice.drift_s;
        let width = self.clock.length(drift_s);
        let (each, axis) = if self.many() {
            ("each = \"axis\"\n", "{axis}")
        } else {
            ("", *self.axes().first().unwrap_or(&"*"))
        };
        let causes = self.temperatures.iter().chain(&self.drives);
        let has_halves = causes.map(|group| group.channels.len()).sum::<usize>() >= FEWEST_SENSORS;
        let module = include_str!("prediction.toml");
        let mut module = module.replace("MEMORY", &self.clock.length(8.0 * drift_s));
        if self.survey.segments > 1 {
            let count = self.survey.segments.min(MOST_FOLDS);
            let by = "by = \"cross_validation\"";
            let folds = format!("{by}, folds = {{ type = \"segments\", count = {count} }}");
            module = module.replace(by, &folds);
        }
        let learns = self.survey.duration_s >= FEWEST_WINDOWS_TO_LEARN * drift_s;
        let is_written = |part: &&str| {
            (has_halves || !part.contains(".half-")) && (learns || !part.contains(".learner]"))
        };
        let parts: Vec<&str> = module.split("\n\n").filter(is_written).collect();
        let mut module = parts.join("\n\n");
        for (is_there, voters) in [
            (has_halves, ", \"half-1\", \"half-2\""),
            (learns, ", \"learner\""),
        ] {
            if !is_there {
                module = module.replace(voters, "");
            }
        }
        text.push_str(&module);
        let halves = || {
            let [one, other] = [0, 1].map(|half| self.regressors(|number| number % 2 == half));
            format!("half-1 = {one}\nhalf-2 = {other}\n")
        };
        let halves = has_halves.then(halves).unwrap_or_default();
        let none = self.clock.length(0.0);
        let lags = |first: i32| {
            let lag = |nth: i32| self.clock.length(f64::from(first + nth) * drift_s);
            list(&[0, 1, 2].map(|nth| toml_string(&lag(nth))))
        };
        let of_now = match (learns, self.many()) {
            (false, _) => "[]",
            (_, true) => "\"motion.{axis}\"",
            _ => "\"motion\"",
        };
        if learns {
            let why = "from the drift of the past alone: it votes in `now`";
            let _ = write!(
                text,
                "\n{}\ntype = \"ar\"\n{each}inputs.truth = \"drift.{axis}\"\nahead = \"{none}\"\nlags = {}\n",
                beside("[nodes.motion]", why),
                lags(1),
            );
        }
        for (node, ahead, first_lag, more, why) in [
            (
                "now",
                &none,
                1,
                of_now,
                "a virtual sensor: the drift of the last",
            ),
            ("next", &width, 0, "[]", "a forecast: the drift of the next"),
        ] {
            let _ = write!(
                text,
                "\n{}\nmodule = \"prediction\"\n{each}ahead = \"{ahead}\"\nlags = {}\n\
                 [nodes.{node}.inputs]\nsensors = {}\n{halves}drift = \"drift.{axis}\"\nmore = {more}\n",
                beside(&format!("[nodes.{node}]"), &format!("{why} {width}")),
                lags(first_lag),
                self.regressors(|_| true),
            );
        }
        text.push_str("\n[outputs]\nnow = \"now\"\nnext = \"next\"\n");
    }
}

/// The name of a file without its folders.
fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// What stands in a line, and a comment beside it.
pub(super) fn beside(line: &str, comment: &str) -> String {
    format!("{line:<34} # {comment}")
}

/// The name of the node that makes something of a signal.
fn of_signal(group: &Group, what: &str) -> String {
    match group.signal.as_str() {
        "temperature" => what.to_owned(),
        signal => format!("{signal}-{what}"),
    }
}

/// A text as TOML writes it.
pub(super) fn toml_string(text: &str) -> String {
    toml::Value::from(text).to_string()
}

fn list(names: &[String]) -> String {
    match names {
        [one] => one.clone(),
        many => format!("[{}]", many.join(", ")),
    }
}
