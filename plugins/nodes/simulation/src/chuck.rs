//! The heated chuck under a chip. Decides its temperature and the heat that it gives to a body nearby, not where that body is.

use std::f64::consts::TAU;

use athermal_trial::machine::Individual;

/// Stefan–Boltzmann constant in W/(m² K⁴) (CODATA 2018).
const STEFAN_BOLTZMANN: f64 = 5.670_374_419e-8;
const KELVIN: f64 = 273.15;
/// Time constant of the regulated chuck in s.
const FOLLOW_S: f64 = 85.0;
/// Fastest change in K/s, heating or cooling.
const FASTEST: f64 = 0.2;
/// The regulator hunts by this much, in K, with this period in s.
const HUNTING: f64 = 0.01;
const HUNTING_S: f64 = 47.0;

/// How a body is coupled to the chuck.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Area × emissivity × view factor in m².
    pub radiating_m2: f64,
    /// Conductance through the gap and the mounts in W/K.
    pub conducting: f64,
}

impl View {
    /// The same coupling in one machine of its type.
    #[must_use]
    pub fn of(self, individual: &Individual, body: &str) -> Self {
        let drawn =
            |parameter: &str, of: f64| of * individual.factor(&format!("{body} {parameter}"));
        Self {
            radiating_m2: drawn("view", self.radiating_m2),
            conducting: drawn("gap", self.conducting),
        }
    }
}

/// A chuck that follows its set point.
#[derive(Debug, Clone)]
pub struct Chuck {
    level: f64,
    hunting: f64,
    follow_s: f64,
}

impl Chuck {
    /// A chuck settled at `set_point` °C.
    #[must_use]
    pub fn new(set_point: f64) -> Self {
        Self {
            level: set_point,
            hunting: 0.0,
            follow_s: FOLLOW_S,
        }
    }

    /// The same in one machine of its type, with a time constant of its own.
    #[must_use]
    pub fn of(self, individual: &Individual) -> Self {
        let follow_s = self.follow_s * individual.factor("chuck time constant");
        Self { follow_s, ..self }
    }

    /// Its temperature in °C.
    #[must_use]
    pub fn temperature(&self) -> f64 {
        self.level + HUNTING * libm::sin(TAU * self.hunting)
    }

    /// Heat in W to a body of `temperature` °C: radiation by the law of Stefan and Boltzmann, `εσAF (T_c⁴ − T⁴)`, and conduction `G (T_c − T)`.
    #[must_use]
    pub fn heat_w(&self, view: View, temperature: f64) -> f64 {
        let fourth = |celsius: f64| {
            let square = (celsius + KELVIN) * (celsius + KELVIN);
            square * square
        };
        let own = self.temperature();
        STEFAN_BOLTZMANN * view.radiating_m2 * (fourth(own) - fourth(temperature))
            + view.conducting * (own - temperature)
    }

    /// One step of `step_s` seconds towards `set_point` °C.
    pub fn step(&mut self, step_s: f64, set_point: f64) {
        let wanted = (set_point - self.level) * (step_s / self.follow_s).min(1.0);
        let most = FASTEST * step_s;
        self.level += wanted.clamp(-most, most);
        self.hunting += step_s / HUNTING_S;
        self.hunting -= self.hunting.floor();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_the_set_point_is_followed_at_a_bounded_rate() {
        let mut chuck = Chuck::new(20.0);
        let mut before = chuck.level;
        for _ in 0..400 {
            chuck.step(5.0, 120.0);
            assert!(chuck.level - before <= FASTEST * 5.0 + 1e-12);
            before = chuck.level;
        }
        assert!((chuck.temperature() - 120.0).abs() <= HUNTING + 1e-3);
    }

    #[test]
    fn a_body_as_warm_as_the_chuck_gets_no_heat() {
        let view = View {
            radiating_m2: 1e-3,
            conducting: 0.03,
        };
        assert_eq!(Chuck::new(40.0).heat_w(view, 40.0), 0.0);
    }

    #[test]
    fn radiation_follows_the_fourth_power() {
        let view = View {
            radiating_m2: 1.0,
            conducting: 0.0,
        };
        // Hand-computed: black bodies at 100 °C and 20 °C exchange 1099.37 − 418.74 W/m².
        let watt = Chuck::new(100.0).heat_w(view, 20.0);
        assert!((watt - 680.6).abs() < 0.2, "{watt}");
    }

    #[test]
    fn conduction_is_proportional_to_the_difference() {
        let view = View {
            radiating_m2: 0.0,
            conducting: 0.03,
        };
        assert!((Chuck::new(50.0).heat_w(view, 20.0) - 0.03 * 30.0).abs() < 1e-12);
    }
}
