//! What a name in a file or on the command line may mean: one table of all that the linked crates bring. Each [`Sort`] of thing has names
//! of its own; what is known under a name is decided by whoever registers it.

use std::any::{Any, TypeId};
use std::fmt;
use std::ops::Deref;

use serde_json::Value;

use crate::diagnostic::{names, nearest};

/// What has names of its own: kinds of nodes, of sources, machines, commands …
pub trait Sort: Send + Sync + 'static {
    /// One of them, in messages: `node type`.
    const ONE: &'static str;
    /// Several.
    const MANY: &'static str;
}

/// What stands for a name, and who brings it.
#[derive(Debug)]
pub struct Registered<T: 'static> {
    /// The name.
    pub name: &'static str,
    /// The crate that brings it.
    pub package: &'static str,
    /// The version of that crate.
    pub version: &'static str,
    /// The JSON Schema of its parameters, with their documentation; null where it has none.
    pub schema: fn() -> &'static Value,
    /// It.
    pub item: T,
}

impl<T> Deref for Registered<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.item
    }
}

impl<T> Registered<T> {
    /// The documentation of its parameters.
    #[must_use]
    pub fn documentation(&self) -> &'static str {
        (self.schema)()["description"].as_str().unwrap_or_default()
    }

    /// The first paragraph of the documentation.
    #[must_use]
    pub fn summary(&self) -> String {
        first_paragraph(self.documentation())
    }

    /// Whom a mistake in its code is for.
    #[must_use]
    pub fn author(&self) -> String {
        format!(
            "the author of `{}`, from {} {}",
            self.name, self.package, self.version
        )
    }
}

/// The first paragraph of a documentation, on one line.
#[must_use]
pub fn first_paragraph(documentation: &str) -> String {
    let paragraph = documentation.split("\n\n").next().unwrap_or_default();
    paragraph.replace('\n', " ")
}

/// An entry of the table; [`list!`](crate::list) makes it.
#[doc(hidden)]
pub struct Listed(pub &'static (dyn Any + Send + Sync));

inventory::collect!(Listed);

/// A name that this program would have with a feature that was left out when it was built; [`lacks!`](crate::lacks) makes it.
#[doc(hidden)]
pub struct Lacking {
    pub sort: fn() -> TypeId,
    pub name: &'static str,
    pub feature: &'static str,
}

inventory::collect!(Lacking);

/// A name does not stand for one thing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NotFound {
    /// What was asked for: `node type`.
    pub one: &'static str,
    /// Several of them.
    pub many: &'static str,
    /// The name.
    pub name: String,
    /// Why not.
    pub why: Why,
}

/// Why a name does not stand for one thing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Why {
    /// There is none of the name.
    Unknown {
        /// The one that may have been meant.
        nearest: Option<&'static str>,
        /// All that there are.
        known: Vec<&'static str>,
    },
    /// The program was built without the feature that brings it.
    Feature(&'static str),
    /// Several crates bring one of the name.
    Twice(Vec<&'static str>),
}

impl NotFound {
    /// Whether several crates bring one of the name.
    #[must_use]
    pub fn is_twice(&self) -> bool {
        matches!(self.why, Why::Twice(_))
    }

    /// What is wrong.
    #[must_use]
    pub fn message(&self) -> String {
        let Self { one, name, .. } = self;
        match &self.why {
            Why::Twice(packages) => {
                format!(
                    "the {one} `{name}` is brought by several crates: {}",
                    names(packages)
                )
            }
            Why::Unknown { .. } | Why::Feature(_) => format!("there is no {one} `{name}`"),
        }
    }

    /// What to do.
    #[must_use]
    pub fn help(&self) -> String {
        match &self.why {
            Why::Unknown { nearest: Some(near), .. } => format!("did you mean `{near}`?"),
            Why::Unknown { known, .. } => format!(
                "`athermal build --with CRATE` brings those of a plugin crate; {} in this program: {}",
                self.many,
                names(known)
            ),
            Why::Feature(feature) => {
                format!("this needs a program that was built with `--features {feature}`")
            }
            Why::Twice(_) => {
                "leave one of the crates out when the program is built, or rename what one of them brings".to_owned()
            }
        }
    }
}

impl fmt::Display for NotFound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let between = match self.why {
            Why::Unknown {
                nearest: Some(_), ..
            } => ",",
            _ => ";",
        };
        write!(f, "{}{between} {}", self.message(), self.help())
    }
}

impl std::error::Error for NotFound {}

fn linked<T: Sort>() -> impl Iterator<Item = &'static Registered<T>> {
    let all = inventory::iter::<Listed>.into_iter();
    all.filter_map(|listed| listed.0.downcast_ref())
}

fn lacking<T: Sort>() -> impl Iterator<Item = &'static Lacking> {
    let all = inventory::iter::<Lacking>.into_iter();
    all.filter(|lacking| (lacking.sort)() == TypeId::of::<T>())
}

/// All of a sort in this program, by name; where several crates bring one name, all of them.
pub fn all<T: Sort>() -> impl Iterator<Item = &'static Registered<T>> + Clone {
    let mut all: Vec<_> = linked().collect();
    all.sort_by_key(|of| (of.name, of.package));
    all.into_iter()
}

