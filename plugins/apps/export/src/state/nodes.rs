//! What each kind of node knows, between its form in a snapshot and its place in the arrays of the runtime.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::CarryError;
use super::image::Image;
use super::learners::Pupil;
use super::snapshot::{Node, Past};
use super::votes::Ballot;
use crate::form::{Form, Record};

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

#[derive(Serialize, Deserialize)]
struct Health {
    state: String,
    sensors: Vec<Watched>,
}

#[derive(Serialize, Deserialize)]
struct Watched {
    heard: Option<i64>,
    newest: Option<(i64, f64)>,
    same_since: Option<i64>,
    begun: Option<i64>,
    fault: u8,
    in_order_since: Option<i64>,
    squares: Vec<f64>,
    next: usize,
    full: bool,
}

#[derive(Serialize, Deserialize)]
struct CrossCheck {
    state: String,
    sensors: Vec<Sensor>,
    verdict: Verdict,
}

#[derive(Serialize, Deserialize)]
struct Verdict {
    of: Option<usize>,
    last: Option<i64>,
    windows: u32,
    with: f64,
    without: f64,
}

#[derive(Serialize, Deserialize)]
struct Sensor {
    last: Option<i64>,
    value: f64,
    change: f64,
    sudden: f64,
    since: Option<i64>,
    out: Option<i64>,
    passes: bool,
    agrees_since: Option<i64>,
}

pub(super) fn read<T: DeserializeOwned>(node: &Record, own: &[u8]) -> Result<T, CarryError> {
    rmp_serde::from_slice(own).map_err(|error| CarryError::of(&node.node, error))
}

pub(super) fn written<T: Serialize>(
    node: &Record,
    state: &T,
) -> Result<Option<Vec<u8>>, CarryError> {
    let bytes = rmp_serde::to_vec_named(state);
    bytes
        .map(Some)
        .map_err(|error| CarryError::of(&node.node, error))
}

/// Where the integers and numbers of a node lie.
pub(super) fn places(node: &Record) -> (usize, usize) {
    (node.place_of("ints"), node.place_of("reals"))
}

impl Image {
    pub(super) fn put_time(&mut self, place: usize, time: Option<i64>) {
        self.ints[place] = i64::from(time.is_some());
        self.ints[place + 1] = time.unwrap_or(0);
    }

    pub(super) fn time(&self, place: usize) -> Option<i64> {
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
    if let Some(pupil) = Pupil::new(node) {
        pupil.begin(image);
        return pupil.put(image, form, known);
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
                ballot.put_own(image, node, own)?;
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
        "cross_check" => {
            let state: CrossCheck = read(node, own)?;
            for (nth, sensor) in state.sensors.iter().enumerate() {
                let place = ints + 10 * nth;
                let times = [sensor.last, sensor.since, sensor.out, sensor.agrees_since];
                for (nth, time) in times.into_iter().enumerate() {
                    image.put_time(place + 2 * nth, time);
                }
                image.ints[place + 8] = i64::from(sensor.passes);
                image.ints[place + 9] = 0;
                let read = [sensor.value, sensor.change, sensor.sudden];
                image.reals[reals + 3 * nth..][..3].copy_from_slice(&read);
            }
            let (own, count) = (&state.verdict, state.sensors.len());
            image.put_time(ints + 10 * count, own.last);
            image.ints[ints + 10 * count + 2] = own.windows.into();
            image.ints[ints + 10 * count + 3] = own.of.map_or(-1, |of| of as i64);
            image.reals[reals + 3 * count..][..2].copy_from_slice(&[own.with, own.without]);
        }
        "health" => {
            let state: Health = read(node, own)?;
            for (nth, sensor) in state.sensors.iter().enumerate() {
                let kept = sensor.squares.len();
                let (place, number) = (ints + 13 * nth, reals + (1 + 2 * kept) * nth);
                let newest = sensor.newest.map(|(at, _)| at);
                let times = [sensor.heard, newest, sensor.same_since, sensor.begun];
                for (nth, time) in times.into_iter().chain([sensor.in_order_since]).enumerate() {
                    image.put_time(place + 2 * nth, time);
                }
                let rest = [sensor.fault.into(), sensor.next as i64, sensor.full.into()];
                image.ints[place + 10..][..3].copy_from_slice(&rest);
                image.reals[number] = sensor.newest.map_or(0.0, |(_, value)| value);
                image.reals[number + 1..][..kept].copy_from_slice(&sensor.squares);
                // Sums stand before what they are of, as a tree.
                let part = |image: &Image, at: usize| match at < kept {
                    true => image.reals[number + 1 + kept + at],
                    false => image.reals[number + 1 + at - kept],
                };
                for at in (1..kept).rev() {
                    let sum = part(image, 2 * at) + part(image, 2 * at + 1);
                    image.reals[number + 1 + kept + at] = sum;
                }
            }
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
    if let Some(pupil) = Pupil::new(node) {
        return pupil.take(image, known);
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
        "vote" => match &ballot {
            Some(ballot) => ballot.take_own(image, node, own)?,
            None => return Ok(()),
        },
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
        "cross_check" => {
            let mut state: CrossCheck = read(node, own)?;
            for (nth, sensor) in state.sensors.iter_mut().enumerate() {
                let (place, number) = (ints + 10 * nth, reals + 3 * nth);
                sensor.last = image.time(place);
                sensor.since = image.time(place + 2);
                sensor.out = image.time(place + 4);
                sensor.agrees_since = image.time(place + 6);
                sensor.passes = image.ints[place + 8] != 0;
                sensor.value = image.reals[number];
                sensor.change = image.reals[number + 1];
                sensor.sudden = image.reals[number + 2];
            }
            let count = state.sensors.len();
            state.verdict = Verdict {
                of: usize::try_from(image.ints[ints + 10 * count + 3]).ok(),
                last: image.time(ints + 10 * count),
                windows: u32::try_from(image.ints[ints + 10 * count + 2]).unwrap_or(u32::MAX),
                with: image.reals[reals + 3 * count],
                without: image.reals[reals + 3 * count + 1],
            };
            written(node, &state)?
        }
        "health" => {
            let mut state: Health = read(node, own)?;
            for (nth, sensor) in state.sensors.iter_mut().enumerate() {
                let kept = sensor.squares.len();
                let (place, number) = (ints + 13 * nth, reals + (1 + 2 * kept) * nth);
                let time = |nth: usize| image.time(place + 2 * nth);
                (sensor.heard, sensor.same_since) = (time(0), time(2));
                (sensor.begun, sensor.in_order_since) = (time(3), time(4));
                sensor.newest = time(1).map(|at| (at, image.reals[number]));
                sensor.fault = u8::try_from(image.ints[place + 10]).unwrap_or(0);
                sensor.next = image.ints[place + 11] as usize;
                sensor.full = image.ints[place + 12] != 0;
                sensor.squares = image.reals[number + 1..][..kept].to_vec();
            }
            written(node, &state)?
        }
        _ => return Ok(()),
    };
    Ok(())
}
