//! A decision in the journal, and its bytes.

use std::hash::Hasher;

use crate::channel::ABSENT;
use crate::sequencer::{Admission, Refusal, Sample, Timeline};
use crate::time::{Duration, Instant};

/// What was decided. A replay applies it without a clock or a threshold.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// A sample waits for its tick.
    Sample(Sample),
    /// A sample came after its tick.
    Late(Sample),
    /// A sample came again.
    Twice(Sample),
    /// A sample was refused.
    Refused(Sample, Refusal),
    /// A sample is too far ahead, and waits until it is decided on; what becomes of it has a record of its own.
    Waits(Sample),
    /// All that waits up to an instant was stepped.
    Tick {
        /// The instant.
        at: Instant,
        /// What came of it; see [`output_hash`].
        hash: u64,
    },
    /// Time passed without samples.
    Beat {
        /// The instant.
        at: Instant,
        /// As of a tick.
        hash: u64,
    },
    /// What follows belongs to another segment.
    Break {
        /// Whether its times may start again.
        afresh: bool,
    },
    /// Learning was frozen, or went on.
    Freeze(bool),
    /// The stamps of a source are shifted from now on.
    Shift {
        /// The source.
        source: u32,
        /// What is added to its stamps.
        offset: Duration,
    },
    /// A source lags behind the host by so much at the least.
    Lag {
        /// The source.
        source: u32,
        /// The host's time at an arrival less its stamp.
        least: Duration,
    },
    /// What a source gives next is left of so many samples, which are not in the journal themselves.
    Thinned {
        /// The source.
        source: u32,
        /// How many samples.
        samples: u64,
    },
    /// Another graph takes over before the next tick. Its model is kept beside the journal.
    Swap {
        /// The digits of its revision as a number.
        revision: u64,
    },
    /// A remark for whoever reads the journal.
    Note(Box<str>),
}

/// A hash of the bits of outputs. All that is absent counts the same, whatever a processor makes of NaN.
#[must_use]
pub fn output_hash(outputs: &[f64]) -> u64 {
    let mut hash = crate::engine::Fnv1a::default();
    for output in outputs {
        let bits = if output.is_nan() { ABSENT } else { *output }.to_bits();
        hash.write(&bits.to_le_bytes());
    }
    hash.finish()
}

const SAMPLE: u8 = 2;
const LATE: u8 = 3;
const TWICE: u8 = 4;
const REFUSED: u8 = 5;
const TICK: u8 = 6;
const BEAT: u8 = 7;
const BREAK: u8 = 8;
const FREEZE: u8 = 9;
const SHIFT: u8 = 10;
const SWAP: u8 = 11;
const NOTE: u8 = 12;
// 13 is a mark of the file itself.
const WAITS: u8 = 14;
const LAG: u8 = 15;
const THINNED: u8 = 16;

impl Record {
    /// The record of what became of a sample; none while that is open.
    #[must_use]
    pub fn of(admission: Admission) -> Option<Self> {
        Some(match admission {
            Admission::Accepted(sample) => Self::Sample(sample),
            Admission::Late(sample) => Self::Late(sample),
            Admission::Twice(sample) => Self::Twice(sample),
            Admission::Refused(sample, refusal) => Self::Refused(sample, refusal),
            Admission::Waits(sample) => Self::Waits(sample),
            Admission::Held => return None,
        })
    }

    /// Does to a timeline what was decided. A tick or beat is not stepped here.
    pub(crate) fn apply(&self, timeline: &mut Timeline) {
        match self {
            Self::Sample(sample) => {
                timeline.accept(*sample);
            }
            Self::Tick { at, .. } | Self::Beat { at, .. } => {
                timeline.tick(*at);
            }
            Self::Break { afresh } => timeline.segment(*afresh),
            Self::Shift { source, offset } => timeline.shift(*source as usize, *offset),
            Self::Lag { source, least } => timeline.lag(*source as usize, *least),
            Self::Waits(sample) => timeline.wait(*sample),
            Self::Late(sample) | Self::Twice(sample) | Self::Refused(sample, _) => {
                timeline.decided(*sample);
            }
            Self::Freeze(_) | Self::Swap { .. } | Self::Note(_) | Self::Thinned { .. } => {}
        }
    }

    /// Whether an engine takes part: a tick, a beat, a break, a freeze.
    #[must_use]
    pub fn is_happening(&self) -> bool {
        matches!(
            self,
            Self::Tick { .. } | Self::Beat { .. } | Self::Break { .. } | Self::Freeze(_)
        )
    }

