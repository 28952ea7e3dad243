//! `athermal browse opc.tcp://…`: walks through the variables of a server, and writes the `channels` that a source would take.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_command::{Answer, Browsed, Failure, Terminal, print};
use athermal_core::unit::Unit;
use clap::Args;
use opcua::types::{
    AttributeId, BrowseDescription, BrowseDirection, BrowseResult, DataValue, EUInformation,
    NodeClass, NodeId, Range, ReferenceDescription, ReferenceTypeId, Variant,
};

use crate::link::{Link, error_words};
use crate::node::Node;
use crate::server::{Mode, Security, Server, Settings};
use crate::source::{quiet, runtime};
use crate::value::{Uncertain, read};

/// Walks through the variables of a server: those that are numbers are written as a source, with their units and ranges where the server
/// has them.
#[derive(Debug, Args)]
pub struct Browse {
    /// Of OPC UA: how messages are secured, such as Basic256Sha256
    #[arg(long, value_name = "POLICY", default_value = "none")]
    security: Security,
    /// Of OPC UA: the folder of a source in the state of a service, with its certificates
    #[arg(long, value_name = "FOLDER")]
    certificates: Option<PathBuf>,
    /// Of OPC UA: begin at this node, such as nsu=urn:plc;s=Therm
    #[arg(long, value_name = "NODE")]
    under: Option<String>,
}

athermal_command::register_scheme!(Browse, "opc.tcp");

/// How many nodes are looked at.
const NODES: usize = 50_000;
/// How many are asked for at once.
const AT_ONCE: usize = 50;

/// A variable that is a number.
#[derive(Debug)]
struct Found {
    node: Node,
    path: Vec<String>,
    unit: Option<Unit>,
    /// What the server calls its unit, where that is none that is known.
    unknown_unit: Option<String>,
    range: Option<(f64, f64)>,
}

impl athermal_command::Browse for Browse {
    fn run(&self, at: &Browsed, terminal: &Terminal) -> Result<Answer, Failure> {
        let server: Server = at.address.parse().map_err(Failure::Request)?;
        let settings = Settings {
            server: server.clone(),
            security: self.security,
            mode: Mode::SignAndEncrypt,
            login: at.login.clone(),
            uri: "urn:athermal:machine:browse".to_owned(),
            name: "athermal browse".to_owned(),
            folder: self
                .certificates
                .clone()
                .unwrap_or_else(|| PathBuf::from("athermal-certificates")),
            patience: at.wait().min(Wait::from_secs(10)),
            retry: Wait::from_secs(1),
        };
        let _quiet = quiet();
        let runtime = runtime().map_err(|error| Failure::Outside(error.to_string()))?;
        let under = self.under.as_deref().map(|of| Node::parse(of, None));
        let under = under.transpose().map_err(Failure::Request)?;
        let walked = runtime.block_on(walk(&settings, under.as_ref(), at.wait()));
        let (found, is_whole) =
            walked.map_err(|why| Failure::Outside(format!("{server}: {why}")))?;
        if !is_whole {
            terminal.warning(format_args!(
                "not all was looked at: name a node by `--under`, or take longer, as with `--for 1min`"
            ));
        }
        if found.is_empty() {
            terminal.warning("no variable there is a number");
            return Ok(Answer::No);
        }
        print!("{}", table(&server, self.security, &found));
        terminal.note(format_args!(
            "{} variables; next: name the channels as your graph does, then `athermal check --live FILE`",
            found.len()
        ));
        Ok(Answer::Fine)
    }
}

