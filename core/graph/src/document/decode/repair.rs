//! Taking what is wrong out of a copy of the tree so that the rest can be read; it reports nothing.

use super::error::{Mistake, Step};
use crate::diagnostic::{Place, nearest};
use crate::document::tree::{Data, Entry, Value};

/// The index of what was taken out of a list; no list is that long.
const GAP: usize = usize::MAX;

/// In how many tables of an enum a missing key is looked for; the limit only bounds the time that a hopeless file takes.
const MOST_TABLES: usize = 16;

/// A copy of the tree without the values that were found wrong.
pub(super) struct Repair {
    tree: Value,
    /// Ways to what was taken out or put in; tables and lists above them are no longer as the user wrote them.
    touched: Vec<Vec<Step>>,
    /// Ways to choices that were put in, and what else would do there.
    chosen: Vec<(Vec<Step>, Vec<String>)>,
}

impl Repair {
    pub(super) fn of(value: &Value) -> Self {
        Repair {
            tree: value.clone(),
            touched: Vec::new(),
            chosen: Vec::new(),
        }
    }

    pub(super) fn tree(&self) -> &Value {
        &self.tree
    }

    pub(super) fn touched(&self) -> &[Vec<Step>] {
        &self.touched
    }

    /// True if a mistake only follows from what was taken out or put in before.
    pub(super) fn explains(&self, mistake: &Mistake) -> bool {
        match mistake.missing_key() {
            Some(key) => self.touched.iter().any(|path| {
                path.len() == mistake.path.len() + 1
                    && path.starts_with(&mistake.path)
                    && path[mistake.path.len()].is_key(key)
            }),
            None => self
                .touched
                .iter()
                .any(|path| path.starts_with(&mistake.path)),
        }
    }

    /// Finds out what may stand under a missing key, and where a buffered enum lacks it, the table within that it is missing of.
    /// `read` gives the first mistake of a tree.
    pub(super) fn place_missing_key(
        &mut self,
        mistake: &mut Mistake,
        read: impl Fn(&Value) -> Option<Mistake>,
    ) {
        let Some(key) = mistake.missing_key() else {
            return;
        };
        let mut tables = Vec::new();
        if let Some(table) = inside(&mut self.tree, &mistake.path) {
            tables_without(table, key, &mut mistake.path.clone(), &mut tables);
        }
        for (path, place) in tables.into_iter().take(MOST_TABLES) {
            let first = self.read_with("", &path, key, &read);
            let (first, way) = (first.as_ref(), way(&path, key));
            if !first.is_some_and(|first| first == mistake || first.is_unknown(&way)) {
                let no_choice = first.filter(|first| first.choices_at(&way).is_some());
                mistake.moved(path, place, no_choice);
                return;
            }
        }
    }

    /// Takes out the value at `path`; false if it is the whole tree or not there.
    pub(super) fn take_out(&mut self, path: &[Step]) -> bool {
        let Some((last, above)) = path.split_last() else {
            return false;
        };
        let Some(holder) = inside(&mut self.tree, above) else {
            return false;
        };
        let taken = match (&mut holder.data, last) {
            (Data::Table(table), Step::Key(key)) => table.remove(key).is_some(),
            (Data::List(values), Step::Index(index)) if *index < values.len() => {
                values.remove(*index);
                true
            }
            _ => false,
        };
        if taken {
            self.touched.retain(|touched| !touched.starts_with(path));
            if let Step::Index(removed) = last {
                // The values behind it move up by one, and the ways into them with them.
                for touched in self
                    .touched
                    .iter_mut()
                    .filter(|touched| touched.starts_with(above))
                {
                    if let Some(Step::Index(index)) = touched.get_mut(above.len())
                        && *index > *removed
                        && *index != GAP
                    {
                        *index -= 1;
                    }
                }
            }
            let mut touched = path.to_vec();
            if let Some(Step::Index(index)) = touched.last_mut() {
                // The value that moves up to this index is as the user wrote it; only the list is touched.
                *index = GAP;
            }
            self.touched.push(touched);
        }
        taken
    }

    /// Puts something readable under a missing key, so that further missing keys show; false if nothing tried is readable there.
    pub(super) fn put_in(
        &mut self,
        path: &[Step],
        key: &str,
        readable: impl Fn(&Value) -> bool,
    ) -> bool {
        let stand_ins = [
            Data::Text("1s".to_owned()),
            Data::Text("s".to_owned()),
            Data::Integer(1),
            Data::Bool(false),
            Data::List(Vec::new()),
            Data::Table(crate::document::tree::Table::new()),
        ];
        for data in stand_ins {
            if !self.insert(path, key, data) {
                return false;
            }
            if readable(&self.tree) {
                self.touched.push(way(path, key));
                return true;
            }
            self.remove(path, key);
        }
        false
    }

