//! Sufficient statistics of rows for least squares. Decides how rows are summed, shifted and merged; does not decide
//! which rows belong together, nor how the sums are solved.

use crate::NumericsError;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use serde::{Deserialize, Serialize};
use stored::StoredGram;

mod stored;

/// A sum of squares below this share of the sum about the shift is rounding, not variance.
pub(crate) const ROUNDING_SHARE: f64 = 1e-12;

/// The lower triangle is accumulated in panels of so many of its columns: faster than the triangular product, which splits
/// into squares (measured with 65 columns, 256 rows: 13 against 18 µs; panels of rows take 17). What is left over makes the
/// first panel, since the last ones would waste most of a vector on it.
const PANEL_COLUMNS: usize = 8;

/// Rows are centred and multiplied so many at a time, or more while they have no more than so many values: so they stay in the
/// first-level cache (measured with 65 columns: 22 µs for 256 rows instead of 26).
const BATCH_ROWS: usize = 64;
const BATCH_VALUES: usize = 64 * 65;

/// Centred sums over rows of regressors `x` (width `p`) and a target `y`, which is kept as column `p`.
///
/// With `z = (x, y)`, weights `v` and a fixed shift `c` (the values of the first row unless given) it holds the number
/// of rows, `Σv`, `Σv(z − c)` and `Σv(z − c)(z − c)ᵀ`. Parts with the same shift merge by plain addition; the shift keeps
/// the cancellation in `Σv(z − z̄)(z − z̄)ᵀ` small for signals that vary little about a large value, such as temperatures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredGram")]
pub struct Gram {
    width: usize,
    count: u64,
    weight: f64,
    /// Empty until the first row.
    shift: Vec<f64>,
    sum: Vec<f64>,
    /// The lower triangle, column after column.
    cross: Vec<f64>,
}

impl Gram {
    /// No rows yet, of `width` regressors; the first row gives the shift.
    pub fn new(width: usize) -> Self {
        let order = width + 1;
        Self {
            width,
            count: 0,
            weight: 0.0,
            shift: Vec::new(),
            sum: vec![0.0; order],
            cross: vec![0.0; triangle(order)],
        }
    }

    /// No rows yet, about a given shift: the regressors' and, last, the target's. So parts that are accumulated apart
    /// share one shift.
    ///
    /// # Errors
    /// [`NumericsError::Width`] for an empty shift, [`NumericsError::NotFinite`] for one that is not finite.
    pub fn with_shift(shift: Vec<f64>) -> Result<Self, NumericsError> {
        if shift.is_empty() {
            return Err(NumericsError::Width {
                expected: 1,
                found: 0,
            });
        }
        if shift.iter().any(|c| !c.is_finite()) {
            return Err(NumericsError::NotFinite);
        }
        let mut gram = Self::new(shift.len() - 1);
        gram.shift = shift;
        Ok(gram)
    }

    /// The number of regressors.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The sum of the rows' weights; the number of rows where none was given.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// The shift, `width + 1` values, or nothing while there are no rows and none was given.
    pub fn shift(&self) -> Option<&[f64]> {
        (!self.shift.is_empty()).then_some(self.shift.as_slice())
    }

    /// Adds one row. For many rows [`Gram::add_rows`] is about ten times faster.
    ///
    /// # Panics
    /// When `x` has not the width of the statistics.
    pub fn push(&mut self, x: &[f64], y: f64) {
        self.push_weighted(x, y, 1.0);
    }

    /// Adds one row of the given weight (not negative). See [`Gram::push`].
    ///
    /// # Panics
    /// When `x` has not the width of the statistics.
    pub fn push_weighted(&mut self, x: &[f64], y: f64, weight: f64) {
        assert_eq!(x.len(), self.width, "a row has the width of its statistics");
        let row: Vec<f64> = x.iter().copied().chain([y]).collect();
        self.add_rows(&row, Some(&[weight]), &mut Vec::new());
    }

