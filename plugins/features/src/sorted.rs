//! Values in order of size, for medians that come and go with a window. Decides how they are kept; not which values belong.

/// Values in order of size.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sorted(Vec<f64>);

impl Sorted {
    pub(crate) fn insert(&mut self, value: f64) {
        let place = self.place(value);
        self.0.insert(place, value);
    }

    /// Takes out a value that was put in.
    pub(crate) fn remove(&mut self, value: f64) {
        let place = self.place(value);
        if self
            .0
            .get(place)
            .is_some_and(|found| found.to_bits() == value.to_bits())
        {
            self.0.remove(place);
        }
    }

    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Makes room, so that a stretch of time that holds more values than before need not.
    pub(crate) fn reserve(&mut self, values: usize) {
        self.0.reserve(values);
    }

    fn place(&self, value: f64) -> usize {
        self.0
            .partition_point(|other| other.total_cmp(&value).is_lt())
    }

    /// The value in the middle, or the mean of the two in the middle; NaN of nothing.
    pub(crate) fn median(&self) -> f64 {
        let (left, right) = (self.0.len().wrapping_sub(1) / 2, self.0.len() / 2);
        match (self.0.get(left), self.0.get(right)) {
            (Some(left), Some(right)) if left == right => *left,
            (Some(left), Some(right)) => 0.5 * left + 0.5 * right,
            _ => f64::NAN,
        }
    }

    /// The median of the absolute deviations from a centre.
    pub(crate) fn deviation(&self, centre: f64) -> f64 {
        // On either side of the centre the deviations are in order already, so that both need only be merged up to the middle.
        let mut right = self.0.partition_point(|&value| value < centre);
        let mut left = right;
        let count = self.0.len();
        let mut next = || {
            let below = left.checked_sub(1).map(|at| centre - self.0[at]);
            let above = self.0.get(right).map(|value| value - centre);
            match (below, above) {
                (Some(below), Some(above)) if below <= above => (left -= 1, below).1,
                (_, Some(above)) => (right += 1, above).1,
                (Some(below), None) => (left -= 1, below).1,
                (None, None) => f64::NAN,
            }
        };
        let mut middle = (f64::NAN, f64::NAN);
        for _ in 0..=count / 2 {
            middle = (middle.1, next());
        }
        if count % 2 == 1 || middle.0 == middle.1 {
            middle.1
        } else {
            0.5 * middle.0 + 0.5 * middle.1
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Sorted {
        let mut sorted = Sorted::default();
        values.iter().for_each(|&value| sorted.insert(value));
        sorted
    }

    #[test]
    fn the_median_is_in_the_middle_of_odd_and_between_of_even_counts() {
        assert_eq!(of(&[3.0, -1.0, 2.0]).median(), 2.0);
        assert_eq!(of(&[3.0, -1.0, 2.0, 8.0]).median(), 2.5);
        assert!(of(&[]).median().is_nan());
    }

    #[test]
    fn the_deviation_is_that_of_all_deviations_sorted() {
        // scipy.stats.median_abs_deviation: of 1, 2, 4, 7, 100 it is 3; of 1, 2, 4, 7 it is 1.5 + 0.5.
        assert_eq!(of(&[1.0, 2.0, 4.0, 7.0, 100.0]).deviation(4.0), 3.0);
        assert_eq!(of(&[1.0, 2.0, 4.0, 7.0]).deviation(3.0), 2.0 - 0.5);
        assert_eq!(of(&[5.0]).deviation(5.0), 0.0);
        assert_eq!(of(&[5.0, 5.0]).deviation(5.0), 0.0);
    }

    #[test]
    fn a_value_taken_out_leaves_its_equals_and_no_trace() {
        let mut sorted = of(&[2.0, 2.0, 9.0]);
        sorted.remove(2.0);
        sorted.remove(9.0);
        assert_eq!(sorted.median(), 2.0);
        sorted.remove(7.0);
        assert_eq!(sorted.median(), 2.0);
    }
}
