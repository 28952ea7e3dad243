//! The rows that some window still holds, and how long each channel has been there, silent or awaited.
//! It does not decide which rows a window holds, nor when there is a value.

use std::array::from_fn;

use super::lanes::{LANES, Lanes, group_count, lengthen};

/// Rows in a ring, counted from the last reset.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    channels: usize,
    time: Vec<i64>,
    /// Row by row one of each channel, and behind the last row as many numbers as a group has channels.
    samples: Vec<f64>,
    /// Nanoseconds from each row to the channel's next sample, 0 where it has one, infinite where none has come yet. Has room from the first
    /// gap on, as samples have.
    wait: Vec<f64>,
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

/// Rows that there is room for from the beginning, and more of which there becomes room at least.
const PIECE: usize = 16;

impl Rows {
    pub(super) fn new(channels: usize, wide_ns: i64) -> Rows {
        let mut rows = Rows {
            channels,
            time: vec![0; PIECE],
            samples: vec![0.0; PIECE * channels + LANES],
            wait: Vec::new(),
            base: 0,
            next: 0,
            last: None,
            complete_from: 0,
            wide_ns,
            even_from: 0,
            silent: vec![[0.0; LANES]; group_count(channels)],
            first: vec![None; channels],
            latest_first: None,
        };
        rows.reset();
        rows
    }

    pub(super) fn reset(&mut self) {
        (self.base, self.next) = (0, 0);
        self.last = None;
        self.complete_from = 0;
        self.even_from = 0;
        self.silent.as_flattened_mut()[..self.channels].fill(f64::INFINITY);
        self.first.fill(None);
        self.latest_first = None;
    }

    /// The number that the next row will have.
    #[inline]
    pub(super) fn next(&self) -> u64 {
        self.next
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

    /// Where the numbers of a row are.
    #[inline]
    fn place(&self, row: u64) -> usize {
        self.slot(row) * self.channels
    }

    /// The samples of a row, NaN where absent.
    #[inline]
    pub(super) fn samples(&self, row: u64) -> &[f64] {
        &self.samples[self.place(row)..][..self.channels]
    }

    /// Those of one group.
    #[inline(always)]
    pub(super) fn sample(&self, row: u64, group: usize) -> Lanes {
        self.lanes(&self.samples, row, group)
    }

    /// The same, with how long after an instant the row is.
    #[inline(always)]
    pub(super) fn timed(&self, row: u64, group: usize, origin: i64) -> (f64, Lanes) {
        let t = self.time(row).wrapping_sub(origin) as f64;
        (t, self.sample(row, group))
    }

    /// What a list has of a row for the channels of a group; 0 for those with which it is filled up.
    #[inline(always)]
    fn lanes(&self, list: &[f64], row: u64, group: usize) -> Lanes {
        let first = group * LANES;
        let Some(lanes) = list[self.place(row) + first..].first_chunk() else {
            return [0.0; LANES];
        };
        let channels = self.channels - first;
        if channels >= LANES {
            return *lanes;
        }
        from_fn(|i| if i < channels { lanes[i] } else { 0.0 })
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
    pub(super) fn wait(&self, row: u64, group: usize) -> Lanes {
        if self.wait.is_empty() {
            return [0.0; LANES];
        }
        self.lanes(&self.wait, row, group)
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

    /// By a part, and at least a piece: windows hold about as many rows at all times.
    fn grow(&mut self, oldest: u64) {
        let first = self.slot(oldest);
        let slots = self.time.len() + (self.time.len() / 64).max(PIECE);
        let (len, numbers) = (self.samples.len() - LANES, slots * self.channels + LANES);
        self.time.rotate_left(first);
        lengthen(&mut self.time, slots, 0);
        for list in [&mut self.samples, &mut self.wait] {
            if !list.is_empty() {
                list[..len].rotate_left(first * self.channels);
                lengthen(list, numbers, 0.0);
            }
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
        let places = slot * self.channels..(slot + 1) * self.channels;
        let row = &mut self.samples[places.clone()];
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
            self.wait[places].fill(0.0);
        } else if absent {
            lengthen(&mut self.wait, self.samples.len(), 0.0);
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
        let place = self.place(self.next);
        let row = &self.samples[place..][..self.channels];
        let silent = self.silent.as_flattened_mut().iter_mut();
        for (silent, y) in silent.zip(row) {
            *silent = if y.is_nan() { *silent + passed } else { 0.0 };
        }
    }

    /// Marks where the new row's channels are awaited and ends the wait of those that have come back; says whether one has begun.
    fn follow_absence(&mut self, oldest: u64) -> bool {
        let mut begun = false;
        let (place, t_ns) = (self.place(self.next), self.time(self.next));
        for channel in 0..self.channels {
            if self.samples[place + channel].is_nan() {
                self.wait[place + channel] = f64::INFINITY;
                continue;
            }
            if self.first[channel].is_none() {
                self.first[channel] = Some(t_ns);
                begun = true;
            }
            for row in (oldest..self.next).rev() {
                let (earlier, t) = (self.place(row) + channel, self.time(row));
                let Some(wait) = self.wait.get_mut(earlier) else {
                    break;
                };
                if *wait != f64::INFINITY {
                    break;
                }
                *wait = t_ns.saturating_sub(t) as f64;
            }
        }
        if begun {
            self.latest_first = Some(t_ns);
        }
        begun
    }
}
