//! Mistakes about names: what may be one, what is taken, and what stands for nothing.

use std::sync::Arc;

use super::nearest_of_many;
use crate::diagnostic::{Names, Place, nearest, problem};

problem! {
    /// A name that breaks the rules.
    A011 BadName {
        /// What it names.
        role: &'static str,
        name: String,
        /// Whether it may begin with a digit.
        digit_first: bool,
    }
    error: "bad name",
    explanation: "Names begin with a letter, then letters, digits, `_` and `-`; members and channels may begin with a digit.",
    message: format!("\"{name}\" cannot be the name of a {role}"),
    label: "not a name",
    help: match digit_first {
        false => "a name begins with a letter, then letters, digits, `_` and `-`",
        true => "a name begins with a letter or digit, then letters, digits, `_` and `-`",
    },
}

problem! {
    /// A name that is taken.
    A012 DuplicateName {
        /// What it names.
        role: &'static str,
        name: String,
        /// What has the name already.
        first_role: &'static str,
        /// Where that is.
        first: Option<Place>,
    }
    error: "duplicate name",
    explanation: "Nodes, sets and signals share one name space; members of a set and channels of a signal are distinct.",
    message: {
        let article = if role == first_role { "another" } else { "a" };
        format!("the {role} \"{name}\" has the name of {article} {first_role}")
    },
    label: "this name is taken",
    help: (role != first_role).then(|| match *role {
        "parameter" => "give the parameter a name that nothing else has".to_owned(),
        _ => "nodes, sets and signals share one name space".to_owned(),
    }),
    related: first.iter().map(|place| (*place, format!("the {first_role} is here"))).collect(),
}

problem! {
    /// A set that is not declared.
    A013 UnknownSet {
        name: String,
        known: Arc<Names>,
        /// What else to write, where something else than a set may be meant.
        or: Option<String>,
    }
    error: "unknown set",
    explanation: "`each` or `channels` names a set that `[sets]` does not have.",
    message: format!("there is no set \"{name}\""),
    label: "not a set",
    help: {
        let help = nearest_of_many(name, known, "the sets are");
        let help = help.unwrap_or_else(|| "declare it under `[sets]`".to_owned());
        match or {
            Some(or) if !help.ends_with('?') => format!("{help}, or {or}"),
            _ => help,
        }
    },
}

problem! {
    /// `{x}` that stands for nothing.
    A014 UnknownPlaceholder {
        /// What stands between the braces.
        name: String,
        /// What it may be here.
        known: Vec<String>,
        /// What it stands in.
        what: String,
        /// What to write for all members, where no single one can be meant.
        instead: Option<String>,
    }
    error: "unknown placeholder",
    explanation: "`{x}` stands for a member of a set that the node has in its `each`; `{channel}` for a signal's channel.",
    message: format!("\"{{{name}}}\" stands for nothing in {what}"),
    label: "stands for nothing",
    help: match (instead, nearest(name, known.iter().map(String::as_str))) {
        (Some(instead), _) => format!("here a reference stands for all members: write \"{instead}\""),
        (None, Some(near)) => format!("did you mean \"{{{near}}}\"?"),
        (None, None) if known.is_empty() => "only a node with `each` has members to stand for".to_owned(),
        (None, None) => {
            let known: Vec<_> = known.iter().map(|name| format!("\"{{{name}}}\"")).collect();
            format!("it may be {}", known.join(", "))
        }
    },
}

problem! {
    /// A list that needs an entry has none.
    A015 EmptyList {
        /// What the list is of.
        what: String,
    }
    error: "empty list",
    explanation: "A set, a list of channels or a list of references has no entries.",
    message: format!("{what} has no entries"),
    label: "empty",
    help: "name at least one",
}
