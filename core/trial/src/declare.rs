//! Decides what `[[tests]]` mean for a graph: channels looked up, units checked, mistakes reported where they stand.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use super::channels::Channels;
use super::data::{DataSet, Simulation};
use super::expectation::Expectation;
use super::problem::{self, NotFound};
use super::series::{Series, Synthetic};
use super::shape;
use super::table::SimulationTable;
use crate::compile::{Part, Plan, Reference, SourceChannel};
use crate::diagnostic::{Diagnostics, Place, Problem, Sources};
use crate::document::problem::{EmptyList, MissingKey, WrongType};
use crate::document::{
    Data, FileReader, GraphFile, Hint, Table, Value, decode, is_misspelt, known_keys, unreadable,
};
use crate::fault::{FaultSpec, Faults};
use crate::machine::{KnownMachine, LONGEST_DAYS, Machine, Schedule, plans};
use crate::registry::find;
use crate::time::Duration;
use crate::unit::Unit;

const KEYS: [&str; 6] = ["name", "fit", "on", "inputs", "faults", "expect"];

/// A test of a graph.
#[derive(Debug, Clone)]
pub struct Trial {
    /// What it shows.
    pub name: String,
    /// Where it stands.
    pub place: Place,
    /// The data that estimators are fitted on.
    pub fit: Option<DataSet>,
    /// What the graph is run over.
    pub on: On,
    /// What is wrong with the sensors during the run.
    pub faults: Vec<FaultSpec>,
    /// What must come out.
    pub expect: Vec<Expectation>,
}

/// What a graph is run over.
#[derive(Debug, Clone)]
pub enum On {
    /// Recorded or simulated data.
    Data(DataSet),
    /// Made-up measurements.
    Synthetic(Synthetic),
}

