//! The text of a graph, put together from its parts. Decides nothing that is expected.

use std::fmt;
use std::ops::Deref;

/// The text of a graph. In lines that are given, `'` stands for `"`, and `; ` parts two lines; several names stand between spaces.
#[derive(Clone)]
pub struct Graph(String);

impl Graph {
    pub fn new() -> Self {
        Self("schema = 1\n".to_owned())
    }

    pub fn named(name: &str) -> Self {
        Self::new().with(&format!("name = '{name}'"))
    }

    /// One that a file is extended by.
    pub fn extending(file: impl fmt::Debug) -> Self {
        Self(format!("schema = 1\nextends = {file:?}\n"))
    }

    /// The least that is fitted of a die tester: the axis Z1 by the slopes of these temperatures.
    pub fn of_die_tester(name: &str, temperatures: &str) -> Self {
        Self::named(name)
            .time("time_s")
            .signal("temperature", "Cel", temperatures, "1min")
            .with("column = '{channel}_degC'")
            .signal("position", "nm", "Z1", "3min")
            .with("column = '{channel}_nm'")
            .slope("drift", "position", "5min", "nm/min")
            .slope("gradients", "temperature", "5min", "mK/min")
            .model("thermal", "linear", "gradients", "drift.Z1", "5min")
            .outputs("predicted = 'thermal'")
    }

    /// Its text with something else in a place; one that is nowhere is a mistake of the test.
    #[track_caller]
    pub fn replace(&self, place: &str, by: &str) -> String {
        assert!(self.contains(place), "`{place}` is not in:\n{self}");
        self.0.replace(place, by)
    }

    /// More lines of what was added last.
    pub fn with(mut self, lines: &str) -> Self {
        self.0 += &lines.replace("; ", "\n").replace('\'', "\"");
        self.0 += "\n";
        self
    }

    pub fn section(mut self, header: &str, lines: &str) -> Self {
        self.0 += &format!("\n[{header}]\n");
        self.with(lines)
    }

    pub fn time(self, column: &str) -> Self {
        self.section("time", &format!("column = '{column}'"))
    }

    pub fn signal(self, name: &str, unit: &str, channels: &str, max_age: &str) -> Self {
        let lines = format!("unit = '{unit}'; channels = {}", list(channels));
        let signal = self.section(&format!("signals.{name}"), &lines);
        signal.with(&format!("max_age = '{max_age}'"))
    }

    /// A node of one input, `signal`.
    pub fn node(self, name: &str, kind: &str, signal: &str) -> Self {
        self.kind(name, kind).inputs(&[("signal", signal)])
    }

    /// Slopes over windows, in a unit if one is named.
    pub fn slope(self, name: &str, signal: &str, windows: &str, unit: &str) -> Self {
        let slope = self.node(name, "slope", signal);
        let slope = slope.with(&format!("windows = {}", list(windows)));
        match unit {
            "" => slope,
            unit => slope.with(&format!("unit = '{unit}'")),
        }
    }

    /// An estimator; some have no features.
    pub fn model(self, name: &str, kind: &str, features: &str, truth: &str, ahead: &str) -> Self {
        let model = self.kind(name, kind);
        let model = model.inputs(&[("features", features), ("truth", truth)]);
        model.with(&format!("ahead = '{ahead}'"))
    }

    /// A node of voters; some have no truth.
    pub fn vote(self, name: &str, kind: &str, voters: &str, truth: &str) -> Self {
        let inputs = [("voters", voters), ("truth", truth)];
        self.kind(name, kind).inputs(&inputs)
    }

    pub fn outputs(self, lines: &str) -> Self {
        self.section("outputs", lines)
    }

    fn kind(self, name: &str, kind: &str) -> Self {
        self.section(&format!("nodes.{name}"), &format!("type = '{kind}'"))
    }

    fn inputs(self, inputs: &[(&str, &str)]) -> Self {
        let given = inputs.iter().filter(|(_, from)| !from.is_empty());
        given.fold(self, |graph, (port, from)| {
            let from = match from {
                table if table.starts_with(['{', '[']) => (*table).to_owned(),
                several if several.contains(' ') => list(several),
                one => format!("'{one}'"),
            };
            graph.with(&format!("inputs.{port} = {from}"))
        })
    }
}

fn list(names: &str) -> String {
    format!("{:?}", names.split(' ').collect::<Vec<_>>())
}

impl Deref for Graph {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl AsRef<[u8]> for Graph {
    fn as_ref(&self) -> &[u8] {
        self.0.as_bytes()
    }
}

impl fmt::Display for Graph {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self)
    }
}
