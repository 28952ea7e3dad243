//! What an engine of a graph holds, as a table for a terminal.

use athermal::Model;
use athermal::core::compile::Periods;
use athermal::core::engine::Held;
use athermal::core::time::Duration;
use athermal_analysis::figures::table;

use crate::terminal::{Failure, Terminal};

/// The text about a model, whose samples come so often.
pub(super) fn text(model: &Model, rate: &[String], terminal: &Terminal) -> Result<String, Failure> {
    let wrong = |error: &dyn std::fmt::Display| Failure::Request(error.to_string());
    let (rates, is_guessed) = model.rates(rate).map_err(|error| wrong(&error))?;
    if is_guessed {
        terminal.note(
            "nothing says how often samples come: they are taken to come once a second, where `--rate` says nothing else",
        );
    }
    let periods = Periods::new(&model.plan, &rates).map_err(|error| wrong(&error))?;
    let held = model.engine()?.holding(&periods);
    let mut rows: Vec<_> = held.past.iter().map(row).collect();
    let mut last = |name: &str, bytes| {
        let blank = String::new;
        rows.push(vec![name.to_owned(), blank(), blank(), blank(), kb(bytes)]);
    };
    last("all else", held.rest);
    last("in all", held.bytes());
    let signals = model.plan.sources.iter().zip(&periods.slots);
    let mut every: Vec<String> = signals
        .map(|(source, &period)| {
            let signal = source.name.split('.').next().unwrap_or_default();
            format!("{signal} each {}", Duration::from_ns(period))
        })
        .collect();
    every.dedup();
    Ok(format!(
        "an engine once all windows are full, with {}\n\n{}",
        every.join(", "),
        table(&["node", "what", "back", "rows", "kB"], &rows)
    ))
}

fn row(of: &Held) -> Vec<String> {
    vec![
        of.of.clone(),
        of.what.to_owned(),
        of.kept.back.to_string(),
        of.kept.rows.to_string(),
        kb(of.kept.bytes),
    ]
}

fn kb(bytes: u64) -> String {
    format!("{:.1}", bytes as f64 / 1e3)
}
