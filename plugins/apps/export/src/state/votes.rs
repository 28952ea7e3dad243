//! What a vote knows, between its form in a snapshot and its place in the arrays of the runtime.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::CarryError;
use super::image::Image;
use super::nodes::{places, read, written};
use super::snapshot::{Node, Withheld};
use crate::form::{BY_TIME, FADING, Form, HEDGE, Record, STATE_GATE};

#[derive(Serialize, Deserialize)]
struct Errors {
    state: String,
    memory: Value,
    squares: Vec<Vec<(i64, f64)>>,
    means: Vec<Option<f64>>,
    counts: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct Losses {
    state: String,
    sums: Vec<f64>,
    gap: f64,
    widest: f64,
    last: Option<i64>,
}

#[derive(Serialize, Deserialize)]
struct Gate {
    state: String,
    followed: Option<u64>,
    other: Option<(u64, i64)>,
}

/// Whether the errors of a vote count ever less.
fn fades(vote: &Record) -> bool {
    vote.int_of("memory") == FADING
}

/// Where the parts of a vote lie.
pub(super) struct Ballot {
    voters: usize,
    judged: usize,
    runs: usize,
    waiting: usize,
    errors: usize,
    /// Whether errors come and go for all voters at once; else each voter has a ring of its own.
    together: bool,
    ints: usize,
    run_times: usize,
    arrived: usize,
    run_of: usize,
    rings: usize,
    error_times: usize,
    rows: usize,
    truths: usize,
    squares: usize,
    sums: usize,
}

impl Ballot {
    pub(super) fn new(form: &Form, node: &Record) -> Self {
        let (voters, judged) = form.voters(node);
        let (ints, rows) = places(node);
        let (runs, waiting) = (node.place_of("runs"), node.place_of("waiting"));
        let errors = node.place_of("errors");
        let run_times = ints + 7;
        let arrived = run_times + runs;
        let run_of = arrived + waiting;
        let rings = run_of + waiting;
        let truths = rows + runs * voters;
        let squares = truths + waiting;
        Self {
            voters,
            judged,
            runs,
            waiting,
            errors,
            together: node.int_of("memory") == BY_TIME,
            ints,
            run_times,
            arrived,
            run_of,
            rings,
            error_times: rings + 2 * node.place_of("rings"),
            rows,
            truths,
            squares,
            sums: squares + judged * errors,
        }
    }

    /// Where the means, the counts and the trust of voters lie.
    fn means(&self) -> usize {
        self.sums + self.judged
    }

    fn counts(&self) -> usize {
        self.means() + self.judged
    }

    fn trust(&self) -> usize {
        self.counts() + self.judged
    }

    /// What every vote begins with.
    pub(super) fn begin(&self, image: &mut Image) {
        image.ints[self.ints + 4] = -1;
        image.ints[self.ints + 5] = -1;
        let means = self.means();
        image.reals[means..means + self.judged].fill(f64::NAN);
        image.reals[self.trust()..][..self.voters].fill(1.0);
    }

    pub(super) fn put(&self, image: &mut Image, known: &Node) {
        let Some(embargo) = &known.learning else {
            return;
        };
        let pairing = &embargo.pairing;
        let first = pairing.number - pairing.past as u64;
        let total = first + pairing.runs.times.len() as u64;
        image.ints[self.ints] = total as i64;
        image.ints[self.ints + 1] = first as i64;
        for (nth, &time) in pairing.runs.times.iter().enumerate() {
            let place = (first as usize + nth) % self.runs;
            image.ints[self.run_times + place] = time;
            let row = &pairing.runs.numbers[nth * self.voters..][..self.voters];
            image.reals[self.rows + place * self.voters..][..self.voters].copy_from_slice(row);
        }
        let kept = embargo.withheld.len().min(self.waiting);
        let withheld = &embargo.withheld[embargo.withheld.len() - kept..];
        image.ints[self.ints + 3] = kept as i64;
        for (nth, late) in withheld.iter().enumerate() {
            image.ints[self.arrived + nth] = late.arrived;
            image.ints[self.run_of + nth] = late.run as i64;
            image.reals[self.truths + nth] = late.truth;
        }
    }

    pub(super) fn take(&self, image: &Image, known: &mut Node) {
        let Some(embargo) = &mut known.learning else {
            return;
        };
        let total = image.ints[self.ints] as usize;
        let first = (image.ints[self.ints + 1] as usize).max(total.saturating_sub(self.runs));
        let pairing = &mut embargo.pairing;
        (pairing.past, pairing.number) = (0, first as u64);
        let time = |run: usize| image.ints[self.run_times + run % self.runs];
        let row = |run: usize| {
            let first = self.rows + (run % self.runs) * self.voters;
            image.reals[first..first + self.voters].iter().copied()
        };
        pairing.runs.times = (first..total).map(time).collect();
        pairing.runs.numbers = (first..total).flat_map(row).collect();
        let from = image.ints[self.ints + 2] as usize;
        let withheld = (0..image.ints[self.ints + 3] as usize).map(|nth| {
            let place = (from + nth) % self.waiting;
            Withheld {
                arrived: image.ints[self.arrived + place],
                truth: image.reals[self.truths + place],
                note: 0.0,
                run: image.ints[self.run_of + place] as u64,
            }
        });
        embargo.withheld = withheld.collect();
        let needed = embargo.withheld.first().map(|late| late.run);
        embargo.pairing.needed = needed.unwrap_or(u64::MAX);
    }

