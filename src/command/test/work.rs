//! Which thread fits what and runs which test. Results come in the order of the files; a fit that several tests share is made once.

use std::collections::BTreeMap;
use std::panic::{self, AssertUnwindSafe};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use athermal::core::diagnostic::panic_text;
use athermal::core::engine::Fitted;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Recording;
use athermal::trial::{self, DataSet, Finding, On};

use super::suite::Suite;
use crate::terminal::Failure;
use athermal_jobs::remarks::of_files;

/// What came of a test.
pub(super) struct Ran {
    /// The number of its file.
    pub(super) suite: usize,
    /// Its number in the file.
    pub(super) trial: usize,
    /// How it went.
    pub(super) status: Status,
    /// All that was checked.
    pub(super) findings: Vec<Finding>,
    /// What else there is to know, e.g. of the fit.
    pub(super) notes: Vec<String>,
    /// What is wrong with the files that were read, those of the fit first.
    pub(super) warnings: Vec<String>,
    /// How long it took, without the fit.
    pub(super) took: Duration,
}

/// How a test went.
#[derive(Debug, Clone)]
pub(super) enum Status {
    /// All is as expected.
    Passed,
    /// Something is not.
    Failed,
    /// It could not be run.
    Broken(Broken),
}

/// Why something could not be run.
#[derive(Debug, Clone)]
pub(super) struct Broken {
    /// What and why.
    pub(super) message: String,
    /// Its exit status.
    pub(super) status: u8,
}

impl Broken {
    fn of(failure: impl Into<Failure>) -> Self {
        match failure.into() {
            Failure::Outside(message) => Self { message, status: 3 },
            Failure::Request(message) => Self { message, status: 2 },
            Failure::Graph { .. } | Failure::Exit(_) => Self {
                message: "the graph has mistakes".to_owned(),
                status: 2,
            },
        }
    }
}

/// The result of a job, or the message of a node that panicked in it: other tests wait for its fit.
fn caught<T>(job: impl FnOnce() -> Result<T, Broken>) -> Result<T, Broken> {
    panic::catch_unwind(AssertUnwindSafe(job)).unwrap_or_else(|panic| {
        Err(Broken {
            message: panic_text(&*panic),
            status: 3,
        })
    })
}

/// What came of a fit.
#[derive(Clone, Default)]
struct Made {
    fitted: Fitted,
    notes: Vec<String>,
    warnings: Vec<String>,
}

/// Runs all tests; `show` is called for each as soon as it and all before it are done.
pub(super) fn run(suites: &[Suite], threads: usize, show: &mut dyn FnMut(&Ran)) -> Vec<Ran> {
    let mut fits: Vec<(usize, &DataSet)> = Vec::new();
    let mut tests = Vec::new();
    for (suite, of) in suites.iter().enumerate() {
        for (trial, declared) in of.trials.iter().enumerate() {
            let fit = declared.fit.as_ref().map(|data| {
                let known = fits.iter().position(|fit| *fit == (suite, data));
                known.unwrap_or_else(|| {
                    fits.push((suite, data));
                    fits.len() - 1
                })
            });
            tests.push((suite, trial, fit));
        }
    }
    let options = FitOptions {
        threads: if fits.len() > 1 { 1 } else { threads },
        ..FitOptions::default()
    };
    let mut made = Vec::new();
    let make = |&(suite, data): &(usize, &DataSet)| caught(|| make(&suites[suite], data, &options));
    in_parallel(&fits, threads, make, |of| made.push(of));
    let none = Ok(Made::default());
    let test = |&(suite, trial, fit): &(usize, usize, Option<usize>)| {
        let made = fit.and_then(|fit| made.get(fit)).unwrap_or(&none);
        test(suites, (suite, trial), made)
    };
    let mut results = Vec::new();
    in_parallel(&tests, threads, test, |ran| {
        show(&ran);
        results.push(ran);
    });
    results
}