/// What a name stands for.
///
/// # Errors
/// When there is nothing of the name: with the nearest that there is, all of them, or the feature that brings it; or when there are
/// several, with the crates that bring them.
pub fn find<T: Sort>(name: &str) -> Result<&'static Registered<T>, NotFound> {
    let mut same = linked().filter(|of| of.name == name);
    let first = same.next();
    let why = match (first, same.next()) {
        (Some(only), None) => return Ok(only),
        (Some(_), Some(_)) => {
            let same = all::<T>().filter(|of| of.name == name);
            Why::Twice(same.map(|of| of.package).collect())
        }
        (None, _) => match lacking::<T>().find(|of| of.name == name) {
            Some(lacking) => Why::Feature(lacking.feature),
            None => {
                let mut known: Vec<_> = all::<T>().map(|of| of.name).collect();
                known.dedup();
                let nearest = nearest(name, known.iter().copied());
                Why::Unknown { nearest, known }
            }
        },
    };
    let (one, many, name) = (T::ONE, T::MANY, name.to_owned());
    Err(NotFound {
        one,
        many,
        name,
        why,
    })
}

/// The names that this program has, and those that it would have with features that were left out when it was built.
pub fn names_of<T: Sort>() -> impl Iterator<Item = &'static str> {
    let lacking = lacking::<T>().map(|of| of.name);
    linked::<T>().map(|of| of.name).chain(lacking)
}

/// The first of a crate's names that another crate has too.
#[must_use]
pub fn taken_twice<T: Sort>(package: &str) -> Option<NotFound> {
    let mut own = linked::<T>().filter(|of| of.package == package);
    own.find_map(|of| find::<T>(of.name).err())
}

/// The schema of what has none.
#[doc(hidden)]
#[must_use]
pub fn no_schema() -> &'static Value {
    &Value::Null
}

/// Puts an item of a [`Sort`] into the table: the sort, the name, the schema, and the item. Macros such as `register!` make use of it.
#[doc(hidden)]
#[macro_export]
macro_rules! list {
    ($sort:ty, $name:expr, $schema:expr, $item:expr) => {
        const _: () = {
            static ENTRY: $crate::registry::Registered<$sort> = $crate::registry::Registered {
                name: $name,
                package: env!("CARGO_PKG_NAME"),
                version: env!("CARGO_PKG_VERSION"),
                schema: $schema,
                item: $item,
            };
            $crate::__private::inventory::submit! { $crate::registry::Listed(&ENTRY) }
        };
    };
}

/// The schema of a type, made once.
#[doc(hidden)]
#[macro_export]
macro_rules! schema_of {
    ($of:ty) => {
        || {
            use $crate::__private::{schemars::schema_for, serde_json::Value};
            static SCHEMA: std::sync::OnceLock<Value> = std::sync::OnceLock::new();
            SCHEMA.get_or_init(|| schema_for!($of).into())
        }
    };
}

/// Says that a program would have names of a sort if it had been built with a feature: the sort, the feature and the names.
#[macro_export]
macro_rules! lacks {
    ($sort:ty, $feature:literal, $($name:literal),+) => {
        $($crate::__private::inventory::submit! {
            $crate::registry::Lacking {
                sort: std::any::TypeId::of::<$sort>,
                name: $name,
                feature: $feature,
            }
        })+
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Plate;

    impl Sort for Plate {
        const ONE: &'static str = "plate";
        const MANY: &'static str = "plates";
    }

    list!(Plate, "steel", no_schema, Plate);
    list!(Plate, "glass", no_schema, Plate);
    lacks!(Plate, "ceramics", "zerodur");

    // As `list!` of another crate would.
    static OTHER: Registered<Plate> = Registered {
        name: "glass",
        package: "other-plates",
        version: "1.0.0",
        schema: no_schema,
        item: Plate,
    };
    inventory::submit! { Listed(&OTHER) }

    #[test]
    fn a_name_that_is_unknown_or_stands_twice_or_needs_a_feature_is_reported_with_a_way_out() {
        assert_eq!(find::<Plate>("steel").map(|of| of.name), Ok("steel"));
        for (name, words) in [
            ("stel", "there is no plate `stel`, did you mean `steel`?"),
            (
                "x",
                "there is no plate `x`; `athermal build --with CRATE` brings those of a plugin crate; plates in this program: `glass`, `steel`",
            ),
            (
                "zerodur",
                "there is no plate `zerodur`; this needs a program that was built with `--features ceramics`",
            ),
            (
                "glass",
                "the plate `glass` is brought by several crates: `athermal-graph`, `other-plates`; leave one of the crates out when the \
                 program is built, or rename what one of them brings",
            ),
        ] {
            let found = find::<Plate>(name).map(|of| of.name);
            assert_eq!(found.map_err(|of| of.to_string()), Err(words.to_owned()));
        }
        let names: Vec<_> = all::<Plate>().map(|of| (of.name, of.package)).collect();
        let own = "athermal-graph";
        assert_eq!(
            names,
            [("glass", own), ("glass", "other-plates"), ("steel", own)]
        );
        assert!(taken_twice::<Plate>("other-plates").is_some());
        assert!(taken_twice::<Plate>("steel-plates").is_none());
    }
}
