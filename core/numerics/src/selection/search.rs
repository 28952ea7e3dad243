//! Greedy searches for the best set of regressors. Decides the order in which candidates come and go and when to stop; does
//! not decide how rows are cut into folds, nor the final coefficients.

use super::fold_state::FoldState;
use super::{CandidateScore, Candidates, Change, Selection, SelectionScore, SelectionStep, Start};
use crate::checks::{check_parameter, check_penalty, check_splits};
use crate::quiet_folds::quiet_folds;
use crate::{Folds, GramBlocks, NumericsError, Split};
use std::borrow::Cow;

/// Takes or drops, step by step, what improves the mean test score most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Which way it goes.
    pub direction: Direction,
    /// The ridge penalty on the sum of squares in the scaled columns; 0 for ordinary least squares.
    pub alpha: f64,
    /// Stop before a step that adds less for each of its units, or whose removal loses more; without it go on to the end. It is
    /// the price of a unit too: several that come together are taken before one alone where that is worth it.
    pub tolerance: Option<f64>,
    /// End with at most so many units; without it, any number.
    pub most: Option<usize>,
    /// What is averaged over the folds.
    pub score: SelectionScore,
}

/// Which way a search goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From nothing, adding the best.
    Forward,
    /// From everything, taking out what is missed least, down to one unit.
    Backward,
    /// Forward, and after each step back for as long as that gives a better set than any of that size before, or than one that
    /// came with several units at once past that size (Pudil, Novovičová and Kittler 1994).
    Floating,
}

/// A search under way.
struct State<'a> {
    how: &'a Search,
    candidates: &'a Candidates,
    folds: Vec<FoldState>,
    units: Vec<bool>,
    columns: Vec<usize>,
    reached: f64,
    selection: Selection,
}

impl Search {
    /// Forward with ordinary least squares and R², all regressors in order of merit.
    pub fn forward() -> Self {
        Self {
            direction: Direction::Forward,
            alpha: 0.0,
            tolerance: None,
            most: None,
            score: SelectionScore::R2,
        }
    }

    /// Selects among columns, each fold scored by a model of its training rows. `scales` has one positive value per
    /// regressor, the same in all folds; see [`crate::Standardization`].
    ///
    /// # Errors
    /// See [`Search::over`]; also [`NumericsError::Folds`] when there are too few rows.
    pub fn run(
        &self,
        blocks: &GramBlocks,
        folds: &Folds,
        scales: &[f64],
    ) -> Result<Selection, NumericsError> {
        let candidates = Candidates::columns(scales.len());
        self.over(&blocks.splits(folds)?, scales, &candidates)
    }

    /// Selects among candidates over any pairs of training and test statistics. Each fold's model has its own intercept.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for a penalty or tolerance out of range, [`NumericsError::Scale`],
    /// [`NumericsError::Width`], [`NumericsError::NotFinite`], [`NumericsError::Folds`] without any fold or with an empty
    /// one.
    pub fn over(
        &self,
        splits: &[Split],
        scales: &[f64],
        candidates: &Candidates,
    ) -> Result<Selection, NumericsError> {
        self.check(splits, scales, candidates)?;
        let reversible = self.direction != Direction::Forward;
        let quiet = match self.score {
            SelectionScore::R2 => quiet_folds(splits),
            SelectionScore::NegativeRmse => Vec::new(),
        };
        let telling = splits.iter().enumerate();
        let telling = telling.filter(|(fold, _)| !quiet.contains(fold));
        let mut state = State {
            how: self,
            candidates,
            folds: telling
                .map(|(_, split)| FoldState::new(split, scales, self.alpha, reversible))
                .collect(),
            units: vec![false; candidates.units()],
            columns: Vec::new(),
            reached: f64::NEG_INFINITY,
            selection: Selection {
                start: None,
                steps: Vec::new(),
                refused: None,
                columns: Vec::new(),
                path: Vec::new(),
                quiet,
                too_large: 0,
            },
        };
        if self.direction != Direction::Backward {
            state.start_with_free();
        }
        match self.direction {
            Direction::Forward => while state.add() {},
            Direction::Floating => state.float(),
            Direction::Backward => {
                state.start_with_all();
                while state.remove() {}
            }
        }
        let mut selection = state.selection;
        selection.columns = state.columns;
        Ok(selection)
    }

