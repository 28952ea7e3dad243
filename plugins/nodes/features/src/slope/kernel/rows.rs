//! The rows that some window still holds, and how long each channel has been there, silent or awaited.
//! It does not decide which rows a window holds, nor when there is a value.

use super::lanes::{LANES, Lanes, group_count};

/// Rows in a ring, counted from the last reset.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    channels: usize,
    groups: usize,
    time: Vec<i64>,
    samples: Vec<Lanes>,
    /// Nanoseconds from each row to the channel's next sample, 0 where it has one, infinite where none has come yet. Has room from the first
    /// gap on.
    wait: Vec<Lanes>,
    /// The row in slot 0, the first or the newest that was there, and the number of the next one.
    base: u64,
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

/// Rows that there is room for from the beginning, and pieces in which there becomes more of it.
const INITIAL_CAPACITY: usize = 64;
const PIECE: usize = 32;

/// Who has not waited.
const AT_ONCE: &Lanes = &[0.0; LANES];

impl Rows {
    pub(super) fn new(channels: usize, wide_ns: i64) -> Rows {
        let groups = group_count(channels);
        Rows {
            channels,
            groups,
            time: vec![0; INITIAL_CAPACITY],
            samples: vec![[0.0; LANES]; INITIAL_CAPACITY * groups],
            wait: Vec::new(),
            base: 0,
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
        (self.base, self.next) = (0, 0);
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
        let beyond = row.wrapping_sub(self.base);
        let behind = row
            .wrapping_add(self.time.len() as u64)
            .wrapping_sub(self.base);
        (if row >= self.base { beyond } else { behind }) as usize
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
        let place = self.slot(row) * self.groups + group;
        self.wait.get(place).unwrap_or(AT_ONCE)
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

    /// Makes room for a quarter more rows than there are, and some more, so that whoever appends to restored rows need not.
    pub(super) fn make_room(&mut self, more: u64) {
        while (self.time.len() as u64) < self.next + self.next / 4 + more {
            self.grow(0);
        }
    }

    /// By an eighth, and at least a piece: windows hold about as many rows at all times.
    fn grow(&mut self, oldest: u64) {
        let first = self.slot(oldest);
        let slots = self.time.len() + (self.time.len() / 8).next_multiple_of(PIECE);
        let places = slots * self.groups;
        self.time.rotate_left(first);
        self.time.resize(slots, 0);
        self.samples.rotate_left(first * self.groups);
        self.samples.resize(places, [0.0; LANES]);
        if !self.wait.is_empty() {
            self.wait.rotate_left(first * self.groups);
            self.wait.resize(places, [0.0; LANES]);
        }
        self.base = oldest;
    }

    /// Appends a row where room has been made; `y` is one sample per channel, absent where it ends early or is `limit` or more.
    /// Says whether some channel has its first sample.
    #[inline(always)]
    pub(super) fn append(&mut self, t_ns: i64, y: &[f64], limit: f64, oldest: u64) -> bool {
        let passed = self.last_time().map_or(0, |last| t_ns.saturating_sub(last));
        if passed > self.wide_ns {
            self.even_from = self.next;
        }
        if self.next - self.base == self.time.len() as u64 {
            self.base = self.next;
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
        if !self.wait.is_empty() {
            self.wait[places].fill([0.0; LANES]);
        } else if absent {
            self.wait.resize(self.samples.len(), [0.0; LANES]);
        }
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
        for channel in 0..self.channels {
            let place = slot * width + channel;
            if self.samples.as_flattened()[place].is_nan() {
                self.wait.as_flattened_mut()[place] = f64::INFINITY;
                continue;
            }
            if self.first[channel].is_none() {
                self.first[channel] = Some(t_ns);
                begun = true;
            }
            for row in (oldest..self.next).rev() {
                let earlier = self.slot(row);
                let Some(wait) = self
                    .wait
                    .as_flattened_mut()
                    .get_mut(earlier * width + channel)
                else {
                    break;
                };
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
