//! When the motors of a stage work. Decides the alignment bursts and their heat, not where the heat goes.

use athermal_core::prng::Prng;
use athermal_trial::machine::Individual;

/// How often and how hard motors work.
#[derive(Debug, Clone, Copy)]
pub struct Duty {
    /// Mean pause between bursts in s.
    pub pause_s: f64,
    /// Shortest and longest burst in s.
    pub burst_s: [f64; 2],
    /// Heat during a burst in W; each burst has its own between half and one and a half of it.
    pub power_w: f64,
}

impl Duty {
    /// The same motors in one machine of its type: their power is drawn, their work is planned.
    #[must_use]
    pub fn of(self, individual: &Individual, stage: &str) -> Self {
        let power_w = self.power_w * individual.factor(&format!("{stage} power"));
        Self { power_w, ..self }
    }
}

/// Alignment bursts at random times: exponential pauses, uniform durations.
#[derive(Debug, Clone)]
pub struct Motors {
    duty: Duty,
    prng: Prng,
    running: bool,
    left_s: f64,
    power_w: f64,
}

/// What the motors do during one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Heat in W.
    pub heat_w: f64,
    /// A burst ended with this step: the stage stands somewhere else, and creeps.
    pub ended: bool,
}

impl Motors {
    /// Motors at rest.
    #[must_use]
    pub fn new(duty: Duty, mut prng: Prng) -> Self {
        let left_s = prng.exponential(duty.pause_s);
        Self {
            duty,
            prng,
            running: false,
            left_s,
            power_w: 0.0,
        }
    }

    /// One step of `step_s` seconds. A burst starts and ends with a step.
    pub fn step(&mut self, step_s: f64) -> Motion {
        self.left_s -= step_s;
        let mut ended = false;
        if self.left_s <= 0.0 {
            if self.running {
                ended = true;
                self.left_s = self.prng.exponential(self.duty.pause_s);
                self.power_w = 0.0;
            } else {
                let [shortest, longest] = self.duty.burst_s;
                self.left_s = self.prng.between(shortest, longest);
                self.power_w = self.duty.power_w * self.prng.between(0.5, 1.5);
            }
            self.running = !self.running;
        }
        Motion {
            heat_w: self.power_w,
            ended,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DUTY: Duty = Duty {
        pause_s: 3600.0,
        burst_s: [300.0, 900.0],
        power_w: 2.0,
    };

    #[test]
    fn motors_work_their_share_of_the_time() {
        let mut motors = Motors::new(DUTY, Prng::stream(1, "motors"));
        let n = 2_000_000_u32;
        let mean = (0..n).map(|_| motors.step(5.0).heat_w).sum::<f64>() / f64::from(n);
        // Bursts of 600 s among pauses of 3600 s; about 2,400 of them, so 3 % standard error.
        let expected = 2.0 * 600.0 / 4200.0;
        assert!((mean / expected - 1.0).abs() < 0.12, "{mean}");
    }

    #[test]
    fn heat_stays_within_its_bounds_and_every_burst_ends_once() {
        let mut motors = Motors::new(DUTY, Prng::stream(1, "motors"));
        let (mut before, mut starts, mut ends) = (0.0, 0, 0);
        for _ in 0..100_000 {
            let motion = motors.step(5.0);
            assert!(motion.heat_w == 0.0 || (1.0..3.0).contains(&motion.heat_w));
            starts += i32::from(before == 0.0 && motion.heat_w > 0.0);
            ends += i32::from(motion.ended);
            before = motion.heat_w;
        }
        assert!(starts > 50);
        assert!((starts - ends).abs() <= 1, "{starts} starts, {ends} ends");
    }
}
