//! Whether the mean of a series has changed. Decides when an alarm is given; does not decide what the series is, nor what
//! follows from the alarm.

mod adwin;
mod page_hinkley;

pub use adwin::{Adwin, AdwinOptions};
pub use page_hinkley::{PageHinkley, PageHinkleyOptions};

/// Where a mean has gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeanChange {
    /// Up.
    Up,
    /// Down.
    Down,
}

#[cfg(test)]
mod tests {
    use super::MeanChange;
    use crate::oracle;

    /// The rows of the oracle's series at which there is an alarm, and where the mean has gone; nothing where there is no oracle.
    pub(super) fn alarms(
        mut push: impl FnMut(f64) -> Option<MeanChange>,
    ) -> Option<Vec<(usize, MeanChange)>> {
        let rows = oracle::table("online_river/drift_input.csv")?.numbers();
        let alarm = |(nth, row): (usize, &Vec<f64>)| Some((nth, push(row[0])?));
        Some(rows.iter().enumerate().filter_map(alarm).collect())
    }

    /// A value that is not finite changes nothing.
    pub(super) fn ignores_what_is_not_finite<T: Clone + PartialEq + std::fmt::Debug>(
        mut detector: T,
        push: impl Fn(&mut T, f64) -> Option<MeanChange>,
    ) {
        push(&mut detector, 1.0);
        let before = detector.clone();
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(push(&mut detector, value), None);
        }
        assert_eq!(detector, before);
    }
}
