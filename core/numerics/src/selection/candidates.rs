//! What a selection adds or takes away at a time. Decides which columns follow from which units; does not decide which unit
//! is worth having.

use std::borrow::Cow;

/// Columns that come and go together.
///
/// A unit is a thing that costs something: a column, or a sensor from which several columns are made. A column is there
/// when all its units are. Candidates to be added are all sets of units that some column needs; to be taken away, single
/// units. Candidate `i` is unit `i` alone while `i` is below the number of units.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Candidates {
    /// The units that each column needs.
    needs: Vec<Vec<usize>>,
    /// The units of each candidate.
    sets: Vec<Vec<usize>>,
    /// The columns that need each unit.
    of_unit: Vec<Vec<usize>>,
}

impl Candidates {
    /// Each of so many columns by itself.
    pub fn columns(width: usize) -> Self {
        Self::of_units((0..width).map(|column| vec![column]).collect())
    }

    /// Columns that need the given units, counted from 0.
    pub fn of_units(mut needs: Vec<Vec<usize>>) -> Self {
        for units in &mut needs {
            units.sort_unstable();
            units.dedup();
        }
        let units = needs.iter().flatten().max().map_or(0, |&last| last + 1);
        let mut of_unit = vec![Vec::new(); units];
        for (column, wanted) in needs.iter().enumerate() {
            for &unit in wanted {
                of_unit[unit].push(column);
            }
        }
        let mut sets: Vec<Vec<usize>> = (0..units).map(|unit| vec![unit]).collect();
        for wanted in needs.iter().filter(|wanted| wanted.len() > 1) {
            if !sets.contains(wanted) {
                sets.push(wanted.clone());
            }
        }
        Self {
            needs,
            sets,
            of_unit,
        }
    }

    /// How many columns there are.
    pub fn width(&self) -> usize {
        self.needs.len()
    }

    /// How many units there are.
    pub fn units(&self) -> usize {
        self.of_unit.len()
    }

    /// How many candidates there are.
    pub(super) fn count(&self) -> usize {
        self.sets.len()
    }

    /// The units of a candidate.
    ///
    /// # Panics
    /// When there is no such candidate.
    pub fn units_of(&self, candidate: usize) -> &[usize] {
        &self.sets[candidate]
    }

    /// The columns that come when a candidate joins the units there.
    pub(super) fn coming(&self, candidate: usize, there: &[bool]) -> Cow<'_, [usize]> {
        if self.sets.len() == self.units() {
            return Cow::Borrowed(&self.of_unit[candidate]);
        }
        let joining = &self.sets[candidate];
        let new = |units: &Vec<usize>| {
            units.iter().any(|unit| !there[*unit])
                && units
                    .iter()
                    .all(|unit| there[*unit] || joining.contains(unit))
        };
        let columns = (0..self.width()).filter(|&column| new(&self.needs[column]));
        Cow::Owned(columns.collect())
    }

    /// The columns that need nothing, and so are always there.
    pub(super) fn free(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.width()).filter(|&column| self.needs[column].is_empty())
    }

    /// The columns that cannot be there without a unit.
    pub(super) fn of_unit(&self, unit: usize) -> &[usize] {
        &self.of_unit[unit]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_of_two_sensors_comes_with_the_second_and_goes_with_either() {
        let sensors = Candidates::of_units(vec![vec![0], vec![0], vec![1], vec![1, 0]]);
        assert_eq!(sensors.count(), 3);
        assert_eq!(sensors.units_of(2), [0, 1]);
        assert_eq!(sensors.coming(0, &[false, false])[..], [0, 1]);
        assert_eq!(sensors.coming(1, &[true, false])[..], [2, 3]);
        assert_eq!(sensors.coming(2, &[false, false])[..], [0, 1, 2, 3]);
        assert_eq!(sensors.of_unit(0), [0, 1, 3]);
    }

    #[test]
    fn alone_every_column_is_its_own_unit() {
        let columns = Candidates::columns(3);
        assert_eq!(columns.units(), 3);
        assert_eq!(columns.coming(1, &[true, false, false])[..], [1]);
        assert_eq!(columns.of_unit(2), [2]);
    }
}
