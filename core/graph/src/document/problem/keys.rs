//! Mistakes about keys and the type of their values.

use super::nearest_or_all;
use crate::diagnostic::problem;
use crate::document::hint::Hint;

problem! {
    /// A key that its table does not have.
    A006 UnknownKey {
        key: String,
        /// What the table belongs to.
        what: String,
        known: Vec<String>,
    }
    error: "unknown key",
    explanation: "Unknown keys are errors everywhere, since a misspelt one would silently have no effect.",
    message: format!("{what} has no key \"{key}\""),
    label: "unknown key",
    help: nearest_or_all(key, known, "the keys are"),
}

problem! {
    /// An input that stands among the parameters of its node.
    A006 InputAsKey {
        key: String,
        /// The node.
        what: String,
        input: String,
    }
    message: format!("{what} has no key \"{key}\""),
    label: "unknown key",
    help: format!("`{input}` is an input: write `inputs.{input} = …`"),
}

problem! {
    /// A key that has no default is not there.
    A007 MissingKey {
        key: String,
        /// What the table belongs to.
        what: String,
        /// What to write, where that is known.
        advice: Option<String>,
    }
    error: "missing key",
    explanation: "A table lacks a key that has no default.",
    message: format!("{what} needs the key \"{key}\""),
    label: format!("\"{key}\" is missing"),
    help: advice.clone(),
}

problem! {
    /// A value of another type than its key needs.
    A008 WrongType {
        /// The key or, in a list, the list's key.
        key: Option<String>,
        expected: String,
        found: String,
        /// What is near what was found, and right.
        hint: Option<Hint>,
    }
    error: "wrong type of value",
    explanation: "A key has a value of another type than it needs. Durations and quantities are texts with a unit.",
    message: format!("expected {expected}{}, found {found}", for_key(key)),
    label: format!("expected {expected}"),
    help: hint.as_ref().map(Hint::help),
}

fn for_key(key: &Option<String>) -> String {
    key.as_ref()
        .map_or_else(String::new, |key| format!(" for \"{key}\""))
}

problem! {
    /// A text that is none of the choices.
    A009 UnknownChoice { key: Option<String>, found: String, choices: Vec<String> }
    error: "unknown choice",
    explanation: "A text names none of the choices that the key has.",
    message: format!("\"{found}\" is not a choice{}", for_key(key)),
    label: "not a choice",
    help: nearest_or_all(found, choices, "the choices are"),
}

problem! {
    /// The value has the right type, and its reader refuses it.
    A010 Refused {
        key: Option<String>,
        /// The reader's reason.
        reason: String,
    }
    error: "value out of range",
    explanation: "A value has the right type and is refused by what reads it.",
    message: match key {
        Some(key) => format!("\"{key}\" is refused: {reason}"),
        None => reason.clone(),
    },
    label: "refused",
    help: None,
}

problem! {
    /// A number that no double or 64-bit integer holds.
    A010 NumberTooLarge { number: String }
    message: format!("the number {number} is too large"),
    label: "",
    help: None,
}

problem! {
    /// A duration of 0 where a positive one is needed.
    A010 NotPositive { key: &'static str }
    message: format!("`{key}` must be greater than 0"),
    label: "",
    help: None,
}

problem! {
    /// Two keys of `[time]` exclude each other.
    A024 TimeContradiction {
        /// The key that is too much.
        key: &'static str,
        /// The key and value that it contradicts.
        with: String,
    }
    error: "contradicting time",
    explanation: "`[time]` has two keys that exclude each other, e.g. both `step` and a unit, or a `format` beside one.",
    message: format!("`{key}` has no meaning with {with}"),
    label: "",
    help: match *key {
        "format" => "leave out one of the two".to_owned(),
        "zone" => {
            "leave it out; dates and times have one, by `unit = \"rfc3339\"` or a `format` without `%z`".to_owned()
        }
        key => format!("leave out `{key}`, or write `unit = \"sample\"`"),
    },
}
