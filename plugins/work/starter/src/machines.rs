//! Decides whether rows of a log are of several machines that stand side by side, and by which column; not how they are read.

use std::collections::BTreeMap;
use std::path::Path;

use athermal_files::{Description, Tables, with_decimal_point};

use super::clock::Clock;
use super::name::ends_in_unit;
use super::texts::Texts;

/// Of a column with more values none is a machine.
const MOST: usize = 20;
/// So many rows are looked at where a column may be one of machines: one may appear late.
const LOOKED_AT: usize = 20_000;

/// The column that says which machine a row is of, with a remark, where rows of several stand side by side.
pub fn column(
    path: &Path,
    tables: &Tables,
    described: &Description,
    clock: &Clock,
) -> Option<(String, String)> {
    let few = |at: usize| {
        let mut of_each: BTreeMap<&str, usize> = BTreeMap::new();
        for row in &described.rows {
            *of_each
                .entry(row.get(at).map_or("", |cell| cell.trim()))
                .or_default() += 1;
        }
        of_each.len() <= MOST
            && of_each.len() * 10 <= described.rows.len()
            && !of_each.contains_key("")
    };
    let may_be = |(at, name): &(usize, &String)| {
        !clock.columns.names().contains(name) && !ends_in_unit(name) && few(*at)
    };
    let mut candidates = described
        .columns
        .iter()
        .enumerate()
        .filter(may_be)
        .peekable();
    candidates.peek()?;
    let more = Description::laid_out(path, LOOKED_AT, &described.table, tables).ok()?;
    let texts = Texts::from(&more, clock.columns.clone());
    let times = texts
        .by_row()
        .filter_map(|(row, text)| Some((row, clock.form.read(text.as_bytes())?)));
    let times: Vec<(usize, i64)> = times.collect();
    candidates.find_map(|(at, name)| Rows::of(&more, &times, at)?.remark(name))
}

/// Rows with the machine that a column says.
struct Rows<'a> {
    described: &'a Description,
    /// Their place, the machine and the time of each.
    rows: Vec<(usize, &'a str, i64)>,
    /// The column of the machine.
    at: usize,
    /// Those of each machine.
    of_each: BTreeMap<&'a str, Vec<(usize, i64)>>,
}

impl<'a> Rows<'a> {
    fn of(described: &'a Description, times: &[(usize, i64)], at: usize) -> Option<Self> {
        let machine =
            |(row, time): &(usize, i64)| Some((*row, described.rows[*row].get(at)?.trim(), *time));
        let rows: Vec<(usize, &str, i64)> = times.iter().filter_map(machine).collect();
        let mut of_each: BTreeMap<&str, Vec<(usize, i64)>> = BTreeMap::new();
        for (row, machine, time) in &rows {
            of_each.entry(machine).or_default().push((*row, *time));
        }
        let is_such =
            (2..=MOST).contains(&of_each.len()) && of_each.values().all(|of| of.len() > 2);
        is_such.then_some(Self {
            described,
            rows,
            at,
            of_each,
        })
    }

    fn remark(&self, name: &str) -> Option<(String, String)> {
        let changes = self
            .rows
            .windows(2)
            .filter(|pair| pair[0].1 != pair[1].1)
            .count();
        let stays = |times: &mut dyn Iterator<Item = i64>| {
            let times: Vec<i64> = times.collect();
            times.windows(2).filter(|pair| pair[1] <= pair[0]).count()
        };
        let of_all = stays(&mut self.rows.iter().map(|row| row.2));
        let of_each = self
            .of_each
            .values()
            .map(|of| stays(&mut of.iter().map(|row| row.1)));
        let of_each: usize = of_each.sum();
        // Where each stands once, it is a segment as it stands.
        let come_back = changes >= 2 * self.of_each.len();
        let why = if come_back && of_all >= 2 && of_all * 3 >= changes && of_each * 10 <= of_all {
            "where it changes the time does not go on"
        } else if come_back && of_each == 0 && changes * 10 >= self.rows.len() && self.leap() {
            "where it changes all values leap"
        } else {
            return None;
        };
        let values: Vec<&str> = self.of_each.keys().copied().take(4).collect();
        let remark = format!(
            "`{name}` has {} values ({}{}), and {why}: rows of several machines stand side by side. Those of each are read by themselves, as a \
             segment. A service is of one machine, and reads its rows with `only = \"{}\"` beside it; `athermal fleet` fits each by itself, from \
             a file of each",
            self.of_each.len(),
            values.join(", "),
            if self.of_each.len() > values.len() {
                ", …"
            } else {
                ""
            },
            values[0],
        );
        Some((name.to_owned(), remark))
    }

    /// Whether all that is measured changes far less from row to row of a machine than from one to another.
    fn leap(&self) -> bool {
        let mut measured = 0;
        let columns = 0..self.described.columns.len();
        let all_leap = columns.filter(|at| *at != self.at).all(|at| {
            let value = |row: usize| {
                let cell = self.described.rows[row].get(at)?;
                with_decimal_point(cell.trim()).parse::<f64>().ok()
            };
            let step = |pair: [usize; 2]| Some(value(pair[1])? - value(pair[0])?);
            let pairs = self.rows.windows(2).filter(|pair| pair[0].1 != pair[1].1);
            let between: Vec<f64> = pairs
                .filter_map(|pair| step([pair[0].0, pair[1].0]))
                .collect();
            let pairs = self.of_each.values().flat_map(|of| of.windows(2));
            let within: Vec<f64> = pairs
                .filter_map(|pair| step([pair[0].0, pair[1].0]))
                .collect();
            // What is no number, and what counts rows or the time, says nothing.
            if between.len() * 2 < self.rows.len() / 10 || between.iter().all(|step| *step >= 0.0) {
                return true;
            }
            measured += 1;
            let mean = |steps: &[f64]| {
                steps.iter().map(|step| step.abs()).sum::<f64>() / steps.len().max(1) as f64
            };
            mean(&between) > 3.0 * mean(&within)
        });
        all_leap && measured > 0
    }
}
