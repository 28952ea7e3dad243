//! The rows that some window still holds, and how long each channel has been there, silent or awaited.
//! It does not decide which rows a window holds, nor when there is a value.

use std::array::from_fn;

use super::sums::{Quad, quads};

/// Rows in a ring whose length is a power of two, counted from the last reset.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    channels: usize,
    quads: usize,
    time: Vec<i64>,
    samples: Vec<Quad>,
    /// Nanoseconds from each row to the channel's next sample, 0 where it has one, infinite where none has come yet.
    wait: Vec<Quad>,
    next: u64,
    /// The first row after the last one from which a sample is missing.
    complete_from: u64,
    /// Nanoseconds since each channel's newest sample, infinite before its first.
    silent: Vec<Quad>,
    /// Nanoseconds since each channel's first sample, negative infinite before it.
    open: Vec<Quad>,
    least_open: f64,
}

const INITIAL_CAPACITY: usize = 64;

impl Rows {
    pub(super) fn new(channels: usize) -> Rows {
        let quads = quads(channels);
        Rows {
            channels,
            quads,
            time: vec![0; INITIAL_CAPACITY],
            samples: vec![[0.0; 4]; INITIAL_CAPACITY * quads],
            wait: vec![[0.0; 4]; INITIAL_CAPACITY * quads],
            next: 0,
            complete_from: 0,
            silent: vec![[f64::INFINITY; 4]; quads],
            open: vec![[f64::NEG_INFINITY; 4]; quads],
            least_open: f64::NEG_INFINITY,
        }
    }

    pub(super) fn reset(&mut self) {
        self.next = 0;
        self.complete_from = 0;
        self.silent.fill([f64::INFINITY; 4]);
        self.open.fill([f64::NEG_INFINITY; 4]);
        self.least_open = f64::NEG_INFINITY;
    }

    /// The number that the next row will have.
    #[inline]
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    pub(super) fn capacity(&self) -> usize {
        self.time.len()
    }

    #[inline]
    pub(super) fn slot(&self, row: u64) -> usize {
        row as usize & (self.time.len() - 1)
    }

    #[inline]
    pub(super) fn time(&self, row: u64) -> i64 {
        self.time[self.slot(row)]
    }

    pub(super) fn last_time(&self) -> Option<i64> {
        (self.next > 0).then(|| self.time(self.next - 1))
    }

    /// The samples of a row in groups of four channels, NaN where absent.
    #[inline]
    pub(super) fn samples(&self, row: u64) -> &[Quad] {
        let slot = self.slot(row);
        &self.samples[slot * self.quads..(slot + 1) * self.quads]
    }

    /// The first row after the last one from which a sample is missing.
    #[inline]
    pub(super) fn complete_from(&self) -> u64 {
        self.complete_from
    }

    /// Nanoseconds from a row to the next sample of each channel.
    #[inline]
    pub(super) fn wait(&self, row: u64) -> &[Quad] {
        let slot = self.slot(row);
        &self.wait[slot * self.quads..(slot + 1) * self.quads]
    }

    /// Nanoseconds since each channel's newest sample.
    pub(super) fn silent(&self) -> &[Quad] {
        &self.silent
    }

    /// Nanoseconds since each channel's first sample.
    pub(super) fn open(&self) -> &[Quad] {
        &self.open
    }

    /// Nanoseconds since the latest of the channels' first samples.
    pub(super) fn least_open(&self) -> f64 {
        self.least_open
    }

    /// Times of a channel's first and newest sample.
    pub(super) fn first_and_newest(&self, channel: usize) -> [Option<i64>; 2] {
        let ago = |ns: &[Quad]| {
            let ns = *ns.as_flattened()[..self.channels].get(channel)?;
            let last = self.last_time()?;
            ns.is_finite().then(|| last.saturating_sub(ns as i64))
        };
        [ago(&self.open), ago(&self.silent)]
    }