    /// Adds rows that lie one after the other, each `width` regressors and then the target, all of weight 1 or of the
    /// given weights (not negative). `scratch` is working memory that can be used again.
    ///
    /// # Panics
    /// When `rows` is not a whole number of rows, or there is not one weight per row.
    pub fn add_rows(&mut self, rows: &[f64], weights: Option<&[f64]>, scratch: &mut Vec<f64>) {
        let order = self.width + 1;
        assert_eq!(rows.len() % order, 0, "rows are whole");
        let count = rows.len() / order;
        let weighed = weights.is_none_or(|weights| weights.len() == count);
        assert!(weighed, "each row has a weight");
        if count == 0 {
            return;
        }
        if self.shift.is_empty() {
            self.shift = rows[..order].to_vec();
        }
        self.count += count as u64;
        let batch_rows = (BATCH_VALUES / order).max(BATCH_ROWS);
        let needed = order * (order + count.min(batch_rows));
        if scratch.len() < needed {
            scratch.resize(needed, 0.0);
        }
        let (products, scratch) = scratch.split_at_mut(order * order);
        for (batch, rows) in rows.chunks(batch_rows * order).enumerate() {
            let centred = &mut scratch[..rows.len()];
            match weights {
                None => {
                    centre(rows, &self.shift, centred, &mut self.sum);
                    self.weight += (rows.len() / order) as f64;
                }
                Some(weights) => {
                    self.centre_weighted(rows, &weights[batch * batch_rows..], centred);
                }
            }
            let accum = match batch {
                0 => Accum::Replace,
                _ => Accum::Add,
            };
            multiply(centred, order, accum, products);
        }
        let mut columns = self.cross.as_mut_slice();
        for (j, products) in products.chunks_exact(order).enumerate() {
            let (column, rest) = columns.split_at_mut(order - j);
            add(column, &products[j..]);
            columns = rest;
        }
    }

    /// Writes `√v·(rows − shift)`, and adds to the sums.
    fn centre_weighted(&mut self, rows: &[f64], weights: &[f64], centred: &mut [f64]) {
        let order = self.width + 1;
        let lines = rows
            .chunks_exact(order)
            .zip(centred.chunks_exact_mut(order));
        for ((row, out), weight) in lines.zip(weights) {
            let root = weight.sqrt();
            let columns = row.iter().zip(&self.shift).zip(out).zip(&mut self.sum);
            for (((z, c), d), sum) in columns {
                *d = root * (z - c);
                *sum += root * *d;
            }
            self.weight += weight;
        }
    }

    /// Adds the rows of `other`, moved to this shift where theirs is another.
    ///
    /// # Errors
    /// [`NumericsError::Width`] when the widths differ.
    pub fn merge(&mut self, other: &Self) -> Result<(), NumericsError> {
        if other.width != self.width {
            return Err(NumericsError::Width {
                expected: self.width,
                found: other.width,
            });
        }
        if other.shift.is_empty() {
            return Ok(());
        }
        if self.shift.is_empty() {
            self.shift.clone_from(&other.shift);
        }
        if self.shift == other.shift {
            self.accumulate(other);
        } else {
            self.accumulate(&other.shifted_to(&self.shift));
        }
        Ok(())
    }

    /// The same rows with some of their regressors, in this order.
    ///
    /// # Errors
    /// [`NumericsError::Column`] where there is no such regressor.
    pub fn of_columns(&self, columns: &[usize]) -> Result<Self, NumericsError> {
        let width = self.width;
        if let Some(&column) = columns.iter().find(|&&column| column >= width) {
            return Err(NumericsError::Column { column, width });
        }
        let all: Vec<usize> = columns.iter().copied().chain([width]).collect();
        let pick = |of: &[f64]| all.iter().map(|&column| of[column]).collect::<Vec<f64>>();
        let mut chosen = Self {
            count: self.count,
            weight: self.weight,
            shift: Vec::new(),
            sum: pick(&self.sum),
            ..Self::new(columns.len())
        };
        if !self.shift.is_empty() {
            chosen.shift = pick(&self.shift);
        }
        for (j, &column) in all.iter().enumerate() {
            for (i, &row) in all.iter().enumerate().skip(j) {
                let (low, high) = (row.min(column), row.max(column));
                chosen.cross[place(i, j, all.len())] = self.cross[place(high, low, width + 1)];
            }
        }
        Ok(chosen)
    }

