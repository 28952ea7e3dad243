//! Decides whether the columns of a log have times of their own, as trends of controllers are exported: a column of times beside each of
//! values. Not which time is that of the rows.

use std::collections::BTreeMap;

use athermal_files::{Description, TimeForm};

use super::clock::{self, Clock};
use super::name::{ends_in_unit, words};
use super::texts::Texts;

/// The clock of a server and that of what it serves differ by less than so many steps; the rest is another time.
const STEPS: f64 = 3.0;
/// A column of numbers is one of times where its name says so.
const CALLED: &str = "time timestamp datetime zeit uhrzeit zeitstempel";

/// Why rows of a log have no one time.
pub fn refusal(described: &Description, clock: &Clock) -> Option<String> {
    let own: BTreeMap<usize, i64> = instants(described, clock);
    let mut steps: Vec<i64> = own
        .values()
        .zip(own.values().skip(1))
        .map(|(a, b)| b - a)
        .collect();
    steps.sort_unstable();
    let usual = *steps.get(steps.len() / 2)? as f64;
    let names = clock.columns.names();
    let mut others = Vec::new();
    for (index, name) in described.columns.iter().enumerate() {
        if names.contains(name) || ends_in_unit(name) {
            continue;
        }
        let texts = Texts::of(described, index);
        let is_called = || {
            let lower = name.to_lowercase();
            words(&lower)
                .iter()
                .any(|word| CALLED.split(' ').any(|of| of == *word))
        };
        let other =
            clock::clock(described, &texts).filter(|other| match (&other.form, &clock.form) {
                (TimeForm::Numbers { ns_per_unit: a }, TimeForm::Numbers { ns_per_unit: b }) => {
                    a == b && is_called()
                }
                (other, own) => is_dated(other) && is_dated(own),
            });
        let is_own = |other: &Clock| {
            other
                .columns
                .names()
                .iter()
                .all(|name| names.contains(name))
        };
        let Some(other) = other.filter(|other| !is_own(other)) else {
            continue;
        };
        let instants = instants(described, &other).into_iter();
        let pairs =
            instants.filter_map(|(row, ns)| Some((row, ns.saturating_sub(*own.get(&row)?))));
        let pairs: Vec<(usize, i64)> = pairs.collect();
        let apart = || pairs.iter().map(|pair| pair.1);
        let (Some(most), Some(least)) = (apart().max(), apart().min()) else {
            continue;
        };
        let spread = most.saturating_sub(least);
        if pairs.len() > 2 && spread as f64 > STEPS * usual {
            others.push((other.columns.to_string(), pairs[pairs.len() - 1].0));
        }
    }
    let (first, row) = others.first()?;
    let at = |name: &str| {
        let column = described.columns.iter().position(|column| column == name);
        column
            .and_then(|column| described.rows[*row].get(column))
            .map_or("", String::as_str)
    };
    let more = match others.len() {
        1 => "is a time of its own".to_owned(),
        all => format!("and {} more are times of their own", all - 1),
    };
    Some(format!(
        "`{first}` {more}, other than `{}`: in one row stand `{}` and `{}`, where a row has one time for all that it has; export \
         it with one time for all columns, or give each time a row with the values that it has, or name the time that counts for all \
         with --time",
        clock.columns,
        at(first),
        at(&clock.columns.to_string()),
    ))
}

fn is_dated(form: &TimeForm) -> bool {
    matches!(form, TimeForm::Rfc3339 | TimeForm::Format(_))
}

/// The instants of a clock in ns, by row.
fn instants(described: &Description, clock: &Clock) -> BTreeMap<usize, i64> {
    let texts = Texts::from(described, clock.columns.clone());
    let rows = texts.by_row();
    rows.filter_map(|(row, text)| Some((row, clock.form.read(text.as_bytes())?)))
        .collect()
}