    /// Puts a choice under a missing key: the one that `word` may be meant for, or the first of those that will do. False if
    /// none will. `read` gives the first mistake of a tree.
    pub(super) fn choose(
        &mut self,
        path: &[Step],
        key: &str,
        word: Option<&str>,
        read: impl Fn(&Value) -> Option<Mistake>,
    ) -> bool {
        // The place of a value in a list is another once one before it is taken out.
        if path.iter().any(|step| matches!(step, Step::Index(_))) {
            return false;
        }
        let mut will_do = self.choices(path, key, read);
        let names = || will_do.iter().map(String::as_str);
        if let Some(near) = word.and_then(|word| nearest(word, names())) {
            will_do = vec![near.to_owned()];
        }
        if will_do.is_empty() {
            return false;
        }
        self.insert(path, key, Data::Text(will_do.remove(0)));
        self.touched.push(way(path, key));
        self.chosen.push((way(path, key), will_do));
        true
    }

    /// The choices under a missing key with which what stands beside it can be read; all where none makes a difference to that.
    fn choices(
        &mut self,
        path: &[Step],
        key: &str,
        read: impl Fn(&Value) -> Option<Mistake>,
    ) -> Vec<String> {
        let way = way(path, key);
        let mut with = |choice: &str| self.read_with(choice, path, key, &read);
        // No choice is without a name.
        let of_no_name = with("");
        let choices = of_no_name.as_ref().and_then(|first| first.choices_at(&way));
        let Some(choices) = choices else {
            return Vec::new();
        };
        let tried: Vec<_> = choices.iter().map(|choice| with(choice)).collect();
        let is_beside = |first: &Mistake| {
            let still_missing = first.path == path && first.missing_key() == Some(key);
            first.path.starts_with(path) && !first.path.starts_with(&way) && !still_missing
        };
        let same = tried.windows(2).all(|two| two[0] == two[1]);
        if same && tried.iter().flatten().all(is_beside) {
            return choices.to_vec();
        }
        let tried = choices.iter().cloned().zip(tried);
        let readable = tried.filter(|(_, first)| {
            let mut first = first.iter();
            first.all(|first| !first.path.starts_with(path))
        });
        readable.map(|(choice, _)| choice).collect()
    }

    /// The first mistake of the tree with a text under a missing key.
    fn read_with(
        &mut self,
        text: &str,
        path: &[Step],
        key: &str,
        read: impl Fn(&Value) -> Option<Mistake>,
    ) -> Option<Mistake> {
        let put = self.insert(path, key, Data::Text(text.to_owned()));
        let first = read(&self.tree);
        if put {
            self.remove(path, key);
        }
        first
    }

    /// The tree with each of the other choices that would do.
    pub(super) fn others(&self) -> impl Iterator<Item = Value> {
        let others = self.chosen.iter();
        let others = others.flat_map(|(way, others)| others.iter().map(move |other| (way, other)));
        others.filter_map(|(way, other)| {
            let mut tree = self.tree.clone();
            inside(&mut tree, way)?.data = Data::Text(other.clone());
            Some(tree)
        })
    }

    /// Puts a value under a key of the table at `path`; false if there is none or it has the key.
    fn insert(&mut self, path: &[Step], key: &str, data: Data) -> bool {
        let Some(holder) = inside(&mut self.tree, path) else {
            return false;
        };
        let place = holder.place;
        let Data::Table(table) = &mut holder.data else {
            return false;
        };
        if table.contains(key) {
            return false;
        }
        let value = Value::new(place, data);
        table.insert(key, Entry { key: place, value });
        true
    }

    fn remove(&mut self, path: &[Step], key: &str) {
        if let Some(holder) = inside(&mut self.tree, path)
            && let Data::Table(table) = &mut holder.data
        {
            table.remove(key);
        }
    }
}

/// The ways to a table and those within it that have no such key, and where they are.
fn tables_without(
    value: &Value,
    key: &str,
    path: &mut Vec<Step>,
    tables: &mut Vec<(Vec<Step>, Place)>,
) {
    let Data::Table(table) = &value.data else {
        return;
    };
    if !table.contains(key) {
        tables.push((path.clone(), value.place));
    }
    for (name, entry) in table.iter() {
        path.push(Step::Key(name.to_owned()));
        tables_without(&entry.value, key, path, tables);
        path.pop();
    }
}

fn way(path: &[Step], key: &str) -> Vec<Step> {
    [path, &[Step::Key(key.to_owned())]].concat()
}

fn inside<'a>(value: &'a mut Value, path: &[Step]) -> Option<&'a mut Value> {
    path.iter()
        .try_fold(value, |value, step| match (&mut value.data, step) {
            (Data::Table(table), Step::Key(key)) => table.get_mut(key),
            (Data::List(values), Step::Index(index)) => values.get_mut(*index),
            _ => None,
        })
}
