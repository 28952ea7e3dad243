//! The rows that some window still holds, and how long each channel has been there, silent or awaited.
//! It does not decide which rows a window holds, nor when there is a value.

use super::lanes::{LANES, Lanes, group_count};

/// Rows in a ring whose length is a power of two, counted from the last reset.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    channels: usize,
    groups: usize,
    time: Vec<i64>,
    samples: Vec<Lanes>,
    /// Nanoseconds from each row to the channel's next sample, 0 where it has one, infinite where none has come yet.
    wait: Vec<Lanes>,
    next: u64,
    /// Time of the last row.
    last: Option<i64>,
    /// The first row after the last one from which a sample is missing.
    complete_from: u64,
    /// A longer time between rows is a wide gap, in nanoseconds; and the first row, or the one after the last wide gap.
    wide_ns: i64,
    even_from: u64,
    /// Nanoseconds since each channel's newest sample, infinite before its first.
    silent: Vec<Lanes>,
    /// Time of each channel's first sample, and the latest of them.
    first: Vec<Option<i64>>,
    latest_first: Option<i64>,
}

const INITIAL_CAPACITY: usize = 64;

impl Rows {
    pub(super) fn new(channels: usize, wide_ns: i64) -> Rows {
        let groups = group_count(channels);
        Rows {
            channels,
            groups,
            time: vec![0; INITIAL_CAPACITY],
            samples: vec![[0.0; LANES]; INITIAL_CAPACITY * groups],
            wait: vec![[0.0; LANES]; INITIAL_CAPACITY * groups],
            next: 0,
            last: None,
            complete_from: 0,
            wide_ns,
            even_from: 0,
            silent: vec![[f64::INFINITY; LANES]; groups],
            first: vec![None; channels],
            latest_first: None,
        }
    }

    pub(super) fn reset(&mut self) {
        self.next = 0;
        self.last = None;
        self.complete_from = 0;
        self.even_from = 0;
        self.silent.fill([f64::INFINITY; LANES]);
        self.first.fill(None);
        self.latest_first = None;
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

    #[inline]
    pub(super) fn last_time(&self) -> Option<i64> {
        self.last
    }

    /// The samples of a row by groups of channels, NaN where absent.
    #[inline]
    pub(super) fn samples(&self, row: u64) -> &[Lanes] {
        let slot = self.slot(row);
        &self.samples[slot * self.groups..(slot + 1) * self.groups]
    }

    /// Those of one group.
    #[inline]
    pub(super) fn sample(&self, row: u64, group: usize) -> &Lanes {
        &self.samples[self.slot(row) * self.groups + group]
    }

    /// The first row after the last one from which a sample is missing.
    #[inline]
    pub(super) fn complete_from(&self) -> u64 {
        self.complete_from
    }

    /// The first row, or the one after the last wide gap.
    #[inline]
    pub(super) fn even_from(&self) -> u64 {
        self.even_from
    }

    /// Nanoseconds from a row to the next sample of each channel of a group.
    #[inline]
    pub(super) fn wait(&self, row: u64, group: usize) -> &Lanes {
        &self.wait[self.slot(row) * self.groups + group]
    }

    /// Nanoseconds since each channel's newest sample.
    pub(super) fn silent(&self) -> &[Lanes] {
        &self.silent
    }

    /// Time of each channel's first sample.
    pub(super) fn first(&self) -> &[Option<i64>] {
        &self.first
    }

    /// The latest of the channels' first samples.
    pub(super) fn latest_first(&self) -> Option<i64> {
        self.latest_first
    }

    /// Time of a channel's newest sample.
    pub(super) fn newest(&self, channel: usize) -> Option<i64> {
        let silent = *self.silent.as_flattened()[..self.channels].get(channel)?;
        let last = self.last_time()?;
        silent
            .is_finite()
            .then(|| last.saturating_sub(silent as i64))
    }

    /// Sets what [`first`](Self::first) and [`newest`](Self::newest) answer, after the rows have been appended.
    pub(super) fn set_first_and_newest(&mut self, first: &[Option<i64>], newest: &[Option<i64>]) {
        self.first.copy_from_slice(first);
        self.latest_first = first.iter().copied().max().flatten();
        let last = self.last_time();
        for (silent, newest) in self.silent.as_flattened_mut().iter_mut().zip(newest) {
            let ago = last.zip(*newest).map(|(last, t)| last.saturating_sub(t));
            *silent = ago.map_or(f64::INFINITY, |ago| ago as f64);
        }
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
        let width = self.groups;
        self.time.resize(2 * old, 0);
        self.samples.resize(2 * old * width, [0.0; LANES]);
        self.wait.resize(2 * old * width, [0.0; LANES]);
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
    #[inline(always)]
    pub(super) fn append(&mut self, t_ns: i64, y: &[f64], limit: f64, oldest: u64) -> bool {
        let passed = self.last_time().map_or(0, |last| t_ns.saturating_sub(last));
        if passed > self.wide_ns {
            self.even_from = self.next;
        }
        let slot = self.slot(self.next);
        self.time[slot] = t_ns;
        let places = slot * self.groups..(slot + 1) * self.groups;
        let row = &mut self.samples[places.clone()];
        let row = &mut row.as_flattened_mut()[..self.channels];
        let y = &y[..y.len().min(self.channels)];
        let (there, missing) = row.split_at_mut(y.len());
        let mut absent = !missing.is_empty();
        let (wholes, rest) = there.as_chunks_mut::<LANES>();
        let (of_wholes, of_rest) = y.as_chunks::<LANES>();
        for (kept, y) in wholes.iter_mut().zip(of_wholes) {
            *kept = y.map(|y| if y.abs() < limit { y } else { f64::NAN });
            absent |= kept.iter().fold(false, |absent, y| absent | y.is_nan());
        }
        for (kept, &y) in rest.iter_mut().zip(of_rest) {
            *kept = if y.abs() < limit { y } else { f64::NAN };
            absent |= kept.is_nan();
        }
        missing.fill(f64::NAN);
        self.wait[places].fill([0.0; LANES]);
        // Where this row and the last are complete nobody is silent or awaited.
        let begun = (absent || self.complete_from == self.next) && {
            self.follow_silence(passed as f64);
            self.follow_absence(oldest)
        };
        self.next += 1;
        self.last = Some(t_ns);
        if absent {
            self.complete_from = self.next;
        }
        begun
    }

    /// Counts how long each channel has been silent at the new row.
    fn follow_silence(&mut self, passed: f64) {
        let slot = self.slot(self.next);
        let row = &self.samples[slot * self.groups..(slot + 1) * self.groups];
        let silent = self.silent.as_flattened_mut().iter_mut();
        for (silent, y) in silent.zip(row.as_flattened()) {
            *silent = if y.is_nan() { *silent + passed } else { 0.0 };
        }
    }

    /// Marks where the new row's channels are awaited and ends the wait of those that have come back; says whether one has begun.
    fn follow_absence(&mut self, oldest: u64) -> bool {
        let mut begun = false;
        let width = LANES * self.groups;
        let (slot, t_ns) = (self.slot(self.next), self.time(self.next));
        let mask = self.time.len() - 1;
        let wait = self.wait.as_flattened_mut();
        for (channel, first) in self.first.iter_mut().enumerate() {
            let place = slot * width + channel;
            if self.samples.as_flattened()[place].is_nan() {
                wait[place] = f64::INFINITY;
                continue;
            }
            if first.is_none() {
                *first = Some(t_ns);
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
            self.latest_first = Some(t_ns);
        }
        begun
    }
}