/// Does jobs in several threads. Their results come in the order of the jobs, each as soon as it and all before it are there.
fn in_parallel<J: Sync, R: Send>(
    jobs: &[J],
    threads: usize,
    run: impl Fn(&J) -> R + Sync,
    mut done: impl FnMut(R),
) {
    let next = AtomicUsize::new(0);
    let (give, results) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..threads.min(jobs.len()) {
            let (give, next, run) = (give.clone(), &next, &run);
            scope.spawn(move || {
                let take = || {
                    let nth = next.fetch_add(1, Ordering::Relaxed);
                    Some((nth, run(jobs.get(nth)?)))
                };
                while take().is_some_and(|result| give.send(result).is_ok()) {}
            });
        }
        drop(give);
        let (mut waiting, mut shown) = (BTreeMap::new(), 0);
        for (nth, result) in results {
            waiting.insert(nth, result);
            while let Some(result) = waiting.remove(&shown) {
                done(result);
                shown += 1;
            }
        }
    });
}

/// Data that a test names.
enum Opened {
    Files(Box<Dataset>),
    Simulated(Box<dyn Recording>),
}

impl Opened {
    fn of(data: &DataSet) -> Result<Self, Broken> {
        match data {
            DataSet::Files(paths) => {
                let dataset = Dataset::new(paths.clone(), Options::default());
                Ok(Self::Files(Box::new(dataset)))
            }
            DataSet::Simulated(simulation) => {
                let simulated = simulation.recording();
                let simulated =
                    simulated.map_err(|error| Broken::of(Failure::Request(error.to_string())))?;
                Ok(Self::Simulated(simulated))
            }
        }
    }

    fn recording(&self) -> &dyn Recording {
        match self {
            Self::Files(dataset) => &**dataset,
            Self::Simulated(simulated) => &**simulated,
        }
    }

    /// What is wrong with the files, once they have been read.
    fn warnings(&self) -> Vec<String> {
        match self {
            Self::Files(dataset) => {
                let messages = of_files(&dataset.reports());
                messages.iter().map(ToString::to_string).collect()
            }
            Self::Simulated(_) => Vec::new(),
        }
    }
}

fn make(suite: &Suite, data: &DataSet, options: &FitOptions) -> Result<Made, Broken> {
    let opened = Opened::of(data)?;
    let (fitted, report) =
        fit(&suite.plan, opened.recording(), options, &mut |_| {}).map_err(Broken::of)?;
    let failed = report.failed();
    let failed = failed.map(|(node, error)| format!("{node} could not be fitted: {error}"));
    Ok(Made {
        fitted,
        notes: failed.collect(),
        warnings: opened.warnings(),
    })
}

fn test(suites: &[Suite], (suite, trial): (usize, usize), made: &Result<Made, Broken>) -> Ran {
    let of = &suites[suite];
    let declared = &of.trials[trial];
    let began = Instant::now();
    let run = |made: &Made| {
        let mut warnings = made.warnings.clone();
        let verdict = match &declared.on {
            On::Data(set) => {
                let opened = Opened::of(set)?;
                let verdict = trial::run(&of.plan, declared, &made.fitted, opened.recording());
                warnings.extend(opened.warnings());
                verdict
            }
            On::Synthetic(synthetic) => trial::run(&of.plan, declared, &made.fitted, synthetic),
        };
        Ok((verdict.map_err(Broken::of)?, made.notes.clone(), warnings))
    };
    let verdict = made.as_ref().map_err(Clone::clone);
    let verdict = verdict.and_then(|made| caught(|| run(made)));
    let (status, findings, notes, warnings) = match verdict {
        Err(broken) => (Status::Broken(broken), Vec::new(), Vec::new(), Vec::new()),
        Ok((verdict, notes, warnings)) => {
            let status = match verdict.passes() {
                true => Status::Passed,
                false => Status::Failed,
            };
            (status, verdict.findings, notes, warnings)
        }
    };
    Ran {
        suite,
        trial,
        status,
        findings,
        notes,
        warnings,
        took: began.elapsed(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_told_as_what_breaks_a_test() {
        let broken = caught::<()>(|| panic!("within a node")).unwrap_err();
        assert!(broken.message.contains("within a node"));
        assert_eq!(caught(|| Ok(1)).unwrap_or_default(), 1);
    }
}
