//! Which inputs of a node stand beside its parameters instead of under `inputs`.

use crate::diagnostic::nearest;
use crate::document::Table;
use crate::node::Kind;

/// The table of all inputs of a node.
pub(super) const INPUTS: &str = "inputs";

/// Keys among the parameters of a node that its kind does not have, each with the input that is meant, or [`INPUTS`].
pub(super) fn misplaced(kind: &Kind, parameters: &Table) -> Vec<(String, &'static str)> {
    let ports = (kind.inputs)().iter().map(|port| port.name);
    let ports: Vec<&'static str> = ports.chain([INPUTS]).collect();
    let schema = (kind.schema)()["properties"].as_object();
    let own = schema.into_iter().flat_map(|own| own.keys());
    let own = own
        .map(String::as_str)
        .chain(kind.framework_keys().iter().copied());
    let own: Vec<&str> = own.collect();
    let meant = |key: &str| {
        if own.contains(&key) {
            return None;
        }
        let is_port = |name: &&'static str| ports.contains(name);
        let same = ports.iter().copied().find(|name| *name == key);
        // A parameter that is as near may be meant as well.
        same.or_else(|| nearest(key, own.iter().chain(&ports).copied()).filter(is_port))
    };
    let meant = parameters
        .keys()
        .filter_map(|key| Some((key.to_owned(), meant(key)?)));
    meant.collect()
}
