//! How far a row lies outside of those that a fit saw. Decides the measure and where its edge is; what is done outside is its
//! user's.

use crate::normal_equations::Problem;
use crate::{Gram, Rows, Standardization};
use faer::Side;
use serde::{Deserialize, Serialize};

/// So many directions are told apart at most: more cost more at a tick and find no more.
const DIRECTIONS: usize = 12;
/// So many directions are gone along at once: numbers of them between are filled up with zeros.
const LANES: usize = 2;
/// The variance below which rows hardly take a direction, in that of a regressor.
const HARDLY: f64 = 0.05;
/// The variance of noise in any direction, in that of a regressor: what weighs directions that rows do take.
const NOISE: f64 = 0.001;
/// The share of the rows of the fit that lie inside.
const INSIDE: f64 = 0.999;

/// How far a row of regressors lies outside of the rows of a fit: `√(d / d₉₉.₉)`, so that 1 is the edge.
///
/// With the standardised regressors `z` of `p` columns, `n` rows and the eigenvectors `v` and eigenvalues `λ` of `ZᵀZ / n` it is
/// `d = (‖z‖² − Σ λ / (λ + 0.001) (vᵀz)²) / (‖z‖² + p)`, the sum over the `λ` above 0.05, at most the twelve largest; `d₉₉.₉` is the
/// 99.9 % quantile of the rows. Where all are in the sum the numerator is `0.001 zᵀ(ZᵀZ / n + 0.001 I)⁻¹z`, the leverage of ridge.
/// What is merely larger in a direction in which the rows vary much changes `d` little; a direction that they hardly took does, at
/// any amplitude.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredNovelty", into = "StoredNovelty")]
pub struct Novelty {
    columns: Box<[Column]>,
    /// How many directions there are.
    directions: usize,
    /// Of each column its part in each direction, `√(λ / (λ + 0.001)) v`, for the standardised regressor; filled up to whole lanes.
    along: Box<[f64]>,
    edge: f64,
}

/// What a column contributes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Column {
    mean: f64,
    scale: f64,
    /// `1 / scale`.
    inverse: f64,
}

/// The same as models hold it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredNovelty {
    /// `d₉₉.₉`.
    edge: f64,
    means: Vec<f64>,
    scales: Vec<f64>,
    /// The directions, one after the other, each with its part of each column.
    directions: Vec<f64>,
}

impl Column {
    fn new(mean: f64, scale: f64) -> Self {
        Self {
            mean,
            scale,
            inverse: 1.0 / scale,
        }
    }
}

impl From<Novelty> for StoredNovelty {
    fn from(novelty: Novelty) -> Self {
        let columns = || novelty.columns.iter();
        let along = &novelty.along;
        let parts = |nth: usize| along.iter().skip(nth).step_by(novelty.lanes()).copied();
        Self {
            edge: novelty.edge,
            means: columns().map(|column| column.mean).collect(),
            scales: columns().map(|column| column.scale).collect(),
            directions: (0..novelty.directions).flat_map(parts).collect(),
        }
    }
}

impl TryFrom<StoredNovelty> for Novelty {
    type Error = &'static str;

    fn try_from(stored: StoredNovelty) -> Result<Self, Self::Error> {
        let width = stored.means.len();
        let directions = stored.directions.len().checked_div(width).unwrap_or(0);
        let lengths = [
            stored.scales.len() == width,
            directions * width == stored.directions.len(),
        ];
        if lengths.contains(&false) || !(1..=DIRECTIONS).contains(&directions) {
            return Err(
                "`novelty` needs a mean, a scale and a part of each of up to twelve directions for each regressor",
            );
        }
        let above_zero = |value: f64| value > 0.0 && value.is_finite();
        let mut values = stored.means.iter().chain(&stored.directions);
        let finite = values.all(|value| value.is_finite());
        if !(finite
            && above_zero(stored.edge)
            && stored.scales.iter().all(|&scale| above_zero(scale)))
        {
            return Err("`novelty` must have finite values, and scales and an edge above 0");
        }
        let both = stored.means.iter().zip(&stored.scales);
        let columns = both.map(|(&mean, &scale)| Column::new(mean, scale));
        let mut novelty = Self::new(columns.collect(), directions);
        let lanes = novelty.lanes();
        for (nth, direction) in stored.directions.chunks_exact(width).enumerate() {
            let places = novelty.along.iter_mut().skip(nth).step_by(lanes);
            places
                .zip(direction)
                .for_each(|(place, part)| *place = *part);
        }
        novelty.edge = stored.edge;
        Ok(novelty)
    }
}

