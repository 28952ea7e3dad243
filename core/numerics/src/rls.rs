//! Recursive least squares that goes back to its fit. Decides one step; does not decide how regressors are scaled (they should be
//! standardised), nor which rows are learned from.

use crate::checks::{check_length, check_parameter};
use crate::dot::dot;
use crate::scratch::Scratch;
use crate::{Gram, NumericsError};
use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};

/// What a fit knows: where a recursion begins, and what it goes back to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RlsFit {
    /// In how many seconds what was learned fades to `1/e`; infinite where nothing does.
    #[serde(with = "memory")]
    pub memory_s: f64,
    /// The share `β` of the fit that what has faded goes back to, 0 to 1.
    pub share: f64,
    /// `θ₀`.
    pub coefficients: Vec<f64>,
    /// `R₀`, the inverse of their covariance in units of the noise variance: the lower triangle, row by row.
    pub information: Vec<f64>,
    /// How many rows that counts as.
    pub rows: f64,
    /// The variance of the noise.
    pub variance: f64,
}

/// What was learned since: all that a recursion goes on from, beside its fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learned {
    /// `R`, as of the fit.
    pub information: Vec<f64>,
    /// `θ₀`, to which it goes back: the fit's, moved with what has leapt.
    pub start: Vec<f64>,
    /// `c = b − Rθ₀`, by which the rows draw away from there.
    pub pull: Vec<f64>,
    /// How many rows it counts as.
    pub rows: f64,
    /// The squares of their errors.
    pub squares: f64,
}

/// A memory as JSON has it, which knows no infinity.
mod memory {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(of: &f64, to: S) -> Result<S::Ok, S::Error> {
        match of.is_finite() {
            true => to.serialize_some(of),
            false => to.serialize_none(),
        }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
    }
}

/// Recursive least squares whose past fades to a share of the fit (exponential resetting and forgetting: Salgado, Goodwin and
/// Middleton 1988; Kulhavý and Zarrop 1993): with `λ = exp(−Δt / memory)`
///
/// `R ← λR + (1 − λ)βR₀ + xxᵀ`, `b ← λb + (1 − λ)βR₀θ₀ + xy`, `θ = R⁻¹b`,
///
/// so that `P = R⁻¹ ≤ P₀/β` in every direction, and `θ` is `θ₀` where nothing was learned. `c = b − Rθ₀` is kept in the place of
/// `b`: `c ← λc + x(y − xᵀθ₀)`, `θ = θ₀ + R⁻¹c`. An intercept is a regressor that is 1 throughout.
///
/// Each row costs a Cholesky factor and its inverse: there is no rank-one form, since all of `R` goes back to `R₀`. What is serialised is
/// the fit; what was learned is [`Rls::learned`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RlsFit", into = "RlsFit")]
pub struct Rls {
    fit: RlsFit,
    learned: Learned,
    coefficients: Vec<f64>,
    /// `W = L⁻¹` of `R = LLᵀ`, so that `P = WᵀW`: the lower triangle, row by row; and the same of the fit.
    root: Vec<f64>,
    root_of_fit: Vec<f64>,
    /// Room for a row.
    row: Scratch,
}

impl From<Rls> for RlsFit {
    fn from(rls: Rls) -> Self {
        rls.fit
    }
}

impl TryFrom<RlsFit> for Rls {
    type Error = NumericsError;

    fn try_from(fit: RlsFit) -> Result<Self, NumericsError> {
        let order = fit.coefficients.len();
        let fine = |value: f64| value > 0.0 && value.is_finite();
        check_parameter("memory_s", fit.memory_s, fit.memory_s > 0.0, "above 0")?;
        let share = (0.0..=1.0).contains(&fit.share);
        check_parameter("share", fit.share, share, "from 0 to 1")?;
        check_parameter("rows", fit.rows, fine(fit.rows), "above 0")?;
        check_parameter("variance", fit.variance, fine(fit.variance), "above 0")?;
        check_length("coefficients", order.max(1), order)?;
        let cells = order * (order + 1) / 2;
        check_length("information", cells, fit.information.len())?;
        let mut rls = Self {
            learned: Learned::of(&fit),
            coefficients: fit.coefficients.clone(),
            root: vec![0.0; cells],
            root_of_fit: Vec::new(),
            row: Scratch(vec![0.0; order]),
            fit,
        };
        if !(rls.solve() && rls.fit.coefficients.iter().all(|value| value.is_finite())) {
            return Err(NumericsError::NotFinite);
        }
        rls.root_of_fit.clone_from(&rls.root);
        Ok(rls)
    }
}

impl Learned {
    /// Nothing yet.
    fn of(fit: &RlsFit) -> Self {
        Self {
            information: fit.information.clone(),
            start: fit.coefficients.clone(),
            pull: vec![0.0; fit.coefficients.len()],
            rows: fit.rows,
            squares: fit.rows * fit.variance,
        }
    }
}