/// Walks from a node on: variables that are numbers, and whether all was looked at.
async fn walk(
    settings: &Settings,
    under: Option<&Node>,
    patience: Wait,
) -> Result<(Vec<Found>, bool), String> {
    let began = Clock::now();
    let mut link = Link::open(settings).await?;
    let namespaces = link.namespaces().await?;
    let start = match under {
        Some(node) => node.resolve(&namespaces)?,
        None => NodeId::objects_folder_id(),
    };
    let (mut seen, mut next) = (HashSet::from([start.clone()]), vec![(start, Vec::new())]);
    let mut variables = Vec::new();
    let mut is_whole = true;
    while !next.is_empty() {
        if began.elapsed() > patience || seen.len() > NODES {
            is_whole = false;
            break;
        }
        let rest = next.split_off(next.len().min(AT_ONCE));
        let now = std::mem::replace(&mut next, rest);
        let references =
            references(&mut link, &now, ReferenceTypeId::HierarchicalReferences).await?;
        for ((_, path), references) in now.iter().zip(references) {
            for of in references {
                let id = of.node_id.node_id.clone();
                // What the server says of itself is no measurement.
                let is_own = id.namespace == 0 && path.is_empty();
                let is_node = matches!(of.node_class, NodeClass::Object | NodeClass::Variable);
                if is_own || !is_node || !seen.insert(id.clone()) {
                    continue;
                }
                let name = of.browse_name.name.to_string();
                let path = [path.as_slice(), &[name]].concat();
                if of.node_class == NodeClass::Variable {
                    variables.push((id.clone(), path.clone()));
                }
                next.push((id, path));
            }
        }
    }
    let asked: Vec<_> = variables
        .iter()
        .map(|(id, _)| (id.clone(), AttributeId::Value))
        .collect();
    let values = link.read(&asked).await?;
    let is_number = |of: &DataValue| {
        let number = of.value.as_ref().is_some_and(Variant::is_numeric);
        number || read(of, Uncertain::Sample, true).is_ok()
    };
    let numbers = variables
        .into_iter()
        .zip(values)
        .filter(|(_, of)| is_number(of));
    let numbers: Vec<_> = numbers.map(|(of, _)| of).collect();
    let mut found = Vec::with_capacity(numbers.len());
    for piece in numbers.chunks(AT_ONCE) {
        let properties = references(&mut link, piece, ReferenceTypeId::HasProperty).await?;
        let (mut asked, mut of) = (Vec::new(), Vec::new());
        for (nth, properties) in properties.iter().enumerate() {
            for property in properties {
                if matches!(
                    property.browse_name.name.as_ref(),
                    "EngineeringUnits" | "EURange"
                ) {
                    asked.push((property.node_id.node_id.clone(), AttributeId::Value));
                    of.push(nth);
                }
            }
        }
        let values = link.read(&asked).await?;
        let first = found.len();
        found.extend(piece.iter().map(|(id, path)| Found {
            node: Node::of(id, &namespaces),
            path: path.clone(),
            unit: None,
            unknown_unit: None,
            range: None,
        }));
        for (nth, value) in of.into_iter().zip(values) {
            let Some(Variant::ExtensionObject(object)) = value.value else {
                continue;
            };
            let found = &mut found[first + nth];
            if let Some(unit) = object.inner_as::<EUInformation>() {
                let names = [&unit.display_name, &unit.description];
                let names = names.map(|of| of.text.as_ref().replace('°', "deg"));
                found.unit = names.iter().find_map(|of| Unit::in_words(of));
                let name = unit.display_name.text.to_string();
                found.unknown_unit = Some(name).filter(|_| found.unit.is_none());
            } else if let Some(range) = object.inner_as::<Range>() {
                found.range = (range.low < range.high).then_some((range.low, range.high));
            }
        }
    }
    link.leave(Wait::from_millis(500)).await;
    Ok((found, is_whole))
}

/// The references of nodes, of a type and those below it.
async fn references(
    link: &mut Link,
    of: &[(NodeId, Vec<String>)],
    kind: ReferenceTypeId,
) -> Result<Vec<Vec<ReferenceDescription>>, String> {
    let asked = of.iter().map(|(id, _)| BrowseDescription {
        node_id: id.clone(),
        browse_direction: BrowseDirection::Forward,
        reference_type_id: kind.into(),
        include_subtypes: true,
        node_class_mask: 0,
        result_mask: 63,
    });
    let asked: Vec<_> = asked.collect();
    let session = Arc::clone(&link.session);
    let browse = async move { session.browse(&asked, 1000, None).await };
    let browsed = link.drive(browse).await?.map_err(|of| error_words(&of))?;
    let mut all = Vec::with_capacity(of.len());
    for mut result in browsed {
        let mut references = result.references.take().unwrap_or_default();
        while !result.continuation_point.is_null() && references.len() < NODES {
            let session = Arc::clone(&link.session);
            let point = [result.continuation_point.clone()];
            let more = async move { session.browse_next(false, &point).await };
            let more = link.drive(more).await?.map_err(|of| error_words(&of))?;
            result = more
                .into_iter()
                .next()
                .unwrap_or_else(BrowseResult::default);
            references.extend(result.references.take().unwrap_or_default());
        }
        all.push(references);
    }
    all.resize_with(of.len(), Vec::new);
    Ok(all)
}

/// A text as TOML writes it.
fn quoted(text: &str) -> String {
    let mut quoted = "\"".to_owned();
    for of in text.chars() {
        match of {
            '"' => quoted += "\\\"",
            '\\' => quoted += "\\\\",
            of if of.is_control() => quoted += &format!("\\u{:04x}", u32::from(of)),
            of => quoted.push(of),
        }
    }
    quoted + "\""
}

