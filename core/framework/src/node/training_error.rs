//! Why a fit gave nothing, in words.

use std::fmt;

use thiserror::Error;

use crate::diagnostic::{count, counted, names};
use crate::time::Duration;

/// Why a fit gave nothing.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TrainingError {
    /// Fewer rows than are needed.
    #[error("{}, and at least {} are needed", counted(*rows, "complete row"), count(needed))]
    TooFewRows {
        /// Rows that there were.
        rows: usize,
        /// Rows that are needed.
        needed: usize,
    },
    /// Fewer complete rows than are needed, while others are incomplete.
    #[error(fmt = too_few_complete)]
    TooFewComplete {
        /// Rows that were complete.
        rows: usize,
        /// Rows that are needed.
        needed: usize,
        /// How many of the others lack nothing but windows that were still cold.
        cold: u64,
        /// How many lack something else, and from which sensors, in words.
        lacking: Option<(u64, String)>,
    },
    /// There is no truth to learn from.
    #[error(fmt = no_truth)]
    NoTruth {
        /// What is to be predicted.
        truth: String,
        /// How many values of it are outside the limits of `train.abs_truth`.
        outside_limits: u64,
        /// How many came before the estimator had run at the right time.
        too_early: u64,
    },
    /// What the truth is made of never gave one.
    #[error(fmt = truth_never_whole)]
    TruthNeverWhole {
        /// What is to be predicted.
        truth: String,
        /// The measured channels behind it.
        measured: Vec<String>,
        /// Those of them that have no value in the data.
        silent: Vec<String>,
        /// How far it looks back.
        span: Duration,
    },
    /// The estimator never ran: nothing that it waits for ever had a value.
    #[error(fmt = never_ran)]
    NeverRan {
        /// The regressors that it waits for.
        regressors: Vec<String>,
        /// The measured channels behind them that have no value in the data either.
        silent: Vec<String>,
        /// How far that one looks back which looks back the least.
        span: Duration,
    },
    /// Squares of values overflow.
    #[error(
        "values of `{name}` are as large as {largest:.0e}, of which no squares can be summed; a `range` on its signal takes such values \
         as missing"
    )]
    TooLarge {
        /// Of what they are.
        name: String,
        /// The largest, in size.
        largest: f64,
    },
    /// The estimator is to go on learning, and nothing that does comes of its fit: a mistake of its kind.
    #[error(
        "its kind says that it learns while it runs, and gives nothing that does, which is a mistake of its own and not of the data: for \
         {author}: `Predictor::learner` gives a learner, or `Estimator::learns` is `Never`; until then `learn = false` does without"
    )]
    NoLearner {
        /// Whom that is for.
        author: String,
    },
    /// The numbers allow no solution.
    #[error("{reason}")]
    Unsolvable {
        /// What is wrong with them, in words.
        reason: String,
    },
}

fn too_few_complete(
    &rows: &usize,
    &needed: &usize,
    &cold: &u64,
    lacking: &Option<(u64, String)>,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    write!(f, "{}", TrainingError::TooFewRows { rows, needed })?;
    if let Some((rows, sensors)) = lacking {
        let lack = if *rows == 1 { "lacks" } else { "lack" };
        write!(f, "; {} {lack} a value from {sensors}", count(*rows))?;
    }
    if cold > 0 {
        write!(f, "; {} came while windows were still cold", count(cold))?;
    }
    Ok(())
}

fn no_truth(
    truth: &str,
    outside_limits: &u64,
    too_early: &u64,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    match (outside_limits, too_early) {
        (0, 0) => write!(f, "`{truth}` has no value in the data"),
        (outside, 0) => write!(
            f,
            "`{truth}` has no value within the limits of `train.abs_truth`, and {outside} outside"
        ),
        (0, early) => write!(
            f,
            "`{truth}` has no value after it could first be predicted, and {early} before"
        ),
        (outside, early) => write!(
            f,
            "of `{truth}` {outside} values are outside the limits of `train.abs_truth`, and {early} came before it could first be \
             predicted; there is no other"
        ),
    }
}

fn have(of: &[String]) -> &'static str {
    if of.len() == 1 { "has" } else { "have" }
}

fn truth_never_whole(
    truth: &str,
    measured: &[String],
    silent: &[String],
    &span: &Duration,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    write!(f, "`{truth}` has no value in the data, ")?;
    if !silent.is_empty() {
        return write!(f, "since {} {} none", names(silent), have(silent));
    }
    write!(f, "though {} {} some", names(measured), have(measured))?;
    if span > Duration::ZERO {
        write!(f, ": it looks back {span}, and nowhere do they fill that")?;
    }
    Ok(())
}

fn never_ran(
    regressors: &[String],
    silent: &[String],
    &span: &Duration,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    write!(f, "{} ", names(regressors))?;
    if silent == regressors {
        return write!(f, "{} no value in the data", have(silent));
    }
    write!(f, "never {} a value", have(regressors))?;
    if !silent.is_empty() {
        write!(
            f,
            ", since {} {} none in the data",
            names(silent),
            have(silent)
        )
    } else if span > Duration::ZERO {
        write!(
            f,
            ": {span} are looked back at least, and nowhere do samples fill that"
        )
    } else {
        write!(
            f,
            ": there is none in the data, or a node on the way lets none through"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{Duration, TrainingError};

    fn told(regressors: &[&str], silent: &[&str]) -> String {
        told_of(regressors, silent, Duration::ZERO)
    }

    fn told_of(regressors: &[&str], silent: &[&str], span: Duration) -> String {
        let named = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        TrainingError::NeverRan {
            regressors: named(regressors),
            silent: named(silent),
            span,
        }
        .to_string()
    }

    #[test]
    fn what_never_had_a_value_is_named_with_the_sensors_behind_it() {
        assert_eq!(told(&["a"], &["a"]), "`a` has no value in the data");
        assert_eq!(
            told(&["a", "b"], &["a", "b"]),
            "`a`, `b` have no value in the data"
        );
        assert_eq!(
            told(&["sum"], &[]),
            "`sum` never has a value: there is none in the data, or a node on the way lets none through"
        );
        assert_eq!(
            told_of(&["slope"], &[], Duration::from_ns(150_000_000_000)),
            "`slope` never has a value: 150s are looked back at least, and nowhere do samples fill that"
        );
        assert_eq!(
            told(&["p", "q", "r"], &["a"]),
            "`p`, `q`, `r` never have a value, since `a` has none in the data"
        );
        let many: Vec<String> = (1..=14).map(|nth| format!("s{nth}")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        assert_eq!(
            told(&many, &["a"]),
            "`s1`, `s2`, `s3`, `s4`, `s5`, `s6`, `s7`, `s8`, `s9`, `s10`, `s11`, `s12` and 2 more never have a value, since `a` has none in the data"
        );
    }
}