impl Novelty {
    /// Of columns whose parts in so many directions are still zeros.
    fn new(columns: Box<[Column]>, directions: usize) -> Self {
        let mut novelty = Self {
            columns,
            directions,
            along: Box::default(),
            edge: 1.0,
        };
        novelty.along = vec![0.0; novelty.columns.len() * novelty.lanes()].into();
        novelty
    }

    /// How many parts a column has, zeros among them.
    fn lanes(&self) -> usize {
        self.directions.max(1).next_multiple_of(LANES)
    }

    /// That of some columns of rows; none where these rows do not say what is usual: where there are no more of them than columns, or
    /// where they never leave the directions that they vary in.
    #[must_use]
    pub fn of(
        gram: &Gram,
        standard: &Standardization,
        columns: &[usize],
        rows: Rows<'_>,
    ) -> Option<Self> {
        let problem = Problem::new(true, gram, columns, &standard.scales);
        let count = gram.count() as f64;
        if columns.is_empty() || problem.active.is_empty() || count <= columns.len() as f64 {
            return None;
        }
        let eigen = problem.gram.self_adjoint_eigen(Side::Lower).ok()?;
        let (values, vectors) = (eigen.S().column_vector(), eigen.U());
        let order = problem.active.len();
        let of = |&column: &usize| Column::new(standard.means[column], standard.scales[column]);
        let directions = (0..order.min(DIRECTIONS))
            .take_while(|nth| values[order - 1 - nth] > HARDLY * count)
            .count();
        let mut novelty = Self::new(columns.iter().map(of).collect(), directions);
        let lanes = novelty.lanes();
        for nth in 0..novelty.directions {
            // They come from the smallest to the largest.
            let from = order - 1 - nth;
            let variance = values[from] / count;
            let share = (variance / (variance + NOISE)).sqrt();
            for (i, &column) in problem.active.iter().enumerate() {
                novelty.along[column * lanes + nth] = share * vectors[(i, from)];
            }
        }
        let mut row = vec![0.0; columns.len()];
        let mut all: Vec<f64> = rows
            .iter()
            .map(|(x, _, _)| {
                row.iter_mut()
                    .zip(columns)
                    .for_each(|(to, &column)| *to = x[column]);
                let (beyond, whole) = novelty.parts(row.iter().copied());
                beyond / whole
            })
            .collect();
        let inside = ((all.len() as f64 * INSIDE).ceil() as usize).saturating_sub(1);
        let (_, edge, _) = all.select_nth_unstable_by(inside, f64::total_cmp);
        novelty.edge = *edge;
        (novelty.edge > 0.0 && novelty.edge.is_finite()).then_some(novelty)
    }

