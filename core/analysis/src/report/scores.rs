//! Scores as tables for a terminal, one for each truth.

use std::fmt::Write as _;

use athermal_core::compile::Plan;
use athermal_run::score::{Score, Scores};

use crate::figures::{count, counted, number, or_dash, paragraph, stated, table};

/// The tables of all truths, below what was asked for.
#[must_use]
pub fn scores(scores: &Scores, asked: &[String]) -> String {
    let mut text: String = asked.iter().map(|line| format!("{line}\n")).collect();
    if !asked.is_empty() {
        text.push('\n');
    }
    let mut truths: Vec<&str> = scores
        .scores
        .iter()
        .map(|score| score.truth.as_str())
        .collect();
    truths.dedup();
    for truth in truths {
        let rows: Vec<&Score> = scores
            .scores
            .iter()
            .filter(|score| score.truth == truth)
            .collect();
        let Some(first) = rows.iter().find(|row| !row.own_instants).or(rows.first()) else {
            continue;
        };
        let _ = writeln!(
            text,
            "{truth} in {}, {}",
            first.unit,
            counted(first.n as u64, "instant")
        );
        let _ = writeln!(
            text,
            "  no model{} {}, persistence {}, standard error of the truth {}",
            first.no_model_is.remark(),
            or_dash(first.baseline_zero),
            persistence(&rows),
            or_dash(first.truth_noise)
        );
        text.push_str(&left_out(&rows));
        let header = [
            "  prediction",
            "ahead",
            "RMSE",
            "R²",
            "R²mean",
            "fit",
            "bias",
            "largest",
            "valid",
        ];
        let cells: Vec<Vec<String>> = rows.iter().map(|row| line(row, first)).collect();
        text.push_str(&table(&header, &cells));
        let cells: Vec<Vec<String>> = rows.iter().filter_map(|row| interval(row)).collect();
        if !cells.is_empty() {
            let header = ["  interval", "from", "to cover", "covers", "width", "score"];
            text.push_str(&table(&header, &cells));
        }
        text.push('\n');
    }
    text
}

/// Which predictions go out under other names than their own, for people; none where all have their own.
#[must_use]
pub fn outputs(plan: &Plan) -> Option<String> {
    let of = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let mut pairs: Vec<String> = Vec::new();
    for output in &plan.outputs {
        let shown = &plan.channels[output.slot];
        let (name, node) = (of(&output.name), of(&shown.name));
        let pair = format!("`{name}` is {node}");
        if shown.predicts.is_some() && name != node && !pairs.contains(&pair) {
            pairs.push(pair);
        }
    }
    (!pairs.is_empty()).then(|| format!("what goes out: {}", pairs.join(", ")))
}

/// How far off the truth of before is, for each horizon where that differs.
fn persistence(rows: &[&Score]) -> String {
    let of = |row: &Score| match row.persistence_on_few() {
        Some(few) => format!(
            "{} on {} of them",
            or_dash(row.baseline_persistence),
            count(few)
        ),
        None => or_dash(row.baseline_persistence),
    };
    let mut all: Vec<(f64, String)> = Vec::new();
    // Where all are scored wherever they are, of all of them.
    let own = rows.iter().all(|row| row.own_instants);
    for row in rows.iter().filter(|row| row.own_instants == own) {
        if all.iter().all(|(ahead_s, _)| *ahead_s != row.ahead_s) {
            all.push((row.ahead_s, of(row)));
        }
    }
    let Some((_, first)) = all.first() else {
        return rows.first().map_or_else(|| or_dash(None), |row| of(row));
    };
    if all.iter().all(|(_, error)| error == first) {
        return first.clone();
    }
    let horizons = all
        .iter()
        .map(|(ahead_s, error)| format!("{error} at {}", stated(*ahead_s)));
    horizons.collect::<Vec<_>>().join(" and ")
}

/// The remark where many instants are not scored, since some prediction has no value there.
fn left_out(rows: &[&Score]) -> String {
    let scored_together = || rows.iter().filter(|row| !row.own_instants);
    let Some(most) = scored_together().max_by_key(|row| row.left_out) else {
        return String::new();
    };
    let valid = |row: &Score| row.valid.unwrap_or(f64::NEG_INFINITY);
    let lacking = scored_together().min_by(|a, b| valid(a).total_cmp(&valid(b)));
    match lacking {
        Some(lacking) if most.leaves_many_out() => {
            let words = format!(
                "{} of {} instants at which {} is there are left out, since others are not, such as {}; --each-on-its-own scores each \
                 wherever it is",
                count(most.left_out),
                count(most.n + most.left_out),
                most.output,
                lacking.output
            );
            paragraph("  ", 2, &words)
        }
        _ => String::new(),
    }
}

fn interval(score: &Score) -> Option<Vec<String>> {
    let interval = score.interval.as_ref()?;
    Some(vec![
        format!("  {}", score.output),
        interval.from.to_owned(),
        percent(100.0 * interval.stated),
        percent(100.0 * interval.covered),
        number(interval.width),
        number(interval.score),
    ])
}

/// How much of a truth is explained, 1 being all of it. What is far off is not written out.
pub(super) fn share(value: f64) -> String {
    if value.abs() < 1e3 {
        format!("{value:.3}")
    } else {
        number(value)
    }
}

fn percent(value: f64) -> String {
    if value.abs() < 1e5 {
        format!("{value:.1}%")
    } else {
        format!("{}%", number(value))
    }
}

/// The line of a score, below the figures of another: those that are the same stand there.
fn line(score: &Score, above: &Score) -> Vec<String> {
    let ratio = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), share);
    // Nothing that is measured bounds how far a free run is ahead.
    let ahead = score.horizon_s.map_or_else(|| "free".to_owned(), stated);
    let mut cells = vec![
        format!("  {}", score.output),
        ahead,
        or_dash(score.rmse),
        ratio(score.r2_zero),
        ratio(score.r2_mean),
        score.fit.map_or_else(|| "-".to_owned(), percent),
        or_dash(score.bias),
        or_dash(score.max_abs),
        score
            .valid
            .map_or_else(|| "-".to_owned(), |valid| percent(100.0 * valid)),
    ];
    let mut remarks = Vec::new();
    if score.is_worse_than_nothing() {
        remarks.push("worse than no model".to_owned());
    }
    if score.valid.is_none() {
        remarks.push("no truth to compare with".to_owned());
    } else if score.n == 0 {
        remarks.push("no prediction of any truth".to_owned());
    } else if score.n != above.n {
        remarks.push(format!(
            "on its own {} (no model {}, persistence {})",
            counted(score.n as u64, "instant"),
            or_dash(score.baseline_zero),
            or_dash(score.baseline_persistence)
        ));
    }
    if !remarks.is_empty() {
        cells.push(remarks.join(", "));
    }
    cells
}
