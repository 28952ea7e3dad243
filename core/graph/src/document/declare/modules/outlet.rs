//! Which node inside of a module an output of it stands for, however deep.

use super::module::{Module, find};
use crate::diagnostic::Diagnostics;
use crate::document::tree::{Table, Value};

/// What an output of a module stands for.
pub(super) enum Outlet<'a> {
    /// A node inside, and its port where one is named.
    Found(String),
    /// There is no such output; these there are, if any.
    Unknown(Option<&'a Table>),
    /// A mistake in it has been reported.
    Broken,
}

/// What an output of a module stands for; the first where no port is named.
pub(super) fn outlet<'a>(
    module: &'a str,
    port: Option<&str>,
    modules: &[&'a Table],
    depth: usize,
) -> Outlet<'a> {
    let Some((found, sight)) = find(module, modules).filter(|_| depth > 0) else {
        return Outlet::Broken;
    };
    let Some(module) = Module::read(module, found, &mut Diagnostics::new()) else {
        return Outlet::Broken;
    };
    let outputs = module.outputs;
    let wanted = match port {
        None => outputs.and_then(|outputs| outputs.iter().next().map(|(_, entry)| entry)),
        Some(port) => outputs.and_then(|outputs| outputs.entry(port)),
    };
    let Some(entry) = wanted else {
        return Outlet::Unknown(outputs);
    };
    let Some(reference) = entry.value.as_text() else {
        return Outlet::Broken;
    };
    let (node, port, _) = parts(reference);
    let Some(inner) = module.nodes.get(node) else {
        return Outlet::Broken;
    };
    let instantiates = inner.as_table().and_then(|keys| keys.get("module"));
    let Some(inner) = instantiates.and_then(Value::as_text) else {
        return Outlet::Found(reference.to_owned());
    };
    let mut seen = modules[..=sight].to_vec();
    seen.extend(module.modules);
    match outlet(inner, port, &seen, depth - 1) {
        Outlet::Found(target) => Outlet::Found(format!("{node}/{target}")),
        // The mistake stands in this module's outputs, not in the reference.
        Outlet::Unknown(_) => Outlet::Broken,
        Outlet::Broken => Outlet::Broken,
    }
}

/// Node, port and channel of a reference.
pub(super) fn parts(text: &str) -> (&str, Option<&str>, Option<&str>) {
    let Some(end) = text.find(['.', ':']) else {
        return (text, None, None);
    };
    let (node, rest) = (&text[..end], &text[end + 1..]);
    if text.as_bytes()[end] == b'.' {
        return (node, None, Some(rest));
    }
    match rest.split_once('.') {
        Some((port, channel)) => (node, Some(port), Some(channel)),
        None => (node, Some(rest), None),
    }
}
