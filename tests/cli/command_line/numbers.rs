//! What is no number is told with what is expected, whichever command is given it.

use std::ffi::OsStr;

use crate::workbench::athermal;

#[test]
fn a_number_that_is_none_is_told_with_what_is_expected() {
    let calls: [(&[&str], &[&str], &str); 8] = [
        (
            &[
                "evaluate", "a", "--data", "b", "--mode", "k-step", "--steps",
            ],
            &["0", "-1"],
            "a whole number of steps, 1 or more and below 2^32",
        ),
        (
            &["fit", "a", "--data", "b", "-o", "c", "--threads"],
            &["x"],
            "a whole number of threads, 0 for one per core",
        ),
        (
            &["test", "a", "--threads"],
            &["1.5"],
            "a whole number of threads, 0 for one per core",
        ),
        (
            &["fit", "a", "--data", "b", "-o", "c", "--memory"],
            &["64MB"],
            "a whole number of megabytes, such as 64",
        ),
        (
            &["simulate", "die-tester", "--days"],
            &["1d"],
            "a number of days, such as 0.5",
        ),
        (
            &["simulate", "die-tester", "--seed"],
            &["-3"],
            "a whole number, 0 or more and below 2^64",
        ),
        (
            &["run", "a", "--input", "b", "--margin"],
            &["5"],
            "a percentage such as \"5%\"",
        ),
        (
            &["retrain", "a", "--margin"],
            &["0.05", "-1%", "NaN%"],
            "a percentage such as \"5%\"",
        ),
    ];
    for (words, texts, expected) in calls {
        for text in texts {
            let words = words.iter().chain([text]);
            let words: Vec<&dyn AsRef<OsStr>> = words.map(|word| word as _).collect();
            let expected = format!("expected {expected}, found {text:?}");
            athermal(&words).ended(2).tells(&[&expected]);
        }
    }
}
