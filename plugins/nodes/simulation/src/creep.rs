//! Creep of an axis after it has moved. Decides how far and how fast it settles, not when it moves.

use athermal_core::prng::Prng;

/// Time constants in s of the fast and the slow part.
const TAU_S: [f64; 2] = [120.0, 900.0];
/// The slow part goes this much further than the fast one.
const SLOW: f64 = 2.0;

/// Creep: after each motion the axis still travels a random distance, `Σ A_i (1 − exp(−t/τ_i))` with normal `A_i`.
/// No temperature tells it.
#[derive(Debug, Clone)]
pub struct Creep {
    sigma_nm: f64,
    left_nm: [f64; 2],
    keep: [f64; 2],
    travelled_nm: f64,
    prng: Prng,
}

impl Creep {
    /// An axis at rest whose fast part has a standard deviation of `sigma_nm`, stepped by `step_s`.
    #[must_use]
    pub fn new(sigma_nm: f64, step_s: f64, prng: Prng) -> Self {
        Self {
            sigma_nm,
            left_nm: [0.0; 2],
            keep: TAU_S.map(|tau_s| libm::exp(-step_s / tau_s)),
            travelled_nm: 0.0,
            prng,
        }
    }

    /// The axis has been moved: it has new distances to creep.
    pub fn start(&mut self) {
        self.left_nm[0] += self.sigma_nm * self.prng.normal();
        self.left_nm[1] += SLOW * self.sigma_nm * self.prng.normal();
    }

    /// One step.
    pub fn step(&mut self) {
        for (left, keep) in self.left_nm.iter_mut().zip(self.keep) {
            let kept = *left * keep;
            self.travelled_nm += *left - kept;
            *left = kept;
        }
    }

    /// How far it has crept in all, in nm.
    #[must_use]
    pub fn travelled_nm(&self) -> f64 {
        self.travelled_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_that_never_moved_does_not_creep() {
        let mut creep = Creep::new(50.0, 5.0, Prng::stream(1, "creep"));
        creep.step();
        assert_eq!(creep.travelled_nm(), 0.0);
    }

    #[test]
    fn creep_settles_at_the_distance_that_was_drawn() {
        let mut creep = Creep::new(50.0, 5.0, Prng::stream(1, "creep"));
        creep.start();
        let [fast, slow] = creep.left_nm;
        for _ in 0..24 {
            creep.step();
        }
        // 120 s: one time constant of the fast part.
        let expected =
            fast * (1.0 - (-1.0_f64).exp()) + slow * (1.0 - (-120.0_f64 / TAU_S[1]).exp());
        assert!((creep.travelled_nm() - expected).abs() < 1e-9);
        for _ in 0..5000 {
            creep.step();
        }
        assert!((creep.travelled_nm() - fast - slow).abs() < 1e-6);
    }

    #[test]
    fn every_motion_creeps_differently() {
        let mut creep = Creep::new(50.0, 5.0, Prng::stream(1, "creep"));
        creep.start();
        let first = creep.left_nm;
        creep.start();
        assert_ne!(creep.left_nm, first.map(|left| 2.0 * left));
    }
}
