//! Decides what a model's noise filters make of one sample after the other; not what the noise is.

/// The last samples, as far back as the noise model reaches.
pub(super) struct Ring {
    rows: Vec<Row>,
    now: usize,
}

#[derive(Clone)]
pub(super) struct Row {
    /// `A y − Σ w`, before the noise model.
    pub(super) noise: f64,
    /// Its derivatives.
    pub(super) raw: Vec<f64>,
    residual: f64,
    derivatives: Vec<f64>,
}

impl Ring {
    /// For so many derivatives.
    pub(super) fn new(count: usize, whitening: usize, nc: usize, integrating: usize) -> Self {
        let row = Row {
            noise: 0.0,
            raw: vec![0.0; count],
            residual: 0.0,
            derivatives: vec![0.0; count],
        };
        Self {
            rows: vec![row; 1 + whitening.max(nc).max(integrating) + integrating],
            now: 0,
        }
    }

    /// The row of the next sample, whose residual is 0 until it has been worked out.
    pub(super) fn next(&mut self) -> &mut Row {
        self.now = (self.now + 1) % self.rows.len();
        let row = &mut self.rows[self.now];
        row.residual = 0.0;
        row.derivatives.fill(0.0);
        row
    }

    fn back(&self, lag: usize) -> usize {
        (self.now + self.rows.len() - lag) % self.rows.len()
    }

    /// `ε = D (1 − q⁻¹)^d/C` of the noise, and the same of its first `at` derivatives; then those by `C` and `D` themselves.
    pub(super) fn whiten(
        &mut self,
        whitening: &[f64],
        c: &[f64],
        integrating: &[f64],
        nd: usize,
        at: usize,
    ) {
        let mut new = std::mem::take(&mut self.rows[self.now].derivatives);
        new[..at].copy_from_slice(&self.rows[self.now].raw[..at]);
        let mut residual = self.rows[self.now].noise;
        for (j, d) in whitening.iter().enumerate() {
            let row = &self.rows[self.back(j + 1)];
            residual += d * row.noise;
            for (to, from) in new[..at].iter_mut().zip(&row.raw) {
                *to += d * from;
            }
        }
        for j in 0..c.len() {
            new[at + j] = -self.rows[self.back(j + 1)].residual;
        }
        for j in 0..nd {
            // The noise, integrated back, `j + 1` samples ago.
            let mut noise = self.rows[self.back(j + 1)].noise;
            for (i, d) in integrating.iter().enumerate() {
                noise += d * self.rows[self.back(j + 2 + i)].noise;
            }
            new[at + c.len() + j] = noise;
        }
        for (j, c) in c.iter().enumerate() {
            let row = &self.rows[self.back(j + 1)];
            residual -= c * row.residual;
            for (to, from) in new.iter_mut().zip(&row.derivatives) {
                *to -= c * from;
            }
        }
        let row = &mut self.rows[self.now];
        row.residual = residual;
        row.derivatives = new;
    }

    pub(super) fn residual(&self) -> f64 {
        self.rows[self.now].residual
    }

    pub(super) fn derivatives(&self) -> &[f64] {
        &self.rows[self.now].derivatives
    }
}
