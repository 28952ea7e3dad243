//! Decides how weights follow a gradient; not which gradient.

/// Adam (Kingma and Ba 2015): steps of a stated size, each weight's scaled by the recent size of its own gradient.
#[derive(Debug)]
pub(crate) struct Adam {
    rate: f64,
    mean: Vec<f64>,
    square: Vec<f64>,
    steps: i32,
}

/// How fast the memory of gradients fades, and that of their squares.
const FADING: (f64, f64) = (0.9, 0.999);
/// What keeps a weight without a gradient from moving.
const SMALL: f64 = 1e-8;
/// A gradient longer than this is shortened to it: one odd batch must not throw the weights away (Pascanu et al. 2013).
const LONGEST: f64 = 1.0;

impl Adam {
    pub(crate) fn new(weights: usize, rate: f64) -> Self {
        Self {
            rate,
            mean: vec![0.0; weights],
            square: vec![0.0; weights],
            steps: 0,
        }
    }

    /// One step down the gradient.
    pub(crate) fn step(&mut self, weights: &mut [f64], gradient: &[f64]) {
        self.steps += 1;
        let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        let shortened = if length > LONGEST {
            LONGEST / length
        } else {
            1.0
        };
        let unbiased = |fading: f64| 1.0 - fading.powi(self.steps);
        let (of_mean, of_square) = (unbiased(FADING.0), unbiased(FADING.1));
        let kept = self.mean.iter_mut().zip(&mut self.square);
        for ((weight, gradient), (mean, square)) in weights.iter_mut().zip(gradient).zip(kept) {
            let gradient = shortened * gradient;
            *mean += (1.0 - FADING.0) * (gradient - *mean);
            *square += (1.0 - FADING.1) * (gradient * gradient - *square);
            *weight -= self.rate * (*mean / of_mean) / ((*square / of_square).sqrt() + SMALL);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_is_as_long_as_the_rate_whatever_the_gradient() {
        let mut weights = [1.0, 1.0];
        Adam::new(2, 0.1).step(&mut weights, &[1e-3, -0.5]);
        assert!((weights[0] - 0.9).abs() < 1e-5 && (weights[1] - 1.1).abs() < 1e-5);
    }

    #[test]
    fn a_bowl_is_found_to_its_bottom() {
        let (mut weights, mut adam) = ([3.0, -2.0], Adam::new(2, 0.05));
        for _ in 0..2000 {
            let gradient = [2.0 * (weights[0] - 1.0), 0.5 * (weights[1] - 4.0)];
            adam.step(&mut weights, &gradient);
        }
        assert!((weights[0] - 1.0).abs() < 1e-3 && (weights[1] - 4.0).abs() < 1e-3);
    }
}
