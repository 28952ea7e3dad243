//! The names that there are, for messages that list them or find the nearest of an unknown one.

use std::cmp::Ordering;
use std::sync::OnceLock;

use indexmap::IndexSet;

use super::nearest::nearest;

/// How many names are compared letter by letter with an unknown one: those that have the most letters in common with it.
const COMPARED: usize = 200;

/// The names that there are, in the order in which they are shown.
#[derive(Debug, Clone, Default)]
pub struct Names {
    names: IndexSet<String>,
    /// The letters of each in order, once one is looked for: a file may refer to thousands of names that it does not have.
    letters: OnceLock<Vec<Vec<char>>>,
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
        if self.names.len() <= COMPARED {
            return nearest(name, self.iter());
        }
        let letters = self
            .letters
            .get_or_init(|| self.iter().map(in_order).collect());
        let wanted = in_order(name);
        let differing = letters.iter().map(|of| differing(&wanted, of));
        let mut alike: Vec<(usize, usize)> = differing.zip(0..).collect();
        alike.select_nth_unstable(COMPARED);
        let mut places: Vec<usize> = alike[..COMPARED].iter().map(|(_, at)| *at).collect();
        places.sort_unstable();
        nearest(name, places.into_iter().map(|at| self.names[at].as_str()))
    }
}

impl FromIterator<String> for Names {
    fn from_iter<I: IntoIterator<Item = String>>(names: I) -> Self {
        Self {
            names: names.into_iter().collect(),
            letters: OnceLock::new(),
        }
    }
}

impl PartialEq for Names {
    fn eq(&self, other: &Self) -> bool {
        self.names == other.names
    }
}

fn in_order(text: &str) -> Vec<char> {
    let mut letters: Vec<char> = text.to_lowercase().chars().collect();
    letters.sort_unstable();
    letters
}

/// How many letters each of two names lacks of the other, the more of both: their distance is no less.
fn differing(one: &[char], other: &[char]) -> usize {
    let (mut i, mut j) = (0, 0);
    let mut common = 0;
    while i < one.len() && j < other.len() {
        match one[i].cmp(&other[j]) {
            Ordering::Less => i += 1,
            Ordering::Greater => j += 1,
            Ordering::Equal => (i, j, common) = (i + 1, j + 1, common + 1),
        }
    }
    one.len().max(other.len()) - common
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_of_thousands_is_the_one_that_looking_at_each_finds() {
        let of = |nth: usize| format!("plate_{nth:04}");
        let names: Names = (0..2000).map(of).collect();
        for wanted in [
            "plat_1234",
            "plate_123",
            "1234_plate",
            "Plate_0777",
            "plate_1",
        ] {
            assert_eq!(
                names.nearest(wanted),
                nearest(wanted, names.iter()),
                "{wanted}"
            );
        }
    }
}
