//! What each kind of node knows, between its form in a snapshot and its place in the arrays of the runtime.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::CarryError;
use super::image::Image;
use super::snapshot::{Node, Past, Withheld};
use crate::form::{Form, Record, STATE_GATE};

#[derive(Serialize, Deserialize)]
struct Slope {
    state: String,
    lengths: Vec<i64>,
    coverage: Value,
    errors: bool,
    kernel: Kernel,
}

#[derive(Serialize, Deserialize)]
struct Kernel {
    windows_ns: Vec<i64>,
    coverage: Value,
    no_value: [u64; 2],
    squares: bool,
    times_ns: Vec<i64>,
    samples: Vec<Option<f64>>,
    cuts: Vec<u64>,
    origins: Vec<f64>,
    rebases: [u64; 2],
    first_ns: Vec<Option<i64>>,
    newest_ns: Vec<Option<i64>>,
}

#[derive(Serialize, Deserialize)]
struct Lag {
    state: String,
    channels: Vec<Past>,
}

#[derive(Serialize, Deserialize)]
struct FirstOrder {
    state: String,
    rates: Vec<f64>,
    last: Vec<Option<(i64, f64)>>,
    values: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct Errors {
    state: String,
    memory: Value,
    squares: Vec<Vec<(i64, f64)>>,
    means: Vec<Option<f64>>,
    counts: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct Gate {
    state: String,
    followed: Option<u64>,
    other: Option<(u64, i64)>,
}

#[derive(Serialize, Deserialize)]
struct Compensate {
    state: String,
    last: Option<i64>,
    unit: Value,
    axes: Vec<Corrected>,
}

#[derive(Serialize, Deserialize)]
struct Corrected {
    target: f64,
    given: f64,
    rate: Option<f64>,
    stopped: bool,
}

#[derive(Serialize, Deserialize)]
struct Stability {
    state: String,
    axes: Vec<Axis>,
}

#[derive(Serialize, Deserialize)]
struct Axis {
    state: Option<u8>,
    other: Option<(u8, i64)>,
}

#[derive(Serialize, Deserialize)]
struct SafeState {
    state: String,
    last: Option<i64>,
    units: Value,
    channels: Vec<Safe>,
}

#[derive(Serialize, Deserialize)]
struct Safe {
    given: f64,
    doubtful: u32,
    away: bool,
    begun: bool,
}

#[derive(Serialize, Deserialize)]
struct Uncorrected {
    state: String,
    seen: Vec<bool>,
}

#[derive(Serialize, Deserialize)]
struct Settled {
    state: String,
    stood: Option<f64>,
    changed: Option<i64>,
    waiting: bool,
    low_since: Option<i64>,
    newest: Option<i64>,
}

fn read<T: DeserializeOwned>(node: &Record, own: &[u8]) -> Result<T, CarryError> {
    rmp_serde::from_slice(own).map_err(|error| CarryError::of(&node.node, error))
}

fn written<T: Serialize>(node: &Record, state: &T) -> Result<Option<Vec<u8>>, CarryError> {
    let bytes = rmp_serde::to_vec_named(state);
    bytes
        .map(Some)
        .map_err(|error| CarryError::of(&node.node, error))
}

/// Where the integers and numbers of a node lie.
fn places(node: &Record) -> (usize, usize) {
    (node.place_of("ints"), node.place_of("reals"))
}

impl Image {
    fn put_time(&mut self, place: usize, time: Option<i64>) {
        self.ints[place] = i64::from(time.is_some());
        self.ints[place + 1] = time.unwrap_or(0);
    }

    fn time(&self, place: usize) -> Option<i64> {
        (self.ints[place] != 0).then_some(self.ints[place + 1])
    }

    fn put_slope(&mut self, node: &Record, kernel: &Kernel) {
        let (ints, reals) = places(node);
        let (room, blocks) = (node.place_of("room"), node.place_of("blocks"));
        let (widths, count) = (node.longs_of("width"), node.place_of("channels"));
        let rows = kernel.times_ns.len();
        let lacks = |row: usize| {
            let samples = &kernel.samples[row * count..(row + 1) * count];
            samples.iter().any(Option::is_none)
        };
        let complete = (0..rows).rev().find(|&row| lacks(row));
        self.ints[ints] = rows as i64;
        self.ints[ints + 1] = complete.map_or(0, |row| row as i64 + 1);
        self.ints[ints + 2] = kernel.rebases[0] as i64;
        self.ints[ints + 3] = kernel.rebases[1] as i64;
        let starts: Vec<u64> = std::iter::once(0)
            .chain(kernel.cuts.iter().copied())
            .collect();
        let kept = &starts[starts.len().saturating_sub(blocks)..];
        self.ints[ints + 4] = kept.len() as i64;
        for (nth, start) in kept.iter().enumerate() {
            self.ints[ints + 5 + nth] = *start as i64;
        }
        let heads = ints + 5 + blocks;
        let last = kernel.times_ns.last().copied().unwrap_or(0);
        for (nth, width) in widths.iter().enumerate() {
            let within = |time: &i64| last.saturating_sub(*time) < *width;
            let head = kernel.times_ns.iter().position(within).unwrap_or(0);
            self.ints[heads + nth] = head.max(rows.saturating_sub(room)) as i64;
        }
        let channels = heads + widths.len();
        for channel in 0..count {
            let (first, newest) = (kernel.first_ns[channel], kernel.newest_ns[channel]);
            self.ints[channels + channel] = i64::from(first.is_some());
            self.ints[channels + count + channel] = first.unwrap_or(0);
            self.ints[channels + 2 * count + channel] = newest.unwrap_or(0);
            self.reals[reals + channel] = kernel.origins[channel];
        }
        for row in rows.saturating_sub(room)..rows {
            let place = row % room;
            self.ints[channels + 3 * count + place] = kernel.times_ns[row];
            for channel in 0..count {
                let sample = kernel.samples[row * count + channel].unwrap_or(f64::NAN);
                self.reals[reals + count + place * count + channel] = sample;
            }
        }
    }

    fn take_slope(
        &self,
        form: &Form,
        node: &Record,
        kernel: &mut Kernel,
    ) -> Result<(), CarryError> {
        let (ints, reals) = places(node);
        let (room, blocks) = (node.place_of("room"), node.place_of("blocks"));
        let (windows, count) = (node.longs_of("width").len(), node.place_of("channels"));
        let rows = self.ints[ints] as usize;
        let starts = &self.ints[ints + 5..][..self.ints[ints + 4] as usize];
        let Some(&oldest) = starts.first() else {
            let reason = format!("it was saved before `{}_init` was called", form.name);
            return Err(CarryError::of(&node.node, reason));
        };
        let oldest = (oldest as usize).max(rows.saturating_sub(room));
        let channels = ints + 5 + blocks + windows;
        let time = |row: usize| self.ints[channels + 3 * count + row % room];
        let sample = |row: usize, channel: usize| {
            let sample = self.reals[reals + count + (row % room) * count + channel];
            (!sample.is_nan()).then_some(sample)
        };
        kernel.times_ns = (oldest..rows).map(time).collect();
        kernel.samples = (oldest..rows)
            .flat_map(|row| (0..count).map(move |channel| sample(row, channel)))
            .collect();
        let cuts = starts.iter().map(|&start| start as usize);
        // A block that begins with the next row is cut anew there.
        let cuts = cuts.filter(|&start| start > oldest && start < rows);
        kernel.cuts = cuts.map(|start| (start - oldest) as u64).collect();
        kernel.origins = self.reals[reals..reals + count].to_vec();
        kernel.rebases = [self.ints[ints + 2] as u64, self.ints[ints + 3] as u64];
        let of = |place: usize, channel: usize| {
            (self.ints[channels + channel] != 0).then(|| self.ints[place + channel])
        };
        kernel.first_ns = (0..count).map(|nth| of(channels + count, nth)).collect();
        kernel.newest_ns = (0..count)
            .map(|nth| of(channels + 2 * count, nth))
            .collect();
        Ok(())
    }
}

/// Where the parts of a vote lie.
struct Ballot {
    voters: usize,
    judged: usize,
    runs: usize,
    waiting: usize,
    errors: usize,
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
    fn new(form: &Form, node: &Record) -> Self {
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
            ints,
            run_times,
            arrived,
            run_of,
            rings,
            error_times: rings + 2 * judged,
            rows,
            truths,
            squares,
            sums: squares + judged * errors,
        }
    }

    /// What every vote begins with.
    fn begin(&self, image: &mut Image) {
        image.ints[self.ints + 4] = -1;
        image.ints[self.ints + 5] = -1;
        let means = self.sums + self.judged;
        image.reals[means..means + self.judged].fill(f64::NAN);
        image.reals[means + self.judged..][..self.voters].fill(1.0);
    }

    fn put(&self, image: &mut Image, known: &Node) {
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

    fn take(&self, image: &Image, known: &mut Node) {
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

    fn put_errors(&self, image: &mut Image, errors: &Errors) {
        for (voter, squares) in errors.squares.iter().enumerate() {
            let kept = squares.len().min(self.errors);
            let mut sum = 0.0;
            for (nth, &(arrived, square)) in squares[squares.len() - kept..].iter().enumerate() {
                image.ints[self.error_times + voter * self.errors + nth] = arrived;
                image.reals[self.squares + voter * self.errors + nth] = square;
                sum += square;
            }
            image.ints[self.rings + 2 * voter + 1] = kept as i64;
            image.reals[self.sums + voter] = sum;
            if kept > 0 {
                image.reals[self.sums + self.judged + voter] = sum / kept as f64;
            }
        }
    }

    fn take_errors(&self, image: &Image, errors: &mut Errors) {
        for (voter, squares) in errors.squares.iter_mut().enumerate() {
            let from = image.ints[self.rings + 2 * voter] as usize;
            let count = image.ints[self.rings + 2 * voter + 1] as usize;
            let error = |nth: usize| {
                let place = voter * self.errors + (from + nth) % self.errors;
                let arrived = image.ints[self.error_times + place];
                (arrived, image.reals[self.squares + place])
            };
            *squares = (0..count).map(error).collect();
        }
    }
}

/// Puts what a node knows into the arrays.
pub(super) fn put(
    image: &mut Image,
    form: &Form,
    node: &Record,
    known: &Node,
) -> Result<(), CarryError> {
    let (ints, reals) = places(node);
    let ballot = (node.kind == "vote").then(|| Ballot::new(form, node));
    if let Some(ballot) = &ballot {
        ballot.begin(image);
        ballot.put(image, known);
    }
    let Some(own) = &known.own else {
        return Ok(());
    };
    match node.kind {
        "slope" => image.put_slope(node, &read::<Slope>(node, own)?.kernel),
        "lag" => {
            let first = node.place_of("first_history");
            let state: Lag = read(node, own)?;
            for (past, to) in state.channels.iter().zip(&form.histories[first..]) {
                image.put_history(to, past);
            }
        }
        "first_order" => {
            let state: FirstOrder = read(node, own)?;
            let count = state.last.len();
            for (nth, last) in state.last.iter().enumerate() {
                image.ints[ints + nth] = i64::from(last.is_some());
                let (at, before) = last.unwrap_or((0, 0.0));
                image.ints[ints + count + nth] = at;
                image.reals[reals + nth] = before;
            }
            image.reals[reals + count..][..state.values.len()].copy_from_slice(&state.values);
        }
        "vote" => {
            if let Some(ballot) = &ballot {
                match node.int_of("rule") {
                    STATE_GATE => {
                        let state: Gate = read(node, own)?;
                        image.ints[ints + 4] = state.followed.map_or(-1, |of| of as i64);
                        if let Some((other, since)) = state.other {
                            image.ints[ints + 5] = other as i64;
                            image.ints[ints + 6] = since;
                        }
                    }
                    _ => ballot.put_errors(image, &read::<Errors>(node, own)?),
                }
            }
        }
        "compensate" => {
            let state: Compensate = read(node, own)?;
            image.put_time(ints, state.last);
            for (nth, axis) in state.axes.iter().enumerate() {
                image.ints[ints + 2 + 2 * nth] = i64::from(axis.rate.is_some());
                image.ints[ints + 3 + 2 * nth] = i64::from(axis.stopped);
                let numbers = [axis.target, axis.given, axis.rate.unwrap_or(0.0)];
                image.reals[reals + 3 * nth..][..3].copy_from_slice(&numbers);
            }
        }
        "stability" => {
            let state: Stability = read(node, own)?;
            for (nth, axis) in state.axes.iter().enumerate() {
                let (other, since) = axis.other.map_or((-1, 0), |(of, at)| (i64::from(of), at));
                let known = axis.state.map_or(-1, i64::from);
                image.ints[ints + 3 * nth..][..3].copy_from_slice(&[known, other, since]);
            }
        }
        "safe_state" => {
            let state: SafeState = read(node, own)?;
            image.put_time(ints, state.last);
            for (nth, safe) in state.channels.iter().enumerate() {
                let known = [safe.doubtful.into(), safe.away.into(), safe.begun.into()];
                image.ints[ints + 2 + 3 * nth..][..3].copy_from_slice(&known);
                image.reals[reals + nth] = safe.given;
            }
        }
        "uncorrected" => {
            let state: Uncorrected = read(node, own)?;
            for (nth, &seen) in state.seen.iter().enumerate() {
                image.ints[ints + nth] = i64::from(seen);
            }
        }
        "settled" => {
            let state: Settled = read(node, own)?;
            image.ints[ints] = i64::from(state.stood.is_some());
            image.put_time(ints + 1, state.changed);
            image.ints[ints + 3] = i64::from(state.waiting);
            image.put_time(ints + 4, state.low_since);
            image.put_time(ints + 6, state.newest);
            image.reals[reals] = state.stood.unwrap_or(0.0);
        }
        _ => {}
    }
    Ok(())
}

/// Takes what a node knows from the arrays.
pub(super) fn take(
    image: &Image,
    form: &Form,
    node: &Record,
    known: &mut Node,
) -> Result<(), CarryError> {
    let (ints, reals) = places(node);
    let ballot = (node.kind == "vote").then(|| Ballot::new(form, node));
    if let Some(ballot) = &ballot {
        ballot.take(image, known);
    }
    let Some(own) = &known.own else {
        return Ok(());
    };
    known.own = match node.kind {
        "slope" => {
            let mut state: Slope = read(node, own)?;
            image.take_slope(form, node, &mut state.kernel)?;
            written(node, &state)?
        }
        "lag" => {
            let mut state: Lag = read(node, own)?;
            let first = node.place_of("first_history");
            for (past, from) in state.channels.iter_mut().zip(&form.histories[first..]) {
                past.entries = image.history(from);
            }
            written(node, &state)?
        }
        "first_order" => {
            let mut state: FirstOrder = read(node, own)?;
            let count = state.last.len();
            let last = |nth: usize| {
                let at = image.ints[ints + count + nth];
                (image.ints[ints + nth] != 0).then(|| (at, image.reals[reals + nth]))
            };
            state.last = (0..count).map(last).collect();
            let width = state.values.len();
            state.values = image.reals[reals + count..][..width].to_vec();
            written(node, &state)?
        }
        "vote" if node.int_of("rule") == STATE_GATE => {
            let mut state: Gate = read(node, own)?;
            state.followed = u64::try_from(image.ints[ints + 4]).ok();
            let other = u64::try_from(image.ints[ints + 5]).ok();
            state.other = other.map(|other| (other, image.ints[ints + 6]));
            written(node, &state)?
        }
        "vote" => {
            let mut state: Errors = read(node, own)?;
            if let Some(ballot) = &ballot {
                ballot.take_errors(image, &mut state);
            }
            written(node, &state)?
        }
        "compensate" => {
            let mut state: Compensate = read(node, own)?;
            state.last = image.time(ints);
            for (nth, axis) in state.axes.iter_mut().enumerate() {
                let numbers = &image.reals[reals + 3 * nth..][..3];
                (axis.target, axis.given) = (numbers[0], numbers[1]);
                axis.rate = (image.ints[ints + 2 + 2 * nth] != 0).then(|| numbers[2]);
                axis.stopped = image.ints[ints + 3 + 2 * nth] != 0;
            }
            written(node, &state)?
        }
        "stability" => {
            let mut state: Stability = read(node, own)?;
            for (nth, axis) in state.axes.iter_mut().enumerate() {
                let known = &image.ints[ints + 3 * nth..][..3];
                axis.state = u8::try_from(known[0]).ok();
                axis.other = u8::try_from(known[1]).ok().map(|other| (other, known[2]));
            }
            written(node, &state)?
        }
        "safe_state" => {
            let mut state: SafeState = read(node, own)?;
            state.last = image.time(ints);
            for (nth, safe) in state.channels.iter_mut().enumerate() {
                let known = &image.ints[ints + 2 + 3 * nth..][..3];
                safe.doubtful = u32::try_from(known[0]).unwrap_or(u32::MAX);
                (safe.away, safe.begun) = (known[1] != 0, known[2] != 0);
                safe.given = image.reals[reals + nth];
            }
            written(node, &state)?
        }
        "uncorrected" => {
            let mut state: Uncorrected = read(node, own)?;
            for (nth, seen) in state.seen.iter_mut().enumerate() {
                *seen = image.ints[ints + nth] != 0;
            }
            written(node, &state)?
        }
        "settled" => {
            let mut state: Settled = read(node, own)?;
            state.stood = (image.ints[ints] != 0).then(|| image.reals[reals]);
            state.changed = image.time(ints + 1);
            state.waiting = image.ints[ints + 3] != 0;
            state.low_since = image.time(ints + 4);
            state.newest = image.time(ints + 6);
            written(node, &state)?
        }
        _ => return Ok(()),
    };
    Ok(())
}
