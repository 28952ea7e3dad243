//! How long what has failed is left alone before it is tried again.

use std::hash::{BuildHasher, RandomState};
use std::time::Duration;

/// The pause after a first failure, and the longest one. A run that lasted as long as that was a good one.
const PAUSES: (Duration, Duration) = (Duration::from_millis(500), Duration::from_secs(30));

/// Ever longer pauses, from half a second to half a minute, each up to a fifth shorter or longer: a fleet is not to come back at once.
#[derive(Debug)]
pub struct BackOff {
    pause: Duration,
    turn: u64,
}

impl Default for BackOff {
    fn default() -> Self {
        Self {
            pause: PAUSES.0,
            turn: 0,
        }
    }
}

impl BackOff {
    /// The pause after a run, or a connection, that lasted so long.
    pub fn after(&mut self, lasted: Duration) -> Duration {
        if lasted >= PAUSES.1 {
            self.pause = PAUSES.0;
        }
        self.turn = self.turn.wrapping_add(1);
        // The keys of a `RandomState` are others in each process.
        let hash = RandomState::new().hash_one(self.turn);
        let jitter = 0.8 + 0.4 * (hash >> 11) as f64 / (1_u64 << 53) as f64;
        let pause = self.pause.mul_f64(jitter);
        self.pause = (self.pause * 2).min(PAUSES.1);
        pause
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_half_a_minute_and_begin_anew_after_a_good_run() {
        let mut back_off = BackOff::default();
        let mut is_about = |lasted: f64, about: f64| {
            let pause = back_off.after(Duration::from_secs_f64(lasted));
            let share = pause.as_secs_f64() / about;
            assert!((0.8..=1.2).contains(&share), "{pause:?} is not {about} s");
        };
        for about in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0] {
            is_about(29.0, about);
        }
        is_about(30.0, 0.5);
        is_about(0.0, 1.0);
    }
}
