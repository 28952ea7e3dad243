//! Many names, looked through once, so that each unknown one finds its nearest soon; what is near is decided by [`nearest()`].

use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};
use std::sync::OnceLock;

use indexmap::{IndexMap, IndexSet};

use super::nearest::{LONGEST, SHORTEST, farthest, nearest};

/// How many names are compared letter by letter with an unknown one, those that have the most letters in common with it first.
/// Fewer that are alike are all compared.
const COMPARED: usize = 200;

/// The names that there are, in the order in which they are shown.
///
/// A file may refer to thousands of names that it does not have and have thousands of others.
#[derive(Debug, Clone, Default)]
pub struct Names {
    names: IndexSet<String>,
    index: OnceLock<Index>,
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
        if name.is_empty() || name.len() > LONGEST {
            return None;
        }
        // A name is not its own nearest, and the index does not leave it out.
        if self.contains(name) {
            return nearest(name, self.iter());
        }
        let index = self.index.get_or_init(|| Index::of(self.iter()));
        let nearest = index.nearest(&name.to_lowercase())?;
        self.names.get_index(nearest).map(String::as_str)
    }
}

impl FromIterator<String> for Names {
    fn from_iter<I: IntoIterator<Item = String>>(names: I) -> Self {
        Self {
            names: names.into_iter().collect(),
            index: OnceLock::new(),
        }
    }
}

impl PartialEq for Names {
    fn eq(&self, other: &Self) -> bool {
        self.names == other.names
    }
}

/// Names in small letters, by what is known of a near one before it is compared.
#[derive(Debug, Clone, Default)]
struct Index {
    /// Each name, with its first place.
    first: HashMap<String, usize>,
    /// The number of letters and the place of the shortest name that begins so.
    begun: HashMap<String, (usize, usize)>,
    /// By the number of letters, then by the letters in order: the places of the names with these letters.
    letters: BTreeMap<usize, IndexMap<Vec<char>, Vec<usize>>>,
    lower: Vec<String>,
}

impl Index {
    fn of<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        let mut index = Self::default();
        for (at, name) in names.enumerate() {
            let lower = name.to_lowercase();
            if name.len() <= LONGEST {
                index.take(at, &lower);
            }
            index.lower.push(lower);
        }
        index
    }

    fn take(&mut self, at: usize, lower: &str) {
        let letters = in_order(lower);
        let count = letters.len();
        for (end, _) in lower
            .char_indices()
            .skip(1)
            .filter(|(end, _)| *end >= SHORTEST)
        {
            let begun = self
                .begun
                .entry(lower[..end].to_owned())
                .or_insert((count, at));
            *begun = (*begun).min((count, at));
        }
        self.first.entry(lower.to_owned()).or_insert(at);
        let same = self.letters.entry(count).or_default();
        same.entry(letters).or_default().push(at);
    }

    /// The places of the names that may be near one of these letters, those with the most of them first, each with the
    /// least distance that they can have: a step of the distance exchanges one letter at most.
    fn by_letters(&self, letters: &[char]) -> Vec<(usize, &[usize])> {
        let mut found = Vec::new();
        for (count, same) in &self.letters {
            let farthest = farthest(letters.len().max(*count));
            if letters.len().abs_diff(*count) > farthest {
                continue;
            }
            let near = same.iter().filter_map(|(theirs, places)| {
                Some((differing(letters, theirs, farthest)?, places.as_slice()))
            });
            found.extend(near);
        }
        found.sort_by_key(|(least, _)| *least);
        found
    }

    fn nearest(&self, wanted: &str) -> Option<usize> {
        let letters = in_order(wanted);
        let count = letters.len();
        // The least distance is the best, and the first place where it is the same.
        let mut best = self.begun.get(wanted).map(|(long, at)| (long - count, *at));
        let beginnings = wanted.char_indices().enumerate().skip(1);
        for (short, (end, _)) in beginnings.filter(|(_, (end, _))| *end >= SHORTEST) {
            let shorter = self.first.get(&wanted[..end]);
            best = nearer(best, shorter.map(|at| (count - short, *at)));
        }
        let mut compared = 0;
        for (least, places) in self.by_letters(&letters) {
            if compared == COMPARED || best.is_some_and(|(distance, _)| distance < least) {
                break;
            }
            let places = &places[..places.len().min(COMPARED - compared)];
            compared += places.len();
            for &at in places {
                let longer = count.max(self.lower[at].chars().count());
                let distance = strsim::damerau_levenshtein(wanted, &self.lower[at]);
                if distance <= farthest(longer) && distance < longer {
                    best = nearer(best, Some((distance, at)));
                }
            }
        }
        best.map(|(_, at)| at)
    }
}

/// The better of two distances, each with its place, where there are two.
fn nearer(one: Option<(usize, usize)>, other: Option<(usize, usize)>) -> Option<(usize, usize)> {
    one.into_iter().chain(other).min()
}

fn in_order(text: &str) -> Vec<char> {
    let mut letters: Vec<char> = text.chars().collect();
    letters.sort_unstable();
    letters
}

/// How many letters each of two names lacks of the other, the more of both, if that is `most` at most.
fn differing(one: &[char], other: &[char], most: usize) -> Option<usize> {
    let (mut i, mut j, mut lacks, mut has) = (0, 0, 0, 0);
    while i < one.len() && j < other.len() && has.max(lacks) <= most {
        match one[i].cmp(&other[j]) {
            Ordering::Less => (has, i) = (has + 1, i + 1),
            Ordering::Greater => (lacks, j) = (lacks + 1, j + 1),
            Ordering::Equal => (i, j) = (i + 1, j + 1),
        }
    }
    let differing = (has + one.len() - i).max(lacks + other.len() - j);
    (differing <= most).then_some(differing)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_nearest_of_many_is_the_one_that_looking_at_each_finds(
            names in proptest::collection::vec("[abAé]{0,7}|[a-d]{1,3}_[a-c]{1,4}", 0..40),
            name in "[abAé]{0,7}|[a-d]{1,3}_[a-c]{1,4}",
        ) {
            let of_each = nearest(&name, names.iter().map(String::as_str));
            let many: Names = names.iter().cloned().collect();
            prop_assert_eq!(many.nearest(&name), of_each);
        }
    }

    #[test]
    fn a_name_that_is_there_is_not_its_own_nearest() {
        let names: Names = ["vote", "votes", "Vote"]
            .map(str::to_owned)
            .into_iter()
            .collect();
        assert_eq!(names.nearest("vote"), Some("Vote"));
        assert_eq!(names.nearest("VOTE"), Some("vote"));
    }
}
