//! Heat in a bar of equal cells, and how much the bar grows. Decides conduction and expansion, not what heats the bar.

use athermal_trial::machine::Individual;

/// What a bar is made of; handbook values at 20 °C.
#[derive(Debug, Clone, Copy)]
pub struct Material {
    /// Thermal conductivity in W/(m K).
    pub conductivity: f64,
    /// Volumetric heat capacity in J/(m³ K).
    pub capacity: f64,
    /// Coefficient of linear expansion in 1/K.
    pub expansion: f64,
}

/// Aluminium 6061-T6.
pub const ALUMINIUM: Material = Material {
    conductivity: 167.0,
    capacity: 2700.0 * 896.0,
    expansion: 23.6e-6,
};

/// Stainless steel 304.
pub const STAINLESS: Material = Material {
    conductivity: 16.2,
    capacity: 8000.0 * 500.0,
    expansion: 17.3e-6,
};

/// Plain carbon steel.
pub const STEEL: Material = Material {
    conductivity: 50.0,
    capacity: 7850.0 * 486.0,
    expansion: 11.7e-6,
};

/// Shape and skin of a bar.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// What it is made of.
    pub material: Material,
    /// Length in m.
    pub length_m: f64,
    /// Cross-section in m².
    pub section_m2: f64,
    /// Surface towards the air in m².
    pub surface_m2: f64,
    /// Heat transfer coefficient of that surface (convection and radiation to the walls together) in W/(m² K).
    pub transfer: f64,
    /// Number of cells.
    pub cells: usize,
}

impl Shape {
    /// The same bar in one machine of its type: its material and its skin are drawn, its measures are those of the drawing.
    #[must_use]
    pub fn of(self, individual: &Individual, body: &str) -> Self {
        let drawn =
            |parameter: &str, of: f64| of * individual.factor(&format!("{body} {parameter}"));
        let Material {
            conductivity,
            capacity,
            expansion,
        } = self.material;
        Self {
            material: Material {
                conductivity: drawn("conductivity", conductivity),
                capacity: drawn("capacity", capacity),
                expansion: drawn("expansion", expansion),
            },
            transfer: drawn("transfer", self.transfer),
            ..self
        }
    }
}

/// A bar, insulated at both ends, with air along its side: `ρc ∂T/∂t = k ∂²T/∂x² + g (T_air − T) + q`.
///
/// Stepped with the fully implicit scheme on control volumes, which is stable and free of oscillation at any step
/// (Patankar, "Numerical heat transfer and fluid flow", 1980, §4.3), and solved by the tridiagonal algorithm (§4.2-7).
#[derive(Debug, Clone)]
pub struct Bar {
    temperature: Vec<f64>,
    heat_w: Vec<f64>,
    upper: Vec<f64>,
    capacity: f64,
    conductance: f64,
    skin: f64,
    growth_nm: f64,
    /// Of one that has changed, by how much it has grown more than it was made to, and what its cells added up to when that was found last.
    more_nm: f64,
    last: Option<f64>,
}

impl Bar {
    /// A bar at one temperature (°C) throughout. It has one cell at least.
    #[must_use]
    pub fn new(shape: &Shape, temperature: f64) -> Self {
        let count = shape.cells.max(1);
        let cell_m = shape.length_m / count as f64;
        Self {
            temperature: vec![temperature; count],
            heat_w: vec![0.0; count],
            upper: vec![0.0; count],
            capacity: shape.material.capacity * shape.section_m2 * cell_m,
            conductance: shape.material.conductivity * shape.section_m2 / cell_m,
            skin: shape.surface_m2 * shape.transfer / count as f64,
            growth_nm: shape.material.expansion * cell_m * 1e9,
            more_nm: 0.0,
            last: None,
        }
    }

    /// Temperature of the first cell, in °C.
    #[must_use]
    pub fn first(&self) -> f64 {
        self.temperature[0]
    }

    /// Temperature of the last cell, in °C.
    #[must_use]
    pub fn last(&self) -> f64 {
        self.temperature[self.temperature.len() - 1]
    }

    /// Temperature of the cell in the middle, in °C.
    #[must_use]
    pub fn middle(&self) -> f64 {
        self.temperature[self.temperature.len() / 2]
    }

    /// Adds heat (W) to the first cell during the next step.
    pub fn heat_first(&mut self, watt: f64) {
        self.heat_w[0] += watt;
    }

    /// Adds heat (W) to the last cell during the next step.
    pub fn heat_last(&mut self, watt: f64) {
        if let Some(heat) = self.heat_w.last_mut() {
            *heat += watt;
        }
    }

    /// Heats all cells evenly during the next step, in K/s.
    pub fn heat_all(&mut self, kelvin_per_s: f64) {
        for heat in &mut self.heat_w {
            *heat += self.capacity * kelvin_per_s;
        }
    }

    /// How much longer the bar is, in nm, than at `reference` °C throughout.
    #[must_use]
    pub fn growth_nm(&self, reference: f64) -> f64 {
        self.growth_nm * self.temperature.iter().map(|t| t - reference).sum::<f64>() + self.more_nm
    }

