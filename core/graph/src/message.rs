//! What a command reports beside its result: words for people, an event with its facts for programs.

use std::fmt;

use serde_json::{Map, Value, json};

/// A report beside a result.
#[derive(Debug, Clone)]
pub struct Message {
    name: &'static str,
    facts: Map<String, Value>,
    words: String,
    count: u64,
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
            count: 1,
        }
    }

    /// The same of facts by their keys.
    #[must_use]
    pub fn of(
        name: &'static str,
        facts: Vec<(&'static str, Value)>,
        words: impl fmt::Display,
    ) -> Self {
        let facts = facts.into_iter().map(|(key, of)| (key.to_owned(), of));
        Self::new(name, Value::Object(facts.collect()), words)
    }

    /// The same in other words.
    #[must_use]
    pub fn reworded(mut self, words: impl FnOnce(&str) -> String) -> Self {
        self.words = words(&self.words);
        self
    }

    /// It counts for so many.
    #[must_use]
    pub fn counting(mut self, count: u64) -> Self {
        self.count = count;
        self
    }

    /// For how many it counts.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// What happened, by its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What is known of it: an object.
    #[must_use]
    pub fn facts(&self) -> Value {
        Value::Object(self.facts.clone())
    }

    /// For programs: an object on one line, with how grave it is.
    #[must_use]
    pub fn line(&self, level: &str) -> String {
        let mut event = Map::new();
        event.insert("event".to_owned(), json!(self.name));
        event.insert("level".to_owned(), json!(level));
        event.extend(self.facts.clone());
        event.insert("message".to_owned(), json!(self.words));
        Value::Object(event).to_string()
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

/// Words without facts for programs.
const REMARK: &str = "remark";

macro_rules! words {
    ($($of:ty),*) => {
        $(impl From<$of> for Message {
            fn from(words: $of) -> Self {
                Self::new(REMARK, Value::Null, words)
            }
        })*
    };
}

words!(fmt::Arguments<'_>, &str, &String, String);
