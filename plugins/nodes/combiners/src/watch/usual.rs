//! Decides which errors are usual, and as how large a new one counts; not whether their mean has changed.

use serde::{Deserialize, Serialize};

use super::Watched;

/// An error that is more times as large as usual counts as so many times.
const LARGEST: f64 = 5.0;

/// How many errors tell at most, by the median of their sizes, which are usual.
const MOST: usize = 100;

/// The standard deviation of normal errors in multiples of the median of their sizes (Hampel 1974).
const OF_MEDIAN: f64 = 1.4826;

/// What has been seen of the sizes of errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Usual {
    /// How many errors have been taken, and the mean of their squares: 0 while they do not tell yet which are usual.
    count: u64,
    mean_square: f64,
    /// The newest errors, as many as tell which are usual, and the place of the oldest where there are as many.
    newest: Vec<f64>,
    oldest: usize,
}

/// What becomes of an error.
#[derive(Debug, PartialEq)]
pub(super) enum Taken {
    /// It helps to tell which are usual.
    Early,
    /// It counts as so many times the usual one.
    Counts(f64),
    /// With it what was usual is no more, and the newest tell what is.
    Unusual,
}

impl Usual {
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            mean_square: 0.0,
            newest: Vec::with_capacity(MOST),
            oldest: 0,
        }
    }

    /// Makes room again in what was read back.
    pub(super) fn reserve(&mut self) {
        self.newest.reserve(MOST.saturating_sub(self.newest.len()));
    }

    /// How many errors have been taken since it began to be known what is usual.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Takes an error, of which so many are early ones. Nothing is allocated.
    pub(super) fn take(&mut self, error: f64, first: u64, watched: Watched) -> Taken {
        self.keep(error, first);
        self.count += 1;
        if self.mean_square == 0.0 {
            if self.newest.len() >= telling(first) {
                self.begin();
            }
            return Taken::Early;
        }
        let usual = self.mean_square.sqrt();
        if self.is_left(LARGEST * usual, watched) {
            self.newest.retain(|error| error.abs() > LARGEST * usual);
            self.oldest = 0;
            self.begin();
            return Taken::Unusual;
        }
        let error = error.clamp(-LARGEST * usual, LARGEST * usual);
        self.mean_square += (error * error - self.mean_square) / self.count as f64;
        if self.count <= first {
            Taken::Early
        } else {
            Taken::Counts(error / self.mean_square.sqrt())
        }
    }

    fn keep(&mut self, error: f64, first: u64) {
        let most = telling(first);
        if self.newest.len() > most {
            // It was read back from where more of them were taken.
            self.newest.rotate_left(self.oldest);
            self.newest.drain(..self.newest.len() - most);
            self.oldest = 0;
        }
        if self.newest.len() < most {
            self.newest.push(error);
        } else {
            self.newest[self.oldest] = error;
            self.oldest = (self.oldest + 1) % most;
        }
    }

    /// The newest errors tell which are usual, unless all were exactly as predicted, which says nothing of those to come.
    fn begin(&mut self) {
        self.mean_square = usual_square(&self.newest);
        self.count = self.newest.len() as u64;
        if self.mean_square == 0.0 {
            self.newest.clear();
            self.oldest = 0;
            self.count = 0;
        }
    }

    /// Whether most of the newest errors are larger than counts; of those with a sign, on both sides, since others are a bias.
    fn is_left(&self, largest: f64, watched: Watched) -> bool {
        let beyond = |sign: f64| {
            let all = self.newest.iter();
            all.filter(|error| *error * sign > largest).count()
        };
        let (above, below) = (beyond(1.0), beyond(-1.0));
        let both = above + below;
        let is_bias = watched == Watched::Error && 4 * above.min(below) < both;
        2 * both > self.newest.len() && !is_bias
    }
}

/// How many errors tell which are usual.
fn telling(first: u64) -> usize {
    usize::try_from(first).map_or(MOST, |first| first.min(MOST))
}

/// The mean square of errors, of which one that is larger than [`LARGEST`] times the usual counts as that.
fn usual_square(errors: &[f64]) -> f64 {
    let mut sizes = [0.0; MOST];
    let there = errors.iter().filter(|error| **error != 0.0);
    let mut count = 0;
    for (size, error) in sizes.iter_mut().zip(there) {
        *size = error.abs();
        count += 1;
    }
    let sizes = &mut sizes[..count];
    if sizes.is_empty() {
        return 0.0;
    }
    let (_, median, _) = sizes.select_nth_unstable_by(count / 2, f64::total_cmp);
    let largest = LARGEST * OF_MEDIAN * *median;
    let squares = errors.iter().map(|error| error.abs().min(largest).powi(2));
    squares.sum::<f64>() / errors.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_errors_of_which_most_are_none_tell_by_the_others_which_are_usual() {
        assert_eq!(usual_square(&[0.0, 0.0, 3.0, 0.0, -1.0]), 2.0);
        assert_eq!(usual_square(&[1.0, -1.0, 1.0, -1.0]), 1.0);
        assert_eq!(usual_square(&[0.0, 0.0]), 0.0);
    }

    #[test]
    fn errors_that_are_none_are_passed_over_until_there_are_some() {
        let mut usual = Usual::new();
        for _ in 0..7 {
            assert_eq!(usual.take(0.0, 3, Watched::Error), Taken::Early);
        }
        assert_eq!(usual.count(), 1);
        usual.take(2.0, 3, Watched::Error);
        usual.take(2.0, 3, Watched::Error);
        assert_eq!(
            usual.take(-2.0, 3, Watched::Error),
            Taken::Counts(-2.0 / f64::sqrt(3.0))
        );
    }

    #[test]
    fn what_most_of_the_newest_are_far_beyond_is_usual_no_more() {
        let mut usual = Usual::new();
        let mut take = |error: f64| usual.take(error, 4, Watched::Error);
        for error in [1.0, -1.0, 1.0, -1.0] {
            take(error);
        }
        assert!(matches!(take(100.0), Taken::Counts(_)));
        assert!(matches!(take(-100.0), Taken::Counts(_)));
        assert_eq!(take(100.0), Taken::Unusual);
        assert_eq!(usual.mean_square, 100.0 * 100.0);
    }

    #[test]
    fn what_is_read_back_from_where_more_told_is_kept_as_far_as_it_tells() {
        let mut usual = Usual::new();
        (1..=7).for_each(|error| {
            usual.take(f64::from(error), 5, Watched::Size);
        });
        usual.take(8.0, 3, Watched::Size);
        assert_eq!(usual.newest.iter().sum::<f64>(), 6.0 + 7.0 + 8.0);
    }
}
