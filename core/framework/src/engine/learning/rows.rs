//! Rows of numbers in one piece of memory, while they wait.

use serde::{Deserialize, Serialize};

use crate::time::Instant;

/// Rows of as many numbers each and their instants, the oldest first. A row lies in one piece, and room is made by a part until the number
/// of rows is known.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(into = "InOrder", try_from = "InOrder")]
pub(crate) struct Rows {
    width: usize,
    times: Vec<Instant>,
    numbers: Vec<f64>,
    first: usize,
    len: usize,
}

/// Rows as they are kept: the same whatever room there is.
#[derive(Serialize, Deserialize)]
struct InOrder {
    width: usize,
    times: Vec<Instant>,
    numbers: Vec<f64>,
}

impl From<Rows> for InOrder {
    fn from(rows: Rows) -> Self {
        Self {
            width: rows.width,
            times: (0..rows.len).filter_map(|nth| rows.time(nth)).collect(),
            numbers: (0..rows.len)
                .flat_map(|nth| rows.row(nth))
                .copied()
                .collect(),
        }
    }
}

impl TryFrom<InOrder> for Rows {
    type Error = &'static str;

    fn try_from(kept: InOrder) -> Result<Self, Self::Error> {
        if kept.times.len().checked_mul(kept.width) != Some(kept.numbers.len()) {
            return Err("rows of runs have another length than stated");
        }
        let mut rows = Self::new(kept.width);
        for (nth, at) in kept.times.iter().enumerate() {
            let numbers = &kept.numbers[nth * kept.width..][..kept.width];
            rows.push(*at).copy_from_slice(numbers);
        }
        Ok(rows)
    }
}

impl Rows {
    /// None yet.
    pub(crate) fn new(width: usize) -> Self {
        Self {
            width,
            times: vec![Instant::MIN; 4],
            numbers: vec![0.0; 4 * width],
            first: 0,
            len: 0,
        }
    }

    pub(crate) fn width(&self) -> usize {
        self.width
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Room for one more row, in which anything may stand.
    #[inline]
    pub(crate) fn push(&mut self, at: Instant) -> &mut [f64] {
        if self.len == self.times.len() {
            self.grow();
        }
        let index = self.index(self.len);
        self.len += 1;
        self.times[index] = at;
        &mut self.numbers[index * self.width..][..self.width]
    }

    /// The instant of a row, counted from the oldest.
    #[inline]
    pub(crate) fn time(&self, nth: usize) -> Option<Instant> {
        (nth < self.len).then(|| self.times[self.index(nth)])
    }

    /// A row, counted from the oldest; anything where there is none.
    #[inline]
    pub(crate) fn row(&self, nth: usize) -> &[f64] {
        &self.numbers[self.index(nth) * self.width..][..self.width]
    }

    /// Forgets the oldest row.
    #[inline]
    pub(crate) fn pop(&mut self) {
        if self.len > 0 {
            self.first = self.index(1);
            self.len -= 1;
        }
    }

    /// Forgets all rows.
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Makes room for half as many rows more as there are, and for a few.
    pub(crate) fn reserve(&mut self) {
        self.grow_to(self.len + self.len / 2 + 8);
    }

    #[inline]
    fn index(&self, nth: usize) -> usize {
        let index = self.first + nth;
        let beyond = index.checked_sub(self.times.len());
        beyond.unwrap_or(index)
    }

    #[cold]
    fn grow(&mut self) {
        self.grow_to(self.times.len() + (self.times.len() / 32).max(4));
    }

    fn grow_to(&mut self, room: usize) {
        let more = room.saturating_sub(self.times.len());
        self.times.rotate_left(self.first);
        self.numbers.rotate_left(self.first * self.width);
        self.first = 0;
        self.times.reserve_exact(more);
        self.times.resize(self.times.len() + more, Instant::MIN);
        self.numbers.reserve_exact(more * self.width);
        self.numbers.resize(self.times.len() * self.width, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prng::Prng;

    #[test]
    fn rows_come_out_whole_and_in_the_order_in_which_they_went_in() {
        let mut random = Prng::stream(3, "rows");
        let mut rows = Rows::new(3);
        let (mut pushed, mut popped) = (0, 0);
        for _ in 0..10_000 {
            if random.normal() > 0.02 * f64::from(pushed - popped) - 1.0 {
                rows.push(Instant::from_ns(i64::from(pushed)))
                    .fill(f64::from(pushed));
                pushed += 1;
            } else if pushed > popped {
                rows.pop();
                popped += 1;
            }
            for (nth, number) in (popped..pushed).enumerate() {
                assert_eq!(rows.time(nth).map(Instant::as_ns), Some(i64::from(number)));
                assert_eq!(rows.row(nth), [f64::from(number); 3]);
            }
            assert_eq!(rows.time(rows.len()), None);
        }
        assert!(popped > 1000 && rows.times.len() < 512, "{popped}");
    }

    #[test]
    fn what_is_kept_of_rows_does_not_depend_on_how_much_room_they_had() {
        let mut rows = Rows::new(2);
        for nth in 0..11 {
            rows.push(Instant::from_ns(nth)).fill(nth as f64);
            if nth % 2 == 0 {
                rows.pop();
            }
        }
        let kept = serde_json::to_string(&rows).unwrap();
        let mut read: Rows = serde_json::from_str(&kept).unwrap();
        read.reserve();
        assert_ne!(read.times.len(), rows.times.len());
        assert_eq!(serde_json::to_string(&read).unwrap(), kept);
        assert_eq!((read.len(), read.row(4)), (5, &[10.0, 10.0][..]));
        let cut = kept.replacen("10.0,", "", 1);
        assert!(serde_json::from_str::<Rows>(&cut).is_err(), "{cut}");
    }
}
