use athermal_core::node::Predictor;

/// A predictor that no model could hold.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct Mean {}

impl Predictor for Mean {
    fn uses(&self) -> &[String] {
        &[]
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        0.0
    }
}

fn main() {}