    /// What a linear form of the columns gives in their middle.
    #[must_use]
    pub fn centre<'a>(
        &self,
        intercept: f64,
        coefficients: impl IntoIterator<Item = &'a f64>,
    ) -> f64 {
        let columns = self.columns.iter().zip(coefficients);
        intercept + columns.map(|(column, b)| b * column.mean).sum::<f64>()
    }

    /// How many columns it is of.
    #[must_use]
    pub fn width(&self) -> usize {
        self.columns.len()
    }

    /// At the values of the columns, in their order: 1 at the edge, more outside.
    #[inline]
    #[must_use]
    pub fn at(&self, x: &[f64]) -> f64 {
        self.at_each(x.iter().copied())
    }

    /// The same at values that are made one by one.
    #[inline]
    #[must_use]
    pub fn at_each(&self, x: impl Iterator<Item = f64>) -> f64 {
        let (beyond, whole) = self.parts(x);
        (beyond / (whole * self.edge)).sqrt()
    }

    /// Numerator and denominator of `d`.
    #[inline]
    fn parts(&self, x: impl Iterator<Item = f64>) -> (f64, f64) {
        // The same sums, of as many zeros as there must be.
        match self.lanes() {
            2 => self.parts_of::<2>(x),
            4 => self.parts_of::<4>(x),
            6 => self.parts_of::<6>(x),
            8 => self.parts_of::<8>(x),
            10 => self.parts_of::<10>(x),
            _ => self.parts_of::<DIRECTIONS>(x),
        }
    }

    #[inline]
    fn parts_of<const LANES: usize>(&self, x: impl Iterator<Item = f64>) -> (f64, f64) {
        let (mut size, mut along) = (0.0, [0.0; LANES]);
        let (parts, _) = self.along.as_chunks::<LANES>();
        for ((column, parts), x) in self.columns.iter().zip(parts).zip(x) {
            let z = (x - column.mean) * column.inverse;
            size += z * z;
            along = std::array::from_fn(|nth| along[nth] + parts[nth] * z);
        }
        let known: f64 = along.iter().map(|part| part * part).sum();
        ((size - known).max(0.0), size + self.columns.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GramBlocks;

    /// Rows of two columns that go together, and a third on its own.
    fn rows() -> GramBlocks {
        let mut blocks = GramBlocks::new(3);
        for i in 0..5000 {
            let t = f64::from(i);
            let (a, b, c) = ((0.11 * t).sin(), (0.37 * t).cos(), (0.71 * t).sin());
            blocks.push(&[20.0 + 3.0 * a + 0.01 * c, 2.0 * a - 0.01 * c, b], a + b);
        }
        blocks
    }

    fn of(blocks: &GramBlocks, columns: &[usize]) -> Option<Novelty> {
        let gram = blocks.total();
        let standard = Standardization::of(&gram);
        Novelty::of(&gram, &standard, columns, blocks.rows().unwrap())
    }

    #[test]
    fn one_row_of_a_thousand_lies_outside() {
        let blocks = rows();
        let novelty = of(&blocks, &[0, 1, 2]).unwrap();
        let rows = blocks.rows().unwrap();
        let outside = rows.iter().filter(|(x, _, _)| novelty.at(x) > 1.0);
        assert_eq!(outside.count(), 5);
    }

    #[test]
    fn a_new_direction_is_outside_and_a_large_amplitude_in_a_known_one_is_hardly() {
        let novelty = of(&rows(), &[0, 1, 2]).unwrap();
        let (tenfold, apart) = (
            novelty.at(&[20.0 + 30.0, 20.0, 0.0]),
            novelty.at(&[20.0 + 1.0, -0.7, 0.0]),
        );
        assert!(tenfold < 1.2, "{tenfold}");
        assert!(apart > 4.0, "{apart}");
        assert!(novelty.at(&[20.0, 0.0, 0.0]) < 0.1, "the middle");
    }

    #[test]
    fn it_is_the_leverage_of_ridge_where_all_directions_are_told_apart() {
        let blocks = rows();
        let gram = blocks.total();
        let standard = Standardization::of(&gram);
        let novelty = of(&blocks, &[0, 2]).unwrap();
        let z = |x: [f64; 2]| {
            [
                (x[0] - standard.means[0]) / standard.scales[0],
                (x[1] - standard.means[2]) / standard.scales[2],
            ]
        };
        let rows = || blocks.rows().unwrap();
        let count = rows().count() as f64;
        let correlation = rows()
            .iter()
            .map(|(x, _, _)| z([x[0], x[2]]))
            .map(|z| z[0] * z[1])
            .sum::<f64>()
            / count;
        let diagonal = 1.0 + NOISE;
        let determinant = diagonal * diagonal - correlation * correlation;
        let measure = |x: [f64; 2]| {
            let [a, b] = z(x);
            let leverage = (diagonal * (a * a + b * b) - 2.0 * correlation * a * b) / determinant;
            NOISE * leverage / (a * a + b * b + 2.0)
        };
        let mut all: Vec<f64> = rows()
            .iter()
            .map(|(x, _, _)| measure([x[0], x[2]]))
            .collect();
        all.sort_by(f64::total_cmp);
        for x in [[21.0, 0.5], [12.0, -3.0], [20.0, 0.01]] {
            let expected = (measure(x) / all[4994]).sqrt();
            let found = novelty.at(&x);
            assert!(
                (found / expected - 1.0).abs() < 1e-6,
                "{found} instead of {expected}"
            );
        }
    }

    #[test]
    fn it_reads_back_to_the_bit_and_what_does_not_fit_is_refused() {
        let novelty = of(&rows(), &[0, 1, 2]).unwrap();
        let text = serde_json::to_string(&novelty).unwrap();
        assert_eq!(serde_json::from_str::<Novelty>(&text).unwrap(), novelty);
        let written = serde_json::to_value(&novelty).unwrap();
        for (key, value) in [
            ("edge", serde_json::json!(0.0)),
            ("means", serde_json::json!([1.0])),
            ("directions", serde_json::json!([])),
        ] {
            let mut wrong = written.clone();
            wrong[key] = value;
            assert!(serde_json::from_value::<Novelty>(wrong).is_err(), "{key}");
        }
    }

    #[test]
    fn rows_that_never_leave_their_directions_or_are_too_few_say_nothing() {
        let mut few = GramBlocks::new(2);
        few.push(&[1.0, 2.0], 0.0);
        few.push(&[2.0, 1.0], 0.0);
        assert_eq!(of(&few, &[0, 1]), None);
        let mut constant = GramBlocks::new(1);
        (0..10).for_each(|_| constant.push(&[1.0], 0.0));
        assert_eq!(of(&constant, &[0]), None);
    }
}
