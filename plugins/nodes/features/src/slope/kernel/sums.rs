//! Sums over runs of rows, for all channels at once: how rows join a run and how runs are added up.
//! It does not decide which rows belong to a run.
//!
//! Times are nanoseconds after the run's origin, values lie about an origin that is the same for all runs. Nothing is
//! ever subtracted from a sum: a sample leaves by not being in the runs that remain.
//! While no sample is missing, count and times are the same for all channels: sums of them per channel have room from the first gap on.

use std::array::from_fn;
use std::ops::Range;

use super::lanes::{LANES, Lanes, group_count, lengthen};
use super::rows::Rows;

/// Sums of `L` channels that concern the times of their samples: Σ1, Σt, Σt².
#[derive(Clone, Copy, Debug)]
pub(super) struct Times<const L: usize> {
    pub(super) n: [f64; L],
    pub(super) t: [f64; L],
    pub(super) tt: [f64; L],
}

impl Times<LANES> {
    /// Of one row, at `t` after the origin.
    #[inline(always)]
    fn of(t: f64, y: &Lanes) -> Times<LANES> {
        let present = |sum: f64| y.map(|y| if y.is_nan() { 0.0 } else { sum });
        Times {
            n: present(1.0),
            t: present(t),
            tt: present(t * t),
        }
    }
}

impl Times<1> {
    /// The same sums for several channels.
    #[inline(always)]
    pub(super) fn repeated<const L: usize>(&self) -> Times<L> {
        Times {
            n: [self.n[0]; L],
            t: [self.t[0]; L],
            tt: [self.tt[0]; L],
        }
    }
}

impl<const L: usize> Times<L> {
    pub(super) const NONE: Times<L> = Times {
        n: [0.0; L],
        t: [0.0; L],
        tt: [0.0; L],
    };

    #[inline(always)]
    pub(super) fn plus(&self, other: &Times<L>) -> Times<L> {
        Times {
            n: from_fn(|i| self.n[i] + other.n[i]),
            t: from_fn(|i| self.t[i] + other.t[i]),
            tt: from_fn(|i| self.tt[i] + other.tt[i]),
        }
    }

    /// The same sums about an origin that lies `by` earlier.
    #[inline(always)]
    pub(super) fn shifted(&self, by: &[f64; L]) -> Times<L> {
        Times {
            n: self.n,
            t: from_fn(|i| self.t[i] + by[i] * self.n[i]),
            tt: from_fn(|i| self.tt[i] + by[i] * (2.0 * self.t[i] + by[i] * self.n[i])),
        }
    }

    /// Sets those of one channel.
    #[inline(always)]
    pub(super) fn set(&mut self, i: usize, one: &Times<1>) {
        (self.n[i], self.t[i], self.tt[i]) = (one.n[0], one.t[0], one.tt[0]);
    }

    /// Those of one channel.
    #[inline(always)]
    pub(super) fn only(&self, i: usize) -> Times<1> {
        Times {
            n: [self.n[i]],
            t: [self.t[i]],
            tt: [self.tt[i]],
        }
    }
}

/// Those of a group. They fill lines of the cache.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct TimesOfLanes(pub(super) Times<LANES>);

/// Sums of a group that concern the values of its channels: Σy, Σty. They fill lines of the cache.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Values {
    pub(super) y: Lanes,
    pub(super) ty: Lanes,
}

impl Values {
    const NONE: Values = Values {
        y: [0.0; LANES],
        ty: [0.0; LANES],
    };

    /// Of one row, at `t` after the origin of time.
    #[inline(always)]
    fn of(t: f64, y: &Lanes, origin: &Lanes) -> Values {
        let y = about(y, origin);
        Values {
            y,
            ty: y.map(|y| t * y),
        }
    }

    #[inline(always)]
    pub(super) fn plus(&self, other: &Values) -> Values {
        Values {
            y: from_fn(|i| self.y[i] + other.y[i]),
            ty: from_fn(|i| self.ty[i] + other.ty[i]),
        }
    }

    #[inline(always)]
    pub(super) fn shifted(&self, by: f64) -> Values {
        Values {
            y: self.y,
            ty: from_fn(|i| self.ty[i] + by * self.y[i]),
        }
    }
}

/// What all channels of a run have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Common {
    pub(super) origin: i64,
    /// Sums of the rows' times, present or not.
    pub(super) rows: Times<1>,
}

