//! The three parts of a window and the slope of their union. It does not decide which rows the parts hold.

use super::sums::{Common, Moments, OfY, Quad, Run};

const NS_PER_S: f64 = 1e9;

/// The end of a closed block, the whole blocks after it and the current block. Each may be empty but the last.
pub(super) struct Parts<'a> {
    pub(super) head: Run<'a>,
    pub(super) whole: Run<'a>,
    pub(super) now: Run<'a>,
    /// Origins of the first two less that of the current block.
    pub(super) head_shift: f64,
    pub(super) whole_shift: f64,
}

/// Origin of `part` less that of `now`; an empty part has none.
#[inline]
pub(super) fn shift(part: &Common, now: &Common) -> f64 {
    if part.rows > 0.0 {
        part.origin.saturating_sub(now.origin) as f64
    } else {
        0.0
    }
}

impl Parts<'_> {
    /// Whether every channel is present in every row of the window.
    #[inline]
    pub(super) fn complete(&self) -> bool {
        self.head.common().complete && self.whole.common().complete && self.now.common().complete
    }

    pub(super) fn n(&self, channel: usize) -> f64 {
        self.head.n(channel) + self.whole.n(channel) + self.now.n(channel)
    }

    /// Time of the oldest sample of a channel, after the origin of the current block; infinite without one.
    pub(super) fn first(&self, channel: usize) -> f64 {
        let head = self.head.first(channel) + self.head_shift;
        let whole = self.whole.first(channel) + self.whole_shift;
        head.min(whole).min(self.now.first(channel))
    }

    /// Sums of a channel over the window, times after the origin of the current block.
    pub(super) fn moments(&self, channel: usize) -> Moments {
        let now = self.now.moments(channel);
        now.merged(self.whole.moments(channel), self.whole_shift)
            .merged(self.head.moments(channel), self.head_shift)
    }

    /// Slopes per second of a complete window: one division, as time is the same for all channels.
    ///
    /// For parts `p`, `q` of `n` samples each with means and centred sums, the union has
    /// `N·Sxy = N·Σ Sxy_p + Σ_{p<q} n_p n_q (x̄_p − x̄_q)(ȳ_p − ȳ_q)`, and `N·Sxx` likewise: no two large numbers are subtracted.
    #[inline]
    pub(super) fn slopes(&self, out: &mut [Quad]) {
        let (head, whole, now) = (self.head.common(), self.whole.common(), self.now.common());
        let from_head = head.mean_t + self.head_shift - now.mean_t;
        let from_whole = whole.mean_t + self.whole_shift - now.mean_t;
        let between = from_head - from_whole;
        let head_now = head.rows * now.rows * from_head;
        let whole_now = whole.rows * now.rows * from_whole;
        let head_whole = head.rows * whole.rows * between;
        let rows = head.rows + whole.rows + now.rows;
        let sxx = rows * (head.sxx + whole.sxx + now.sxx)
            + head_now * from_head
            + whole_now * from_whole
            + head_whole * between;
        let scale = NS_PER_S / sxx;
        let of_sums = rows * scale;
        let of_head = (head_now + head_whole) * scale;
        let of_whole = (whole_now - head_whole) * scale;
        let values = [self.head.y(), self.whole.y(), self.now.y()];
        weigh(values, [of_sums, of_head, of_whole], out);
    }

    /// Slopes per second of a window with gaps, by the same formula with the times of each channel; all parts have been spread.
    #[inline(never)]
    pub(super) fn slopes_with_gaps(&self, out: &mut [Quad]) {
        let y = [self.head.y(), self.whole.y(), self.now.y()];
        let t = [self.head.t(), self.whole.t(), self.now.t()];
        for quad in 0..out.len() {
            let (hy, wy, ny) = (&y[0][quad], &y[1][quad], &y[2][quad]);
            let (ht, wt, nt) = (&t[0][quad], &t[1][quad], &t[2][quad]);
            out[quad] = std::array::from_fn(|i| {
                let from_head = ht.mean[i] + self.head_shift - nt.mean[i];
                let from_whole = wt.mean[i] + self.whole_shift - nt.mean[i];
                let between = from_head - from_whole;
                let head_now = ht.n[i] * nt.n[i] * from_head;
                let whole_now = wt.n[i] * nt.n[i] * from_whole;
                let head_whole = ht.n[i] * wt.n[i] * between;
                let samples = ht.n[i] + wt.n[i] + nt.n[i];
                let sxx = samples * (ht.sxx[i] + wt.sxx[i] + nt.sxx[i])
                    + head_now * from_head
                    + whole_now * from_whole
                    + head_whole * between;
                // The very operations of `slopes` and `weigh`, so that a channel keeps its bits while another is absent.
                let scale = NS_PER_S / sxx;
                samples * scale * (hy.sxy[i] + wy.sxy[i] + ny.sxy[i])
                    + (head_now + head_whole) * scale * (hy.mean[i] - ny.mean[i])
                    + (whole_now - head_whole) * scale * (wy.mean[i] - ny.mean[i])
            });
        }
    }
}

/// The part of the work that is done for every output. Indexing keeps the compiler from vectorising over groups of
/// four, which would shuffle more than it computes; within four it then does.
#[inline(never)]
fn weigh([head, whole, now]: [&[OfY]; 3], weights: [f64; 3], out: &mut [Quad]) {
    let [of_sums, of_head, of_whole] = weights;
    for quad in 0..out.len() {
        let (h, w, n) = (&head[quad], &whole[quad], &now[quad]);
        out[quad] = std::array::from_fn(|i| {
            of_sums * (h.sxy[i] + w.sxy[i] + n.sxy[i])
                + of_head * (h.mean[i] - n.mean[i])
                + of_whole * (w.mean[i] - n.mean[i])
        });
    }
}

impl Moments {
    /// Standard error of the slope per second; nothing for fewer than three samples.
    pub(super) fn stderr(&self) -> Option<f64> {
        let residual = (self.syy - self.sxy / self.sxx * self.sxy).max(0.0);
        (self.n > 2.0).then(|| (residual / (self.n - 2.0) / self.sxx).sqrt() * NS_PER_S)
    }
}
