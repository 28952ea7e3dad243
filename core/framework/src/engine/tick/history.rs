//! What a channel held at an earlier instant.

use std::collections::VecDeque;

use crate::channel::{ABSENT, COLD};
use crate::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// The past of one channel, as far back as anybody reads it.
///
/// Readers ask for instants that never go back, each through a cursor of its own, so that an answer costs a step or two.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct History {
    depth: Duration,
    entries: VecDeque<Past>,
    /// How many entries have been dropped at the front since the segment began.
    dropped: u64,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Past {
    at: Instant,
    value: f64,
    stamp: Instant,
}

/// A reader's place: the number, since the segment began, of entries at or before the instant asked last.
pub type Cursor = u64;

impl History {
    /// A history that can be asked for instants up to `depth` back.
    #[must_use]
    pub fn new(depth: Duration) -> Self {
        Self {
            depth,
            entries: VecDeque::new(),
            dropped: 0,
        }
    }

    /// Writes down what the channel holds from `at` on; NaN where a run gave nothing.
    pub fn push(&mut self, at: Instant, value: f64, stamp: Instant) {
        self.drop_before(at - self.depth);
        self.append(Past { at, value, stamp });
    }

    /// Room is made by a part: a channel is about as long back at all times.
    fn append(&mut self, past: Past) {
        if self.entries.len() == self.entries.capacity() {
            self.entries.reserve_exact((self.entries.len() / 16).max(4));
        }
        self.entries.push_back(past);
    }

    /// Writes down at `now` what is planned to be held from `at` on, in place of all that was planned for then or later.
    pub(crate) fn plan(&mut self, now: Instant, at: Instant, value: f64) {
        while self.entries.back().is_some_and(|last| last.at >= at) {
            self.entries.pop_back();
        }
        self.drop_before(now - self.depth);
        let stamp = at;
        self.append(Past { at, value, stamp });
    }

    /// What is planned for an instant, and from when on; NaN where that is longer before it than `max_age`, or nothing is planned.
    pub(crate) fn planned(&self, at: Instant, max_age: Duration) -> (f64, Instant) {
        let begun = self.entries.partition_point(|entry| entry.at <= at);
        match begun.checked_sub(1).and_then(|last| self.entries.get(last)) {
            Some(held) if at - held.at <= max_age => (held.value, held.at),
            Some(held) => (ABSENT, held.at),
            None => (ABSENT, at),
        }
    }

    /// Forgets what nobody asks for any more who asks for `at` or later.
    fn drop_before(&mut self, at: Instant) {
        while self.entries.get(1).is_some_and(|next| next.at <= at) {
            self.entries.pop_front();
            self.dropped += 1;
        }
    }

    /// The value that was held at `at`, and its stamp; NaN where there was none or it was older than `max_age`.
    pub fn at(&self, at: Instant, max_age: Duration, cursor: &mut Cursor) -> (f64, Instant) {
        let (value, stamp, _) = self.at_until(at, at, max_age, cursor);
        (value, stamp)
    }

    /// The same, and from which instant on the answer may be another when nothing more is written down for instants before
    /// `unwritten`.
    #[inline]
    pub(crate) fn at_until(
        &self,
        at: Instant,
        unwritten: Instant,
        max_age: Duration,
        cursor: &mut Cursor,
    ) -> (f64, Instant, Instant) {
        let (held, next) = self.find(at, cursor);
        let Some(held) = held else {
            // Before the first value the stamp is the instant asked for, and what is written down first turns absent into cold.
            let nothing = if next.is_some() { COLD } else { ABSENT };
            return (nothing, at, Instant::MIN);
        };
        // What is planned for later may yet be another.
        let next = next.map_or(unwritten, |next| next.at.min(unwritten));
        let last = held.stamp + max_age;
        if held.value.is_nan() {
            (held.value, held.stamp, next)
        } else if at > last {
            (ABSENT, held.stamp, next)
        } else {
            (
                held.value,
                held.stamp,
                next.min(last + Duration::from_ns(1)),
            )
        }
    }

    /// What was held at `at`, and what came next.
    #[inline]
    fn find(&self, at: Instant, cursor: &mut Cursor) -> (Option<&Past>, Option<&Past>) {
        *cursor = (*cursor).max(self.dropped);
        let mut next = self.entry(*cursor);
        let mut held = None;
        while let Some(past) = next
            && past.at <= at
        {
            held = next;
            *cursor += 1;
            next = self.entry(*cursor);
        }
        let held = held.or_else(|| self.entry(cursor.checked_sub(1)?));
        (held, next)
    }

    /// Lets a cursor go back, so that an instant before the one asked last may be asked for.
    pub fn go_back(&self, at: Instant, cursor: &mut Cursor) {
        while let Some(last) = cursor.checked_sub(1)
            && self.entry(last).is_some_and(|past| past.at > at)
        {
            *cursor = last;
        }
    }

