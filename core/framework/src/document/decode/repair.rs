//! Taking what is wrong out of a copy of the tree so that the rest can be read; it reports nothing.

use super::error::{Mistake, Step};
use crate::document::tree::{Data, Entry, Value};

/// The index of what was taken out of a list; no list is that long.
const GAP: usize = usize::MAX;

/// A copy of the tree without the values that were found wrong.
pub(super) struct Repair {
    tree: Value,
    /// Ways to what was taken out or put in; tables and lists above them are no longer as the user wrote them.
    touched: Vec<Vec<Step>>,
}

impl Repair {
    pub(super) fn of(value: &Value) -> Self {
        Repair {
            tree: value.clone(),
            touched: Vec::new(),
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
        let mut way = path.to_vec();
        way.push(Step::Key(key.to_owned()));
        for data in stand_ins {
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
            table.insert(
                key,
                Entry {
                    key: place,
                    value: Value::new(place, data),
                },
            );
            if readable(&self.tree) {
                self.touched.push(way);
                return true;
            }
            if let Some(Value {
                data: Data::Table(table),
                ..
            }) = inside(&mut self.tree, path)
            {
                table.remove(key);
            }
        }
        false
    }
}

fn inside<'a>(value: &'a mut Value, path: &[Step]) -> Option<&'a mut Value> {
    path.iter()
        .try_fold(value, |value, step| match (&mut value.data, step) {
            (Data::Table(table), Step::Key(key)) => table.get_mut(key),
            (Data::List(values), Step::Index(index)) => values.get_mut(*index),
            _ => None,
        })
}
