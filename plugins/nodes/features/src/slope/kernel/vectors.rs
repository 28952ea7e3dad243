//! Decides for which processors the loops of the kernel are compiled, so that each takes as many numbers at once as it can.
//!
//! What is called with every row is inlined throughout, since what is not is compiled for the plainest processor; closures are
//! short, so that they are inlined too. No sum is taken in another order, and no product is fused with one, so that the bits are
//! the same on all of them.

use pulp::{Arch, Simd, WithSimd};

use super::RollingSlope;

/// The vectors of the processor that this runs on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vectors(Arch);

impl Vectors {
    pub(super) fn new() -> Self {
        Self(Arch::new())
    }

    #[inline]
    pub(super) fn push(self, kernel: &mut RollingSlope, t_ns: i64, y: &[f64]) -> bool {
        self.0.dispatch(Push { kernel, t_ns, y })
    }

    #[inline]
    pub(super) fn slopes(self, kernel: &mut RollingSlope, out: &mut [f64]) {
        self.0.dispatch(Slopes { kernel, out });
    }
}

struct Push<'a> {
    kernel: &'a mut RollingSlope,
    t_ns: i64,
    y: &'a [f64],
}

impl WithSimd for Push<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        self.kernel.push_here(self.t_ns, self.y)
    }
}

struct Slopes<'a> {
    kernel: &'a mut RollingSlope,
    out: &'a mut [f64],
}

impl WithSimd for Slopes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.kernel.slopes_here(simd, self.out);
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::prng::Prng;

    use super::super::{Coverage, NoValue};
    use super::*;

    #[test]
    fn slopes_are_the_same_bits_with_and_without_the_vectors_of_this_processor() {
        let coverage = Coverage {
            min_samples: 3,
            min_coverage: 0.5,
            cold_partial: false,
        };
        let no_value = NoValue {
            absent: f64::NAN,
            cold: f64::NAN,
        };
        let windows = [7, 20, 45, 90, 300].map(|s| s * 1_000_000_000);
        let fresh = || RollingSlope::new(&windows, 11, coverage, no_value, true);
        let (mut with, mut without) = (fresh(), fresh());
        without.vectors = Vectors(Arch::Scalar);
        let mut random = Prng::stream(3, "rows of slopes");
        let (mut t_ns, mut there) = (0, 0);
        for row in 0..4000 {
            t_ns += (random.between(0.2, 3.0) * 1e9) as i64;
            // A stretch without gaps, then one with some.
            let silent = if row % 1000 < 600 { 0.0 } else { 0.2 };
            let y = [(); 11].map(|()| match random.between(0.0, 1.0) < silent {
                true => f64::NAN,
                false => 20.0 + random.normal(),
            });
            let mut of = [[0.0; 55]; 2];
            for (kernel, of) in [&mut with, &mut without].into_iter().zip(&mut of) {
                assert!(kernel.push(t_ns, &y));
                kernel.slopes(of);
            }
            let bits = of.map(|of| of.map(f64::to_bits));
            assert_eq!(bits[0], bits[1], "row {row}");
            there += of[0].iter().filter(|slope| slope.is_finite()).count();
        }
        assert!(there > 200_000, "{there}");
    }
}
