//! `[nodes]`: each node expanded into one instance per member; kinds, references and parameters are left to the compiler.

use super::each::{Each, Member, Total, own_each, room_for};
use super::modules::{Expanded, Placed};
use super::placeholder;
use super::reading::{
    in_samples, known_keys, length, meant, missing, one_or_more, samples, table, text,
};
use super::sets::Sets;
use crate::diagnostic::Diagnostics;
use crate::document::graph_file::{InputDecl, InstanceDecl, NodeDecl};
use crate::document::problem;
use crate::document::tree::{Data, Entry, Table, Value};
use crate::time::Duration;

/// Keys that the framework reads; all others are the node's own.
pub(super) const OWN_KEYS: [&str; 3] = ["type", "each", "inputs"];

pub(super) fn declare(
    expanded: &Expanded,
    sets: &Sets,
    sample: Option<Duration>,
    broken: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) -> Vec<NodeDecl> {
    let mut total = Total::default();
    let nodes = &expanded.nodes;
    let mut declared = Vec::with_capacity(nodes.len());
    for placed in nodes {
        // Inside a module, one place in a file stands for a node of each instance.
        let context = (!placed.around.is_empty()).then(|| format!("node `{}`", placed.name));
        let outer = diagnostics.scope(context);
        let mut node = node(placed, sets, sample, &mut total, diagnostics);
        diagnostics.scope(outer);
        // Inside a module that has mistakes, what stands there may not be what was meant.
        if !placed.around.is_empty()
            && expanded.faulty
            && let Some(node) = &mut node
        {
            (node.faulty, node.open) = (true, true);
        }
        if node.as_ref().is_none_or(|node| node.faulty) {
            broken.push(placed.name.clone());
            node.iter_mut().for_each(leave_out_open);
        }
        declared.extend(node);
    }
    declared
}

fn node(
    placed: &Placed,
    sets: &Sets,
    sample: Option<Duration>,
    total: &mut Total,
    diagnostics: &mut Diagnostics,
) -> Option<NodeDecl> {
    let Placed {
        name,
        entry,
        around,
    } = placed;
    let before = diagnostics.reported();
    let keys = table(&entry.value, name, diagnostics)?;
    let what = format!("node \"{name}\"");
    // A misspelt key is reported with the parameters.
    let kind = match meant(keys, "type", &OWN_KEYS) {
        Some(value) => text(value, "type", diagnostics).map(|kind| (kind.to_owned(), value.place)),
        // Why it could not be expanded has been reported.
        None if keys.contains("module") => None,
        None => {
            missing(
                &entry.value,
                "type",
                &what,
                Some("say which kind of node it is; `athermal nodes` lists them"),
                diagnostics,
            );
            None
        }
    };
    let own = own_each(keys, sets, diagnostics);
    let each = around_and_own(placed, own.sets, sets);
    let before_texts = diagnostics.reported();
    if own.known {
        let inside = placed.around.last();
        let parameters = inside.map_or(&[][..], |around| &around.parameters);
        let named = Named {
            each: &each,
            parameters,
            what: &what,
        };
        named.check(&entry.value, diagnostics);
    }
    let mut parameters = Value::new(entry.value.place, Data::Table(own_parameters(keys)));
    convert_samples(&mut parameters, sample, diagnostics);
    let mut open = diagnostics.reported() > before_texts;
    let template = Template {
        inputs: match keys.get("inputs") {
            Some(value) => inputs(value, &what, sample, diagnostics),
            None => Vec::new(),
        },
        parameters,
        sample,
    };
    let members = if own.sound {
        let (parameters, count) = (&template.parameters, template.inputs.len());
        room_for(name, entry, &each, parameters, count, total, diagnostics)
    } else {
        None
    };
    let is_expanded = members.is_some();
    let before_members = diagnostics.reported();
    let mut instances = Vec::new();
    for member in members.into_iter().flatten() {
        let (inputs, parameters) = template.of_member(name, &member, diagnostics);
        instances.push(InstanceDecl {
            inputs,
            parameters,
            scopes: scopes(placed, &member),
            member: (!each.is_empty()).then_some(member.name),
        });
    }
    open |= !is_expanded || diagnostics.reported() > before_members;
    let faulty = open || diagnostics.reported() > before;
    if !is_expanded {
        // Without its members, a node is looked through as if it had none.
        instances.push(InstanceDecl {
            inputs: template
                .inputs
                .into_iter()
                .map(|input| input.decl)
                .collect(),
            parameters: template.parameters,
            scopes: Vec::new(),
            member: None,
        });
    }
    let each = around
        .iter()
        .flat_map(|around| &around.each)
        .cloned()
        .chain(
            each.iter()
                .skip(sets_around(placed))
                .map(|(set, _)| set.clone()),
        )
        .collect();
    Some(NodeDecl {
        name: name.clone(),
        place: entry.key,
        kind,
        each,
        instances,
        faulty,
        open,
    })
}

