//! What a run of samples comes to: count, mean, spread, smallest and largest. Decides how samples and runs are put together;
//! not which samples a run holds.

/// A summary of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Summary {
    pub(crate) count: f64,
    pub(crate) mean: f64,
    /// Σ(x − x̄)².
    squares: f64,
    pub(crate) min: f64,
    pub(crate) max: f64,
}

impl Summary {
    pub(crate) const NONE: Summary = Summary {
        count: 0.0,
        mean: 0.0,
        squares: 0.0,
        min: f64::INFINITY,
        max: f64::NEG_INFINITY,
    };

    pub(crate) fn one(value: f64) -> Self {
        Self {
            count: 1.0,
            mean: value,
            squares: 0.0,
            min: value,
            max: value,
        }
    }

    /// Both together (Chan, Golub and LeVeque 1983, equation 2.1). Nothing is ever taken out of a summary, so that a sample of
    /// 10⁹ leaves no trace once it is outside.
    pub(crate) fn and(&self, other: &Self) -> Self {
        if self.count == 0.0 || other.count == 0.0 {
            return if self.count == 0.0 { *other } else { *self };
        }
        let count = self.count + other.count;
        let apart = other.mean - self.mean;
        Self {
            count,
            mean: self.mean + apart * (other.count / count),
            squares: self.squares
                + other.squares
                + apart * apart * (self.count * other.count / count),
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The standard deviation of the samples, by n − 1; nothing of fewer than two.
    pub(crate) fn deviation(&self) -> Option<f64> {
        (self.count >= 2.0).then(|| (self.squares / (self.count - 1.0)).sqrt())
    }
}
