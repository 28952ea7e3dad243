//! Decides who speaks, what has learned or the fit that it began from; what either says is theirs.

use serde::{Deserialize, Serialize};

use crate::time::{Duration, Instant};

/// Over how many windows of truth both are compared.
const WINDOWS: usize = 20;

/// Who speaks, and why: the tens of the port `learning`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Speaks {
    /// What has learned.
    Learner = 0,
    /// The fit, since there have not been so many windows of truth.
    TooFew = 10,
    /// The fit, whose error was smaller.
    Worse = 20,
    /// The fit, since no truth came for a memory.
    Silence = 30,
}

/// Who speaks, as a value of the port `learning` says it.
#[must_use]
pub fn who_speaks(says: f64) -> &'static str {
    match says as u8 / 10 {
        0 => "the learner speaks",
        1 => "its fit speaks, since there have not been 20 windows of truth yet",
        2 => "its fit speaks, since it errs less",
        _ => "its fit speaks, since no truth came for a memory",
    }
}

/// The errors of a learner and of its fit over the last windows of truth.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Standing {
    /// Of each window the sums of the squares of both, in a ring.
    squares: Vec<[f64; 2]>,
    /// Where the newest is in it.
    newest: usize,
    /// When that began, and when a truth came last.
    from: Option<Instant>,
    last: Option<Instant>,
}

impl Standing {
    pub(crate) fn new() -> Self {
        Self {
            squares: Vec::with_capacity(WINDOWS),
            ..Self::default()
        }
    }

    /// Takes the errors of both for a truth that is about a window.
    pub(crate) fn observe(&mut self, errors: [f64; 2], at: Instant, window: Duration) {
        self.last = Some(at);
        if self
            .from
            .is_none_or(|from| at < from || at - from >= window)
        {
            self.from = Some(at);
            if self.squares.len() < WINDOWS {
                self.newest = self.squares.len();
                self.squares.push([0.0; 2]);
            } else {
                self.newest = (self.newest + 1) % WINDOWS;
                self.squares[self.newest] = [0.0; 2];
            }
        }
        for (sum, error) in self.squares[self.newest].iter_mut().zip(errors) {
            *sum += error * error;
        }
    }

    /// Whether no truth came for a memory.
    #[inline]
    pub(crate) fn is_silent(&self, now: Instant, memory: Duration) -> bool {
        self.last.is_none_or(|last| now - last > memory)
    }

    /// Who speaks at an instant.
    pub(crate) fn speaks(&self, now: Instant, memory: Duration) -> Speaks {
        let sum = |of: usize| self.squares.iter().map(|both| both[of]).sum::<f64>();
        if self.squares.len() < WINDOWS {
            Speaks::TooFew
        } else if self.is_silent(now, memory) {
            Speaks::Silence
        } else if sum(0) <= sum(1) {
            Speaks::Learner
        } else {
            Speaks::Worse
        }
    }

    /// Goes on from another.
    pub(crate) fn go_on_from(&mut self, other: &Self) {
        let mut squares = std::mem::take(&mut self.squares);
        squares.clear();
        squares.extend(other.squares.iter().take(WINDOWS));
        *self = Self {
            newest: other.newest.min(squares.len().saturating_sub(1)),
            squares,
            ..*other
        };
    }

    /// Moves what is remembered to the clock of another segment.
    pub(crate) fn shift(&mut self, shift: Duration) {
        self.from = self.from.map(|from| from + shift);
        self.last = self.last.map(|last| last + shift);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_learner_speaks_while_it_errs_no_more_over_twenty_windows_and_not_for_ever_after_the_last()
    {
        let (window, memory) = (Duration::from_ns(300), Duration::from_ns(10_000));
        let mut standing = Standing::new();
        let at = |nth: i64| Instant::from_ns(100 * nth);
        let mut nth = 0;
        let mut more = |standing: &mut Standing, windows: i64, errors: [f64; 2]| {
            for _ in 0..3 * windows {
                standing.observe(errors, at(nth), window);
                nth += 1;
            }
            standing.speaks(at(nth), memory)
        };
        assert_eq!(more(&mut standing, 19, [1.0, 1.0]), Speaks::TooFew);
        assert_eq!(more(&mut standing, 1, [1.0, 1.0]), Speaks::Learner);
        assert_eq!(more(&mut standing, 1, [2.0, 1.0]), Speaks::Worse);
        assert_eq!(more(&mut standing, 19, [1.0, 1.0]), Speaks::Worse);
        assert_eq!(more(&mut standing, 1, [1.0, 1.0]), Speaks::Learner);
        let last = at(nth - 1);
        assert_eq!(standing.speaks(last + memory, memory), Speaks::Learner);
        let later = last + memory + Duration::from_ns(1);
        assert_eq!(standing.speaks(later, memory), Speaks::Silence);
        let mut other = Standing::new();
        other.go_on_from(&standing);
        other.shift(Duration::from_ns(1));
        assert_eq!(other.speaks(later, memory), Speaks::Learner);
    }
}
