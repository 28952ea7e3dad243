//! What can be wrong with a graph that reads well, by what it is about.

mod agreement;
mod inputs;
mod kinds;
mod outputs;
mod references;
mod truth;

pub use agreement::*;
pub use inputs::*;
pub use kinds::*;
pub use outputs::*;
pub use references::*;
pub use truth::*;

use crate::diagnostic::{Names, names, nearest};

fn nearest_or_all<T: AsRef<str>>(name: &str, known: &[T], there_are: &str) -> String {
    match nearest(name, known.iter().map(AsRef::as_ref)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("{there_are} {}", names(known)),
    }
}

/// As [`nearest_or_all`], of many.
fn nearest_of_many(name: &str, known: &Names, there_are: &str) -> String {
    match known.nearest(name) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("{there_are} {}", names(known.iter())),
    }
}
