//! Values in order of size, for medians that come and go with a window. Decides how they are kept; not which values belong.

use std::collections::VecDeque;

/// How many values a block holds: all of a usual window, about the square root of one of 5 h at 10 Hz.
const BLOCK: usize = 512;

/// Values in order of size.
///
/// They stand in blocks that are full up to the last, so that any place is found without a search. One that comes or goes moves
/// others in its own block, and one at either end of each block behind (the tiered vectors of Goodrich and Kloss 1999); all in
/// one piece, half of a long window would move with every sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sorted {
    /// The first block, most often the only one. Nothing ever comes or goes at its front.
    first: Vec<f64>,
    behind: Vec<VecDeque<f64>>,
    count: usize,
}

impl Sorted {
    pub(crate) fn insert(&mut self, value: f64) {
        let place = self.place(|other| other.total_cmp(&value).is_lt());
        self.count += 1;
        if self.count > BLOCK * (1 + self.behind.len()) {
            // As many as there are, as a vector grows.
            self.reserve(self.count);
        }
        let (mut moved, mut place) = match place.checked_sub(BLOCK) {
            Some(behind) => (Some(value), behind),
            None => {
                self.first.insert(place, value);
                (self.first.get(BLOCK).copied(), 0)
            }
        };
        self.first.truncate(BLOCK);
        for block in &mut self.behind[place / BLOCK..] {
            let Some(value) = moved else { break };
            block.insert(place % BLOCK, value);
            (moved, place) = (block.get(BLOCK).copied(), 0);
            block.truncate(BLOCK);
        }
    }

    /// Takes out a value that was put in.
    pub(crate) fn remove(&mut self, value: f64) {
        let place = self.place(|other| other.total_cmp(&value).is_lt());
        if place == self.count || self.at(place).to_bits() != value.to_bits() {
            return;
        }
        self.count -= 1;
        let mut block = match place.checked_sub(BLOCK) {
            Some(behind) => {
                self.behind[behind / BLOCK].remove(behind % BLOCK);
                behind / BLOCK
            }
            None => {
                self.first.remove(place);
                let next = self.behind.first_mut().and_then(VecDeque::pop_front);
                self.first.extend(next);
                0
            }
        };
        while let Some(next) = self.behind.get_mut(block + 1).and_then(VecDeque::pop_front) {
            self.behind[block].push_back(next);
            block += 1;
        }
    }

    pub(crate) fn clear(&mut self) {
        self.first.clear();
        self.behind.iter_mut().for_each(VecDeque::clear);
        self.count = 0;
    }

    /// Makes room for so many values more, so that a stretch of time that holds more than before need not.
    pub(crate) fn reserve(&mut self, values: usize) {
        let all = self.count + values;
        let first = self.first.len();
        // While one is moved on, a block has one too many.
        self.first.reserve(all.min(BLOCK + 1).saturating_sub(first));
        while all > BLOCK * (1 + self.behind.len()) {
            self.behind.push(VecDeque::with_capacity(BLOCK + 1));
        }
    }

    fn at(&self, place: usize) -> f64 {
        match place.checked_sub(BLOCK) {
            Some(behind) => self.behind[behind / BLOCK][behind % BLOCK],
            None => self.first[place],
        }
    }

    /// The place of the first value that does not lie before another.
    fn place(&self, lies_before: impl Fn(&f64) -> bool) -> usize {
        if self.count <= BLOCK || !lies_before(&self.first[BLOCK - 1]) {
            return self.first.partition_point(lies_before);
        }
        let before = |block: &VecDeque<f64>| block.back().is_some_and(&lies_before);
        let block = self.behind.partition_point(before);
        let within = self.behind.get(block);
        let within = within.map_or(0, |within| within.partition_point(&lies_before));
        (BLOCK * (1 + block) + within).min(self.count)
    }