    /// Appends the body, and returns the kind.
    pub(super) fn encode(&self, body: &mut Vec<u8>) -> u8 {
        let mut put = |bytes: &[u8]| body.extend_from_slice(bytes);
        let mut sample = |of: &Sample| {
            put(&of.channel.to_le_bytes());
            put(&of.stamp.as_ns().to_le_bytes());
            put(&of.value.to_bits().to_le_bytes());
        };
        match self {
            Self::Sample(of) => (sample(of), SAMPLE).1,
            Self::Late(of) => (sample(of), LATE).1,
            Self::Twice(of) => (sample(of), TWICE).1,
            Self::Waits(of) => (sample(of), WAITS).1,
            Self::Refused(of, refusal) => {
                sample(of);
                let (why, by) = match refusal {
                    Refusal::NoChannel => (0, Duration::ZERO),
                    Refusal::Future { ahead } => (1, *ahead),
                    Refusal::Clock { off } => (2, *off),
                };
                put(&[why]);
                put(&by.as_ns().to_le_bytes());
                REFUSED
            }
            Self::Tick { at, hash } | Self::Beat { at, hash } => {
                put(&at.as_ns().to_le_bytes());
                put(&hash.to_le_bytes());
                if matches!(self, Self::Tick { .. }) {
                    TICK
                } else {
                    BEAT
                }
            }
            Self::Break { afresh } => {
                put(&[u8::from(*afresh)]);
                BREAK
            }
            Self::Freeze(frozen) => {
                put(&[u8::from(*frozen)]);
                FREEZE
            }
            Self::Shift { source, offset: by } | Self::Lag { source, least: by } => {
                put(&source.to_le_bytes());
                put(&by.as_ns().to_le_bytes());
                if matches!(self, Self::Shift { .. }) {
                    SHIFT
                } else {
                    LAG
                }
            }
            Self::Thinned { source, samples } => {
                put(&source.to_le_bytes());
                put(&samples.to_le_bytes());
                THINNED
            }
            Self::Swap { revision } => {
                put(&revision.to_le_bytes());
                SWAP
            }
            Self::Note(text) => {
                put(text.as_bytes());
                NOTE
            }
        }
    }

    /// Reads a body of a kind; none where it is none.
    pub(super) fn decode(kind: u8, body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let record = match kind {
            SAMPLE => Self::Sample(fields.sample()?),
            LATE => Self::Late(fields.sample()?),
            TWICE => Self::Twice(fields.sample()?),
            WAITS => Self::Waits(fields.sample()?),
            REFUSED => {
                let sample = fields.sample()?;
                let [why] = fields.take()?;
                let by = fields.duration()?;
                let refusal = match why {
                    0 => Refusal::NoChannel,
                    1 => Refusal::Future { ahead: by },
                    2 => Refusal::Clock { off: by },
                    _ => return None,
                };
                Self::Refused(sample, refusal)
            }
            TICK | BEAT => {
                let at = fields.instant()?;
                let hash = fields.number()?;
                if kind == TICK {
                    Self::Tick { at, hash }
                } else {
                    Self::Beat { at, hash }
                }
            }
            BREAK => Self::Break {
                afresh: fields.flag()?,
            },
            FREEZE => Self::Freeze(fields.flag()?),
            SHIFT => Self::Shift {
                source: u32::from_le_bytes(fields.take()?),
                offset: fields.duration()?,
            },
            LAG => Self::Lag {
                source: u32::from_le_bytes(fields.take()?),
                least: fields.duration()?,
            },
            THINNED => Self::Thinned {
                source: u32::from_le_bytes(fields.take()?),
                samples: fields.number()?,
            },
            SWAP => Self::Swap {
                revision: fields.number()?,
            },
            NOTE => {
                let text = std::str::from_utf8(std::mem::take(&mut fields.0)).ok()?;
                Self::Note(text.into())
            }
            _ => return None,
        };
        fields.0.is_empty().then_some(record)
    }
}

/// What is left of a body.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    fn number(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn flag(&mut self) -> Option<bool> {
        match self.take()? {
            [0] => Some(false),
            [1] => Some(true),
            _ => None,
        }
    }

    fn instant(&mut self) -> Option<Instant> {
        Some(Instant::from_ns(self.number()?.cast_signed()))
    }

    fn duration(&mut self) -> Option<Duration> {
        Some(Duration::from_ns(self.number()?.cast_signed()))
    }

    fn sample(&mut self) -> Option<Sample> {
        Some(Sample {
            channel: u32::from_le_bytes(self.take()?),
            stamp: self.instant()?,
            value: f64::from_bits(self.number()?),
        })
    }
}
