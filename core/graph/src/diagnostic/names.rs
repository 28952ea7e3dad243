//! The names that there are, for messages that list them or find the nearest of an unknown one.

use indexmap::IndexSet;

use super::nearest::nearest;

/// The names that there are, in the order in which they are shown.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Names {
    names: IndexSet<String>,
}

impl Names {
    /// All of them, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &str> {
        self.names.iter().map(String::as_str)
    }

    /// Whether a name is among them.
    #[must_use]
    pub fn contains(&self, name: &str) -> bool {
        self.names.contains(name)
    }

    /// As [`nearest()`] of all of them.
    #[must_use]
    pub fn nearest(&self, name: &str) -> Option<&str> {
        nearest(name, self.iter())
    }
}

impl FromIterator<String> for Names {
    fn from_iter<I: IntoIterator<Item = String>>(names: I) -> Self {
        Self {
            names: names.into_iter().collect(),
        }
    }
}