impl Common {
    const NONE: Common = Common {
        origin: 0,
        rows: Times::NONE,
    };

    /// Adds a row, and says how long after the origin it is.
    #[inline(always)]
    fn add_time(&mut self, t_ns: i64) -> f64 {
        // Rows too far apart for a difference are in no window together, and sums over them are of no use.
        let t = t_ns.wrapping_sub(self.origin) as f64;
        self.rows = self.rows.plus(&Times {
            n: [1.0],
            t: [t],
            tt: [t * t],
        });
        t
    }
}

/// Runs by slot number.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) common: Vec<Common>,
    /// By group of channels.
    pub(super) groups: Vec<Group>,
}

/// The runs of a group of channels.
#[derive(Clone, Debug)]
pub(super) struct Group {
    keeps_squares: bool,
    /// Whether the sums of time per channel are kept.
    keeps_times: bool,
    pub(super) values: Vec<Values>,
    pub(super) times: Vec<TimesOfLanes>,
    /// Σy².
    pub(super) squares: Vec<Lanes>,
}

impl Table {
    pub(super) fn new(channels: usize, squares: bool, slots: usize) -> Table {
        let group = Group {
            keeps_squares: squares,
            keeps_times: false,
            values: Vec::new(),
            times: Vec::new(),
            squares: Vec::new(),
        };
        let mut table = Table {
            common: Vec::new(),
            groups: vec![group; group_count(channels)],
        };
        table.resize(slots);
        table
    }

    pub(super) fn slots(&self) -> usize {
        self.common.len()
    }

    /// From now on sums of time are kept per channel or not; runs must be computed anew when this is switched on.
    pub(super) fn keep_times(&mut self, keep: bool) {
        let slots = self.slots();
        for group in &mut self.groups {
            group.keeps_times = keep;
            if keep {
                lengthen(&mut group.times, slots, TimesOfLanes(Times::NONE));
            }
        }
    }

    /// Changes the number of slots; the runs must be computed anew.
    pub(super) fn resize(&mut self, slots: usize) {
        lengthen(&mut self.common, slots, Common::NONE);
        for group in &mut self.groups {
            lengthen(&mut group.values, slots, Values::NONE);
            // Once there was a gap, a later one must not have to make room.
            if group.keeps_times || !group.times.is_empty() {
                lengthen(&mut group.times, slots, TimesOfLanes(Times::NONE));
            }
            if group.keeps_squares {
                lengthen(&mut group.squares, slots, [0.0; LANES]);
            }
        }
    }

    /// Forgets the first runs.
    pub(super) fn forget(&mut self, first: usize) {
        let first = first.min(self.slots());
        self.common.copy_within(first.., 0);
        for group in &mut self.groups {
            group.values.copy_within(first.., 0);
            if group.keeps_times {
                group.times.copy_within(first.., 0);
            }
            if group.keeps_squares {
                group.squares.copy_within(first.., 0);
            }
        }
    }

    /// Makes an empty run about an origin.
    pub(super) fn clear(&mut self, slot: usize, origin: i64) {
        self.common[slot] = Common {
            origin,
            ..Common::NONE
        };
        for group in &mut self.groups {
            group.values[slot] = Values::NONE;
            if group.keeps_times {
                group.times[slot] = TimesOfLanes(Times::NONE);
            }
            if group.keeps_squares {
                group.squares[slot] = [0.0; LANES];
            }
        }
    }

    /// Adds rows to a run, the last one first: their times, and their samples less the origins of the channels.
    #[inline(always)]
    pub(super) fn add(&mut self, slot: usize, rows: &Rows, numbers: Range<u64>, origins: &[Lanes]) {
        let common = &mut self.common[slot];
        for row in numbers.clone().rev() {
            common.add_time(rows.time(row));
        }
        let origin = common.origin;
        for (index, (group, about)) in self.groups.iter_mut().zip(origins).enumerate() {
            let mut values = group.values[slot];
            for row in numbers.clone().rev() {
                let (t, y) = rows.timed(row, index, origin);
                values = values.plus(&Values::of(t, &y, about));
            }
            group.values[slot] = values;
            if group.keeps_squares {
                let mut sum = group.squares[slot];
                for row in numbers.clone().rev() {
                    let squares = squares(&rows.sample(row, index), about);
                    sum = from_fn(|i| sum[i] + squares[i]);
                }
                group.squares[slot] = sum;
            }
            if group.keeps_times {
                let mut times = group.times[slot].0;
                for row in numbers.clone().rev() {
                    let (t, y) = rows.timed(row, index, origin);
                    times = times.plus(&Times::of(t, &y));
                }
                group.times[slot].0 = times;
            }
        }
    }