/// What the tests of a graph are; `None` after any mistake, all of which are reported. Schedules are read, and added to `sources`.
pub fn declare(
    graph: &GraphFile,
    plan: &Plan,
    reader: &dyn FileReader,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<Vec<Trial>> {
    read(graph, (plan, None), reader, sources, diagnostics)
}

/// Tells what is wrong with the tests of a graph that has other mistakes, as far as it shows beside them.
pub fn mistakes(
    graph: &GraphFile,
    part: &Part,
    reader: &dyn FileReader,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) {
    let plan = (part.plan(), Some(part));
    read(graph, plan, reader, sources, diagnostics);
}

fn read(
    graph: &GraphFile,
    (plan, part): (&Plan, Option<&Part>),
    reader: &dyn FileReader,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<Vec<Trial>> {
    let Some(tests) = graph.tests.as_ref().and_then(Value::as_list) else {
        return Some(Vec::new());
    };
    let before = diagnostics.error_count();
    let mut trials: Vec<Trial> = Vec::new();
    let mut names: Vec<(&str, Place)> = Vec::new();
    let mut schedules = Schedules::new();
    let mut compared = BTreeSet::new();
    let channels = Channels::of(plan, &graph.outputs);
    for test in tests {
        let Some(table) = test.as_table() else {
            diagnostics.report(test.place, wrong_type("tests", "a table", test));
            continue;
        };
        let name = table.get("name");
        let text = name.and_then(Value::as_text);
        if let (Some(name), Some(text)) = (name, text) {
            match names.iter().find(|(taken, _)| *taken == text) {
                Some(&(_, first)) => {
                    let name_twice = problem::DuplicateName {
                        name: text.to_owned(),
                        first,
                    };
                    diagnostics.report(name.place, name_twice);
                }
                None => names.push((text, name.place)),
            }
        }
        let context = text.map_or_else(|| "a test".to_owned(), |name| format!("test \"{name}\""));
        let own = graph.tree.place.source;
        let inherited_by = (test.place.source != own).then(|| sources.path(own).to_owned());
        let trial = diagnostics.within(context, |diagnostics| {
            Declaring {
                plan,
                channels: &channels,
                part,
                inherited_by,
                reader,
                sources,
                schedules: &mut schedules,
                compared: &mut compared,
                diagnostics,
            }
            .trial(test, table)
        });
        trials.extend(trial);
    }
    (diagnostics.error_count() == before).then_some(trials)
}

/// Makes the plan compute every port that its tests look at, whether another node reads it or not.
pub fn observe(plan: &mut Plan, trials: &[Trial]) {
    let expectations = trials.iter().flat_map(|trial| &trial.expect);
    plan.observe(expectations.flat_map(|expectation| expectation.slots.iter().copied()));
}

/// The schedules that have been read for a machine, so that mistakes in one are reported once; nothing for one that has any.
type Schedules = BTreeMap<(PathBuf, &'static str), Option<Schedule>>;

/// Reads one test; what it expects is read in a file of its own.
pub(super) struct Declaring<'a> {
    pub(super) plan: &'a Plan,
    channels: &'a Channels<'a>,
    /// What of a graph with mistakes is missing in the plan; none where it has no mistakes.
    part: Option<&'a Part>,
    /// The file that inherits the test, where it stands in another.
    inherited_by: Option<String>,
    reader: &'a dyn FileReader,
    sources: &'a mut Sources,
    schedules: &'a mut Schedules,
    /// The machines of which it is known what they measure of what the graph does.
    compared: &'a mut BTreeSet<&'static str>,
    pub(super) diagnostics: &'a mut Diagnostics,
}

impl Declaring<'_> {
    fn trial(&mut self, test: &Value, table: &Table) -> Option<Trial> {
        known_keys(table, &KEYS, "a test", self.diagnostics);
        let misspelt = |key: &str| is_misspelt(table, key, &KEYS);
        let name = match table.get("name") {
            Some(value) => {
                if value.as_text().is_none() {
                    let problem = wrong_type("name", "a text in quotes", value);
                    self.diagnostics.report(value.place, problem);
                }
                value.as_text()
            }
            None if misspelt("name") => None,
            None => {
                let problem = MissingKey {
                    key: "name".to_owned(),
                    what: "a test".to_owned(),
                    advice: Some("describe in a sentence what it shows: name = \"…\"".to_owned()),
                };
                self.diagnostics.report(test.place, problem);
                None
            }
        };
        let fit = table.get("fit").map(|value| self.data("fit", value));
        let on = match (table.entry("on"), table.entry("inputs")) {
            (Some(on), None) => self.data("on", &on.value).map(On::Data),
            (None, Some(inputs)) => self.inputs(&inputs.value).map(On::Synthetic),
            (Some(on), Some(inputs)) => {
                let problem = problem::TwoData { inputs: inputs.key };
                self.diagnostics.report(on.key, problem);
                None
            }
            (None, None) if misspelt("on") || misspelt("inputs") => None,
            (None, None) => {
                self.diagnostics.report(test.place, problem::NoData {});
                None
            }
        };
        let faults = match table.get("faults") {
            Some(value) => self.list("faults", value, Self::fault),
            None => Some(Vec::new()),
        };
        let expect = match table.get("expect") {
            Some(value) => self.list("expect", value, Self::expectation),
            None => Some(Vec::new()),
        };
        let stated = table.get("expect");
        let nothing = stated.map_or(!misspelt("expect"), |list| {
            list.as_list().is_some_and(<[Value]>::is_empty)
        });
        if nothing {
            let place = stated.map_or(test.place, |value| value.place);
            let problem = problem::NothingExpected { what: "the test" };
            self.diagnostics.report(place, problem);
        }
        Some(Trial {
            name: name?.to_owned(),
            place: test.place,
            fit: fit.map_or(Some(None), |fit| fit.map(Some))?,
            on: on?,
            faults: faults?.concat(),
            expect: expect?,
        })
    }

    /// The entries of a list that have no mistakes.
    fn list<T>(
        &mut self,
        key: &str,
        value: &Value,
        read: impl Fn(&mut Self, &Value) -> Option<T>,
    ) -> Option<Vec<T>> {
        let Some(list) = value.as_list() else {
            let mut problem = wrong_type(key, "a list of tables", value);
            problem.hint = Hint::for_tables(&value.data);
            self.diagnostics.report(value.place, problem);
            return None;
        };
        let before = self.diagnostics.error_count();
        let read: Vec<T> = list.iter().filter_map(|value| read(self, value)).collect();
        (self.diagnostics.error_count() == before).then_some(read)
    }

    fn data(&mut self, key: &'static str, value: &Value) -> Option<DataSet> {
        let resolve = |value: &Value| {
            let path = value.as_text()?;
            Some(self.sources.resolve(value.place, path))
        };
        match &value.data {
            Data::Text(_) => Some(DataSet::Files(vec![resolve(value)?])),
            Data::List(files) if files.iter().all(|file| file.as_text().is_some()) => {
                if files.is_empty() {
                    let what = format!("the list of files for \"{key}\"");
                    let problem = EmptyList { what };
                    self.diagnostics.report(value.place, problem);
                    return None;
                }
                Some(DataSet::Files(files.iter().filter_map(resolve).collect()))
            }
            Data::Table(_) => self.simulation(key, value),
            _ => {
                let expected = "a file, a list of files, or { simulate = \"MACHINE\" }";
                let problem = wrong_type(key, expected, value);
                self.diagnostics.report(value.place, problem);
                None
            }
        }
    }

    fn simulation(&mut self, key: &'static str, value: &Value) -> Option<DataSet> {
        let what = format!("\"{key}\"");
        let table = decode::<SimulationTable>(value, &what, self.diagnostics)?;
        let place = value.place_of("simulate");
        if !(table.days > 0.0 && table.days <= LONGEST_DAYS) {
            let found = table.days.to_string();
            self.range(value, "days", found, "above 0 and at most 3653");
        }
        let known = find::<KnownMachine>(&table.simulate);
        let known = known.map_err(|why| {
            self.diagnostics
                .report(place, problem::UnknownMachine { why });
        });
        let known = known.ok()?;
        // What one lacks is lacking in every test that simulates it, and reported once.
        if self.compared.insert(known.machine.name()) {
            let test = self.diagnostics.scope(None);
            self.measured_by(known.machine, place);
            self.diagnostics.scope(test);
        }
        let schedule = match &table.schedule {
            Some(path) => Some(self.schedule(path, value.place_of("schedule"), known.machine)?),
            None => None,
        };
        Some(DataSet::Simulated(Simulation {
            machine: known.machine.name(),
            days: table.days,
            seed: table.seed,
            schedule,
            changes: table.change,
        }))
    }

    /// Whether a machine measures what the graph reads, in units that convert.
    fn measured_by(&mut self, machine: &dyn Machine, place: Place) {
        let plan = self.plan;
        let channels = machine.channels();
        let measures = |name: &str| channels.iter().find(|channel| channel.reference() == name);
        let needed = plan.sources.iter().filter(|source| !source.optional);
        // A signal with mistakes may be optional.
        let sure = |source: &&SourceChannel| {
            let signal = Reference::parse(&source.name).node;
            !self.part.is_some_and(|part| part.is_broken(signal))
        };
        let missing: Vec<String> = needed
            .filter(sure)
            .filter(|source| measures(&source.name).is_none() && !plans(machine, source))
            .map(|source| source.name.clone())
            .collect();
        if !missing.is_empty() {
            let problem = problem::MachineLacks {
                machine: machine.name(),
                channels: missing,
                has: channels.iter().map(|channel| channel.reference()).collect(),
                inherited_by: self.inherited_by.clone(),
            };
            self.diagnostics.report(place, problem);
        }
        for (source, planned) in plan.sources.iter().zip(&plan.channels) {
            let unit = measures(&source.name).and_then(|channel| Unit::parse(channel.unit).ok());
            if let Some(unit) = unit.filter(|unit| !unit.measures_same(&planned.channel.unit)) {
                let problem = problem::Units {
                    key: "simulate",
                    found: unit,
                    channel: source.name.clone(),
                    expected: planned.channel.unit.clone(),
                };
                self.diagnostics.report(place, problem);
            }
        }
    }

    /// A schedule from its file, in which its mistakes are reported.
    fn schedule(&mut self, path: &str, place: Place, machine: &dyn Machine) -> Option<Schedule> {
        let path = self.sources.resolve(place, path);
        let known = (path.clone(), machine.name());
        if let Some(read) = self.schedules.get(&known) {
            return read.clone();
        }
        let shown = path.display().to_string();
        let text: Arc<str> = match self.reader.read_named(&path) {
            Ok(text) => text.into(),
            Err(error) => {
                let reason = unreadable(&error);
                let problem = problem::ScheduleUnreadable {
                    path: shown,
                    reason,
                };
                self.diagnostics.report(place, problem);
                self.schedules.insert(known, None);
                return None;
            }
        };
        let parsed = Schedule::parse(&text, machine.set_points());
        let schedule = parsed
            .map_err(|errors| {
                let file = self.sources.add(shown, Arc::clone(&text));
                for error in errors {
                    let place = self.sources.line(file, error.line);
                    self.diagnostics.report(
                        place,
                        problem::InSchedule {
                            reason: error.reason,
                        },
                    );
                }
            })
            .ok();
        self.schedules.insert(known, schedule.clone());
        schedule
    }

    fn inputs(&mut self, value: &Value) -> Option<Synthetic> {
        let Some(table) = value.as_table() else {
            let expected = "a table with a key for each channel";
            let problem = wrong_type("inputs", expected, value);
            self.diagnostics.report(value.place, problem);
            return None;
        };
        let mut channels: Vec<(usize, Series)> = Vec::new();
        if table.is_empty() {
            self.diagnostics.report(value.place, problem::NoData {});
        }
        let plan = self.plan;
        for (reference, entry) in table.iter() {
            let Some(slots) = self.measured(reference, entry.key) else {
                continue;
            };
            for slot in slots {
                if channels.iter().any(|(taken, _)| *taken == slot) {
                    let channel = plan.sources[slot].name.clone();
                    let problem = problem::ChannelTwice { channel };
                    self.diagnostics.report(entry.key, problem);
                    continue;
                }
                let planned = &plan.channels[slot];
                let series = shape::read(
                    &entry.value,
                    &planned.name,
                    &planned.channel.unit,
                    self.diagnostics,
                );
                channels.extend(series.map(|series| (slot, series)));
            }
        }
        (!channels.is_empty()).then_some(Synthetic { channels })
    }

    fn fault(&mut self, value: &Value) -> Option<Vec<FaultSpec>> {
        let spec = decode::<FaultSpec>(value, "the fault", self.diagnostics)?;
        if spec.from < Duration::ZERO {
            self.range(value, "from", spec.from.to_string(), "0 or later");
        }
        if let Some(lasting) = spec.lasting.filter(|lasting| *lasting <= Duration::ZERO) {
            self.range(value, "for", lasting.to_string(), "greater than 0");
        }
        if spec.size.is_some() && !spec.kind.has_size() {
            let problem = problem::ExcludedKeys {
                key: "size",
                with: "kind",
            };
            self.diagnostics.report(value.place_of("size"), problem);
        }
        let plan = self.plan;
        let slots = self.measured(&spec.channel, value.place_of("channel"))?;
        let one = |slot: usize| {
            let name = plan.sources[slot].name.as_str();
            let unit = &plan.channels[slot].channel.unit;
            let named = FaultSpec {
                channel: name.to_owned(),
                ..spec.clone()
            };
            named
                .resolve(&[(name, unit)])
                .and_then(|faults| {
                    let short = faults.into_iter().map(|fault| crate::fault::Fault {
                        from_ns: 0,
                        for_ns: 1,
                        ..fault
                    });
                    Faults::new(short.collect(), 1, 1)
                })
                .map(|_| named)
        };
        let made: Result<Vec<_>, _> = slots.into_iter().map(one).collect();
        made.map_err(|error| {
            let key = if spec.size.is_some() { "size" } else { "kind" };
            let problem = problem::Fault { error };
            self.diagnostics.report(value.place_of(key), problem);
        })
        .ok()
    }

    pub(super) fn channels(&mut self, reference: &str, place: Place) -> Option<Vec<usize>> {
        self.channels
            .look_up(reference)
            .map_err(|problem| self.not_found(reference, place, problem))
            .ok()
    }

    /// The channels of what is to be beaten, which may be no node as well.
    pub(super) fn rival(&mut self, reference: &str, place: Place) -> Option<Vec<usize>> {
        let unknown = self.channels.unknown(reference, &["zero", "persistence"]);
        let found = match unknown {
            Some(unknown) => Err(unknown.into()),
            None => self.channels.look_up(reference),
        };
        found
            .map_err(|problem| self.not_found(reference, place, problem))
            .ok()
    }

    fn measured(&mut self, reference: &str, place: Place) -> Option<Vec<usize>> {
        let plan = self.plan;
        match self.channels.look_up_measured(reference) {
            Ok(Ok(slots)) => Some(slots),
            Ok(Err(channel)) => {
                let known = plan.sources.iter().map(|source| source.name.clone());
                let problem = problem::NotMeasured {
                    channel,
                    known: known.collect(),
                };
                self.diagnostics.report(place, problem);
                None
            }
            Err(problem) => {
                self.not_found(reference, place, problem);
                None
            }
        }
    }

    /// Tells that a reference names nothing, unless what it names may be missing.
    fn not_found(&mut self, reference: &str, place: Place, problem: Box<dyn Problem>) {
        let name = Reference::parse(reference).whole_node();
        if !self.part.is_some_and(|part| part.is_broken(&name)) {
            let inherited_by = self.inherited_by.clone();
            let not_found = NotFound {
                problem,
                of_the_node: self.channels.of_the_node(reference),
                inherited_by,
            };
            self.diagnostics.report(place, not_found);
        }
    }

    pub(super) fn range(
        &mut self,
        value: &Value,
        key: &'static str,
        found: String,
        allowed: &'static str,
    ) {
        let problem = problem::Range {
            key,
            found,
            allowed,
        };
        self.diagnostics.report(value.place_of(key), problem);
    }
}

fn wrong_type(key: &str, expected: &str, value: &Value) -> WrongType {
    WrongType {
        key: Some(key.to_owned()),
        expected: expected.to_owned(),
        found: value.found(),
        hint: None,
    }
}