    /// No rows, about the same shift.
    pub(crate) fn emptied(&self) -> Self {
        Self {
            shift: self.shift.clone(),
            ..Self::new(self.width)
        }
    }

    /// [`Gram::merge`] for parts that are known to be of one width and, once they have rows, of one shift.
    pub(crate) fn add_same_shift(&mut self, other: &Self) {
        debug_assert!(other.count == 0 || self.shift == other.shift);
        self.accumulate(other);
    }

    fn accumulate(&mut self, other: &Self) {
        self.count += other.count;
        self.weight += other.weight;
        add(&mut self.sum, &other.sum);
        add(&mut self.cross, &other.cross);
    }

    fn shifted_to(&self, shift: &[f64]) -> Self {
        let order = self.width + 1;
        let delta: Vec<f64> = shift.iter().zip(&self.shift).map(|(n, o)| n - o).collect();
        let mut moved = self.clone();
        moved.shift = shift.to_vec();
        for j in 0..order {
            for i in j..order {
                moved.cross[place(i, j, order)] = self.moment(i, j, delta[i], delta[j]);
            }
            moved.sum[j] = self.sum[j] - self.weight * delta[j];
        }
        moved
    }

    /// `Σv(z_i − c_i − δ_i)(z_j − c_j − δ_j)` for `i ≥ j`.
    fn moment(&self, i: usize, j: usize, delta_i: f64, delta_j: f64) -> f64 {
        self.cross[place(i, j, self.width + 1)]
            - self.sum[i] * delta_j
            - delta_i * (self.sum[j] - self.weight * delta_j)
    }

    /// The weighted means of the regressors and, last, of the target; zeros while there are no rows.
    pub fn means(&self) -> Vec<f64> {
        if self.shift.is_empty() {
            return vec![0.0; self.width + 1];
        }
        self.shift
            .iter()
            .zip(self.mean_offsets())
            .map(|(c, offset)| c + offset)
            .collect()
    }

    /// `Σv(z − centre)(z − centre)ᵀ`, symmetric of order `width + 1`, the target last. Zeros while there are no rows.
    ///
    /// # Panics
    /// When `centre` has not `width + 1` values.
    pub fn moments_about(&self, centre: &[f64]) -> Mat<f64> {
        assert_eq!(
            centre.len(),
            self.width + 1,
            "a centre has a value for each column"
        );
        let delta: Vec<f64> = if self.shift.is_empty() {
            vec![0.0; self.width + 1]
        } else {
            centre.iter().zip(&self.shift).map(|(m, c)| m - c).collect()
        };
        self.moments_off_shift(&delta)
    }

    /// `Σv(z − z̄)(z − z̄)ᵀ`, symmetric of order `width + 1`, the target last. Zeros while there are no rows.
    pub fn moments(&self) -> Mat<f64> {
        self.moments_off_shift(&self.mean_offsets())
    }

    /// The population variances of the regressors and, last, of the target: exactly 0 where what is left after taking
    /// the mean out cannot be distinguished from rounding.
    pub fn variances(&self) -> Vec<f64> {
        self.mean_offsets()
            .iter()
            .enumerate()
            .map(|(j, &delta)| {
                let about_shift = self.cross[place(j, j, self.width + 1)];
                let about_mean = self.moment(j, j, delta, delta);
                if self.weight <= 0.0 || about_mean <= ROUNDING_SHARE * about_shift {
                    0.0
                } else {
                    about_mean / self.weight
                }
            })
            .collect()
    }

