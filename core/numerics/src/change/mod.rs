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
