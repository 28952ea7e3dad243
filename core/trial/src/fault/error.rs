//! Why faults cannot be applied, and how that is worded.

use std::fmt;

use super::FaultKind;
use crate::failure::Failure;
use crate::time::Duration;
use crate::unit::Unit;

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
    /// No channel has the name.
    UnknownChannel {
        /// The name.
        channel: String,
        /// The channel that may have been meant.
        nearest: Option<String>,
        /// The channels that there are.
        known: Vec<String>,
    },
    /// The size is not in a unit of the channel.
    SizeUnit {
        /// The channel.
        channel: String,
        /// The unit of the size.
        found: Box<Unit>,
        /// A unit that fits.
        wanted: Box<Unit>,
    },
    /// There is no size, and no usual one for the unit.
    NoSize {
        /// The channel.
        channel: String,
        /// The kind of fault.
        kind: FaultKind,
        /// The unit of the channel.
        unit: Box<Unit>,
    },
    /// It begins after the last row, and nothing has failed.
    Late {
        /// The channel.
        channel: String,
        /// When it begins, after the first row.
        from: Duration,
        /// From the first row to the last, of the longest segment.
        length: Duration,
    },
    /// The text is not a fault.
    Text {
        /// The part that is not understood.
        part: String,
        /// What it should be.
        reason: String,
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
                "fault {}: from {} for {}; the start must not be negative and the length must be above 0",
                fault + 1,
                Duration::from_ns(*from_ns),
                Duration::from_ns(*for_ns)
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
            Self::Late {
                channel,
                from,
                length,
            } => write!(
                f,
                "the fault of `{channel}` begins {from} after the first row, and the data last {length}: nothing has failed; let it begin \
                 sooner"
            ),
            Self::UnknownChannel {
                channel,
                nearest,
                known,
            } => {
                write!(f, "there is no channel `{channel}`")?;
                match nearest {
                    Some(nearest) => write!(f, ", did you mean `{nearest}`?"),
                    None => write!(f, "; there are {}", known.join(", ")),
                }
            }
            Self::SizeUnit {
                channel,
                found,
                wanted,
            } => write!(
                f,
                "the size of a fault of `{channel}` is in {found}; it must be in {wanted}"
            ),
            Self::NoSize {
                channel,
                kind,
                unit,
            } => write!(
                f,
                "a `{}` of `{channel}` needs a size in {}",
                kind.name(),
                unit.difference()
            ),
            Self::Text { part, reason } => write!(f, "fault `{part}`: {reason}"),
        }
    }
}

impl From<FaultError> for Failure {
    fn from(error: FaultError) -> Self {
        Self::Request(error.to_string())
    }
}

athermal_core::register_error!(FaultError);

impl std::error::Error for FaultError {}