    /// Sets runs from a slot on to the sums from each row on, the last one first, and of what comes behind: a run of another table, or
    /// nothing, about an origin.
    #[inline(always)]
    pub(super) fn sum_each(
        &mut self,
        slot: usize,
        behind: Option<(&Table, usize)>,
        rows: &Rows,
        numbers: Range<u64>,
        (origin, origins): (i64, &[Lanes]),
    ) {
        let mut common = behind.map_or(Common::NONE, |(table, run)| table.common[run]);
        common.origin = origin;
        let slots = slot..;
        for (slot, row) in slots.clone().zip(numbers.clone().rev()) {
            common.add_time(rows.time(row));
            self.common[slot] = common;
        }
        for (index, (group, about)) in self.groups.iter_mut().zip(origins).enumerate() {
            let behind = behind.map(|(table, run)| (&table.groups[index], run));
            let mut values = behind.map_or(Values::NONE, |(group, run)| group.values[run]);
            for (slot, row) in slots.clone().zip(numbers.clone().rev()) {
                let (t, y) = rows.timed(row, index, origin);
                values = values.plus(&Values::of(t, &y, about));
                group.values[slot] = values;
            }
            if group.keeps_squares {
                let mut sum = behind.map_or([0.0; LANES], |(group, run)| group.squares[run]);
                for (slot, row) in slots.clone().zip(numbers.clone().rev()) {
                    let squares = squares(&rows.sample(row, index), about);
                    sum = from_fn(|i| sum[i] + squares[i]);
                    group.squares[slot] = sum;
                }
            }
            if group.keeps_times {
                let mut times = behind.map_or(Times::NONE, |(group, run)| group.times[run].0);
                for (slot, row) in slots.clone().zip(numbers.clone().rev()) {
                    let (t, y) = rows.timed(row, index, origin);
                    times = times.plus(&Times::of(t, &y));
                    group.times[slot].0 = times;
                }
            }
        }
    }

    /// Sets a run to another one.
    #[inline(always)]
    pub(super) fn copy(&mut self, from: usize, to: usize) {
        self.common[to] = self.common[from];
        for group in &mut self.groups {
            group.values[to] = group.values[from];
            if group.keeps_times {
                group.times[to] = group.times[from];
            }
            if group.keeps_squares {
                group.squares[to] = group.squares[from];
            }
        }
    }

    /// Sets the first runs to the sums of as many of another table from the one at the same place on, about an origin; the run after
    /// them is an empty one.
    #[inline(always)]
    pub(super) fn sum_from_end(&mut self, origin: i64, table: &Table, runs: usize) {
        self.clear(runs, origin);
        let by = |slot: usize| table.common[slot].origin.wrapping_sub(origin) as f64;
        let mut rows = Times::NONE;
        for slot in (0..runs).rev() {
            rows = rows.plus(&table.common[slot].rows.shifted(&[by(slot)]));
            self.common[slot] = Common { origin, rows };
        }
        for (group, other) in self.groups.iter_mut().zip(&table.groups) {
            let mut values = Values::NONE;
            for slot in (0..runs).rev() {
                values = values.plus(&other.values[slot].shifted(by(slot)));
                group.values[slot] = values;
            }
            if group.keeps_squares {
                let mut sum = [0.0; LANES];
                for slot in (0..runs).rev() {
                    sum = from_fn(|i| sum[i] + other.squares[slot][i]);
                    group.squares[slot] = sum;
                }
            }
            if group.keeps_times {
                let mut times = Times::NONE;
                for slot in (0..runs).rev() {
                    times = times.plus(&other.times[slot].0.shifted(&[by(slot); LANES]));
                    group.times[slot].0 = times;
                }
            }
        }
    }
}

/// Squares of samples less the origins of their channels.
#[inline(always)]
fn squares(y: &Lanes, origin: &Lanes) -> Lanes {
    about(y, origin).map(|y| y * y)
}

/// Samples less the origins of their channels; nothing is added for one that is absent.
#[inline(always)]
fn about(y: &Lanes, origin: &Lanes) -> Lanes {
    let about: Lanes = from_fn(|i| y[i] - origin[i]);
    about.map(|y| if y.is_nan() { 0.0 } else { y })
}