/// The table of a source.
fn table(server: &Server, security: Security, found: &[Found]) -> String {
    let mut text = format!(
        "[sources.plc]\ntype = \"opcua\"\nendpoint = {}\n",
        quoted(&server.url)
    );
    if security != Security::None {
        text += &format!("security = {}\n", quoted(security.name()));
    }
    let mut uris = BTreeMap::<_, usize>::new();
    for uri in found.iter().filter_map(|of| of.node.uri()) {
        *uris.entry(uri).or_default() += 1;
    }
    let usual = uris
        .iter()
        .max_by_key(|(_, count)| **count)
        .map(|(uri, _)| *uri);
    if let Some(uri) = usual {
        text += &format!("namespace = {}\n", quoted(uri));
    }
    text += "\n[sources.plc.channels]\n";
    let mut names = BTreeSet::new();
    for of in found {
        let node = match of.node.uri() == usual {
            true => of.node.identifier(),
            false => of.node.to_string(),
        };
        let name = quoted(&name_of(of, &mut names));
        text += &match &of.unit {
            Some(unit) => format!(
                "{name} = {{ from = {}, unit = {} }}",
                quoted(&node),
                quoted(unit.text())
            ),
            None => format!("{name} = {}", quoted(&node)),
        };
        let unit = of.unknown_unit.as_deref();
        let unit = unit.map(|of| format!("the server says unit `{}`", of.escape_debug()));
        let range = of.range.map(|(low, high)| format!("range {low} to {high}"));
        let said: Vec<_> = unit.into_iter().chain(range).collect();
        if !said.is_empty() {
            text += &format!("  # {}", said.join(", "));
        }
        text += "\n";
    }
    text
}

/// The name of a channel: what it measures, if its unit says so, and what it is called; with what it is in, where two have one name.
fn name_of(of: &Found, names: &mut BTreeSet<String>) -> String {
    let measures = |text: &str| {
        let unit = of.unit.as_ref();
        unit.is_some_and(|unit| Unit::parse(text).is_ok_and(|of| unit.measures_same(&of)))
    };
    let signal = match () {
        () if measures("Cel") => "temperature",
        () if measures("nm") => "position",
        () => "value",
    };
    let mut name = String::new();
    for part in of.path.iter().rev() {
        let plain = part
            .chars()
            .map(|of| if of.is_ascii_alphanumeric() { of } else { '_' });
        let plain: String = plain.collect();
        name = match name.is_empty() {
            true => plain,
            false => format!("{plain}_{name}"),
        };
        let full = format!("{signal}.{name}");
        if !name.is_empty() && names.insert(full.clone()) {
            return full;
        }
    }
    let mut number = 2;
    loop {
        let full = format!("{signal}.{name}{number}");
        if names.insert(full.clone()) {
            return full;
        }
        number += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_found_is_written_as_a_source_whatever_it_is_called() {
        let of = |node: &str, path: &[&str], unit: Option<&str>| Found {
            node: Node::parse(node, None).unwrap(),
            path: path.iter().map(|of| (*of).to_owned()).collect(),
            unit: unit.and_then(Unit::in_words),
            unknown_unit: unit
                .filter(|of| Unit::in_words(of).is_none())
                .map(str::to_owned),
            range: (unit == Some("degC")).then_some((0.0, 50.0)),
        };
        let found = [
            of("nsu=urn:plc;s=T.a", &["Therm", "a"], Some("degC")),
            of("nsu=urn:plc;s=U.a", &["Room", "a"], Some("degC")),
            of("nsu=urn:plc;i=7", &["Axis", "Z \"1\"\n"], Some("nm")),
            of("nsu=urn:other;s=x\"\u{7f}", &["x"], Some("bushels")),
            of("ns=9;i=1", &[], None),
        ];
        let text = table(
            &"opc.tcp://plc".parse().unwrap(),
            Security::Basic256Sha256,
            &found,
        );
        let table: toml::Table = text.parse().unwrap_or_else(|of| panic!("{of}: {text}"));
        let source = &table["sources"]["plc"];
        assert_eq!(source["namespace"].as_str(), Some("urn:plc"));
        assert_eq!(source["security"].as_str(), Some("Basic256Sha256"));
        let names: Vec<_> = source["channels"].as_table().unwrap().keys().collect();
        assert_eq!(
            names,
            [
                "temperature.a",
                "temperature.Room_a",
                "position.Z__1__",
                "value.x",
                "value.2"
            ]
        );
        assert!(
            text.contains("from = \"s=T.a\", unit = \"Cel\" }  # range 0 to 50\n"),
            "{text}"
        );
        assert!(
            text.contains("# the server says unit `bushels`\n"),
            "{text}"
        );
    }
}
