//! How results of tests look: for people, as JSON, and as JUnit XML.

use std::fmt::Write as _;
use std::time::Duration;

use athermal::trial::{Finding, Wanted};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use serde_json::{Value, json};

use super::suite::Suite;
use super::work::{Ran, Status};
use crate::terminal::{Answer, Failure};
use athermal_analysis::figures::count;

/// The line of a test and, unless it passed, the figures that made it fail.
pub(super) fn lines(suite: &Suite, ran: &Ran) -> String {
    let name = &suite.trials[ran.trial].name;
    let mark = match ran.status {
        Status::Passed => '✓',
        Status::Failed | Status::Broken(_) => '✗',
    };
    let mut text = format!("  {mark} {name} ({})\n", seconds(ran.took));
    for reason in reasons(ran) {
        let _ = writeln!(text, "      {reason}");
    }
    text
}

/// Why a test did not pass; nothing for one that did.
fn reasons(ran: &Ran) -> Vec<String> {
    match &ran.status {
        Status::Passed => Vec::new(),
        Status::Broken(broken) => vec![format!("could not be run: {}", broken.message)],
        Status::Failed => {
            let off = ran.findings.iter().filter(|finding| !finding.holds());
            let notes = ran.notes.iter().map(|note| format!("note: {note}"));
            off.map(ToString::to_string).chain(notes).collect()
        }
    }
}

fn seconds(took: Duration) -> String {
    format!("{:.2} s", took.as_secs_f64())
}

/// All results together.
pub(super) struct Summary<'a> {
    suites: &'a [Suite],
    results: &'a [Ran],
    took: Duration,
}

impl<'a> Summary<'a> {
    pub(super) fn of(suites: &'a [Suite], results: &'a [Ran], took: Duration) -> Self {
        Self {
            suites,
            results,
            took,
        }
    }

    /// How many passed, failed and could not be run.
    fn counts(&self) -> [usize; 3] {
        let mut counts = [0; 3];
        for ran in self.results {
            counts[match ran.status {
                Status::Passed => 0,
                Status::Failed => 1,
                Status::Broken(_) => 2,
            }] += 1;
        }
        counts
    }

    /// One line for people.
    pub(super) fn line(&self) -> String {
        let parts = self
            .counts()
            .into_iter()
            .zip(["passed", "failed", "could not be run"]);
        let parts = parts.filter(|(n, _)| *n > 0);
        let parts = parts.map(|(n, what)| format!("{} {what}", count(n as u64)));
        let parts = match &parts.collect::<Vec<_>>()[..] {
            [] => "nothing to do".to_owned(),
            parts => parts.join(", "),
        };
        let all = self.results.len();
        let tests = if all == 1 { "test" } else { "tests" };
        format!("{all} {tests}: {parts}, in {}", seconds(self.took))
    }

    /// What the command answers.
    pub(super) fn answer(&self) -> Result<Answer, Failure> {
        let broken = self.results.iter().filter_map(|ran| match &ran.status {
            Status::Broken(broken) => Some(broken.status),
            Status::Passed | Status::Failed => None,
        });
        match broken.max() {
            Some(status) => Err(Failure::Exit(status)),
            None if self.counts()[1] > 0 => Ok(Answer::No),
            None => Ok(Answer::Fine),
        }
    }

    /// The facts for programs.
    pub(super) fn json(&self) -> Value {
        let tests: Vec<Value> = self.results.iter().map(|ran| self.test(ran)).collect();
        let [passed, failed, errors] = self.counts();
        json!({
            "tests": tests,
            "passed": passed,
            "failed": failed,
            "errors": errors,
            "seconds": self.took.as_secs_f64(),
        })
    }

    fn test(&self, ran: &Ran) -> Value {
        let suite = &self.suites[ran.suite];
        let trial = &suite.trials[ran.trial];
        let findings: Vec<Value> = ran.findings.iter().map(finding).collect();
        let (status, error) = match &ran.status {
            Status::Passed => ("passed", None),
            Status::Failed => ("failed", None),
            Status::Broken(broken) => ("error", Some(&broken.message)),
        };
        json!({
            "file": suite.path,
            "line": suite.line(trial),
            "name": trial.name,
            "status": status,
            "error": error,
            "seconds": ran.took.as_secs_f64(),
            "findings": findings,
            "notes": ran.notes,
            "warnings": ran.warnings,
        })
    }

    /// The results in the form that continuous integration reads.
    pub(super) fn junit(&self) -> Result<String, Failure> {
        let mut report = Report::new("athermal");
        report.set_time(self.took);
        for (number, suite) in self.suites.iter().enumerate() {
            let mut of_suite = TestSuite::new(&suite.path);
            let results = self.results.iter().filter(|ran| ran.suite == number);
            of_suite.set_time(results.clone().map(|ran| ran.took).sum());
            of_suite.add_test_cases(results.map(|ran| case(suite, ran)));
            report.add_test_suite(of_suite);
        }
        report
            .to_string()
            .map_err(|error| Failure::Outside(error.to_string()))
    }
}

fn case(suite: &Suite, ran: &Ran) -> TestCase {
    let trial = &suite.trials[ran.trial];
    let mut status = match ran.status {
        Status::Passed => TestCaseStatus::success(),
        Status::Failed => TestCaseStatus::non_success(NonSuccessKind::Failure),
        Status::Broken(_) => TestCaseStatus::non_success(NonSuccessKind::Error),
    };
    let reasons = reasons(ran);
    if let Some(first) = reasons.first() {
        status
            .set_message(first)
            .set_description(reasons.join("\n"));
    }
    let mut case = TestCase::new(&trial.name, status);
    case.set_classname(&suite.name).set_time(ran.took);
    case.extra.insert("file".into(), (&suite.path).into());
    case.extra
        .insert("line".into(), suite.line(trial).to_string().into());
    case
}

fn finding(finding: &Finding) -> Value {
    let number = |value: f64| value.is_finite().then_some(value);
    let wanted = match finding.wanted {
        Wanted::Below(limit) => json!({ "below": number(limit) }),
        Wanted::Above(limit) => json!({ "above": number(limit) }),
        Wanted::Equal { value, within } => json!({ "equals": value, "within": within }),
        Wanted::Between(low, high) => json!({ "from": low, "to": high }),
        Wanted::Nothing => json!({ "absent": true }),
    };
    let first = finding
        .first
        .map(|(time, value)| json!({ "at_s": time.secs(), "value": number(value) }));
    json!({
        "of": finding.of,
        "check": finding.check,
        "rival": finding.rival,
        "holds": finding.holds(),
        "found": finding.found.and_then(number),
        "wanted": wanted,
        "unit": finding.unit,
        "instants": finding.instants,
        "first": first,
    })
}