    fn check(
        &self,
        splits: &[Split],
        scales: &[f64],
        candidates: &Candidates,
    ) -> Result<(), NumericsError> {
        check_penalty(self.alpha)?;
        let tolerance = self.tolerance.unwrap_or(0.0);
        check_parameter("tolerance", tolerance, !tolerance.is_nan(), "a number")?;
        if candidates.width() != scales.len() {
            return Err(NumericsError::Width {
                expected: scales.len(),
                found: candidates.width(),
            });
        }
        check_splits(splits, scales)
    }
}

impl State<'_> {
    fn size(&self) -> usize {
        self.units.iter().filter(|there| **there).count()
    }

    /// Adds the best candidate, if it is worth it.
    fn add(&mut self) -> bool {
        let most = self.how.most.unwrap_or(usize::MAX);
        let adding = (0..self.candidates.count()).filter(|&candidate| {
            let new = self.new_units(candidate);
            new > 0 && self.size() + new <= most
        });
        let moves: Vec<usize> = adding.collect();
        let Some(step) = self.best(&moves, Change::Added) else {
            return false;
        };
        // Positive so that a gain of NaN stops too.
        let worth = step.mean - self.price(step.candidate, step.change);
        let gains_enough = |tolerance: f64| worth - self.reached >= tolerance;
        if !self.how.tolerance.is_none_or(gains_enough) {
            self.selection.refused = Some(step);
            return false;
        }
        self.take(step);
        true
    }

    /// How many units a candidate brings that are not there yet.
    fn new_units(&self, candidate: usize) -> usize {
        let units = self.candidates.units_of(candidate).iter();
        units.filter(|&&unit| !self.units[unit]).count()
    }

    /// What a candidate must gain beyond what one unit must.
    fn price(&self, candidate: usize, change: Change) -> f64 {
        match (change, self.how.tolerance) {
            (Change::Added, Some(tolerance)) => {
                tolerance.max(0.0) * self.new_units(candidate).saturating_sub(1) as f64
            }
            _ => 0.0,
        }
    }

    /// Takes out the unit that is missed least, if that is worth it.
    fn remove(&mut self) -> bool {
        let size = self.size();
        if size <= 1 {
            return false;
        }
        let there: Vec<usize> = (0..self.units.len()).filter(|&u| self.units[u]).collect();
        let Some(step) = self.best(&there, Change::Removed) else {
            return false;
        };
        let too_many = self.how.most.is_some_and(|most| size > most);
        if too_many {
            self.selection.too_large = self.selection.path.len();
        }
        let loses_little = |tolerance: f64| self.reached - step.mean <= tolerance;
        if !(too_many || self.how.tolerance.is_none_or(loses_little)) {
            self.selection.refused = Some(step);
            return false;
        }
        self.take(step);
        true
    }

    fn float(&mut self) {
        let mut records = vec![f64::NEG_INFINITY; self.units.len() + 1];
        loop {
            let (before, smaller) = (self.units.clone(), self.size());
            if !self.add() {
                return;
            }
            // What jumps over a size stands there too: a set of that size that is worse is no way back.
            for record in &mut records[smaller + 1..=self.size()] {
                *record = record.max(self.reached);
            }
            let new: Vec<bool> = (0..before.len())
                .map(|unit| self.units[unit] && !before[unit])
                .collect();
            while self.size() > 2 {
                let old = (0..before.len()).filter(|&unit| self.units[unit] && !new[unit]);
                let old: Vec<usize> = old.collect();
                let Some(step) = self.best(&old, Change::Removed) else {
                    break;
                };
                let record = &mut records[self.size() - 1];
                if step.mean.is_nan() || step.mean <= *record {
                    break;
                }
                *record = step.mean;
                self.take(step);
            }
        }
    }

    fn include(&mut self, column: usize) {
        self.columns.push(column);
        for fold in &mut self.folds {
            fold.turn(column, Change::Added);
        }
    }

    /// Columns that cost nothing are there from the start, so that the first unit too is worth only what it adds to them.
    fn start_with_free(&mut self) {
        self.candidates
            .free()
            .for_each(|column| self.include(column));
        if !self.columns.is_empty() {
            self.start(Vec::new());
        }
    }

    fn start_with_all(&mut self) {
        let mut left_out = Vec::new();
        for column in 0..self.candidates.width() {
            if self.folds.iter().any(|fold| fold.combines(column)) {
                left_out.push(column);
                continue;
            }
            self.include(column);
        }
        for unit in 0..self.units.len() {
            let columns = self.candidates.of_unit(unit);
            self.units[unit] = columns.iter().any(|column| self.columns.contains(column));
        }
        self.start(left_out);
    }

    /// Notes the score of what is there before the first step.
    fn start(&mut self, left_out: Vec<usize>) {
        let score = self.how.score;
        let folds: Vec<f64> = self.folds.iter().map(|f| f.present_score(score)).collect();
        let mean = folds.iter().sum::<f64>() / folds.len() as f64;
        self.reached = mean;
        self.selection.path.push(self.columns.clone());
        self.selection.start = Some(Start {
            mean,
            folds,
            left_out,
        });
    }

    fn changed(&self, candidate: usize, change: Change) -> Cow<'_, [usize]> {
        match change {
            Change::Added => self.candidates.coming(candidate, &self.units),
            Change::Removed => Cow::Borrowed(self.candidates.of_unit(candidate)),
        }
    }

    fn best(&self, moves: &[usize], change: Change) -> Option<SelectionStep> {
        let score = self.how.score;
        let mut candidates = Vec::with_capacity(moves.len());
        let mut best: Option<(CandidateScore, Cow<'_, [usize]>)> = None;
        let mut highest = f64::NEG_INFINITY;
        for &candidate in moves {
            let columns = self.changed(candidate, change);
            let tells = change == Change::Removed
                || columns
                    .iter()
                    .any(|&column| self.folds.iter().any(|fold| fold.varies(column)));
            let mean = if tells {
                let folds = self.folds.iter();
                let sum: f64 = folds.map(|f| f.score(&columns, change, score)).sum();
                sum / self.folds.len() as f64
            } else {
                f64::NAN
            };
            let tried = CandidateScore { candidate, mean };
            let worth = mean - self.price(candidate, change);
            if worth.is_finite() && worth > highest {
                highest = worth;
                best = Some((tried, columns));
            }
            candidates.push(tried);
        }
        best.map(|(CandidateScore { candidate, mean }, columns)| {
            let folds = self.folds.iter();
            SelectionStep {
                candidate,
                change,
                mean,
                folds: folds.map(|f| f.score(&columns, change, score)).collect(),
                candidates,
            }
        })
    }

    fn take(&mut self, step: SelectionStep) {
        let columns = self.changed(step.candidate, step.change).into_owned();
        let added = step.change == Change::Added;
        for fold in &mut self.folds {
            for &column in &columns {
                fold.turn(column, step.change);
            }
        }
        for &unit in self.candidates.units_of(step.candidate) {
            self.units[unit] = added;
        }
        if added {
            self.columns.extend(columns);
        } else {
            self.columns.retain(|column| !columns.contains(column));
        }
        self.reached = step.mean;
        self.selection.path.push(self.columns.clone());
        self.selection.steps.push(step);
    }
}
