//! Warnings about predictions of which nothing is scored.

use athermal_core::watch::Watch;
use athermal_run::score::Unscored;

use crate::model::few;
use athermal_analysis::figures::{counted, stated};

/// Warns of them, of those with one reason together.
pub fn warn(host: &dyn Watch, unscored: &[Unscored]) {
    let mut groups: Vec<(Vec<String>, String)> = Vec::new();
    for of in unscored {
        let (output, why) = (of.output.clone(), why(of));
        match groups.iter_mut().find(|(_, groups)| *groups == why) {
            Some((outputs, _)) => outputs.push(output),
            None => groups.push((vec![output], why)),
        }
    }
    for (outputs, why) in groups {
        let outputs = few(&outputs);
        host.warning(format_args!("{outputs}: nothing is scored: {why}"));
    }
}

/// Why nothing is scored, whichever prediction it is.
fn why(of: &Unscored) -> String {
    let there = [
        counted(of.ticks, "row"),
        counted(of.truths as u64, "truth"),
        counted(of.predictions, "prediction"),
        counted(of.pairs as u64, "pair"),
    ];
    let why = match &of.first_silent {
        Some(silent) if *silent == of.truth => format!("{silent} never has a value"),
        Some(silent) => format!("the first to lack a value is {silent}"),
        None if of.within_limit == 0 => "no truth is within `--abs-truth-below`".to_owned(),
        None if of.pairs == 0 => format!(
            "no truth is there {} after a prediction; are the data longer than that, without a gap?",
            stated(of.ahead_s)
        ),
        None => {
            "where one is, other predictions of the truth are not there; `--each-on-its-own` scores each wherever it is"
                .to_owned()
        }
    };
    format!("{}: {why}", there.join(", "))
}
