//! Decides which lists of lags make sense, and which lag is taken where none is stated.

use athermal_core::node::Mistake;
use athermal_core::time::Duration;

/// As it is now.
pub(crate) fn now() -> Vec<Duration> {
    vec![Duration::ZERO]
}

/// Lags that repeat or are negative.
pub(crate) fn lag_mistakes(name: &str, lags: &[Duration]) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    if lags.is_empty() {
        mistakes.push(
            Mistake::at(name, format!("`{name}` is empty"))
                .help("give one lag or more, such as [\"5min\"]"),
        );
    }
    for (i, lag) in lags.iter().enumerate() {
        if lags[..i].contains(lag) {
            mistakes.push(Mistake::at(
                format!("{name}.{i}"),
                format!("the lag {lag} stands twice in `{name}`"),
            ));
        }
    }
    mistakes
}
