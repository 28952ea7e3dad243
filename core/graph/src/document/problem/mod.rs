//! What can be wrong with the text of a graph file, by what it is about.

mod expansion;
mod files;
mod keys;
mod modules;
mod names;
mod signals;
mod values;

pub use expansion::*;
pub use files::*;
pub use keys::*;
pub use modules::*;
pub use names::*;
pub use signals::*;
pub use values::*;

use crate::diagnostic::{Names, listed, nearest};

/// At most twelve names in quotes, for a list of what there is.
fn quoted<'a>(names: impl Iterator<Item = &'a str>) -> String {
    listed(names.map(|name| format!("\"{name}\"")), 12)
}

/// "did you mean" or a list of what there is.
fn nearest_or_all(name: &str, known: &[String], there_are: &str) -> Option<String> {
    let known = known.iter().map(String::as_str);
    meant_or_all(nearest(name, known.clone()), known, there_are)
}

/// As [`nearest_or_all`], of many.
fn nearest_of_many(name: &str, known: &Names, there_are: &str) -> Option<String> {
    meant_or_all(known.nearest(name), known.iter(), there_are)
}

fn meant_or_all<'a>(
    near: Option<&str>,
    known: impl ExactSizeIterator<Item = &'a str>,
    there_are: &str,
) -> Option<String> {
    match (near, known.len()) {
        (Some(near), _) => Some(format!("did you mean \"{near}\"?")),
        (None, 0) => None,
        (None, 1) => Some(format!("there is only {}", quoted(known))),
        (None, _) => Some(format!("{there_are} {}", quoted(known))),
    }
}
