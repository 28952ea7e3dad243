//! The air around a machine. Decides how its temperature fluctuates and how well it couples to the bodies, not what the bodies do with it.

use std::f64::consts::TAU;

use crate::wander::Wander;
use athermal_core::prng::Prng;

/// How a room fluctuates. Amplitudes and standard deviations in K.
#[derive(Debug, Clone, Copy)]
pub struct RoomShape {
    /// Half the difference between the warmest and the coldest hour of a day.
    pub diurnal: f64,
    /// Amplitude of the cycle of the air conditioning.
    pub cycle: f64,
    /// Mean period of that cycle in s.
    pub cycle_s: f64,
    /// Weather, doors and people: standard deviation, with a memory of `weather_s`.
    pub weather: f64,
    /// Memory of the weather in s.
    pub weather_s: f64,
    /// Turbulence of the air: standard deviation, with a memory of one minute.
    pub turbulence: f64,
}

/// Seconds that the air needs to follow a new set point.
const FOLLOW_S: f64 = 1200.0;
/// Recordings start at eight in the morning, and it is warmest at three in the afternoon.
const WARMEST_S: f64 = 7.0 * 3600.0;
const DAY_S: f64 = 86_400.0;

/// The temperature of the air: set point, diurnal wave, air conditioning whose period and amplitude vary, and two Ornstein–Uhlenbeck processes.
#[derive(Debug, Clone)]
pub struct Room {
    shape: RoomShape,
    step_s: f64,
    time_s: f64,
    level: f64,
    cycle: f64,
    pace: Wander,
    swing: Wander,
    weather: Wander,
    turbulence: Wander,
}

impl Room {
    /// A room at its set point (°C), stepped by `step_s`.
    #[must_use]
    pub fn new(shape: RoomShape, set_point: f64, start_s: f64, step_s: f64, seed: u64) -> Self {
        let stream = |label: &str| Prng::stream(seed, label);
        Self {
            shape,
            step_s,
            time_s: start_s,
            level: set_point,
            cycle: stream("room cycle").uniform(),
            pace: Wander::new(0.1, 1800.0, step_s, stream("room pace")),
            swing: Wander::new(0.2, 5400.0, step_s, stream("room swing")),
            weather: Wander::new(
                shape.weather,
                shape.weather_s,
                step_s,
                stream("room weather"),
            ),
            turbulence: Wander::new(shape.turbulence, 60.0, step_s, stream("room turbulence")),
        }
    }

    /// The temperature of the air in °C, one step later.
    pub fn step(&mut self, set_point: f64) -> f64 {
        self.time_s += self.step_s;
        self.level += (set_point - self.level) * (self.step_s / FOLLOW_S);
        self.cycle += self.step_s / self.shape.cycle_s * (1.0 + self.pace.step()).max(0.2);
        self.cycle -= self.cycle.floor();
        let angle = TAU * self.cycle;
        // Cooling is switched on faster than the room warms up: a second harmonic.
        let wave = libm::sin(angle) + 0.25 * libm::sin(2.0 * angle);
        self.level
            + self.shape.diurnal * libm::cos(TAU * (self.time_s - WARMEST_S) / DAY_S)
            + self.shape.cycle * (1.0 + self.swing.step()) * wave
            + self.weather.step()
            + self.turbulence.step()
    }
}

/// How well the air couples to one body, relative to design: draughts and doors change it within hours.
#[derive(Debug, Clone)]
pub struct Coupling(Wander);

impl Coupling {
    /// A coupling that wanders by `sigma` about 1 with a memory of four hours.
    #[must_use]
    pub fn new(sigma: f64, step_s: f64, prng: Prng) -> Self {
        Self(Wander::new(sigma, 4.0 * 3600.0, step_s, prng))
    }

    /// The factor one step later, never below 0.3.
    pub fn step(&mut self) -> f64 {
        (1.0 + self.0.step()).max(0.3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STILL: RoomShape = RoomShape {
        diurnal: 0.0,
        cycle: 0.0,
        cycle_s: 1320.0,
        weather: 0.0,
        weather_s: 7200.0,
        turbulence: 0.0,
    };

    fn day(shape: RoomShape) -> Vec<f64> {
        let mut room = Room::new(shape, 21.5, 0.0, 10.0, 5);
        (0..8640).map(|_| room.step(21.5)).collect()
    }

    #[test]
    fn a_still_room_stays_at_its_set_point() {
        assert!(day(STILL).iter().all(|t| *t == 21.5));
    }

    #[test]
    fn the_warmest_hour_is_seven_hours_after_the_start() {
        let t = day(RoomShape {
            diurnal: 0.4,
            ..STILL
        });
        let warmest = (0..t.len()).max_by(|a, b| t[*a].total_cmp(&t[*b]));
        assert_eq!(warmest, Some(7 * 360 - 1));
        assert!((t[7 * 360 - 1] - 21.9).abs() < 1e-12);
    }

    #[test]
    fn the_air_conditioning_cycles_at_about_its_period() {
        let t = day(RoomShape {
            cycle: 0.3,
            ..STILL
        });
        let rising = t.windows(2).filter(|w| w[0] < 21.5 && w[1] >= 21.5).count() as f64;
        let expected = DAY_S / STILL.cycle_s;
        assert!((rising / expected - 1.0).abs() < 0.15, "{rising}");
    }

    #[test]
    fn a_new_set_point_is_followed() {
        let mut room = Room::new(STILL, 21.5, 0.0, 10.0, 5);
        let last = (0..1000).map(|_| room.step(23.0)).last();
        assert!(last.is_some_and(|t| (t - 23.0).abs() < 1e-3));
    }

    #[test]
    fn the_coupling_wanders_about_one_and_stays_positive() {
        let mut coupling = Coupling::new(0.5, 600.0, Prng::stream(2, "coupling"));
        let f: Vec<f64> = (0..20_000).map(|_| coupling.step()).collect();
        assert!(f.iter().all(|f| *f >= 0.3));
        assert!(f.iter().any(|f| *f < 0.9) && f.iter().any(|f| *f > 1.1));
    }
}
