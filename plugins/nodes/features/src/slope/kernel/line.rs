//! The line through a window, beside its slope.

use std::array::from_fn;

use pulp::Scalar;

use super::lanes::{LANES, Lanes};
use super::parts::{ABREAST, Line};
use super::window::Kind;
use super::{RollingSlope, layout};

impl RollingSlope {
    /// Standard errors of the slopes at the last row, per second, laid out as in [`slopes`](Self::slopes): `sqrt(SSR / (n − 2) / Σ(x − x̄)²)`,
    /// SSR the residual sum of squares of the same fit. Absent for fewer than three samples and unless the kernel keeps squares.
    ///
    /// `SSR = Σ(y − ȳ)² − slope·Σ(x − x̄)(y − ȳ)` loses digits as `r²` approaches 1: its relative error is about 1e-15 / (1 − r²).
    pub fn stderr(&mut self, out: &mut [f64]) {
        self.tell(out, |line, _| line.stderr());
    }

    /// The values of the lines at the last row's time, laid out as in [`slopes`](Self::slopes). Absent unless the kernel keeps squares.
    pub fn ends(&mut self, out: &mut [f64]) {
        self.tell(out, |line, origin| Some(origin + line.end()));
    }

    /// The coefficients of determination `1 − SSR / Σ(y − ȳ)²` of the lines, laid out as in [`slopes`](Self::slopes). Absent where
    /// all samples are the same and unless the kernel keeps squares.
    pub fn r_squared(&mut self, out: &mut [f64]) {
        self.tell(out, |line, _| line.r_squared());
    }

    /// Something about the line of each channel and window, given with the origin of the channel's values.
    fn tell(&mut self, out: &mut [f64], of: impl Fn(&Line, f64) -> Option<f64>) {
        if !self.squares {
            out.fill(self.no_value.absent);
            return;
        }
        let Some(mut results) = self.room(out) else {
            return;
        };
        for (group, out) in out.chunks_mut(LANES * results.len()).enumerate() {
            self.tell_of(group, &mut results, &of);
            layout::put(Scalar::new(), &results, out);
        }
        self.results = results;
        self.mark_cold(out);
    }

    fn tell_of(&self, group: usize, values: &mut [Lanes], of: impl Fn(&Line, f64) -> Option<f64>) {
        let (groups, origins) = (self.blocks.groups(group), &self.blocks.origins()[group]);
        let end_ns = self.last_time().unwrap_or(0);
        for (index, (window, values)) in self.windows.iter().zip(values).enumerate() {
            let times = self.weights[index / ABREAST].times(index % ABREAST);
            let moments = match window.kind {
                Kind::Gaps => window.parts.moments(groups),
                _ => window.parts.moments_with(groups, &times),
            };
            let origin = self.blocks.now(window.parts.places[2]).origin;
            let end = end_ns.wrapping_sub(origin) as f64;
            *values = from_fn(|i| {
                let line = window.parts.line(groups, i, &moments, end);
                let line = match moments.thin(i) || line.is_flat() {
                    true => self.line(window, LANES * group + i),
                    false => line,
                };
                of(&line, origins[i]).unwrap_or(self.no_value.absent)
            });
            self.mark_absent(window, group, &moments.n, values);
        }
    }
}
