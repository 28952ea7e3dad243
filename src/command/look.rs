//! `athermal check --live`: what the sources of a machine file have of each channel at present.

use std::path::PathBuf;
use std::time::Duration;

use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::run::model::Model;
use athermal_analysis::figures::{counted, instant, seconds};
use athermal_serve::connector::Seen;
use athermal_serve::deployment::{DeclaredSource, Deployment};
use serde_json::{Value, json};

use crate::terminal::{Format, Terminal};

/// How long a source may take to give one of everything.
const PATIENCE: Duration = Duration::from_secs(10);

/// Asks the sources of a machine file for one of everything, and shows it. Gives whether nothing is missing.
pub fn look(terminal: &Terminal, machine: &Model, files: &Sources) -> bool {
    let mut known = Diagnostics::new();
    let deployment = Deployment::check(&machine.graph, &machine.plan, files, &mut known);
    let mut is_whole = true;
    for source in deployment.into_iter().flat_map(|of| of.sources) {
        let wiring = source.wiring(&machine.plan, PathBuf::new());
        match source.parameters.look(wiring, PATIENCE) {
            Ok(seen) => is_whole &= show(terminal, &source, &seen),
            Err(error) => {
                is_whole = false;
                terminal.warning(format_args!("source `{}`: {error}", source.name));
            }
        }
    }
    is_whole
}

fn show(terminal: &Terminal, source: &DeclaredSource, seen: &[Seen]) -> bool {
    let cells: Vec<_> = seen.iter().map(|of| cells(source, of)).collect();
    let names = [
        "channel", "from", "value", "quality", "time", "clock", "granted",
    ];
    if terminal.format == Format::Json {
        let row = |row: &[String; 7]| -> Value {
            let pairs = names
                .iter()
                .zip(row)
                .map(|(name, cell)| ((*name).to_owned(), json!(cell)));
            Value::Object(pairs.collect())
        };
        let rows: Vec<_> = cells.iter().map(row).collect();
        println!("{:#}", json!({ "source": source.name, "channels": rows }));
    } else {
        let head = names.map(str::to_owned);
        let all = || std::iter::once(&head).chain(&cells);
        let widths: Vec<_> = (0..7)
            .map(|nth| all().map(|row| row[nth].chars().count()).max().unwrap_or(0))
            .collect();
        println!("source `{}`, of kind {}", source.name, source.kind.name);
        for row in all() {
            let row = row
                .iter()
                .zip(&widths)
                .map(|(cell, width)| format!("{cell:width$}"));
            println!("  {}", row.collect::<Vec<_>>().join("  ").trim_end());
        }
    }
    let missing = seen.iter().filter(|of| of.value.is_none()).count();
    if missing > 0 {
        terminal.warning(format_args!(
            "source `{}`: {} missing of {}",
            source.name,
            counted(missing as u64, "channel"),
            seen.len()
        ));
    }
    missing == 0
}

fn cells(source: &DeclaredSource, seen: &Seen) -> [String; 7] {
    let of = &source.channels[seen.channel];
    let dash = || "-".to_owned();
    [
        of.channel.name.clone(),
        of.address.clone(),
        seen.value.map_or_else(dash, |value| value.to_string()),
        seen.quality.clone(),
        seen.stamp.map_or_else(dash, |at| instant(seconds(at))),
        seen.offset
            .map_or_else(dash, |of| format!("{:.3} s", of.secs())),
        seen.granted.clone(),
    ]
}
