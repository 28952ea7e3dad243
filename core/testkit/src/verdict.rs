//! In what order rules are tried, and how broken ones are reported.

use std::collections::BTreeSet;
use std::fmt;

use super::derived;
use super::rules::{self, Subject};
use super::tried::{PANICS, tried};
use super::{Case, Examined, Rule};
use crate::node::{Kind, NodeKind, NodeSpec};
use crate::registry::all;

/// A rule that a kind breaks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broken {
    /// The rule.
    pub rule: Rule,
    /// The parameters of the case, where it is not broken in all.
    pub case: Option<String>,
    /// What was found.
    pub found: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.rule, indented(&self.found))?;
        if let Some(case) = &self.case {
            writeln!(f, "  in the case: {}", indented(case))?;
        }
        let advice = if self.found.starts_with(PANICS) {
            "a node answers with absence or a `Mistake` where it cannot go on, and never panics; `RUST_BACKTRACE=1` shows where it does"
        } else {
            self.rule.advice()
        };
        write!(f, "  to do: {advice}")
    }
}

fn indented(text: &str) -> String {
    text.trim().replace('\n', "\n  ")
}

/// All the rules that a kind breaks in any of the cases.
#[must_use]
pub fn broken<T: NodeSpec>(cases: &[Case]) -> Vec<Broken> {
    let name = T::kind_name();
    let kind = all::<NodeKind>().find(|kind| kind.name == name);
    let kind = kind.expect("a type with a specification is registered");
    let in_all = |rule, found: Vec<String>| -> Vec<Broken> {
        let each = |found| broken_in(rule, None, found);
        found.into_iter().map(each).collect()
    };
    let shared = rules::shared(kind);
    if !shared.is_empty() {
        // No graph with it can be compiled.
        return in_all(Rule::Names, shared);
    }
    let mut broken = in_all(Rule::Explained, rules::explained(kind));
    if cases.is_empty() {
        let found = "there is no case to try it in".to_owned();
        broken.push(broken_in(Rule::Answers, None, found));
    }
    let mut subjects = subjects(kind, cases, &mut broken);
    let of_learning = derived::of_learning(&subjects);
    subjects.extend(self::subjects(kind, &of_learning, &mut broken));
    let of_ports: Vec<Case> = derived::of_ports(kind, &subjects).into_iter().collect();
    subjects.extend(self::subjects(kind, &of_ports, &mut broken));
    for subject in &subjects {
        for &(rule, check) in rules::ALL {
            if subject.case.asks_for(rule)
                && let Err(found) = tried(|| check.run(subject, &subjects))
            {
                broken.push(broken_in(rule, Some(subject.case), found));
            }
        }
    }
    broken
}

/// The kind in each of the cases in which it can be tried.
fn subjects<'a>(
    kind: &'static Kind,
    cases: &'a [Case],
    broken: &mut Vec<Broken>,
) -> Vec<Subject<'a>> {
    let mut subjects = Vec::new();
    for case in cases {
        match tried(|| Subject::new(kind, case)) {
            Ok(subject) => match subject.belongs() {
                Ok(()) => subjects.push(subject),
                Err(found) => broken.push(broken_in(Rule::Fits, Some(case), found)),
            },
            Err(found) => broken.push(broken_in(Rule::Answers, Some(case), found)),
        }
    }
    subjects
}

fn broken_in(rule: Rule, case: Option<&Case>, found: String) -> Broken {
    Broken {
        rule,
        case: case.map(|case| case.parameters.clone()),
        found,
    }
}

/// Fails with all that is wrong, if anything is; [`conformance!`](crate::conformance) makes use of it.
///
/// # Panics
/// Where a rule is broken.
pub fn assert_conforms<T: NodeSpec>(cases: &[Case]) {
    let broken = broken::<T>(cases);
    if !broken.is_empty() {
        let texts: Vec<_> = broken.iter().map(ToString::to_string).collect();
        panic!(
            "`{}` breaks {} of the rules that every node keeps\n\n{}\n",
            T::kind_name(),
            broken.len(),
            texts.join("\n\n")
        );
    }
}

/// Fails where a kind of a crate has no [`conformance!`](crate::conformance) in this test program.
///
/// # Panics
/// Where there is such a kind, or none at all.
pub fn assert_every_kind_conforms(package: &str) {
    let of_package = all::<NodeKind>().filter(|kind| kind.package == package);
    let registered: BTreeSet<&str> = of_package.map(|kind| kind.name).collect();
    let examined: BTreeSet<&str> = inventory::iter::<Examined>()
        .map(|examined| (examined.kind)())
        .collect();
    assert!(
        !registered.is_empty(),
        "{package} registers no kind that this test program links"
    );
    let missing: Vec<_> = registered.difference(&examined).collect();
    assert!(
        missing.is_empty(),
        "no `conformance!` for {missing:?} of {package}"
    );
}