    /// Goes on from another history of the same channel, keeping what it reached back further.
    pub fn adopt(&mut self, other: &Self) {
        let begin = other.entries.front().map_or(Instant::MAX, |past| past.at);
        self.entries.retain(|past| past.at < begin);
        if self.depth <= other.depth {
            self.entries.clear();
        }
        self.entries.extend(&other.entries);
        // Ticks need not come as regularly as they did; the engine thread must not have to make room.
        self.entries.reserve(self.entries.len().max(16));
        // Readers find their places anew; all that counts is that numbers go on.
        self.dropped = other.dropped;
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.dropped = 0;
    }

    fn entry(&self, number: u64) -> Option<&Past> {
        let index = usize::try_from(number.checked_sub(self.dropped)?).ok()?;
        self.entries.get(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::is_cold;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn d(seconds: i64) -> Duration {
        Duration::from_ns(seconds * 1_000_000_000)
    }

    #[test]
    fn the_last_value_at_or_before_the_instant_is_given_while_young_enough() {
        let mut past = History::new(d(100));
        let mut cursor = 0;
        past.push(s(0), 1.0, s(0));
        past.push(s(10), 2.0, s(10));
        assert_eq!(past.at(s(5), d(60), &mut cursor).0, 1.0);
        assert_eq!(past.at(s(10), d(60), &mut cursor).0, 2.0);
        assert_eq!(past.at(s(70), d(60), &mut cursor).0, 2.0);
        assert!(past.at(s(71), d(60), &mut cursor).0.is_nan());
    }

    #[test]
    fn a_run_that_gave_nothing_ends_the_hold() {
        let mut past = History::new(d(100));
        past.push(s(0), 1.0, s(0));
        past.push(s(10), ABSENT, s(10));
        assert!(past.at(s(12), d(60), &mut 0).0.is_nan());
        assert_eq!(past.at(s(9), d(60), &mut 0).0, 1.0);
    }

    #[test]
    fn before_the_first_value_it_is_cold_and_without_any_value_absent() {
        let mut past = History::new(d(100));
        assert!(!is_cold(past.at(s(0), d(60), &mut 0).0));
        past.push(s(10), 1.0, s(10));
        assert!(is_cold(past.at(s(9), d(60), &mut 0).0));
    }

    /// A reader that asks again only when it must sees what one sees that always asks.
    #[test]
    fn an_answer_stays_as_it_is_until_its_end() {
        let (lag, max_age) = (d(30), d(12));
        let mut past = History::new(lag);
        let (mut always, mut seldom) = (0, 0);
        let (mut kept, mut until, mut asked) = ((f64::NAN, Instant::MIN), Instant::MIN, 0);
        let mut pushed = 0;
        for t in 0..2000 {
            let now = s(t);
            let expected = past.at(now - lag, max_age, &mut always);
            if now >= until {
                let (value, stamp, stays) = past.at_until(now - lag, now, max_age, &mut seldom);
                (kept, until) = ((value, stamp), stays + lag);
                asked += 1;
            }
            assert_eq!(kept.0.to_bits(), expected.0.to_bits(), "at {t} s");
            assert_eq!(kept.1, expected.1, "at {t} s");
            pushed += i64::from(matches!(t % 97, 0 | 7 | 20 | 50 | 60 | 90));
            match t % 97 {
                0 | 7 | 50 | 90 => past.push(now, t as f64, now),
                60 => past.push(now, t as f64, now - d(10)),
                20 => past.push(now, ABSENT, now),
                _ => {}
            }
        }
        // Twice for each value, when it is there and when it is too old, and at every tick before the first.
        assert!(
            asked < 2 * pushed + lag.as_ns() / 1_000_000_000 + 2,
            "{asked}"
        );
    }

    #[test]
    fn a_cursor_that_went_back_gives_earlier_values_again() {
        let mut past = History::new(d(100));
        let mut cursor = 0;
        for t in 0..10 {
            past.push(s(10 * t), t as f64, s(10 * t));
        }
        assert_eq!(past.at(s(75), d(60), &mut cursor).0, 7.0);
        for (t, expected) in [(34, 3.0), (30, 3.0), (80, 8.0), (0, 0.0)] {
            past.go_back(s(t), &mut cursor);
            assert_eq!(past.at(s(t), d(60), &mut cursor).0, expected, "at {t} s");
        }
    }

    #[test]
    fn what_nobody_can_ask_for_any_more_is_dropped() {
        let mut past = History::new(d(30));
        let mut cursor = 0;
        for t in 0..10_000 {
            past.push(s(t), t as f64, s(t));
            if t >= 30 {
                assert_eq!(past.at(s(t - 30), d(60), &mut cursor).0, (t - 30) as f64);
            }
        }
        assert!(past.entries.len() <= 32, "{}", past.entries.len());
    }
}
