//! What was read of a value that has mistakes, and of which keys nothing more can be said.

use super::error::Step;

/// A value as its type, as far as it could be read: whole, or with mistakes, of which has been told.
#[derive(Debug, Clone)]
pub struct Decoded<T> {
    value: T,
    /// What it may be as well, where a choice could not be read.
    others: Vec<T>,
    left_out: LeftOut,
}

impl<T> Decoded<T> {
    pub(super) fn of(value: T, others: Vec<T>, left_out: LeftOut) -> Self {
        Self {
            value,
            others,
            left_out,
        }
    }

    /// The value, if nothing was left out.
    #[must_use]
    pub fn whole(self) -> Option<T> {
        self.is_whole().then_some(self.value)
    }

    /// The same of a reference.
    pub fn as_whole(&self) -> Option<&T> {
        self.is_whole().then_some(&self.value)
    }

    /// The value with defaults and stand-ins for what was left out, once for each choice that may stand where one could not be read.
    pub fn readings(&self) -> impl Iterator<Item = &T> {
        std::iter::once(&self.value).chain(&self.others)
    }

    /// The first of these, and whether what it has under a key is what stands there.
    pub fn sure(&self) -> (&T, impl Fn(&str) -> bool) {
        (&self.value, |key: &str| !self.left_out.explains(key))
    }

    /// What was left out.
    pub fn left_out(&self) -> &LeftOut {
        &self.left_out
    }

    /// The same with other values.
    pub fn map<U>(self, of: impl Fn(T) -> U) -> Decoded<U> {
        let others = self.others.into_iter().map(&of).collect();
        Decoded::of(of(self.value), others, self.left_out)
    }

    fn is_whole(&self) -> bool {
        self.left_out.0.is_empty()
    }
}

/// Ways to values that could not be read, by keys, up to a list of which an element could not.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LeftOut(Vec<Vec<String>>);

impl LeftOut {
    pub(super) fn of(ways: impl Iterator<Item = Vec<Step>>) -> Self {
        let keys = |way: Vec<Step>| {
            let keys = way.into_iter().map_while(|step| match step {
                Step::Key(key) => Some(key),
                Step::Index(_) => None,
            });
            keys.collect()
        };
        Self(ways.map(keys).collect())
    }

    /// Whether what is said of the value at `path`, such as `solver.alpha`, may only follow from what was left out: from
    /// the value itself, or from one above or below it.
    pub fn explains(&self, path: &str) -> bool {
        let on_the_way =
            |left_out: &Vec<String>| path.split('.').zip(left_out).all(|(a, b)| a == b);
        self.0.iter().any(on_the_way)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_left_out_explains_what_is_above_and_below_and_nothing_else() {
        let way = ["solver", "alpha"].map(|key| Step::Key(key.to_owned()));
        let left_out = LeftOut::of([way.to_vec()].into_iter());
        assert!(left_out.explains("solver"));
        assert!(left_out.explains("solver.alpha.0"));
        assert!(!left_out.explains("solver.folds"));
        assert!(!left_out.explains("lags"));
        assert!(!LeftOut::default().explains("lags"));
        let element = [Step::Key("lags".to_owned()), Step::Index(1)];
        let left_out = LeftOut::of([element.to_vec()].into_iter());
        assert!(left_out.explains("lags.0"));
    }
}
