//! What can be wrong with the fitted model that a machine file names.

use serde_json::Value;

use crate::compile::{Change, ParameterChange};
use crate::diagnostic::{Place, listed, problem};

problem! {
    /// The model cannot be read.
    A190 Unusable {
        path: String,
        /// In words.
        reason: String,
        /// The file that names it.
        machine: String,
        /// Whether there is no file at its path, which a fit may then write.
        is_free: bool,
    }
    error: "unusable model",
    explanation: "`model` names what `athermal fit` has written. `fit`, `compare`, `diff` and `test` do without it.",
    message: format!("the model {path} cannot be used: {reason}"),
    label: "",
    help: match is_free {
        true => format!("`athermal fit {machine} --data FILE -o {path}` writes it"),
        // What stands there may be somebody's data.
        false => format!("name what `athermal fit {machine} --data FILE -o MODEL.json` writes"),
    },
}

problem! {
    /// An estimator is another than the model's.
    A191 Unlike {
        instance: String,
        /// How many more instances of the node are.
        more: usize,
        change: Change,
        path: String,
        /// Where the machine file names the model.
        named: Place,
        machine: String,
    }
    error: "model of another graph",
    explanation: "A machine file runs with the fits of its `model` only where the parameters and inputs of each estimator are those of \
        the fit.",
    message: {
        let are_not = match more {
            0 => "is not".to_owned(),
            more => format!("and {more} more of its node are not"),
        };
        let differs = match change {
            Change::Changed(parameters) => differs(parameters),
            _ => "there is none of that name".to_owned(),
        };
        format!("`{instance}` {are_not} as in the model {path}: {differs}")
    },
    label: "not what was fitted",
    help: format!(
        "fit this graph (`athermal fit {machine} --data FILE -o {path}`), or restore what was fitted"
    ),
    related: vec![(*named, "the model that was fitted".to_owned())],
}

problem! {
    /// What estimators read is made in another way than it was for the fit.
    A192 ReadsOther { instances: Vec<String>, path: String, named: Place }
    warning: "fit on other values",
    explanation: "An estimator is as in the `model`, and what it reads is now made in another way: its coefficients may no longer be \
        right.",
    message: format!(
        "{} as in the model {path}, though what is read is now made in another way",
        match &instances[..] {
            [one] => format!("`{one}` is"),
            [one, rest @ ..] => format!("`{one}` and {} more are", rest.len()),
            [] => "estimators are".to_owned(),
        }
    ),
    label: "fitted on other values",
    help: "fit the graph anew to be sure; `athermal diff` shows what has changed",
    related: vec![(*named, "the model that was fitted".to_owned())],
}

/// The first few properties that differ: what the file has, then what was fitted. Where an input reads other channels, their
/// properties add nothing.
fn differs(parameters: &[ParameterChange]) -> String {
    const MOST: usize = 3;
    let follows = |change: &&ParameterChange| {
        let owner = change.path.rsplit_once('.').map(|(owner, _)| owner);
        parameters.iter().any(|other| Some(&*other.path) == owner)
    };
    let own: Vec<_> = parameters
        .iter()
        .filter(|change| !follows(change))
        .collect();
    let mut shown: Vec<_> = own
        .iter()
        .take(MOST)
        .map(|change| differs_in(change))
        .collect();
    let more = own.len().saturating_sub(MOST);
    if more > 0 {
        shown.push(format!("and {more} more"));
    }
    shown.join("; ")
}

fn differs_in(change: &ParameterChange) -> String {
    let path = &change.path;
    match (&change.from, &change.to) {
        (Some(Value::Array(fitted)), Some(Value::Array(now))) => {
            let lacks: Vec<_> = fitted.iter().filter(|one| !now.contains(one)).collect();
            let has: Vec<_> = now.iter().filter(|one| !fitted.contains(one)).collect();
            match (lacks.is_empty(), has.is_empty()) {
                (true, true) => format!("`{path}` is in another order"),
                (false, true) => format!("`{path}` lacks {}", all(lacks)),
                (true, false) => format!("`{path}` has {} too", all(has)),
                (false, false) => format!(
                    "`{path}` has {}, and had {} for the fit",
                    all(has),
                    all(lacks)
                ),
            }
        }
        (Some(fitted), Some(now)) => {
            format!(
                "`{path}` is {}, and was {} for the fit",
                plain(now),
                plain(fitted)
            )
        }
        (None, Some(now)) => format!("`{path}` is {}, and was not given for the fit", plain(now)),
        (fitted, None) => {
            let fitted = fitted.as_ref().map(plain).unwrap_or_default();
            format!("`{path}` is not given, and was {fitted} for the fit")
        }
    }
}

fn all<'a>(values: impl IntoIterator<Item = &'a Value>) -> String {
    listed(values.into_iter().map(plain), 4)
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => all(values),
        other => other.to_string(),
    }
}
