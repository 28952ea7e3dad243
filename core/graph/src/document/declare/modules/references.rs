//! Which node of the whole graph a reference means that is written beside or inside a module.

use super::outlet::{Outlet, outlet, parts};
use super::{DEEPEST, Expansion, Level};
use crate::diagnostic::Place;
use crate::document::problem;
use crate::document::tree::{Data, Entry, Table, Value};

impl Expansion<'_> {
    /// The table `inputs` of a node.
    pub(super) fn inputs(&mut self, value: &Value, level: &Level<'_>) -> Value {
        let Data::Table(ports) = &value.data else {
            return value.clone();
        };
        let ports = ports.iter().map(|(port, entry)| {
            let value = self.input(&entry.value, level);
            let key = entry.key;
            (port.to_owned(), Entry { key, value })
        });
        Value::new(value.place, Data::Table(ports.collect()))
    }

    /// What one input reads: a reference, a list of them, or a table that holds either.
    pub(super) fn input(&mut self, value: &Value, level: &Level<'_>) -> Value {
        let data = match &value.data {
            Data::Text(text) => return self.reference(text, value, level),
            Data::List(values) => {
                let mut all = Vec::with_capacity(values.len());
                for value in values {
                    let value = self.input(value, level);
                    match value.data {
                        // An input that was given a list is spliced in.
                        Data::List(several) => all.extend(several),
                        _ => all.push(value),
                    }
                }
                Data::List(all)
            }
            Data::Table(keys) => {
                let mut filled = Table::new();
                for (key, entry) in keys.iter() {
                    let value = match (&level.given, key) {
                        (_, "from") => self.input(&entry.value, level),
                        (Some(given), _) => given.fill(&entry.value, self.diagnostics),
                        (None, _) => entry.value.clone(),
                    };
                    let key_place = entry.key;
                    match value.data {
                        // An input that was given with an age keeps it, unless the node says another.
                        Data::Table(inner) if key == "from" => {
                            for (key, entry) in inner {
                                if key == "from" || !keys.contains(&key) {
                                    filled.insert(key, entry);
                                }
                            }
                        }
                        _ => {
                            filled.insert(
                                key,
                                Entry {
                                    key: key_place,
                                    value,
                                },
                            );
                        }
                    }
                }
                Data::Table(filled)
            }
            other => other.clone(),
        };
        Value::new(value.place, data)
    }

    fn reference(&mut self, text: &str, value: &Value, level: &Level<'_>) -> Value {
        let place = value.place;
        let mut text = text.to_owned();
        if let Some(given) = &level.given {
            if let Some((input, rest)) = leading(&text)
                && let Some(reads) = given.inputs.get(input)
            {
                return match &reads.data {
                    _ if rest.is_empty() => reads.clone(),
                    Data::Text(reference) => {
                        let rest = given.fill_text(rest, place, self.diagnostics);
                        Value::new(reads.place, Data::Text(reference.clone() + &rest))
                    }
                    _ => {
                        let problem = problem::Refused {
                            key: Some(input.to_owned()),
                            reason: format!(
                                "module \"{}\" takes a part of this input, which only a single reference has",
                                given.module
                            ),
                        };
                        self.diagnostics.report(reads.place, problem);
                        reads.clone()
                    }
                };
            }
            text = given.fill_text(&text, place, self.diagnostics);
        }
        let text = self.outside(&text, place, level);
        Value::new(place, Data::Text(text))
    }

    /// A reference as the whole graph knows it.
    fn outside(&mut self, text: &str, place: Place, level: &Level<'_>) -> String {
        let (node, port, channel) = parts(text);
        let Some(entry) = level.nodes.entry(node) else {
            if let Some(given) = &level.given {
                let inputs = given.inputs.keys().map(|input| format!("{{{input}}}"));
                let problem = problem::OutOfReach {
                    name: node.to_owned(),
                    module: given.module.clone(),
                    known: self.known(&[level.nodes], inputs),
                };
                self.diagnostics.report(place, problem);
            }
            return text.to_owned();
        };
        let prefix = level.prefix();
        let instantiates = entry.value.as_table().and_then(|keys| keys.get("module"));
        let Some(module) = instantiates.and_then(Value::as_text) else {
            return format!("{prefix}{text}");
        };
        let target = match outlet(module, port, &level.modules, DEEPEST) {
            Outlet::Found(target) => format!("{prefix}{node}/{target}"),
            Outlet::Unknown(outputs) => {
                let known = self.known(outputs.as_slice(), []);
                let problem = problem::UnknownOutput {
                    node: node.to_owned(),
                    output: port.map(str::to_owned),
                    module: module.to_owned(),
                    known,
                };
                self.diagnostics.report(place, problem);
                text.to_owned()
            }
            // What is wrong with the module is reported there.
            Outlet::Broken => text.to_owned(),
        };
        match channel {
            Some(channel) => format!("{target}.{channel}"),
            None => target,
        }
    }

    /// The section `[outputs]`.
    pub(super) fn outputs(&mut self, outputs: &mut Value, level: &Level<'_>) {
        if let Some(outputs) = outputs.as_table_mut() {
            for (_, entry) in outputs.iter_mut() {
                entry.value = self.input(&entry.value, level);
            }
        }
    }

    /// What the tests expect, and of what; what is no reference to a node stays as it is, as does the name of an output, which comes
    /// before a node of its name.
    pub(super) fn tests(&mut self, tests: &mut Value, outputs: Option<&Table>, level: &Level<'_>) {
        let is_column = |value: &Value| {
            let (head, port, _) = value.as_text().map(parts)?;
            Some(port.is_none() && outputs?.contains(head))
        };
        let is_column = |value: &Value| is_column(value).unwrap_or_default();
        let tests = tables(tests).filter_map(|test| test.get_mut("expect"));
        for expectation in tests.flat_map(tables) {
            if let Some(of) = expectation.get_mut("of").filter(|of| !is_column(of)) {
                *of = self.input(of, level);
            }
            let rivals = expectation.get_mut("beats");
            if let Some(Data::List(rivals)) = rivals.map(|rivals| &mut rivals.data) {
                for rival in rivals {
                    // These two are no nodes.
                    let is_kind = matches!(rival.as_text(), Some("zero" | "persistence"));
                    if !is_kind && !is_column(rival) {
                        *rival = self.input(rival, level);
                    }
                }
            }
        }
    }
}

/// The tables of a list.
fn tables(list: &mut Value) -> impl Iterator<Item = &mut Table> {
    let values = match &mut list.data {
        Data::List(values) => values.as_mut_slice(),
        _ => &mut [],
    };
    values.iter_mut().filter_map(Value::as_table_mut)
}

/// The input in braces with which a text begins, and what follows it.
fn leading(text: &str) -> Option<(&str, &str)> {
    text.strip_prefix('{')?.split_once('}')
}