/// Where a row of a triangle begins.
pub(crate) const fn row_at(row: usize) -> usize {
    row * (row + 1) / 2
}

/// A step for the widest vectors that the processor has: no sum is taken in another order, and no product fused with one, so that
/// the bits are the same on all of them.
struct Step<'a> {
    rls: &'a mut Rls,
    x: &'a [f64],
    y: f64,
    after_s: f64,
}

impl WithSimd for Step<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        self.rls.step_here(self.x, self.y, self.after_s)
    }
}

impl Rls {
    /// The model's value.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> f64 {
        assert_eq!(x.len(), self.coefficients.len(), "a value per coefficient");
        dot(&self.coefficients, x)
    }

    /// The variance of the model's value in units of the noise variance, `xᵀPx`: what is not known of the coefficients.
    /// `x(i)` is the value of regressor `i`.
    #[must_use]
    pub fn spread(&self, x: impl Fn(usize) -> f64) -> f64 {
        spread(&self.root, self.coefficients.len(), x)
    }

    /// The same of the fit, `xᵀP₀x`.
    #[must_use]
    pub fn spread_of_fit(&self, x: impl Fn(usize) -> f64) -> f64 {
        spread(&self.root_of_fit, self.coefficients.len(), x)
    }

    /// Learns from one row that comes so many seconds after the one before, without allocating: its error before. A row
    /// that is not finite, or too large to be squared, is ignored.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    pub fn step(&mut self, x: &[f64], y: f64, after_s: f64) -> f64 {
        Arch::new().dispatch(Step {
            rls: self,
            x,
            y,
            after_s,
        })
    }

    #[inline(always)]
    fn step_here(&mut self, x: &[f64], y: f64, after_s: f64) -> f64 {
        let error = y - self.predict(x);
        let of_start = y - dot(&self.learned.start, x);
        let square = error * error / (1.0 + self.spread(|i| x[i]));
        // Written so that NaN fails.
        if !(square < f64::INFINITY && of_start.is_finite() && after_s >= 0.0) {
            return error;
        }
        let left = libm::exp(-after_s / self.fit.memory_s);
        let back = (1.0 - left) * self.fit.share;
        let (fit, learned) = (&self.fit, &mut self.learned);
        for (i, &of_row) in x.iter().enumerate() {
            let cells = row_at(i)..=row_at(i) + i;
            let start = &fit.information[cells.clone()];
            let row = learned.information[cells].iter_mut();
            for ((cell, start), x) in row.zip(start).zip(x) {
                *cell = left * *cell + back * start + of_row * x;
            }
            learned.pull[i] = left * learned.pull[i] + of_row * of_start;
        }
        learned.rows = left * learned.rows + back * fit.rows + 1.0;
        learned.squares = left * learned.squares + back * (fit.rows * fit.variance) + square;
        self.solve_or_begin_again();
        error
    }

    /// Moves a coefficient, and what it goes back to, without a row, after which it is known as by one row alone.
    ///
    /// # Panics
    /// When there is no such coefficient.
    pub fn shift(&mut self, coefficient: usize, by: f64) {
        self.coefficients[coefficient] += by;
        self.learned.start[coefficient] += by;
        let order = self.coefficients.len();
        let row = &mut self.row.0;
        let information = &mut self.learned.information;
        for (j, cell) in row.iter_mut().enumerate() {
            *cell = information[row_at(coefficient.max(j)) + coefficient.min(j)];
        }
        let known = row[coefficient];
        if known > 1.0 {
            let less = (1.0 - 1.0 / known) / known;
            for i in 0..order {
                for (j, right) in row[..=i].iter().enumerate() {
                    let cell = &mut information[row_at(i) + j];
                    *cell = match (i == coefficient, j == coefficient) {
                        (true, true) => 1.0,
                        (true, false) => *right / known,
                        (false, true) => row[i] / known,
                        (false, false) => *cell - row[i] * right * less,
                    };
                }
            }
        }
        for (i, pull) in self.learned.pull.iter_mut().enumerate() {
            let both = self.coefficients.iter().zip(&self.learned.start);
            let parts = both
                .enumerate()
                .map(|(j, (now, start))| information[row_at(i.max(j)) + i.min(j)] * (now - start));
            *pull = parts.sum();
        }
        self.solve_or_begin_again();
    }

    /// What cannot be solved any more begins again from the fit.
    #[inline(always)]
    fn solve_or_begin_again(&mut self) {
        if !self.solve() {
            self.learned = Learned::of(&self.fit);
            self.root.clone_from(&self.root_of_fit);
            self.coefficients.clone_from(&self.fit.coefficients);
        }
    }

    /// Finds root and coefficients from what was learned; false where the information is not positive, or a number not finite.
    #[inline(always)]
    fn solve(&mut self) -> bool {
        self.root.copy_from_slice(&self.learned.information);
        if !invert_root(&mut self.root, &mut self.row.0) {
            return false;
        }
        self.coefficients.copy_from_slice(&self.learned.start);
        add_product(&self.root, &self.learned.pull, &mut self.coefficients);
        self.coefficients.iter().all(|value| value.is_finite())
    }

    /// The variance of the noise, as far as it is remembered.
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.learned.squares / self.learned.rows
    }

    /// The coefficients, one per regressor.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// `W`, the lower triangle row by row, so that `P = WᵀW`.
    #[must_use]
    pub fn root(&self) -> &[f64] {
        &self.root
    }

    /// Where it began.
    #[must_use]
    pub fn fit(&self) -> &RlsFit {
        &self.fit
    }

    /// What was learned since.
    #[must_use]
    pub fn learned(&self) -> &Learned {
        &self.learned
    }

    /// Goes on from what was learned from the same fit, with the same bits; whether that can be.
    #[must_use]
    pub fn resume(&mut self, learned: &Learned) -> bool {
        let lengths = |of: &Learned| [&of.information, &of.start, &of.pull].map(Vec::len);
        let fine = |value: f64| value > 0.0 && value.is_finite();
        let sound = lengths(learned) == lengths(&self.learned)
            && fine(learned.rows)
            && fine(learned.squares);
        if sound {
            self.learned.clone_from(learned);
            if self.solve() {
                return true;
            }
            self.solve_or_begin_again();
        }
        false
    }
}

