//! Decides what there is to what a command tells beside its result: words for people, and for programs its name and what it is about.

use std::fmt;

use serde_json::{Map, Value, json};

/// Something that is told beside a result.
#[derive(Debug, Clone)]
pub struct Message {
    name: &'static str,
    facts: Map<String, Value>,
    words: String,
}

impl Message {
    /// What happened, with what is known of it: an object, or nothing.
    #[must_use]
    pub fn new(name: &'static str, facts: Value, words: impl fmt::Display) -> Self {
        let facts = match facts {
            Value::Object(facts) => facts,
            _ => Map::new(),
        };
        Self {
            name,
            facts,
            words: words.to_string(),
        }
    }

    /// For programs: an object on one line, with how grave it is.
    #[must_use]
    pub fn line(&self, level: &str) -> String {
        let mut told = Map::new();
        told.insert("event".to_owned(), json!(self.name));
        told.insert("level".to_owned(), json!(level));
        told.extend(self.facts.clone());
        told.insert("message".to_owned(), json!(self.words));
        Value::Object(told).to_string()
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

/// Words of which programs need to know no more than that they were said.
const REMARK: &str = "remark";

impl From<fmt::Arguments<'_>> for Message {
    fn from(words: fmt::Arguments<'_>) -> Self {
        Self::new(REMARK, Value::Null, words)
    }
}

impl From<&str> for Message {
    fn from(words: &str) -> Self {
        Self::new(REMARK, Value::Null, words)
    }
}

impl From<&String> for Message {
    fn from(words: &String) -> Self {
        words.as_str().into()
    }
}

impl From<String> for Message {
    fn from(words: String) -> Self {
        Self::new(REMARK, Value::Null, words)
    }
}
