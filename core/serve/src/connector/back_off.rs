//! How long what has failed is left alone before it is tried again.

use std::hash::{BuildHasher, RandomState};
use std::time::Duration;

/// The pause after a first failure, and the longest one unless a machine file says another.
const PAUSES: (Duration, Duration) = (Duration::from_millis(500), Duration::from_secs(30));

/// Ever longer pauses, from half a second to half a minute or what `retry` says, each up to a fifth shorter or longer: a fleet is not to
/// come back at once. A run that lasted as long as the longest was a good one.
#[derive(Debug)]
pub struct BackOff {
    pause: Duration,
    longest: Duration,
    turn: u64,
}

impl Default for BackOff {
    fn default() -> Self {
        Self::up_to(PAUSES.1)
    }
}

impl BackOff {
    /// Pauses up to this one.
    #[must_use]
    pub fn up_to(longest: Duration) -> Self {
        Self {
            pause: PAUSES.0.min(longest),
            longest,
            turn: 0,
        }
    }

    /// The pause after a run, or a connection, that lasted so long.
    pub fn after(&mut self, lasted: Duration) -> Duration {
        if lasted >= self.longest {
            self.pause = PAUSES.0.min(self.longest);
        }
        self.turn = self.turn.wrapping_add(1);
        // The keys of a `RandomState` are others in each process.
        let hash = RandomState::new().hash_one(self.turn);
        let jitter = 0.8 + 0.4 * (hash >> 11) as f64 / (1_u64 << 53) as f64;
        let pause = self.pause.mul_f64(jitter);
        self.pause = (self.pause * 2).min(self.longest);
        pause
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest_and_begin_anew_after_a_good_run() {
        let is_about = |back_off: &mut BackOff, lasted: f64, about: f64| {
            let pause = back_off.after(Duration::from_secs_f64(lasted));
            let share = pause.as_secs_f64() / about;
            assert!((0.8..=1.2).contains(&share), "{pause:?} is not {about} s");
        };
        let cases: [(BackOff, f64, &[f64]); 3] = [
            (
                BackOff::default(),
                30.0,
                &[0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0],
            ),
            (
                BackOff::up_to(Duration::from_secs(2)),
                2.0,
                &[0.5, 1.0, 2.0, 2.0],
            ),
            (BackOff::up_to(Duration::from_millis(100)), 0.1, &[0.1, 0.1]),
        ];
        for (mut back_off, longest, pauses) in cases {
            for about in pauses {
                is_about(&mut back_off, longest * 0.9, *about);
            }
            is_about(&mut back_off, longest, pauses[0]);
            is_about(&mut back_off, 0.0, pauses[1]);
        }
    }
}
