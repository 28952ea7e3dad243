//! Decides what can be wrong with the fitted model that a machine file names, and how it is said.

use serde_json::Value;

use crate::compile::{Change, ParameterChange};
use crate::diagnostic::{Place, Problem, Severity, listed};

/// Why a machine file cannot run with the model that it names, or only with doubt.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // each variant's fields are the data of the sentence that `message` makes of them
pub enum NamedModelProblem {
    /// The model cannot be read.
    Unusable {
        path: String,
        /// In words.
        reason: String,
        /// The file that names it.
        machine: String,
        /// Whether there is no file at its path, which a fit may then write.
        is_free: bool,
    },
    /// An estimator is another than the model's.
    Unlike {
        instance: String,
        /// How many more instances of the node are.
        more: usize,
        change: Change,
        path: String,
        /// Where the machine file names the model.
        named: Place,
        machine: String,
    },
    /// What estimators read is made in another way than it was for the fit.
    ReadsOther {
        instances: Vec<String>,
        path: String,
        named: Place,
    },
}

impl Problem for NamedModelProblem {
    fn code(&self) -> &'static str {
        match self {
            Self::Unusable { .. } => "A190",
            Self::Unlike { .. } => "A191",
            Self::ReadsOther { .. } => "A192",
        }
    }

    fn severity(&self) -> Severity {
        match self {
            Self::Unusable { .. } | Self::Unlike { .. } => Severity::Error,
            Self::ReadsOther { .. } => Severity::Warning,
        }
    }

    // What has gaps is not compared.
    fn may_follow_from_a_gap(&self) -> bool {
        false
    }

    fn message(&self) -> String {
        match self {
            Self::Unusable { path, reason, .. } => {
                format!("the model {path} cannot be used: {reason}")
            }
            Self::Unlike {
                instance,
                more,
                change,
                path,
                ..
            } => {
                let are_not = match more {
                    0 => "is not".to_owned(),
                    more => format!("and {more} more of its node are not"),
                };
                let differs = match change {
                    Change::Changed(parameters) => differs(parameters),
                    _ => "there is none of that name".to_owned(),
                };
                format!("`{instance}` {are_not} as in the model {path}: {differs}")
            }
            Self::ReadsOther {
                instances, path, ..
            } => format!(
                "{} as in the model {path}, though what is read is now made in another way",
                match &instances[..] {
                    [one] => format!("`{one}` is"),
                    [one, rest @ ..] => format!("`{one}` and {} more are", rest.len()),
                    [] => "estimators are".to_owned(),
                }
            ),
        }
    }

    fn label(&self) -> String {
        match self {
            Self::Unusable { .. } => String::new(),
            Self::Unlike { .. } => "not what was fitted".to_owned(),
            Self::ReadsOther { .. } => "fitted on other values".to_owned(),
        }
    }

    fn help(&self) -> Option<String> {
        Some(match self {
            Self::Unusable {
                path,
                machine,
                is_free: true,
                ..
            } => format!("`athermal fit {machine} --data FILE -o {path}` writes it"),
            // What stands there may be somebody's data.
            Self::Unusable { machine, .. } => {
                format!("name what `athermal fit {machine} --data FILE -o MODEL.json` writes")
            }
            Self::Unlike { path, machine, .. } => format!(
                "fit this graph (`athermal fit {machine} --data FILE -o {path}`), or say what was fitted"
            ),
            Self::ReadsOther { .. } => {
                "fit the graph anew to be sure; `athermal diff` tells what has changed".to_owned()
            }
        })
    }

    fn related(&self) -> Vec<(Place, String)> {
        match self {
            Self::Unusable { .. } => Vec::new(),
            Self::Unlike { named, .. } | Self::ReadsOther { named, .. } => {
                vec![(*named, "the model that was fitted".to_owned())]
            }
        }
    }
}

/// The first few properties that differ: what the file says, then what was fitted. Where an input reads other channels, their
/// properties say no more.
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
    let mut told: Vec<_> = own.iter().take(MOST).map(|change| told(change)).collect();
    let more = own.len().saturating_sub(MOST);
    if more > 0 {
        told.push(format!("and {more} more"));
    }
    told.join("; ")
}

fn told(change: &ParameterChange) -> String {
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