    /// Sets what [`first_and_newest`](Self::first_and_newest) answers, after the rows have been appended.
    pub(super) fn set_first_and_newest(&mut self, channel: usize, times: [Option<i64>; 2]) {
        let last = self.last_time();
        let ago = |t: Option<i64>| Some(last?.saturating_sub(t?) as f64);
        let [first, newest] = times.map(ago);
        self.open.as_flattened_mut()[channel] = first.unwrap_or(f64::NEG_INFINITY);
        self.silent.as_flattened_mut()[channel] = newest.unwrap_or(f64::INFINITY);
        let open = self.open.as_flattened()[..self.channels].iter().copied();
        let begun = open.filter(|open| *open >= 0.0);
        self.least_open = begun.fold(f64::INFINITY, f64::min);
    }

    /// Makes room for one more row if all from `oldest` on are kept; says whether rows have changed their slots.
    pub(super) fn reserve(&mut self, oldest: u64) -> bool {
        if self.next - oldest < self.time.len() as u64 {
            return false;
        }
        self.grow(oldest);
        true
    }

    /// Makes room for twice the rows that there are, so that whoever appends to restored rows need not.
    pub(super) fn make_room(&mut self) {
        while (self.time.len() as u64) < 2 * self.next {
            self.grow(0);
        }
    }

    fn grow(&mut self, oldest: u64) {
        let old = self.time.len();
        let width = self.quads;
        self.time.resize(2 * old, 0);
        self.samples.resize(2 * old * width, [0.0; 4]);
        self.wait.resize(2 * old * width, [0.0; 4]);
        for row in oldest..self.next {
            let (from, to) = (row as usize & (old - 1), self.slot(row));
            self.time[to] = self.time[from];
            let groups = from * width..(from + 1) * width;
            self.samples.copy_within(groups.clone(), to * width);
            self.wait.copy_within(groups, to * width);
        }
    }

    /// Appends a row where room has been made; `y` is one sample per channel, absent where it ends early or is `limit` or more.
    /// Says whether some channel has its first sample.
    pub(super) fn append(&mut self, t_ns: i64, y: &[f64], limit: f64, oldest: u64) -> bool {
        let passed = self.last_time().map_or(0, |last| t_ns.saturating_sub(last)) as f64;
        let slot = self.slot(self.next);
        self.time[slot] = t_ns;
        let groups = slot * self.quads..(slot + 1) * self.quads;
        let row = &mut self.samples[groups.clone()];
        let (there, missing) =
            row.as_flattened_mut()[..self.channels].split_at_mut(y.len().min(self.channels));
        for (kept, &y) in there.iter_mut().zip(y) {
            *kept = if y.abs() < limit { y } else { f64::NAN };
        }
        missing.fill(f64::NAN);
        let mut absent = false;
        for (quad, y) in row.iter().enumerate() {
            let (silent, open) = (&mut self.silent[quad], &mut self.open[quad]);
            *open = from_fn(|i| open[i] + passed);
            *silent = from_fn(|i| {
                if y[i].is_nan() {
                    silent[i] + passed
                } else {
                    0.0
                }
            });
            absent |= y[0].is_nan() | y[1].is_nan() | y[2].is_nan() | y[3].is_nan();
        }
        self.least_open += passed;
        self.wait[groups].fill([0.0; 4]);
        let follow = absent || self.complete_from == self.next;
        let begun = follow && self.follow_absence(oldest);
        self.next += 1;
        if absent {
            self.complete_from = self.next;
        }
        begun
    }

    /// Marks where the new row's channels are awaited and ends the wait of those that have come back; says whether one has begun.
    fn follow_absence(&mut self, oldest: u64) -> bool {
        let mut begun = false;
        let width = 4 * self.quads;
        let (slot, t_ns) = (self.slot(self.next), self.time(self.next));
        let mask = self.time.len() - 1;
        let wait = self.wait.as_flattened_mut();
        for channel in 0..self.channels {
            let place = slot * width + channel;
            if self.samples.as_flattened()[place].is_nan() {
                wait[place] = f64::INFINITY;
                continue;
            }
            let open = &mut self.open.as_flattened_mut()[channel];
            if *open == f64::NEG_INFINITY {
                *open = 0.0;
                begun = true;
            }
            for row in (oldest..self.next).rev() {
                let earlier = row as usize & mask;
                let wait = &mut wait[earlier * width + channel];
                if *wait != f64::INFINITY {
                    break;
                }
                *wait = t_ns.saturating_sub(self.time[earlier]) as f64;
            }
        }
        if begun {
            self.least_open = 0.0;
        }
        begun
    }
}
