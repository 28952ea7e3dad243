//! The bytes of a record in the journal.

use super::Record;

use crate::sequencer::{Refusal, Sample};
use crate::time::{Duration, Instant};

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

/// Appends the body, and returns the kind.
pub(super) fn encode(record: &Record, body: &mut Vec<u8>) -> u8 {
    let mut put = |bytes: &[u8]| body.extend_from_slice(bytes);
    let mut sample = |of: &Sample| {
        put(&of.channel.to_le_bytes());
        put(&of.stamp.as_ns().to_le_bytes());
        put(&of.value.to_bits().to_le_bytes());
    };
    match record {
        Record::Sample(of) => (sample(of), SAMPLE).1,
        Record::Late(of) => (sample(of), LATE).1,
        Record::Twice(of) => (sample(of), TWICE).1,
        Record::Waits(of) => (sample(of), WAITS).1,
        Record::Refused(of, refusal) => {
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
        Record::Tick { at, hash } | Record::Beat { at, hash } => {
            put(&at.as_ns().to_le_bytes());
            put(&hash.to_le_bytes());
            if matches!(record, Record::Tick { .. }) {
                TICK
            } else {
                BEAT
            }
        }
        Record::Break { afresh } => {
            put(&[u8::from(*afresh)]);
            BREAK
        }
        Record::Freeze(frozen) => {
            put(&[u8::from(*frozen)]);
            FREEZE
        }
        Record::Shift { source, offset: by } | Record::Lag { source, least: by } => {
            put(&source.to_le_bytes());
            put(&by.as_ns().to_le_bytes());
            if matches!(record, Record::Shift { .. }) {
                SHIFT
            } else {
                LAG
            }
        }
        Record::Thinned { source, samples } => {
            put(&source.to_le_bytes());
            put(&samples.to_le_bytes());
            THINNED
        }
        Record::Swap { revision } => {
            put(&revision.to_le_bytes());
            SWAP
        }
        Record::Note(text) => {
            put(text.as_bytes());
            NOTE
        }
    }
}

/// Reads a body of a kind; none where it is none.
pub(super) fn decode(kind: u8, body: &[u8]) -> Option<Record> {
    let mut fields = Fields(body);
    let record = match kind {
        SAMPLE => Record::Sample(fields.sample()?),
        LATE => Record::Late(fields.sample()?),
        TWICE => Record::Twice(fields.sample()?),
        WAITS => Record::Waits(fields.sample()?),
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
            Record::Refused(sample, refusal)
        }
        TICK | BEAT => {
            let at = fields.instant()?;
            let hash = fields.number()?;
            if kind == TICK {
                Record::Tick { at, hash }
            } else {
                Record::Beat { at, hash }
            }
        }
        BREAK => Record::Break {
            afresh: fields.flag()?,
        },
        FREEZE => Record::Freeze(fields.flag()?),
        SHIFT => Record::Shift {
            source: u32::from_le_bytes(fields.take()?),
            offset: fields.duration()?,
        },
        LAG => Record::Lag {
            source: u32::from_le_bytes(fields.take()?),
            least: fields.duration()?,
        },
        THINNED => Record::Thinned {
            source: u32::from_le_bytes(fields.take()?),
            samples: fields.number()?,
        },
        SWAP => Record::Swap {
            revision: fields.number()?,
        },
        NOTE => {
            let text = std::str::from_utf8(std::mem::take(&mut fields.0)).ok()?;
            Record::Note(text.into())
        }
        _ => return None,
    };
    fields.0.is_empty().then_some(record)
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