    /// The means less the shift, from the sums, so that nothing is lost to the size of the shift.
    pub(crate) fn mean_offsets(&self) -> Vec<f64> {
        if self.weight <= 0.0 {
            return vec![0.0; self.width + 1];
        }
        self.sum.iter().map(|s| s / self.weight).collect()
    }

    /// [`Gram::moments_about`] with the centre given as its distance from the shift.
    pub(crate) fn moments_off_shift(&self, delta: &[f64]) -> Mat<f64> {
        let order = self.width + 1;
        let mut moments = Mat::zeros(order, order);
        for j in 0..order {
            for i in j..order {
                let moment = self.moment(i, j, delta[i], delta[j]);
                moments[(i, j)] = moment;
                moments[(j, i)] = moment;
            }
        }
        moments
    }

    /// Whether all sums are finite.
    pub fn is_finite(&self) -> bool {
        let mut sums = self.shift.iter().chain(&self.sum).chain(&self.cross);
        self.weight.is_finite() && sums.all(|v| v.is_finite())
    }
}

/// How many numbers the lower triangle of a matrix has.
pub(crate) fn triangle(order: usize) -> usize {
    order * (order + 1) / 2
}

/// Where row `i ≥ j` of column `j` lies in the lower triangle.
fn place(i: usize, j: usize, order: usize) -> usize {
    triangle(order) - triangle(order - j) + i - j
}

fn add(to: &mut [f64], added: &[f64]) {
    for (a, b) in to.iter_mut().zip(added) {
        *a += b;
    }
}

/// Writes the products of centred rows with themselves, or adds them, to the lower triangle of the column-major `products`;
/// what is above it is not reported.
fn multiply(centred: &[f64], order: usize, accum: Accum, products: &mut [f64]) {
    let centred = MatRef::from_column_major_slice(centred, order, centred.len() / order);
    let mut products = MatMut::from_column_major_slice_mut(products, order, order);
    let mut start = 0;
    while start < order {
        let wide = match (order - start) % PANEL_COLUMNS {
            0 => PANEL_COLUMNS,
            left_over => left_over,
        };
        matmul(
            products
                .as_mut()
                .submatrix_mut(start, start, order - start, wide),
            accum,
            centred.subrows(start, order - start),
            centred.subrows(start, wide).transpose(),
            1.0,
            Par::Seq,
        );
        start += wide;
    }
}

/// Writes `rows − shift` and adds it to `sum`; four rows at a time, since the sums would otherwise be read and written
/// as often as the rows.
fn centre(rows: &[f64], shift: &[f64], centred: &mut [f64], sum: &mut [f64]) {
    let order = shift.len();
    let whole = rows.len() / (4 * order) * (4 * order);
    let (fours, rest) = rows.split_at(whole);
    let (out_fours, out_rest) = centred.split_at_mut(whole);
    let lines = fours.chunks_exact(4 * order);
    for (four, out) in lines.zip(out_fours.chunks_exact_mut(4 * order)) {
        let [z0, z1, z2, z3] = quarters(four, order);
        let (out_01, out_23) = out.split_at_mut(2 * order);
        let (out_0, out_1) = out_01.split_at_mut(order);
        let (out_2, out_3) = out_23.split_at_mut(order);
        for j in 0..order {
            let (d0, d1) = (z0[j] - shift[j], z1[j] - shift[j]);
            let (d2, d3) = (z2[j] - shift[j], z3[j] - shift[j]);
            out_0[j] = d0;
            out_1[j] = d1;
            out_2[j] = d2;
            out_3[j] = d3;
            sum[j] += (d0 + d1) + (d2 + d3);
        }
    }
    for (row, out) in rest
        .chunks_exact(order)
        .zip(out_rest.chunks_exact_mut(order))
    {
        for j in 0..order {
            out[j] = row[j] - shift[j];
            sum[j] += out[j];
        }
    }
}

