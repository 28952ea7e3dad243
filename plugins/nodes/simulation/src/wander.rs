//! A quantity that wanders about zero and forgets where it was. Decides the random process, not what wanders.

use athermal_core::prng::Prng;

/// An Ornstein–Uhlenbeck process with zero mean, discretised exactly for a fixed step:
/// `x(t + dt) = μ x(t) + σ √(1 − μ²) n` with `μ = exp(−dt/τ)` (Gillespie, Phys. Rev. E 54, 2084, 1996, eq. 3.1),
/// where `σ` is the standard deviation in the long run.
#[derive(Debug, Clone)]
pub struct Wander {
    value: f64,
    keep: f64,
    kick: f64,
    prng: Prng,
}

impl Wander {
    /// A process of standard deviation `sigma` that forgets within `tau_s` seconds, stepped by `step_s`. It starts from a draw of its long-run distribution.
    #[must_use]
    pub fn new(sigma: f64, tau_s: f64, step_s: f64, mut prng: Prng) -> Self {
        let keep = libm::exp(-step_s / tau_s);
        Self {
            value: sigma * prng.normal(),
            keep,
            kick: sigma * (1.0 - keep * keep).sqrt(),
            prng,
        }
    }

    /// The value one step later.
    pub fn step(&mut self) -> f64 {
        self.value = self.keep * self.value + self.kick * self.prng.normal();
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_and_memory_are_those_asked_for() {
        let (sigma, tau_s, step_s) = (2.0, 50.0, 5.0);
        let mut wander = Wander::new(sigma, tau_s, step_s, Prng::stream(3, "wander"));
        let n = 400_000_u32;
        let x: Vec<f64> = (0..n).map(|_| wander.step()).collect();
        let variance = x.iter().map(|v| v * v).sum::<f64>() / f64::from(n);
        let lagged = x.windows(11).map(|w| w[0] * w[10]).sum::<f64>() / f64::from(n);
        // About n·dt/(2τ) = 20,000 independent values: 1 % standard error of the variance.
        assert!(
            (variance / (sigma * sigma) - 1.0).abs() < 0.05,
            "{variance}"
        );
        // Ten steps are one time constant.
        assert!(
            (lagged / variance - (-1.0_f64).exp()).abs() < 0.05,
            "{lagged}"
        );
    }

    #[test]
    fn halving_the_step_changes_neither_spread_nor_memory() {
        let coarse = Wander::new(1.0, 60.0, 10.0, Prng::stream(1, "a"));
        let fine = Wander::new(1.0, 60.0, 5.0, Prng::stream(1, "a"));
        assert!((fine.keep * fine.keep - coarse.keep).abs() < 1e-15);
        let two_kicks = fine.kick * (1.0 + fine.keep * fine.keep).sqrt();
        assert!((two_kicks - coarse.kick).abs() < 1e-15);
    }
}
