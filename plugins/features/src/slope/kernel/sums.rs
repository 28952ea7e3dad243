//! Sums over runs of rows, for all channels at once: how rows join a run and how runs are added up.
//! It does not decide which rows belong to a run.
//!
//! Times are nanoseconds after the run's origin, values lie about an origin that is the same for all runs. Nothing is
//! ever subtracted from a sum: a sample leaves by not being in the runs that remain.
//! While no sample is missing, count and times are the same for all channels: sums of them per channel are kept only on demand.
//! Channels lie in groups of four, so that the loops over them become vector instructions; the last group is filled up
//! with channels that are always present.

use std::array::from_fn;

/// One value for each of four channels.
pub(super) type Quad = [f64; 4];

/// How many groups of four channels there are.
pub(super) fn quads(channels: usize) -> usize {
    channels.div_ceil(4)
}

/// Sums of `L` channels that concern the times of their samples: Σ1, Σt, Σt².
#[derive(Clone, Copy, Debug)]
pub(super) struct Times<const L: usize> {
    pub(super) n: [f64; L],
    pub(super) t: [f64; L],
    pub(super) tt: [f64; L],
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
    pub(super) fn shifted(&self, by: f64) -> Times<L> {
        Times {
            n: self.n,
            t: from_fn(|i| self.t[i] + by * self.n[i]),
            tt: from_fn(|i| self.tt[i] + by * (2.0 * self.t[i] + by * self.n[i])),
        }
    }
}

/// Sums of four channels that concern their values: Σy, Σty.
#[derive(Clone, Copy, Debug)]
pub(super) struct Values {
    pub(super) y: Quad,
    pub(super) ty: Quad,
}

impl Values {
    const NONE: Values = Values {
        y: [0.0; 4],
        ty: [0.0; 4],
    };

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

/// Runs by slot number. Group `slot * quads + quad` belongs to channels `4 * quad` and on.
#[derive(Clone, Debug)]
pub(super) struct Table {
    quads: usize,
    keeps_squares: bool,
    /// Whether the sums of time per channel are kept.
    keeps_times: bool,
    pub(super) common: Vec<Common>,
    pub(super) values: Vec<Values>,
    pub(super) times: Vec<Times<4>>,
    /// Σy².
    pub(super) squares: Vec<Quad>,
}

impl Table {
    pub(super) fn new(channels: usize, squares: bool, slots: usize) -> Table {
        let mut table = Table {
            quads: quads(channels),
            keeps_squares: squares,
            keeps_times: false,
            common: Vec::new(),
            values: Vec::new(),
            times: Vec::new(),
            squares: Vec::new(),
        };
        table.resize(slots);
        table
    }

    pub(super) fn slots(&self) -> usize {
        self.common.len()
    }

    /// From now on sums of time are kept per channel or not; runs must be computed anew when this is switched on.
    pub(super) fn keep_times(&mut self, keep: bool) {
        self.keeps_times = keep;
    }

    /// Changes the number of slots; the runs must be computed anew.
    pub(super) fn resize(&mut self, slots: usize) {
        let none = Common {
            origin: 0,
            rows: Times::NONE,
        };
        self.common.resize(slots, none);
        self.values.resize(slots * self.quads, Values::NONE);
        self.times.resize(slots * self.quads, Times::NONE);
        if self.keeps_squares {
            self.squares.resize(slots * self.quads, [0.0; 4]);
        }
    }

    /// Makes an empty run about an origin.
    pub(super) fn clear(&mut self, slot: usize, origin: i64) {
        self.common[slot] = Common {
            origin,
            rows: Times::NONE,
        };
        let groups = slot * self.quads..(slot + 1) * self.quads;
        self.values[groups.clone()].fill(Values::NONE);
        self.times[groups.clone()].fill(Times::NONE);
        if self.keeps_squares {
            self.squares[groups].fill([0.0; 4]);
        }
    }

    /// Sets run `to` to run `from` and one more row: its time, its samples less the origins of the channels.
    #[inline]
    pub(super) fn add_row(
        &mut self,
        [from, to]: [usize; 2],
        t_ns: i64,
        row: &[Quad],
        origins: &[Quad],
    ) {
        let before = self.common[from];
        let t = t_ns.saturating_sub(before.origin) as f64;
        let this = Times {
            n: [1.0],
            t: [t],
            tt: [t * t],
        };
        self.common[to] = Common {
            origin: before.origin,
            rows: before.rows.plus(&this),
        };
        let (from, to) = (from * self.quads, to * self.quads);
        for (quad, (y, origin)) in row.iter().zip(origins).enumerate() {
            let y: Quad = from_fn(|i| if y[i].is_nan() { 0.0 } else { y[i] - origin[i] });
            let this = Values {
                y,
                ty: from_fn(|i| t * y[i]),
            };
            self.values[to + quad] = self.values[from + quad].plus(&this);
            if self.keeps_squares {
                let squares = self.squares[from + quad];
                self.squares[to + quad] = from_fn(|i| squares[i] + y[i] * y[i]);
            }
        }
        if self.keeps_times {
            for (quad, y) in row.iter().enumerate() {
                let present = |sum: f64| from_fn(|i| if y[i].is_nan() { 0.0 } else { sum });
                let this = Times {
                    n: present(1.0),
                    t: present(t),
                    tt: present(t * t),
                };
                self.times[to + quad] = self.times[from + quad].plus(&this);
            }
        }
    }

    /// Sets run `to` to run `from` and a run of another table.
    pub(super) fn add_run(&mut self, [from, to]: [usize; 2], table: &Table, slot: usize) {
        let (before, common) = (self.common[from], &table.common[slot]);
        let by = common.origin.saturating_sub(before.origin) as f64;
        self.common[to] = Common {
            origin: before.origin,
            rows: before.rows.plus(&common.rows.shifted(by)),
        };
        let [from, to, slot] = [from, to, slot].map(|slot| slot * self.quads);
        for quad in 0..self.quads {
            let values = table.values[slot + quad].shifted(by);
            self.values[to + quad] = self.values[from + quad].plus(&values);
            if self.keeps_squares {
                let (a, b) = (self.squares[from + quad], table.squares[slot + quad]);
                self.squares[to + quad] = from_fn(|i| a[i] + b[i]);
            }
            if self.keeps_times {
                let times = table.times[slot + quad].shifted(by);
                self.times[to + quad] = self.times[from + quad].plus(&times);
            }
        }
    }
}
