//! Parameters that are written as a list or as a table. Decides which of both is read; not what either means.

use std::fmt;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// Reads either form, since an untagged enum, derived, forgets what was wrong with it. `expected` names both.
pub(crate) fn list_or_table<'de, D, T, L, M>(
    deserializer: D,
    expected: &'static str,
    list: fn(L) -> T,
    table: fn(M) -> T,
) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    L: Deserialize<'de>,
    M: Deserialize<'de>,
{
    deserializer.deserialize_any(Form {
        expected,
        list,
        table,
    })
}

struct Form<T, L, M> {
    expected: &'static str,
    list: fn(L) -> T,
    table: fn(M) -> T,
}

impl<'de, T, L: Deserialize<'de>, M: Deserialize<'de>> Visitor<'de> for Form<T, L, M> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<T, A::Error> {
        L::deserialize(SeqAccessDeserializer::new(list)).map(self.list)
    }

    fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<T, A::Error> {
        M::deserialize(MapAccessDeserializer::new(table)).map(self.table)
    }
}