    /// Puts what the rule itself knows into the arrays.
    pub(super) fn put_own(
        &self,
        image: &mut Image,
        node: &Record,
        own: &[u8],
    ) -> Result<(), CarryError> {
        match node.int_of("rule") {
            STATE_GATE => {
                let state: Gate = read(node, own)?;
                image.ints[self.ints + 4] = state.followed.map_or(-1, |of| of as i64);
                if let Some((other, since)) = state.other {
                    image.ints[self.ints + 5] = other as i64;
                    image.ints[self.ints + 6] = since;
                }
            }
            HEDGE => self.put_losses(image, &read(node, own)?),
            _ => self.put_errors(image, &read(node, own)?, fades(node)),
        }
        Ok(())
    }

    /// Takes what the rule itself knows from the arrays.
    pub(super) fn take_own(
        &self,
        image: &Image,
        node: &Record,
        own: &[u8],
    ) -> Result<Option<Vec<u8>>, CarryError> {
        match node.int_of("rule") {
            STATE_GATE => {
                let mut state: Gate = read(node, own)?;
                state.followed = u64::try_from(image.ints[self.ints + 4]).ok();
                let other = u64::try_from(image.ints[self.ints + 5]).ok();
                state.other = other.map(|other| (other, image.ints[self.ints + 6]));
                written(node, &state)
            }
            HEDGE => {
                let mut state: Losses = read(node, own)?;
                self.take_losses(image, &mut state);
                written(node, &state)
            }
            _ => {
                let mut state: Errors = read(node, own)?;
                self.take_errors(image, &mut state, fades(node));
                written(node, &state)
            }
        }
    }

    fn put_errors(&self, image: &mut Image, errors: &Errors, fades: bool) {
        let mut next = vec![0; errors.squares.len()];
        if self.together {
            // One row for all errors of an arrival.
            let mut rows = Vec::new();
            let front = |voter: usize, nth: usize| errors.squares[voter].get(nth);
            let arrival = |next: &[usize]| {
                let fronts = next.iter().enumerate();
                let fronts = fronts.filter_map(|(voter, &nth)| front(voter, nth));
                fronts.map(|&(arrived, _)| arrived).min()
            };
            while let Some(first) = arrival(&next) {
                let row = next.iter_mut().enumerate().map(|(voter, nth)| {
                    let square = front(voter, *nth).filter(|(arrived, _)| *arrived == first);
                    *nth += usize::from(square.is_some());
                    square.map_or(f64::NAN, |&(_, square)| square)
                });
                rows.push((first, row.collect::<Vec<f64>>()));
            }
            let kept = &rows[rows.len().saturating_sub(self.errors)..];
            image.ints[self.rings + 1] = kept.len() as i64;
            for (nth, (arrived, row)) in kept.iter().enumerate() {
                image.ints[self.error_times + nth] = *arrived;
                for (voter, &square) in row.iter().enumerate() {
                    image.reals[self.squares + voter * self.errors + nth] = square;
                }
            }
        }
        for (voter, squares) in errors.squares.iter().enumerate() {
            let kept = squares.len().min(self.errors);
            let kept = &squares[squares.len() - kept..];
            if !self.together {
                for (nth, &(arrived, square)) in kept.iter().enumerate() {
                    image.ints[self.error_times + voter * self.errors + nth] = arrived;
                    image.reals[self.squares + voter * self.errors + nth] = square;
                }
                image.ints[self.rings + 2 * voter + 1] = kept.len() as i64;
            }
            let sum = kept.iter().fold(0.0, |sum, (_, square)| sum + square);
            let (mean, count) = match (fades, kept) {
                (_, []) => (f64::NAN, 0.0),
                (true, _) => (
                    errors.means[voter].unwrap_or(f64::NAN),
                    errors.counts[voter],
                ),
                (false, _) => (sum / kept.len() as f64, kept.len() as f64),
            };
            image.reals[self.sums + voter] = sum;
            image.reals[self.means() + voter] = mean;
            image.reals[self.counts() + voter] = count;
        }
    }

    fn take_errors(&self, image: &Image, errors: &mut Errors, fades: bool) {
        for (voter, squares) in errors.squares.iter_mut().enumerate() {
            let ring = if self.together { 0 } else { voter };
            let from = image.ints[self.rings + 2 * ring] as usize;
            let count = image.ints[self.rings + 2 * ring + 1] as usize;
            let error = |nth: usize| {
                let place = (from + nth) % self.errors;
                let arrived = image.ints[self.error_times + ring * self.errors + place];
                (
                    arrived,
                    image.reals[self.squares + voter * self.errors + place],
                )
            };
            let all = (0..count).map(error);
            *squares = all.filter(|(_, square)| !square.is_nan()).collect();
            if fades {
                let mean = image.reals[self.means() + voter];
                errors.means[voter] = (!mean.is_nan()).then_some(mean);
                errors.counts[voter] = image.reals[self.counts() + voter];
            }
        }
    }

    fn put_losses(&self, image: &mut Image, losses: &Losses) {
        image.ints[self.rings + 1] = i64::from(losses.last.is_some());
        image.ints[self.error_times] = losses.last.unwrap_or(0);
        image.reals[self.squares] = losses.gap;
        image.reals[self.squares + 1] = losses.widest;
        image.reals[self.sums..][..self.voters].copy_from_slice(&losses.sums);
    }

    fn take_losses(&self, image: &Image, losses: &mut Losses) {
        let has_last = image.ints[self.rings + 1] != 0;
        losses.last = has_last.then_some(image.ints[self.error_times]);
        losses.gap = image.reals[self.squares];
        losses.widest = image.reals[self.squares + 1];
        losses.sums = image.reals[self.sums..][..self.voters].to_vec();
    }
}
