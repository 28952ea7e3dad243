//! Centred sums of a run of samples, for all channels at once: how samples join them and how two runs are merged.
//! It does not decide which samples belong to a run.
//!
//! Every run keeps means and sums of products of deviations from them (Chan, Golub and LeVeque 1983, eq. 1.3 to 1.5), never
//! raw sums, and nothing is ever subtracted: a sample leaves by not being in the runs that remain.
//! While every channel is present in every row of a run, count and time are the same for all of them and are kept once.
//! Channels lie in groups of four, so that the loops over them become vector instructions; the last group is filled up
//! with channels that are always present and zero.

/// What all channels of a run have in common. Times are nanoseconds after `origin`, whole numbers wherever they are of one sample.
///
/// The order matters: were `mean_t` and `sxx` neighbours, they would be read as one vector just after having been written
/// one by one, which stalls the processor.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Common {
    /// Mean of time, of a complete run.
    pub(super) mean_t: f64,
    pub(super) origin: i64,
    /// Squared deviations of time, of a complete run.
    pub(super) sxx: f64,
    /// Every channel is present in every row; the sums of time per channel are then not filled.
    pub(super) complete: bool,
    /// Rows of the run, 0 for an empty one.
    pub(super) rows: f64,
    /// Latest of the channels' first samples.
    pub(super) latest_first: f64,
    /// Fewest samples that any channel has.
    pub(super) fewest: f64,
}

impl Common {
    pub(super) const EMPTY: Common = Common {
        origin: 0,
        rows: 0.0,
        complete: true,
        mean_t: 0.0,
        sxx: 0.0,
        fewest: 0.0,
        latest_first: f64::INFINITY,
    };
}

/// Centred sums of one channel over one run. Times are nanoseconds after the origin of the run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moments {
    pub(super) n: f64,
    pub(super) mean_t: f64,
    pub(super) mean_y: f64,
    pub(super) sxx: f64,
    pub(super) sxy: f64,
    pub(super) syy: f64,
}

impl Moments {
    /// The union of two runs of one channel; `shift` is the origin of `other` less that of `self`.
    pub(super) fn merged(self, other: Moments, shift: f64) -> Moments {
        if other.n == 0.0 {
            return self;
        }
        let n = self.n + other.n;
        let part = other.n / n;
        let weight = self.n * part;
        let dt = (other.mean_t + shift) - self.mean_t;
        let dy = other.mean_y - self.mean_y;
        Moments {
            n,
            mean_t: self.mean_t + dt * part,
            mean_y: self.mean_y + dy * part,
            sxx: self.sxx + other.sxx + weight * dt * dt,
            sxy: self.sxy + other.sxy + weight * dt * dy,
            syy: self.syy + other.syy + weight * dy * dy,
        }
    }
}

/// One value for each of four channels.
pub(super) type Quad = [f64; 4];

/// How many groups of four channels there are.
pub(super) fn quads(channels: usize) -> usize {
    channels.div_ceil(4)
}

/// Sums of four channels that concern their values.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OfY {
    pub(super) mean: Quad,
    pub(super) sxy: Quad,
}

/// Sums of four channels that concern the times of their samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OfT {
    pub(super) n: Quad,
    pub(super) mean: Quad,
    pub(super) sxx: Quad,
    pub(super) first: Quad,
}

impl OfT {
    /// The sums of a complete run.
    fn of(common: &Common) -> OfT {
        OfT {
            n: [common.rows; 4],
            mean: [common.mean_t; 4],
            sxx: [common.sxx; 4],
            first: [common.latest_first; 4],
        }
    }
}

/// One run in a [`Table`].
#[derive(Clone, Copy)]
pub(super) struct Run<'a> {
    table: &'a Table,
    slot: usize,
}

impl<'a> Run<'a> {
    #[inline]
    pub(super) fn common(&self) -> &'a Common {
        &self.table.common[self.slot]
    }

    #[inline]
    pub(super) fn y(&self) -> &'a [OfY] {
        &self.table.y[self.table.range(self.slot)]
    }

    /// Empty unless the table keeps squares.
    #[inline]
    fn syy(&self) -> &'a [Quad] {
        let range = self.table.range(self.slot);
        self.table.syy.get(range).unwrap_or_default()
    }

    #[inline]
    pub(super) fn t(&self) -> &'a [OfT] {
        &self.table.t[self.table.range(self.slot)]
    }

    /// Number of samples of a channel.
    pub(super) fn n(&self, channel: usize) -> f64 {
        if self.common().complete {
            self.common().rows
        } else {
            self.t()[channel / 4].n[channel % 4]
        }
    }

    /// Time of the oldest sample of a channel, infinite without one.
    pub(super) fn first(&self, channel: usize) -> f64 {
        if self.common().complete {
            self.common().latest_first
        } else {
            self.t()[channel / 4].first[channel % 4]
        }
    }

    pub(super) fn moments(&self, channel: usize) -> Moments {
        let (quad, lane) = (channel / 4, channel % 4);
        let of_t = if self.common().complete {
            OfT::of(self.common())
        } else {
            self.t()[quad]
        };
        Moments {
            n: of_t.n[lane],
            mean_t: of_t.mean[lane],
            mean_y: self.y()[quad].mean[lane],
            sxx: of_t.sxx[lane],
            sxy: self.y()[quad].sxy[lane],
            syy: self.syy().get(quad).map_or(0.0, |syy| syy[lane]),
        }
    }
}

