//! Pseudo-random numbers that are the same on every platform. Decides the generator and how streams are separated, not what is drawn from it.
//!
//! Only integer arithmetic, `+ - * /`, `sqrt` and the pure Rust `libm` are used: the platform's own `ln` may differ in the last bit.

use crate::engine::fnv_1a;

/// xoshiro256++ (Blackman and Vigna, "Scrambled linear pseudorandom number generators", ACM TOMS 47(4), 2021), with normal deviates.
#[derive(Debug, Clone)]
pub struct Prng {
    state: [u64; 4],
    spare: Option<f64>,
}

/// One output of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014); advances `state`.
fn split_mix_64(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Prng {
    /// The stream called `label` of `seed`. Streams with different labels are independent, so that one more sensor or motor leaves
    /// the numbers of all others as they were.
    #[must_use]
    pub fn stream(seed: u64, label: &str) -> Self {
        let mut mix = seed;
        let mut mix = split_mix_64(&mut mix) ^ fnv_1a(label.as_bytes());
        let state = std::array::from_fn(|_| split_mix_64(&mut mix));
        Self { state, spare: None }
    }

    /// The next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let s = &mut self.state;
        let result = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        result
    }

    /// Uniform in `[0, 1)`, a multiple of 2⁻⁵³.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Exponentially distributed with the given mean.
    pub fn exponential(&mut self, mean: f64) -> f64 {
        -mean * libm::log(1.0 - self.uniform())
    }

    /// Normal with mean 0 and standard deviation 1, by the polar method (Marsaglia and Bray, SIAM Review 6(3), 1964).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let u = 2.0 * self.uniform() - 1.0;
            let v = 2.0 * self.uniform() - 1.0;
            let s = u * u + v * v;
            if s > 0.0 && s < 1.0 {
                let factor = (-2.0 * libm::log(s) / s).sqrt();
                self.spare = Some(v * factor);
                return u * factor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_gives_the_numbers_of_its_authors() {
        let mut prng = Prng {
            state: [1, 2, 3, 4],
            spare: None,
        };
        // Output of xoshiro256plusplus.c from prng.di.unimi.it for the state 1, 2, 3, 4.
        for expected in [
            41_943_041,
            58_720_359,
            3_588_806_011_781_223,
            3_591_011_842_654_386,
            9_228_616_714_210_784_205,
            9_973_669_472_204_895_162,
        ] {
            assert_eq!(prng.bits(), expected);
        }
    }

    #[test]
    fn the_seeding_gives_the_numbers_of_its_authors() {
        // Output of splitmix64.c for the seed 1234567.
        let mut state = 1_234_567;
        for expected in [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
        ] {
            assert_eq!(split_mix_64(&mut state), expected);
        }
    }

    #[test]
    fn streams_differ_by_label_and_by_seed() {
        let first = |seed, label| Prng::stream(seed, label).bits();
        assert_eq!(first(1, "room"), first(1, "room"));
        assert_ne!(first(1, "room"), first(1, "chuck"));
        assert_ne!(first(1, "room"), first(2, "room"));
    }

    #[test]
    fn normal_deviates_have_the_moments_of_a_normal_distribution() {
        let mut prng = Prng::stream(7, "moments");
        let n = 200_000_u32;
        let mut sums = [0.0; 4];
        for _ in 0..n {
            let x = prng.normal();
            for (power, sum) in sums.iter_mut().enumerate() {
                *sum += x.powi(power as i32 + 1);
            }
        }
        let [mean, square, cube, fourth] = sums.map(|s| s / f64::from(n));
        // Five standard errors of each moment of N(0, 1): variances 1, 2, 15, 96 over n.
        let within = |variance: f64| 5.0 * (variance / f64::from(n)).sqrt();
        assert!(mean.abs() < within(1.0), "{mean}");
        assert!((square - 1.0).abs() < within(2.0), "{square}");
        assert!(cube.abs() < within(15.0), "{cube}");
        assert!((fourth - 3.0).abs() < within(96.0), "{fourth}");
    }

    #[test]
    fn exponential_waits_have_the_mean_asked_for() {
        let mut prng = Prng::stream(7, "waits");
        let n = 100_000_u32;
        let mean = (0..n).map(|_| prng.exponential(3.0)).sum::<f64>() / f64::from(n);
        assert!(
            (mean - 3.0).abs() < 5.0 * 3.0 / f64::from(n).sqrt(),
            "{mean}"
        );
    }
}
