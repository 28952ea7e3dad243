//! Where regressors are found among what gathers have read.

use std::ops::Range;

use super::gather::Gathered;
use crate::compile::{Entry, Gather};
use crate::time::Instant;

/// Regressors that follow each other and are read by one gather.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Part {
    pub(crate) gather: usize,
    places: Places,
}

/// Where regressors are within their gather.
#[derive(Debug, Clone, PartialEq)]
enum Places {
    SideBySide(Range<usize>),
    Apart(Box<[usize]>),
}

impl Part {
    pub(crate) fn new(gather: usize, places: &[usize]) -> Self {
        let first = places.first().copied().unwrap_or(0);
        let range = first..first + places.len();
        let side_by_side = range.clone().eq(places.iter().copied());
        Self {
            gather,
            places: if side_by_side {
                Places::SideBySide(range)
            } else {
                Places::Apart(places.into())
            },
        }
    }

    pub(crate) fn len(&self) -> usize {
        match &self.places {
            Places::SideBySide(range) => range.len(),
            Places::Apart(places) => places.len(),
        }
    }

    /// What its regressors are.
    pub(crate) fn entries(&self, gathers: &[Gather]) -> Vec<Entry> {
        let entries = &gathers[self.gather].entries;
        match &self.places {
            Places::SideBySide(range) => entries[range.clone()].to_vec(),
            Places::Apart(places) => places.iter().map(|&place| entries[place]).collect(),
        }
    }

    /// Whether they lie side by side, so that they need not be copied.
    pub(crate) fn is_side_by_side(&self) -> bool {
        matches!(self.places, Places::SideBySide(_))
    }

    /// The values where they lie and the oldest stamp among them, where they lie side by side and are known to be all there.
    #[inline]
    pub(crate) fn in_place<'a>(&self, gathered: &'a [Gathered]) -> Option<(&'a [f64], Instant)> {
        let Places::SideBySide(range) = &self.places else {
            return None;
        };
        let from = &gathered[self.gather];
        Some((&from.values[range.clone()], from.stamp_of(range.len())?))
    }

    /// Reads its piece of a row: whether all of it is there, and the oldest stamp of what is.
    #[inline]
    pub(crate) fn read(&self, gathered: &[Gathered], piece: &mut [f64]) -> (bool, Instant) {
        let from = &gathered[self.gather];
        match &self.places {
            Places::SideBySide(range) => piece.copy_from_slice(&from.values[range.clone()]),
            Places::Apart(places) => {
                // Four by four as they are multiplied: what was written one by one is slow to be read as vectors.
                let (fours, rest) = piece.as_chunks_mut::<4>();
                let (places, places_of_rest) = places.as_chunks::<4>();
                for (four, places) in fours.iter_mut().zip(places) {
                    *four = places.map(|place| from.values[place]);
                }
                for (value, &place) in rest.iter_mut().zip(places_of_rest) {
                    *value = from.values[place];
                }
            }
        }
        match from.stamp_of(piece.len()) {
            Some(stamp) => (true, stamp),
            None => self.look_at_each(piece, &from.stamps),
        }
    }

    #[inline(never)]
    fn look_at_each(&self, piece: &[f64], stamps: &[Instant]) -> (bool, Instant) {
        let of_each = |nth: usize| match &self.places {
            Places::SideBySide(range) => stamps[range.start + nth],
            Places::Apart(places) => stamps[places[nth]],
        };
        let there = (0..piece.len()).filter(|&nth| !piece[nth].is_nan());
        let (count, oldest) = there.fold((0, Instant::MAX), |(count, oldest), nth| {
            (count + 1, oldest.min(of_each(nth)))
        });
        (count == piece.len(), oldest)
    }
}