/// Runs in numbered slots; what a slot holds is contiguous over channels.
#[derive(Clone, Debug)]
pub(super) struct Table {
    quads: usize,
    squares: bool,
    common: Vec<Common>,
    y: Vec<OfY>,
    syy: Vec<Quad>,
    t: Vec<OfT>,
}

impl Table {
    pub(super) fn new(channels: usize, squares: bool, slots: usize) -> Table {
        let mut table = Table {
            quads: quads(channels),
            squares,
            common: Vec::new(),
            y: Vec::new(),
            syy: Vec::new(),
            t: Vec::new(),
        };
        table.resize(slots);
        table
    }

    pub(super) fn slots(&self) -> usize {
        self.common.len()
    }

    /// More slots, empty ones; those there keep their numbers.
    pub(super) fn resize(&mut self, slots: usize) {
        let groups = slots * self.quads;
        self.common.resize(slots, Common::EMPTY);
        self.y.resize(groups, OfY::default());
        self.t.resize(groups, OfT::default());
        if self.squares {
            self.syy.resize(groups, Quad::default());
        }
    }

    #[inline]
    fn range(&self, slot: usize) -> std::ops::Range<usize> {
        slot * self.quads..(slot + 1) * self.quads
    }

    #[inline]
    pub(super) fn run(&self, slot: usize) -> Run<'_> {
        Run { table: self, slot }
    }

    #[inline]
    pub(super) fn common(&self, slot: usize) -> &Common {
        &self.common[slot]
    }

    pub(super) fn clear(&mut self, slot: usize) {
        let range = self.range(slot);
        self.common[slot] = Common::EMPTY;
        self.y[range.clone()].fill(OfY::default());
        if let Some(syy) = self.syy.get_mut(range) {
            syy.fill(Quad::default());
        }
    }

    /// Fills the sums of time per channel of a complete run, so that it can be read beside one that is not.
    #[inline]
    pub(super) fn spread(&mut self, slot: usize) {
        if self.common[slot].complete {
            let of_t = OfT::of(&self.common[slot]);
            let range = self.range(slot);
            self.t[range].fill(of_t);
        }
    }

    /// Adds one row, NaN where a channel is absent; `all_present` says that none is.
    pub(super) fn add(&mut self, slot: usize, t_ns: i64, y: &[Quad], all_present: bool) {
        if self.common[slot].rows == 0.0 {
            self.clear(slot);
            self.common[slot].origin = t_ns;
        }
        let t = t_ns.saturating_sub(self.common[slot].origin) as f64;
        if all_present && self.common[slot].complete {
            self.add_to_complete(slot, t, y);
        } else {
            self.add_with_gaps(slot, t, y);
        }
    }

    fn add_to_complete(&mut self, slot: usize, t: f64, y: &[Quad]) {
        let range = self.range(slot);
        let common = &mut self.common[slot];
        let before = common.rows;
        common.rows += 1.0;
        let part = 1.0 / common.rows;
        let kept = before * part;
        let dt = t - common.mean_t;
        common.mean_t += dt * part;
        common.sxx += kept * dt * dt;
        common.fewest = common.rows;
        common.latest_first = common.latest_first.min(t);
        let lever = kept * dt;
        if let Some(syy) = self.syy.get_mut(range.clone()) {
            for ((syy, own), y) in syy.iter_mut().zip(&self.y[range.clone()]).zip(y) {
                for i in 0..4 {
                    let dy = y[i] - own.mean[i];
                    syy[i] += kept * dy * dy;
                }
            }
        }
        for (own, y) in self.y[range].iter_mut().zip(y) {
            for (i, y) in y.iter().enumerate() {
                let dy = y - own.mean[i];
                own.mean[i] += dy * part;
                own.sxy[i] += lever * dy;
            }
        }
    }

    fn add_with_gaps(&mut self, slot: usize, t: f64, y: &[Quad]) {
        self.spread(slot);
        let first = self.range(slot).start;
        for (quad, y) in y.iter().enumerate() {
            let present = y.map(|y| !y.is_nan());
            let sample = OfY {
                mean: std::array::from_fn(|i| if present[i] { y[i] } else { 0.0 }),
                sxy: [0.0; 4],
            };
            let at = OfT {
                n: present.map(|present| if present { 1.0 } else { 0.0 }),
                mean: [t; 4],
                sxx: [0.0; 4],
                first: present.map(|present| if present { t } else { f64::INFINITY }),
            };
            self.absorb_quad(first + quad, &sample, &at, &[0.0; 4], 0.0);
        }
        self.summarise(slot, 1.0);
    }

    /// Merges a run, of another table, into `slot`; a run merged into an empty one is that run to the bit.
    pub(super) fn absorb(&mut self, slot: usize, other: &Run<'_>) {
        if other.common().rows == 0.0 {
            return;
        }
        if self.common[slot].rows == 0.0 {
            self.copy_from(slot, other);
            return;
        }
        let origin = self.common[slot].origin;
        let shift = other.common().origin.saturating_sub(origin) as f64;
        if self.common[slot].complete && other.common().complete {
            self.absorb_complete(slot, other, shift);
            return;
        }
        self.spread(slot);
        let first = self.range(slot).start;
        let of_all = OfT::of(other.common());
        for (quad, y) in other.y().iter().enumerate() {
            let t = if other.common().complete {
                &of_all
            } else {
                &other.t()[quad]
            };
            let syy = other.syy().get(quad).unwrap_or(&[0.0; 4]);
            self.absorb_quad(first + quad, y, t, syy, shift);
        }
        self.summarise(slot, other.common().rows);
    }

    fn absorb_complete(&mut self, slot: usize, other: &Run<'_>, shift: f64) {
        let range = self.range(slot);
        let common = &mut self.common[slot];
        let before = common.rows;
        common.rows += other.common().rows;
        let part = other.common().rows / common.rows;
        let weight = before * part;
        let dt = (other.common().mean_t + shift) - common.mean_t;
        common.mean_t += dt * part;
        common.sxx += other.common().sxx + weight * dt * dt;
        common.fewest = common.rows;
        common.latest_first = common.latest_first.min(other.common().latest_first + shift);
        let lever = weight * dt;
        if let Some(syy) = self.syy.get_mut(range.clone()) {
            let values = self.y[range.clone()].iter().zip(other.y());
            for ((syy, other_syy), (own, y)) in syy.iter_mut().zip(other.syy()).zip(values) {
                for i in 0..4 {
                    let dy = y.mean[i] - own.mean[i];
                    syy[i] += other_syy[i] + weight * dy * dy;
                }
            }
        }
        for (own, y) in self.y[range].iter_mut().zip(other.y()) {
            for i in 0..4 {
                let dy = y.mean[i] - own.mean[i];
                own.mean[i] += dy * part;
                own.sxy[i] += y.sxy[i] + lever * dy;
            }
        }
    }

    /// Merges sums of four channels; a channel without samples on either side changes nothing.
    #[inline]
    fn absorb_quad(&mut self, at: usize, y: &OfY, t: &OfT, syy: &Quad, shift: f64) {
        let (own_y, own_t) = (&mut self.y[at], &mut self.t[at]);
        let mut unused = [0.0; 4];
        let own_syy = self.syy.get_mut(at).unwrap_or(&mut unused);
        for i in 0..4 {
            let n = own_t.n[i] + t.n[i];
            let part = t.n[i] / n.max(1.0);
            let weight = own_t.n[i] * part;
            let dt = (t.mean[i] + shift) - own_t.mean[i];
            let dy = y.mean[i] - own_y.mean[i];
            own_t.n[i] = n;
            own_t.mean[i] += dt * part;
            own_t.sxx[i] += t.sxx[i] + weight * dt * dt;
            own_t.first[i] = own_t.first[i].min(t.first[i] + shift);
            own_y.mean[i] += dy * part;
            own_y.sxy[i] += y.sxy[i] + weight * dt * dy;
            own_syy[i] += syy[i] + weight * dy * dy;
        }
    }

    /// The run of `from` becomes that of `to`, in the same table.
    pub(super) fn copy_within(&mut self, from: usize, to: usize) {
        self.common[to] = self.common[from];
        let (range, to) = (self.range(from), self.range(to).start);
        self.y.copy_within(range.clone(), to);
        if self.squares {
            self.syy.copy_within(range.clone(), to);
        }
        if !self.common[from].complete {
            self.t.copy_within(range, to);
        }
    }

    /// The run becomes that of `slot`.
    pub(super) fn copy_from(&mut self, slot: usize, other: &Run<'_>) {
        let range = self.range(slot);
        self.common[slot] = *other.common();
        self.y[range.clone()].copy_from_slice(other.y());
        if self.squares {
            self.syy[range.clone()].copy_from_slice(other.syy());
        }
        if !other.common().complete {
            self.t[range].copy_from_slice(other.t());
        }
    }

    fn summarise(&mut self, slot: usize, rows: f64) {
        let mut fewest = [f64::INFINITY; 4];
        let mut latest_first = [f64::NEG_INFINITY; 4];
        for t in &self.t[self.range(slot)] {
            for i in 0..4 {
                fewest[i] = fewest[i].min(t.n[i]);
                latest_first[i] = latest_first[i].max(t.first[i]);
            }
        }
        let common = &mut self.common[slot];
        common.rows += rows;
        common.complete = false;
        common.fewest = fewest.into_iter().fold(f64::INFINITY, f64::min);
        common.latest_first = latest_first.into_iter().fold(f64::NEG_INFINITY, f64::max);
    }
}