/// Puts `W = L⁻¹` in the place of a matrix `LLᵀ`, the lower triangle row by row, so that `WᵀW` is its inverse; false where it is not positive.
/// There is room for a row beside.
#[inline(always)]
pub(crate) fn invert_root(root: &mut [f64], room: &mut [f64]) -> bool {
    let order = room.len();
    // Cholesky's factor, column by column, each taken off the rest at once: rows lie together, so that vectors are wide.
    for k in 0..order {
        let pivot = root[row_at(k) + k].sqrt();
        if !(pivot > 0.0 && pivot < f64::INFINITY) {
            return false;
        }
        root[row_at(k) + k] = pivot;
        for i in k + 1..order {
            root[row_at(i) + k] /= pivot;
            room[i] = root[row_at(i) + k];
        }
        for i in k + 1..order {
            let of_row = room[i];
            let cells = root[row_at(i) + k + 1..=row_at(i) + i].iter_mut();
            for (cell, of_column) in cells.zip(&room[k + 1..=i]) {
                *cell -= of_row * of_column;
            }
        }
    }
    // Its inverse, row by row.
    for i in 0..order {
        let (done, rest) = root.split_at_mut(row_at(i));
        let row = &mut rest[..=i];
        let (pivot, room) = (row[i], &mut room[..i]);
        room.copy_from_slice(&row[..i]);
        row.fill(0.0);
        for (k, of_row) in room.iter().enumerate() {
            for (cell, of) in row.iter_mut().zip(&done[row_at(k)..=row_at(k) + k]) {
                *cell -= of_row * of;
            }
        }
        row[i] = 1.0;
        row.iter_mut().for_each(|cell| *cell /= pivot);
    }
    true
}

/// Adds `WᵀWx`.
#[inline(always)]
pub(crate) fn add_product(root: &[f64], x: &[f64], to: &mut [f64]) {
    for i in 0..x.len() {
        let row = &root[row_at(i)..=row_at(i) + i];
        let along = dot(row, &x[..=i]);
        for (sum, of_row) in to.iter_mut().zip(row) {
            *sum += along * of_row;
        }
    }
}

/// `Σ (Wx)²`.
fn spread(root: &[f64], order: usize, x: impl Fn(usize) -> f64) -> f64 {
    let rows = (0..order).map(|i| {
        let row = &root[row_at(i)..=row_at(i) + i];
        let along: f64 = row.iter().enumerate().map(|(j, of)| of * x(j)).sum();
        along * along
    });
    rows.sum()
}

/// The information that rows give about the coefficients of the standardised columns and, last, the intercept's, in units of the
/// noise variance, when the rows in `gram` count as if there were `rows` of them: the lower triangle of `rows/n · ZᵀZ + αI`.
#[must_use]
pub fn information_of(
    gram: &Gram,
    columns: &[usize],
    scales: &[f64],
    alpha: f64,
    rows: f64,
) -> Vec<f64> {
    let moments = gram.moments();
    let share = rows / gram.weight();
    // What the rows do not determine at all must not make the whole unsolvable.
    let alpha = alpha.max(1e-7 * rows);
    let cell = |i: usize, j: usize| match (columns.get(i), columns.get(j)) {
        (Some(&a), Some(&b)) => {
            let penalty = if i == j { alpha } else { 0.0 };
            share * moments[(a, b)] / (scales[a] * scales[b]) + penalty
        }
        (None, None) => rows,
        _ => 0.0,
    };
    let order = columns.len() + 1;
    (0..order)
        .flat_map(|i| (0..=i).map(move |j| (i, j)))
        .map(|(i, j)| cell(i, j))
        .collect()
}

#[cfg(test)]
mod tests;