fn quarters(rows: &[f64], order: usize) -> [&[f64]; 4] {
    std::array::from_fn(|k| &rows[k * order..(k + 1) * order])
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: [[f64; 3]; 4] = [
        [21.0, -3.0, 1.0],
        [23.0, 5.0, -2.0],
        [22.0, 1.0, 4.0],
        [28.0, 0.5, 8.0],
    ];

    fn of(rows: &[[f64; 3]]) -> Gram {
        let mut gram = Gram::new(2);
        for row in rows {
            gram.push(&row[..2], row[2]);
        }
        gram
    }

    fn by_definition(rows: &[[f64; 3]], weights: &[f64]) -> Mat<f64> {
        let total: f64 = weights.iter().sum();
        let lines = || rows.iter().zip(weights);
        let mean = |j: usize| lines().map(|(z, v)| v * z[j]).sum::<f64>() / total;
        Mat::from_fn(3, 3, |i, j| {
            lines()
                .map(|(z, v)| v * (z[i] - mean(i)) * (z[j] - mean(j)))
                .sum()
        })
    }

    fn assert_near(a: &Mat<f64>, b: &Mat<f64>) {
        for j in 0..3 {
            for i in 0..3 {
                assert!((a[(i, j)] - b[(i, j)]).abs() < 1e-12, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn moments_about_the_means_are_those_of_their_definition() {
        assert_near(&of(&ROWS).moments(), &by_definition(&ROWS, &[1.0; 4]));
        let weights = [0.5, 2.0, 1.0, 0.25];
        let mut weighted = Gram::new(2);
        for (row, weight) in ROWS.iter().zip(weights) {
            weighted.push_weighted(&row[..2], row[2], weight);
        }
        assert_near(&weighted.moments(), &by_definition(&ROWS, &weights));
        assert_eq!(weighted.weight(), 3.75);
    }

    #[test]
    fn parts_with_different_shifts_merge_to_the_whole() {
        let mut merged = of(&ROWS[..1]);
        merged.merge(&of(&ROWS[1..])).unwrap();
        assert_eq!(merged.count(), 4);
        assert_near(&merged.moments(), &of(&ROWS).moments());
        for (a, b) in merged.means().iter().zip(of(&ROWS).means()) {
            assert!((a - b).abs() < 1e-14);
        }
        assert!(merged.merge(&Gram::new(3)).is_err());
    }

    #[test]
    fn a_large_offset_does_not_cost_the_variance() {
        let mut gram = Gram::new(1);
        for i in 0..10_000 {
            gram.push(&[1e9 + f64::from(i % 2)], 0.0);
        }
        assert_eq!(gram.variances(), [0.25, 0.0]);
    }

    #[test]
    fn without_rows_everything_is_zero() {
        let gram = Gram::new(2);
        assert_eq!(gram.means(), [0.0; 3]);
        assert_eq!(gram.variances(), [0.0; 3]);
        assert_eq!(gram.moments_about(&[1.0; 3]), Mat::<f64>::zeros(3, 3));
    }

    #[test]
    fn some_columns_have_the_statistics_of_rows_of_these() {
        let (mut all, mut some) = (Gram::new(3), Gram::new(2));
        for i in 0..50 {
            let t = f64::from(i);
            let x = [t.sin(), 20.0 + t.cos(), (0.1 * t).sin()];
            all.push(&x, t);
            some.push(&[x[2], x[1]], t);
        }
        let chosen = all.of_columns(&[2, 1]).unwrap();
        assert_eq!(chosen.means(), some.means());
        assert_eq!((chosen.count(), chosen.shift()), (50, some.shift()));
        assert_eq!(chosen.moments(), some.moments());
        assert!(all.of_columns(&[3]).is_err());
        assert_eq!(Gram::new(3).of_columns(&[1]).unwrap(), Gram::new(1));
    }
}
