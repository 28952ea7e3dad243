//! Why faults cannot be applied. Decides how it is told, not what is refused.

use std::fmt;

use super::FaultKind;

/// Why faults cannot be applied.
#[derive(Debug, Clone, PartialEq)]
pub enum FaultError {
    /// The channel is beyond the width of the rows.
    Channel {
        /// Which fault, from 0.
        fault: usize,
        /// Its channel.
        channel: usize,
        /// How many channels there are.
        width: usize,
    },
    /// The start is negative or the length not positive.
    Span {
        /// Which fault, from 0.
        fault: usize,
        /// Its start in ns.
        from_ns: i64,
        /// Its length in ns.
        for_ns: i64,
    },
    /// The size is not finite, or not positive where it is a standard deviation.
    Size {
        /// Which fault, from 0.
        fault: usize,
        /// Its kind.
        kind: FaultKind,
        /// Its size.
        size: f64,
    },
}

impl fmt::Display for FaultError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channel {
                fault,
                channel,
                width,
            } => write!(
                f,
                "fault {}: channel {channel} of a recording that has {width}",
                fault + 1
            ),
            Self::Span {
                fault,
                from_ns,
                for_ns,
            } => write!(
                f,
                "fault {}: from {from_ns} ns for {for_ns} ns; the start must not be negative and the length must be above 0",
                fault + 1
            ),
            Self::Size { fault, kind, size } => {
                let allowed = if *kind == FaultKind::Noise {
                    "finite and not negative"
                } else {
                    "finite"
                };
                write!(
                    f,
                    "fault {}: a size of {size} for `{}`; it must be {allowed}",
                    fault + 1,
                    kind.name()
                )
            }
        }
    }
}

impl std::error::Error for FaultError {}
