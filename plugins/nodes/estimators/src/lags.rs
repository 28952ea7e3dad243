//! Decides which lists of lags make sense, and which lag is taken where none is stated.

use athermal_core::node::Mistake;
use athermal_core::time::Duration;

/// As it is now.
pub(crate) fn now() -> Vec<Duration> {
    vec![Duration::ZERO]
}

/// Lags that stand twice in a list.
pub(crate) fn repeated(name: &str, lags: &[Duration]) -> Vec<Mistake> {
    let twice = |&(i, lag): &(usize, &Duration)| lags[..i].contains(lag);
    let mistake = |(i, lag)| {
        let message = format!("the lag {lag} stands twice in `{name}`");
        Mistake::at(format!("{name}.{i}"), message)
    };
    let twice = lags.iter().enumerate().filter(twice);
    twice.map(mistake).collect()
}
