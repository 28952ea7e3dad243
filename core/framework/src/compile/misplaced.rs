//! Which inputs of a node stand beside its parameters instead of under `inputs`.

use crate::diagnostic::nearest;
use crate::document::Table;
use crate::node::Kind;

/// The table of all inputs of a node.
pub(super) const INPUTS: &str = "inputs";

/// Keys among the parameters of a node that its kind does not have, each with the input that is meant, or [`INPUTS`].
pub(super) fn misplaced(kind: &Kind, parameters: &Table) -> Vec<(String, &'static str)> {
    let ports = (kind.inputs)().iter().map(|port| port.name);
    let names: Vec<_> = ports.chain([INPUTS]).collect();
    let meant = |key: &str| {
        let same = names.iter().copied().find(|name| *name == key);
        same.or_else(|| nearest(key, names.iter().copied()))
    };
    let suspects = parameters.keys().filter_map(|key| Some((key, meant(key)?)));
    let suspects: Vec<_> = suspects.collect();
    if suspects.is_empty() {
        return Vec::new();
    }
    let schema = (kind.schema)();
    let own = schema.get("properties").and_then(|of| of.as_object());
    let own = own
        .into_iter()
        .flat_map(|own| own.keys().map(String::as_str));
    let own: Vec<_> = own.chain(kind.framework_keys().iter().copied()).collect();
    let is_meant = |key: &str, name: &str| {
        // A parameter that is as near may be meant as well.
        let all = own.iter().copied().chain([name]);
        !own.contains(&key) && (key == name || nearest(key, all) == Some(name))
    };
    let suspects = suspects.into_iter();
    let meant = suspects.filter(|(key, name)| is_meant(key, name));
    meant.map(|(key, name)| (key.to_owned(), name)).collect()
}