    /// The value in the middle, or the mean of the two in the middle; NaN of nothing.
    pub(crate) fn median(&self) -> f64 {
        match (self.count.wrapping_sub(1) / 2, self.count / 2) {
            _ if self.count == 0 => f64::NAN,
            (left, right) if left == right => self.at(left),
            (left, right) => 0.5 * self.at(left) + 0.5 * self.at(right),
        }
    }

    /// The median of the absolute deviations from a centre; NaN of nothing.
    pub(crate) fn deviation(&self, centre: f64) -> f64 {
        if self.count == 0 {
            return f64::NAN;
        }
        // On either side of the centre the deviations are in order already: what is sought is how many of the smaller half
        // are below the centre.
        let split = self.place(|&value| value < centre);
        let below = |i: usize| centre - self.at(split - 1 - i);
        let above = |i: usize| self.at(split + i) - centre;
        let half = self.count / 2;
        let (mut least, mut most) = (half.saturating_sub(self.count - split), half.min(split));
        while least < most {
            let taken = least.midpoint(most);
            if below(taken) <= above(half - taken - 1) {
                least = taken + 1;
            } else {
                most = taken;
            }
        }
        let (left, right) = (least, half - least);
        let next = f64::min(
            if left < split {
                below(left)
            } else {
                f64::INFINITY
            },
            if split + right < self.count {
                above(right)
            } else {
                f64::INFINITY
            },
        );
        let last = f64::max(
            if left > 0 {
                below(left - 1)
            } else {
                f64::NEG_INFINITY
            },
            if right > 0 {
                above(right - 1)
            } else {
                f64::NEG_INFINITY
            },
        );
        if self.count % 2 == 1 || last == next {
            next
        } else {
            0.5 * last + 0.5 * next
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

    #[test]
    fn a_window_of_several_blocks_has_the_medians_of_its_values_sorted_anew() {
        let middle = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            let (left, right) = ((values.len() - 1) / 2, values.len() / 2);
            match values[left] == values[right] {
                true => values[right],
                false => 0.5 * values[left] + 0.5 * values[right],
            }
        };
        let mut sorted = Sorted::default();
        let mut window = VecDeque::new();
        let mut random = 1_u64;
        // The window grows to five blocks, stays, shrinks to nothing and grows again; many of its values are equal.
        for step in 0..12_000_usize {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let wanted = match step {
                ..5_000 => 5 * BLOCK,
                5_000..8_000 => 8_000 - step,
                _ => 3 * BLOCK + 1,
            };
            let value = (random >> 53) as f64 / 7.0 - 146.0 + (step as f64 * 0.01).sin();
            let value = if step % 3 == 0 { value.round() } else { value };
            sorted.insert(value);
            window.push_back(value);
            while window.len() > wanted {
                sorted.remove(window.pop_front().unwrap());
            }
            if step % 61 != 0 || window.is_empty() {
                continue;
            }
            let median = middle(&mut window.iter().copied().collect());
            assert_eq!(
                sorted.median().to_bits(),
                median.to_bits(),
                "at step {step}"
            );
            let deviation = middle(&mut window.iter().map(|x| (x - median).abs()).collect());
            let found = sorted.deviation(median);
            assert_eq!(found.to_bits(), deviation.to_bits(), "at step {step}");
        }
    }

    #[test]
    fn a_window_that_has_been_as_full_before_needs_no_more_room() {
        let mut sorted = Sorted::default();
        sorted.reserve(3 * BLOCK);
        let room = |sorted: &Sorted| {
            let behind = sorted.behind.iter().map(VecDeque::capacity).sum::<usize>();
            sorted.first.capacity() + behind
        };
        let before = room(&sorted);
        for i in 0..3 * BLOCK {
            sorted.insert((i * 7 % 1000) as f64);
        }
        sorted.clear();
        for i in 0..3 * BLOCK {
            sorted.insert(-(i as f64));
        }
        assert_eq!(room(&sorted), before);
    }
}
