//! The table of a fleet: a line for each machine, the worst first.

use std::collections::BTreeMap;

use athermal_analysis::figures::{count, number, or_dash, table};
use serde_json::{Value, json};

use crate::doubts::Doubt;
use crate::figure::Standing;

/// So many machines are shown where not all are asked for.
const WORST: usize = 20;

/// What stands behind the line of a machine.
pub(crate) fn remark(doubts: &[Doubt], more: impl IntoIterator<Item = String>) -> String {
    let doubts = doubts.iter().map(ToString::to_string);
    more.into_iter()
        .chain(doubts)
        .collect::<Vec<_>>()
        .join("; ")
}

/// The table, with what stands behind each line.
pub(crate) fn standings(
    all: &[Standing],
    remarks: &BTreeMap<String, String>,
    shows_all: bool,
) -> String {
    let has_no_model = all
        .iter()
        .any(|of| of.figures.iter().any(|of| of.figure.no_model.is_some()));
    let mut header = vec![
        "machine",
        "worst",
        "on",
        "RMSE",
        "unit",
        "of the fleet's",
        "mean",
    ];
    if has_no_model {
        header.push("of no model's");
    }
    let most = if shows_all { all.len() } else { WORST };
    let rows: Vec<Vec<String>> = all
        .iter()
        .take(most)
        .map(|of| {
            let mut row = vec![of.machine.clone()];
            let worst = of.worst();
            let dash = || "-".to_owned();
            match worst {
                Some((figure, ratio)) => row.extend([
                    figure.of.clone(),
                    count(figure.n),
                    or_dash(figure.rmse),
                    figure.unit.clone(),
                    times(ratio),
                ]),
                None => row.extend(std::iter::repeat_with(dash).take(5)),
            }
            row.push(of.mean_ratio.map_or_else(dash, times));
            if has_no_model {
                let share = worst.and_then(|(figure, _)| Some(figure.rmse? / figure.no_model?));
                row.push(share.map_or_else(dash, times));
            }
            row.extend(
                remarks
                    .get(&of.machine)
                    .filter(|of| !of.is_empty())
                    .cloned(),
            );
            row
        })
        .collect();
    let mut text = table(&header, &rows);
    if rows.len() < all.len() {
        text.push_str(&format!(
            "and {} more: see --all\n",
            count((all.len() - rows.len()) as u64)
        ));
    }
    text
}

fn times(ratio: f64) -> String {
    format!("{} ×", number(ratio))
}

/// The same for programs.
pub(crate) fn facts(of: &Standing) -> Value {
    let worst = of
        .worst()
        .map(|(figure, ratio)| json!({ "of": figure.of, "ratio": ratio }));
    json!({
        "machine": of.machine,
        "worst": worst,
        "mean_ratio": of.mean_ratio,
        "scores": of.figures,
    })
}
