//! Decides under which names states and fitted predictors become known, and which names were taken twice; what stands under them
//! in a file is decided by what is written.

use std::fmt;
use std::sync::OnceLock;

use serde::Serialize;

/// A name under which something of a node is written into snapshots or models. All crates of a program share these names;
/// [`state!`](crate::state) and [`predictor!`](crate::predictor) make them known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct WrittenName {
    /// Of what it is the name.
    #[serde(rename = "role")]
    pub of: Written,
    /// The name.
    pub name: &'static str,
    /// The crate that brings it.
    pub package: &'static str,
    /// The version of that crate.
    pub version: &'static str,
}

/// What is written under a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Written {
    /// See [`State`](super::State).
    State,
    /// See [`Predictor`](super::Predictor).
    Predictor,
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::State => "state",
            Self::Predictor => "predictor",
        })
    }
}

inventory::collect!(WrittenName);

/// All these names that are linked into this program, in order; a name that was taken twice stands there twice.
pub fn written_names() -> &'static [WrittenName] {
    static NAMES: OnceLock<Vec<WrittenName>> = OnceLock::new();
    NAMES.get_or_init(|| {
        let mut names: Vec<_> = inventory::iter::<WrittenName>().copied().collect();
        names.sort_unstable();
        names
    })
}

/// The first of a crate's names that is taken twice: what it names, the name and the crates that took it.
pub fn taken_twice(package: &str) -> Option<(Written, &'static str, Vec<&'static str>)> {
    let mut names = written_names().chunk_by(|a, b| (a.of, a.name) == (b.of, b.name));
    let of_package = |same: &&[WrittenName]| same.iter().any(|of| of.package == package);
    let twice = names.find(|same| same.len() > 1 && of_package(same))?;
    Some((
        twice[0].of,
        twice[0].name,
        twice.iter().map(|of| of.package).collect(),
    ))
}

#[doc(hidden)]
#[macro_export]
macro_rules! __written {
    ($of:ident, $name:literal) => {
        $crate::inventory::submit! {
            $crate::node::WrittenName {
                of: $crate::node::Written::$of,
                name: $name,
                package: env!("CARGO_PKG_NAME"),
                version: env!("CARGO_PKG_VERSION"),
            }
        }
    };
}