/// The sets of the modules around a node, then those of its own `each`.
fn around_and_own<'a>(placed: &Placed, own: Each<'a>, sets: &'a Sets) -> Each<'a> {
    let around = placed.around.iter().flat_map(|around| {
        let members = |set: &String| Some((around.placeholder(set), sets.sound(set)?));
        around.each.iter().filter_map(members)
    });
    around.chain(own).collect()
}

fn sets_around(placed: &Placed) -> usize {
    placed.around.iter().map(|around| around.each.len()).sum()
}

/// How the nodes beside this one, in each of the modules around it, name this member.
fn scopes(placed: &Placed, member: &Member<'_>) -> Vec<(String, Option<String>)> {
    let mut sets = 0;
    let mut scopes = Vec::new();
    for around in placed.around.iter() {
        sets += around.each.len();
        if sets > 0 {
            let inside = &placed.name[around.path.len()..];
            let one = placeholder::fill(&around.one, &member.pairs);
            let rest: Vec<_> = member.pairs[sets..].iter().map(|(_, name)| *name).collect();
            let rest = (!rest.is_empty()).then(|| rest.join("-"));
            scopes.push((one + inside, rest));
        }
    }
    scopes
}

/// What placeholders of a node may stand for.
struct Named<'a> {
    each: &'a Each<'a>,
    /// Those of the module in which it stands.
    parameters: &'a [String],
    what: &'a str,
}

impl Named<'_> {
    /// What the node's author can name.
    fn known(&self) -> Vec<String> {
        let own = self.each.iter().map(|(set, _)| set);
        let own = own.filter(|set| !set.contains('/'));
        own.chain(self.parameters).cloned().collect()
    }

    /// Reports placeholders that stand for nothing.
    fn check(&self, value: &Value, diagnostics: &mut Diagnostics) {
        let is_set = |name: &&str| self.each.iter().any(|(set, _)| set == name);
        value.any_text(&mut |text, place| {
            for name in placeholder::names(text).filter(|name| !is_set(name)) {
                let problem = problem::UnknownPlaceholder {
                    name: name.to_owned(),
                    known: self.known(),
                    what: self.what.to_owned(),
                    instead: None,
                };
                // Around a module it may have been reported already.
                diagnostics.report_unless_known(place, problem);
            }
            false
        });
    }
}

/// What a node says for all of its members.
struct Template {
    inputs: Vec<Input>,
    parameters: Value,
    sample: Option<Duration>,
}

/// An input, before it is known for which member.
struct Input {
    decl: InputDecl,
    /// Its maximum age, where that says something only with a member in it.
    max_age: Option<Value>,
}

impl Template {
    /// The inputs and parameters of one member. A text may be a duration or a number of samples only with the member in it.
    fn of_member(
        &self,
        node: &str,
        member: &Member<'_>,
        diagnostics: &mut Diagnostics,
    ) -> (Vec<InputDecl>, Value) {
        let mut parameters = filled(&self.parameters, &member.pairs);
        if member.pairs.is_empty() {
            let inputs = self.inputs.iter().map(|input| input.decl.clone());
            return (inputs.collect(), parameters);
        }
        let context = format!("node `{node}`, member `{}`", member.name);
        let outer = diagnostics.scope(Some(context));
        // Those that stand there without a member have been converted, or reported.
        if !has_samples(&self.parameters) {
            convert_samples(&mut parameters, self.sample, diagnostics);
        }
        let inputs = self.inputs.iter().map(|input| {
            let mut decl = filled_input(&input.decl, &member.pairs);
            let max_age = input.max_age.as_ref();
            let max_age = max_age.map(|value| filled(value, &member.pairs));
            // A placeholder that stands for nothing has been reported.
            if let Some(value) = max_age.filter(|value| !has_placeholders(value)) {
                let length = length(&value, "max_age", self.sample, diagnostics);
                decl.max_age = length.map(|length| (length, value.place));
            }
            decl
        });
        let inputs = inputs.collect();
        diagnostics.scope(outer);
        (inputs, parameters)
    }
}

