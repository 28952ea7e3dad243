//! The rows of a machine by their values: how many there are, and the checksum by which they are known again. Not where they stand.

use std::cell::RefCell;
use std::hash::Hasher as _;

use athermal_core::compile::Plan;
use athermal_core::engine::Fnv1a;
use athermal_run::fit::{Blocks, FitError};
use athermal_run::model::DataCard;
use athermal_run::recording::{Event, Recording, Samples, Source, SourceError};
use serde::{Deserialize, Serialize};

/// What stands before a row and before a segment in what is summed.
const ROW: u8 = 0;
const SEGMENT: u8 = 1;

/// The rows of a machine, as a graph reads them.
///
/// The checksum is FNV-1a of 64 bits over all events in order: of a row a zero byte, its instant in ns and its values as doubles, in
/// the order and the units of the graph's channels and with the lowest byte first; of the beginning of a segment a byte of 1. What is
/// absent is one NaN. So the same numbers have the same checksum from CSV, Parquet and Arrow, in however many files.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RowsId {
    /// How many rows there are.
    pub rows: u64,
    /// How many bytes were summed.
    pub bytes: u64,
    /// The checksum in hexadecimal digits.
    pub hash: String,
}

impl RowsId {
    /// Reads all rows of a recording as a graph does.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn of(recording: &dyn Recording, plan: &Plan) -> Result<Self, SourceError> {
        let (mut source, mut samples) = (recording.open(plan)?, Samples::default());
        let mut sum = Sum::default();
        while let Some(event) = source.next(&mut samples)? {
            sum.add(event, &samples);
        }
        Ok(sum.id())
    }

    /// The rows that blocks were made of: of each block in order its day, lowest byte first, and the checksum of its rows.
    ///
    /// # Errors
    /// When a block cannot be read.
    pub fn of_blocks(blocks: &(impl Blocks + ?Sized)) -> Result<Self, FitError> {
        let mut sum = Sum::default();
        for nth in 0..blocks.count() {
            let read = blocks.read(nth, &mut |block| {
                sum.rows += block.ticks;
                sum.write(&block.day.to_le_bytes());
                sum.write(block.rows.as_bytes());
            });
            read.map_err(FitError::Recording)?;
        }
        Ok(sum.id())
    }

    /// These rows on the card of a model: without a path.
    #[must_use]
    pub fn card(&self) -> DataCard {
        DataCard {
            rows: self.rows,
            bytes: self.bytes,
            hash: self.hash.clone(),
            ..DataCard::default()
        }
    }
}

/// What has been read so far.
#[derive(Debug, Clone, Default)]
struct Sum {
    hash: Fnv1a,
    rows: u64,
    bytes: u64,
}

impl Sum {
    fn add(&mut self, event: Event, samples: &Samples) {
        match event {
            Event::Segment => self.write(&[SEGMENT]),
            Event::Row(time) => {
                self.rows += 1;
                self.write(&[ROW]);
                self.write(&time.as_ns().to_le_bytes());
                for &value in &samples.values {
                    let value = if value.is_nan() { f64::NAN } else { value };
                    self.write(&value.to_bits().to_le_bytes());
                }
            }
        }
    }

    fn write(&mut self, piece: &[u8]) {
        self.hash.write(piece);
        self.bytes += piece.len() as u64;
    }

    fn id(&self) -> RowsId {
        RowsId {
            rows: self.rows,
            bytes: self.bytes,
            hash: format!("{:016x}", self.hash.finish()),
        }
    }
}

/// A recording whose rows are summed whenever it is read to its end.
pub struct Summed<'a> {
    recording: &'a dyn Recording,
    /// What each reading to the end gave, if all gave the same.
    found: RefCell<Option<Result<RowsId, ()>>>,
}

impl<'a> Summed<'a> {
    /// One of a recording.
    #[must_use]
    pub fn new(recording: &'a dyn Recording) -> Self {
        let found = RefCell::new(None);
        Self { recording, found }
    }

    /// The rows; nothing where they were not the same each time, or were never read to their end.
    pub fn id(self) -> Option<RowsId> {
        self.found.into_inner()?.ok()
    }
}

impl Recording for Summed<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        Ok(Box::new(Summing {
            source: self.recording.open(plan)?,
            sum: Sum::default(),
            found: &self.found,
        }))
    }
}

struct Summing<'a> {
    source: Box<dyn Source + 'a>,
    sum: Sum,
    found: &'a RefCell<Option<Result<RowsId, ()>>>,
}

impl Source for Summing<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let next = self.source.next(samples)?;
        match next {
            Some(event) => self.sum.add(event, samples),
            None => {
                let (id, mut found) = (self.sum.id(), self.found.borrow_mut());
                let is_other = |of: &Result<RowsId, ()>| of.as_ref() != Ok(&id);
                *found = Some(if found.as_ref().is_some_and(is_other) {
                    Err(())
                } else {
                    Ok(id)
                });
            }
        }
        Ok(next)
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::time::Instant;

    use super::*;

    fn id(events: &[(Event, Vec<f64>)]) -> RowsId {
        let mut sum = Sum::default();
        for (event, values) in events {
            let samples = Samples {
                values: values.clone(),
                ..Samples::default()
            };
            sum.add(*event, &samples);
        }
        sum.id()
    }

    #[test]
    fn rows_are_known_by_instants_values_and_segments_and_nothing_else() {
        let row = |ns, values: &[f64]| (Event::Row(Instant::from_ns(ns)), values.to_vec());
        let other_nan = f64::from_bits(f64::NAN.to_bits() | 1);
        let of = id(&[row(0, &[1.0, f64::NAN]), row(5, &[2.0, 3.0])]);
        assert_eq!((of.rows, of.bytes), (2, 2 * (1 + 8 + 16)));
        assert_eq!(id(&[row(0, &[1.0, -other_nan]), row(5, &[2.0, 3.0])]), of);
        let others = [
            id(&[row(0, &[1.0, f64::NAN]), row(6, &[2.0, 3.0])]),
            id(&[row(0, &[1.0, 0.0]), row(5, &[2.0, 3.0])]),
            id(&[
                row(0, &[1.0, f64::NAN]),
                (Event::Segment, vec![]),
                row(5, &[2.0, 3.0]),
            ]),
            id(&[row(0, &[1.0, f64::NAN])]),
        ];
        assert!(others.iter().all(|other| other.hash != of.hash));
    }

    #[test]
    fn the_checksum_is_fnv_1a_of_the_stated_bytes() {
        let row = (Event::Row(Instant::from_ns(1)), vec![0.5]);
        let mut bytes = vec![0];
        bytes.extend(1_i64.to_le_bytes());
        bytes.extend(0.5_f64.to_le_bytes());
        bytes.push(1);
        let expected = athermal_core::engine::fnv_1a(&bytes);
        assert_eq!(
            id(&[row, (Event::Segment, vec![])]).hash,
            format!("{expected:016x}")
        );
    }
}