    /// Grows by a share more than it is made to, from where it was when this was called last: what has changed moves nothing at rest.
    pub fn swell(&mut self, share: f64) {
        let sum: f64 = self.temperature.iter().sum();
        let by = self.last.map_or(0.0, |last| sum - last);
        self.more_nm += share * self.growth_nm * by;
        self.last = Some(sum);
    }

    /// One step of `step_s` seconds in air of `air` °C; `coupling` scales the heat transfer of the skin (1 as designed).
    pub fn step(&mut self, step_s: f64, air: f64, coupling: f64) {
        let inertia = self.capacity / step_s;
        let skin = self.skin * coupling;
        let k = self.conductance;
        let last = self.temperature.len() - 1;
        let (mut upper, mut solved) = (0.0, 0.0);
        for cell in 0..=last {
            let below = if cell == 0 { 0.0 } else { k };
            let above = if cell == last { 0.0 } else { k };
            let source = inertia * self.temperature[cell] + skin * air + self.heat_w[cell];
            let pivot = 1.0 / (inertia + skin + below + above - below * upper);
            upper = above * pivot;
            solved = (source + below * solved) * pivot;
            self.upper[cell] = upper;
            self.temperature[cell] = solved;
            self.heat_w[cell] = 0.0;
        }
        for cell in (0..last).rev() {
            self.temperature[cell] += self.upper[cell] * self.temperature[cell + 1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROD: Shape = Shape {
        material: STAINLESS,
        length_m: 0.1,
        section_m2: 1e-4,
        surface_m2: 0.0,
        transfer: 0.0,
        cells: 40,
    };

    #[test]
    fn an_insulated_bar_keeps_its_heat() {
        let mut bar = Bar::new(&ROD, 20.0);
        let (watt, step_s) = (0.5, 5.0);
        for _ in 0..100 {
            bar.heat_first(watt);
            bar.step(step_s, 0.0, 1.0);
        }
        let heat_j: f64 = bar
            .temperature
            .iter()
            .map(|t| bar.capacity * (t - 20.0))
            .sum();
        assert!((heat_j - watt * 100.0 * step_s).abs() < 1e-6, "{heat_j}");
    }

    #[test]
    fn heat_through_the_ends_gives_the_gradient_of_fourier() {
        let mut bar = Bar::new(&ROD, 20.0);
        let watt = 0.2;
        for _ in 0..2000 {
            bar.heat_first(watt);
            bar.heat_last(-watt);
            bar.step(20.0, 0.0, 1.0);
        }
        // Between the centres of the end cells: one cell less than the length.
        let between_m = ROD.length_m * 39.0 / 40.0;
        let expected = watt * between_m / (STAINLESS.conductivity * ROD.section_m2);
        assert!(
            (bar.first() - bar.last() - expected).abs() < 1e-6 * expected,
            "{}",
            bar.first() - bar.last()
        );
    }

    #[test]
    fn a_cosine_decays_as_the_heat_equation_says() {
        // Carslaw and Jaeger, "Conduction of heat in solids", 1959, §3.4: cos(πx/L) decays with the rate α (π/L)².
        let mut bar = Bar::new(&ROD, 20.0);
        let angle = |cell: usize| std::f64::consts::PI * (cell as f64 + 0.5) / 40.0;
        for cell in 0..40 {
            bar.temperature[cell] += angle(cell).cos();
        }
        let step_s = 0.5;
        for _ in 0..200 {
            bar.step(step_s, 0.0, 1.0);
        }
        let alpha = STAINLESS.conductivity / STAINLESS.capacity;
        let rate = alpha * (std::f64::consts::PI / ROD.length_m).powi(2);
        let expected = (-rate * 100.0).exp();
        let found = (bar.first() - 20.0) / angle(0).cos();
        assert!(
            (found / expected - 1.0).abs() < 2e-3,
            "{found} for {expected}"
        );
    }

    #[test]
    fn a_bar_in_warmer_air_approaches_it_and_grows_by_its_expansion() {
        let shape = Shape {
            surface_m2: 0.01,
            transfer: 10.0,
            ..ROD
        };
        let mut bar = Bar::new(&shape, 20.0);
        let mut before = bar.growth_nm(20.0);
        for _ in 0..2000 {
            bar.step(10.0, 21.0, 1.0);
            let now = bar.growth_nm(20.0);
            assert!(now + 1e-9 >= before);
            before = now;
        }
        let expected_nm = STAINLESS.expansion * ROD.length_m * 1e9;
        assert!((before - expected_nm).abs() < 1e-3, "{before}");
    }

    #[test]
    fn a_stronger_coupling_warms_faster() {
        let shape = Shape {
            surface_m2: 0.01,
            transfer: 10.0,
            ..ROD
        };
        let after = |coupling| {
            let mut bar = Bar::new(&shape, 20.0);
            bar.step(10.0, 21.0, coupling);
            bar.middle()
        };
        assert!(after(1.3) > after(1.0));
    }
}