fn inputs(
    value: &Value,
    what: &str,
    sample: Option<Duration>,
    diagnostics: &mut Diagnostics,
) -> Vec<Input> {
    let Some(ports) = table(value, "inputs", diagnostics) else {
        return Vec::new();
    };
    ports
        .iter()
        .map(|(port, entry)| input(port, entry, what, sample, diagnostics))
        .collect()
}

/// An input; one that does not say readably what it reads is there all the same, and reads nothing.
fn input(
    port: &str,
    entry: &Entry,
    what: &str,
    sample: Option<Duration>,
    diagnostics: &mut Diagnostics,
) -> Input {
    let input = format!("input \"{port}\" of {what}");
    let (from, max_age) = match &entry.value.data {
        Data::Table(keys) => {
            let known = ["from", "max_age"];
            known_keys(keys, &known, &input, diagnostics);
            let max_age = meant(keys, "max_age", &known);
            let from = meant(keys, "from", &known);
            if from.is_none() {
                let advice = "name what it reads, e.g. from = \"gradients\"";
                missing(&entry.value, "from", &input, Some(advice), diagnostics);
            }
            (from, max_age)
        }
        _ => (Some(&entry.value), None),
    };
    let references = from.and_then(|from| one_or_more(from, port, &input, diagnostics));
    let (open, closed) = match max_age {
        Some(value) if has_placeholders(value) => (Some(value.clone()), None),
        closed => (None, closed),
    };
    let closed = closed
        .and_then(|value| Some((length(value, "max_age", sample, diagnostics)?, value.place)));
    Input {
        decl: InputDecl {
            port: port.to_owned(),
            place: entry.key,
            references: references.unwrap_or_default(),
            max_age: closed,
        },
        max_age: open,
    }
}

fn own_parameters(keys: &Table) -> Table {
    keys.iter()
        .filter(|(key, _)| !OWN_KEYS.contains(key))
        .map(|(key, entry)| (key.to_owned(), entry.clone()))
        .collect()
}

/// Writes every number of samples as the duration that it stands for.
fn convert_samples(value: &mut Value, sample: Option<Duration>, diagnostics: &mut Diagnostics) {
    // Changing a table copies it, and hardly any has samples.
    if !has_samples(value) {
        return;
    }
    *value = value.with_texts(&mut |text, place| {
        let converted = match samples(text).map(|number| in_samples(text, number, sample)) {
            Some(Ok(duration)) => duration.to_string(),
            Some(Err(problem)) => {
                diagnostics.report(place, problem);
                text.to_owned()
            }
            None => text.to_owned(),
        };
        Value::new(place, Data::Text(converted))
    });
}

/// The same for the tables of a list, except for the text under a key that is for people.
pub(super) fn convert_samples_but(
    tables: &mut Value,
    key: &str,
    sample: Option<Duration>,
    diagnostics: &mut Diagnostics,
) {
    let Data::List(list) = &mut tables.data else {
        return;
    };
    for table in list.iter_mut().filter_map(Value::as_table_mut) {
        for (_, entry) in table.iter_mut().filter(|(name, _)| *name != key) {
            convert_samples(&mut entry.value, sample, diagnostics);
        }
    }
}

/// Leaves out the references with a placeholder that stands for nothing, which has been reported.
fn leave_out_open(node: &mut NodeDecl) {
    let inputs = node.instances.iter_mut().flat_map(|of| &mut of.inputs);
    for input in inputs {
        let open = |text: &str| placeholder::names(text).next().is_some();
        input.references.retain(|(text, _)| !open(text));
    }
}

fn filled_input(input: &InputDecl, members: &[(&str, &str)]) -> InputDecl {
    let references = input.references.iter();
    InputDecl {
        port: input.port.clone(),
        place: input.place,
        references: references
            .map(|(text, place)| (placeholder::fill(text, members), *place))
            .collect(),
        max_age: input.max_age,
    }
}

fn filled(value: &Value, members: &[(&str, &str)]) -> Value {
    // A table without placeholders is shared by all members, not copied.
    if members.is_empty() || !has_placeholders(value) {
        return value.clone();
    }
    value.with_texts(&mut |text, place| {
        let text = placeholder::fill(text, members);
        Value::new(place, Data::Text(text))
    })
}

fn has_placeholders(value: &Value) -> bool {
    value.any_text(&mut |text, _| placeholder::names(text).next().is_some())
}

fn has_samples(value: &Value) -> bool {
    value.any_text(&mut |text, _| samples(text).is_some())
}
