//! Where a channel has no sample for much longer than ever else while rows come, as after a cable is pulled.

use serde::Serialize;

/// A shorter part of all rows is nothing to speak of.
const LEAST_SHARE: f64 = 0.1;
/// So many times as many rows as come for each sample else are long.
const TIMES: u64 = 20;

/// Rows one after the other that have no sample of a channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Silence {
    /// How many.
    pub rows: u64,
    /// Of how many in all.
    pub of_rows: u64,
    /// The instant of the first of them, in s.
    pub from_s: f64,
    /// The instant of the last of them, in s.
    pub to_s: f64,
}

/// Finds the longest silence while rows come.
#[derive(Debug, Clone, Default)]
pub struct Finder {
    rows: u64,
    samples: u64,
    now: Silence,
    longest: Silence,
}

impl Finder {
    /// Takes the next row, and whether it has a sample.
    pub fn push(&mut self, at_s: f64, has_sample: bool) {
        self.rows += 1;
        if has_sample {
            self.samples += 1;
            self.interrupt();
            return;
        }
        if self.now.rows == 0 {
            self.now.from_s = at_s;
        }
        self.now.rows += 1;
        self.now.to_s = at_s;
    }

    /// What follows is not set against what was.
    pub fn interrupt(&mut self) {
        let over = std::mem::take(&mut self.now);
        if over.rows > self.longest.rows {
            self.longest = over;
        }
    }

    /// The silence that goes on while rows come, once it is so many times as long as is usual and lasts so long, in s: there a
    /// share of all rows would be more from day to day.
    #[must_use]
    pub fn goes_on(&self, least_s: f64) -> Option<Silence> {
        let Self { now, samples, .. } = self;
        let is_long = now.rows * samples.max(&1) > TIMES * (self.rows - now.rows);
        (now.rows > 0 && is_long && now.to_s - now.from_s >= least_s).then_some(Silence {
            of_rows: self.rows,
            ..*now
        })
    }

    /// Whether there has been a sample.
    #[must_use]
    pub fn had_samples(&self) -> bool {
        self.samples > 0
    }

    /// Lets the silence that goes on end, so that what is usual is not taken from it.
    pub fn forget(&mut self) {
        self.rows -= std::mem::take(&mut self.now).rows;
    }

    /// The silence; none where there is none that is longer than usual. A channel without any sample was silent from the first row
    /// to the last.
    #[must_use]
    pub fn found(self) -> Option<Silence> {
        let mut longest = self.longest;
        if self.now.rows > longest.rows {
            longest = self.now;
        }
        self.is_long(longest.rows).then_some(Silence {
            of_rows: self.rows,
            ..longest
        })
    }

    /// The silence that lasts to the last row, where it is long, of a channel that had samples: of what is measured only now and then,
    /// or not at all, others say nothing.
    #[must_use]
    pub fn lasting(self) -> Option<Silence> {
        (self.had_samples() && self.is_long(self.now.rows)).then_some(Silence {
            of_rows: self.rows,
            ..self.now
        })
    }

    fn is_long(&self, rows: u64) -> bool {
        rows as f64 >= LEAST_SHARE * self.rows as f64
            && rows * self.samples.max(1) > TIMES * (self.rows - rows).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: impl IntoIterator<Item = bool>) -> Option<Silence> {
        let mut finder = Finder::default();
        for (nth, has_sample) in rows.into_iter().enumerate() {
            finder.push(nth as f64, has_sample);
        }
        finder.found()
    }

    #[test]
    fn a_sensor_that_dies_is_silent_from_then_on() {
        let found = of((0..100).map(|nth| nth < 70)).unwrap();
        assert_eq!((found.rows, found.of_rows), (30, 100));
        assert_eq!((found.from_s, found.to_s), (70.0, 99.0));
    }

    #[test]
    fn a_silence_is_found_while_it_goes_on_once_it_is_long_and_much_longer_than_usual() {
        let mut finder = Finder::default();
        for nth in 0..3000 {
            finder.push(f64::from(nth), nth % 8 == 0);
            assert_eq!(finder.goes_on(5.0), None, "at {nth} s");
        }
        for nth in 3000..4000 {
            finder.push(f64::from(nth), false);
            let lasts_s = f64::from(nth - 2993);
            let found = finder.goes_on(100.0);
            assert_eq!(found.is_some(), lasts_s >= 159.0, "for {lasts_s} s");
        }
        assert_eq!(finder.goes_on(100.0).unwrap().from_s, 2993.0);
        finder.forget();
        finder.push(4000.0, true);
        assert_eq!(finder.goes_on(0.0), None);
    }

    #[test]
    fn what_is_rarely_measured_is_not_silent_in_between() {
        assert_eq!(of((0..200).map(|nth| nth % 50 == 0)), None);
        assert_eq!(of((0..2000).map(|nth| nth % 8 == 0)), None);
        assert!(of((0..2000).map(|nth| nth % 8 == 0 && nth > 300)).is_some());
    }

    #[test]
    fn without_any_sample_it_is_silent_from_the_first_row_on() {
        let found = of([false; 100]).unwrap();
        assert_eq!((found.rows, found.of_rows), (100, 100));
        assert_eq!((found.from_s, found.to_s), (0.0, 99.0));
        // Of a few rows nothing is said.
        assert_eq!(of([false; 20]), None);
    }

    #[test]
    fn only_a_silence_to_the_end_is_lasting() {
        let lasting = |is_there: fn(u32) -> bool| {
            let mut finder = Finder::default();
            (0..300).for_each(|nth| finder.push(f64::from(nth), is_there(nth)));
            finder.lasting()
        };
        assert_eq!(lasting(|nth| !(100..200).contains(&nth)), None);
        let found = lasting(|nth| nth < 200).unwrap();
        assert_eq!((found.rows, found.from_s), (100, 200.0));
        assert_eq!(lasting(|_| false), None);
    }
}
