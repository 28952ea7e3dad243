//! Decides what a model of transfer functions consists of.

use serde::{Deserialize, Serialize};

use super::roots::{is_within, on_edge, reflected};

/// How many coefficients each polynomial has, in the letters of Ljung (1999), chapter 4.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Orders {
    /// Of `A`: past values of what is predicted.
    pub na: usize,
    /// Of each input.
    pub inputs: Vec<InputOrders>,
    /// Of `C`: past innovations.
    pub nc: usize,
    /// Of `D`: past values of the noise.
    pub nd: usize,
    /// How often the noise is integrated.
    pub differences: usize,
}

/// The orders of one input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InputOrders {
    /// Of `B`: how many values of the input count.
    pub nb: usize,
    /// How many samples the newest of them lies back.
    pub nk: usize,
    /// Of `F`: past values of what the input brings about.
    pub nf: usize,
}

impl Orders {
    /// The number of coefficients, with the level where there is one.
    #[must_use]
    pub fn coefficients(&self) -> usize {
        let of_inputs: usize = self.inputs.iter().map(|input| input.nb + input.nf).sum();
        usize::from(self.has_level()) + self.na + of_inputs + self.nc + self.nd
    }

    /// Whether the level is determined: not where the noise is integrated, which has none.
    #[must_use]
    pub fn has_level(&self) -> bool {
        self.differences == 0
    }

    /// Whether each model of other orders is one of these too, with coefficients that are 0.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        let of_input = |(own, other): (&InputOrders, &InputOrders)| {
            own.nk == other.nk && other.nb <= own.nb && other.nf <= own.nf
        };
        self.differences == other.differences
            && self.inputs.len() == other.inputs.len()
            && self.inputs.iter().zip(&other.inputs).all(of_input)
            && other.na <= self.na
            && other.nc <= self.nc
            && other.nd <= self.nd
    }

    /// The first sample of a segment whose residual has all that it needs.
    #[must_use]
    pub fn first(&self) -> usize {
        let reaches = self.inputs.iter().map(|input| reach(input.nk, input.nb));
        reaches.max().unwrap_or(0).max(self.na) + self.nd + self.differences
    }

    /// How many values directly before a residual must be known so that nothing that it needs is in doubt.
    #[must_use]
    pub fn measured(&self) -> usize {
        self.na + self.nd + self.differences
    }

    /// How many values that filters gave before a segment have to be found.
    #[must_use]
    pub fn starts(&self) -> usize {
        self.inputs.iter().map(|input| input.nf).sum()
    }
}

/// What a polynomial without its leading 1 makes of the values until now, of which the last is the newest.
pub(super) fn back(polynomial: &[f64], values: &[f64]) -> f64 {
    let back = polynomial.iter().zip(values.iter().rev());
    back.map(|(p, value)| p * value).sum()
}

/// How many samples the oldest value that counts lies back.
fn reach(delay: usize, b: usize) -> usize {
    b.checked_sub(1).map_or(0, |b| delay + b)
}

/// `q^−nk B(q)/F(q)` of one input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transfer {
    /// How many samples the newest value that counts lies back.
    pub delay: usize,
    /// `b₀, b₁, …`.
    pub b: Vec<f64>,
    /// `f₁, f₂, …`, after a leading 1.
    pub f: Vec<f64>,
}

impl Transfer {
    /// What an input that stays as it is leads to, per unit.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.b.iter().sum::<f64>() / (1.0 + self.f.iter().sum::<f64>())
    }
}

/// A model, `A(q) (y − μ) = Σ B_i(q)/F_i(q) u_i + C(q)/(D(q) (1 − q⁻¹)^d) e` (Ljung 1999, eq. 4.33).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Polynomials {
    /// `a₁, a₂, …`, after a leading 1.
    pub a: Vec<f64>,
    /// Those of each input.
    pub inputs: Vec<Transfer>,
    /// `c₁, c₂, …`, after a leading 1.
    pub c: Vec<f64>,
    /// `d₁, d₂, …`, after a leading 1.
    pub d: Vec<f64>,
    /// How often the noise is integrated.
    pub differences: usize,
    /// What the model is about when all inputs are 0.
    pub level: f64,
}

impl Polynomials {
    /// The model of these orders whose coefficients are all 0.
    #[must_use]
    pub fn zero(orders: &Orders) -> Self {
        let inputs = orders.inputs.iter().map(|input| Transfer {
            delay: input.nk,
            b: vec![0.0; input.nb],
            f: vec![0.0; input.nf],
        });
        Self {
            a: vec![0.0; orders.na],
            inputs: inputs.collect(),
            c: vec![0.0; orders.nc],
            d: vec![0.0; orders.nd],
            differences: orders.differences,
            level: 0.0,
        }
    }

    /// The same model of these orders, with coefficients that are 0; none where they do not [contain](Orders::contains) it.
    pub(super) fn padded(&self, orders: &Orders) -> Option<Self> {
        let mut padded = Self {
            level: self.level,
            ..Self::zero(orders)
        };
        let put = |to: &mut Vec<f64>, from: &[f64]| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        };
        for (to, from) in padded.inputs.iter_mut().zip(&self.inputs) {
            put(&mut to.b, &from.b);
            put(&mut to.f, &from.f);
        }
        put(&mut padded.a, &self.a);
        put(&mut padded.c, &self.c);
        put(&mut padded.d, &self.d);
        orders.contains(&self.orders()).then_some(padded)
    }

    /// How many coefficients each polynomial has.
    #[must_use]
    pub fn orders(&self) -> Orders {
        let inputs = self.inputs.iter().map(|input| InputOrders {
            nb: input.b.len(),
            nk: input.delay,
            nf: input.f.len(),
        });
        Orders {
            na: self.a.len(),
            inputs: inputs.collect(),
            nc: self.c.len(),
            nd: self.d.len(),
            differences: self.differences,
        }
    }

    /// What the model is about while its inputs stay as they are.
    #[must_use]
    pub fn at_rest(&self, input: impl Fn(usize) -> f64) -> f64 {
        let transfers = self.inputs.iter().enumerate();
        let sum: f64 = transfers.map(|(nth, of)| of.gain() * input(nth)).sum();
        self.level + sum / (1.0 + self.a.iter().sum::<f64>())
    }

    /// Makes it a model of values that are so many times as large.
    pub fn rescale(&mut self, times: f64) {
        self.level *= times;
        let b = self.inputs.iter_mut().flat_map(|of| &mut of.b);
        b.for_each(|b| *b *= times);
    }

    /// Whether predictions depend on what has been measured before.
    #[must_use]
    pub fn follows(&self) -> bool {
        self.a.len() + self.c.len() + self.d.len() + self.differences > 0
    }

    /// How many samples back the noise is made of what has been measured.
    pub(super) fn reach(&self) -> usize {
        let inputs = self.inputs.iter();
        let reaches = inputs.map(|input| reach(input.delay, input.b.len()));
        reaches.max().unwrap_or(0).max(self.a.len())
    }

    /// How many values that filters gave before a segment have to be found.
    #[must_use]
    pub fn starts(&self) -> usize {
        self.inputs.iter().map(|input| input.f.len()).sum()
    }

    /// `D(q) (1 − q⁻¹)^d`, without its leading 1.
    pub(super) fn whitening(&self) -> Vec<f64> {
        let mut product: Vec<f64> = std::iter::once(1.0).chain(self.d.iter().copied()).collect();
        let undifferenced = product.len();
        product.resize(undifferenced + self.differences, 0.0);
        for last in undifferenced..product.len() {
            for j in (1..=last).rev() {
                product[j] -= product[j - 1];
            }
        }
        product.split_off(1)
    }

    /// What comes of 1 that is added to the noise before its filters, `1/(A(q) D(q) (1 − q⁻¹)^d)`: in the same sample, in the
    /// next one and so on.
    fn response(&self, most: usize) -> Vec<f64> {
        let whitening = self.whitening();
        let (mut noise, mut response) = (Vec::with_capacity(most), Vec::with_capacity(most));
        for nth in 0..most {
            let own = f64::from(u8::from(nth == 0)) - back(&whitening, &noise);
            noise.push(own);
            response.push(own - back(&self.a, &response));
        }
        response
    }

    /// The variance of predictions one sample ahead, two samples and so on, in that of an innovation: sums of the squares of
    /// what an innovation leads to (Ljung 1999, section 3.2).
    #[must_use]
    pub fn variances(&self, most: usize) -> Vec<f64> {
        let response = self.response(most);
        let mut sum = 0.0;
        let variances = (0..most).map(|nth| {
            let brought = response[nth] + back(&self.c, &response[..nth]);
            sum += brought * brought;
            sum
        });
        variances.collect()
    }

    /// Which of the coefficients, in the order of [`flat`](Self::flat), are of an unstable filter. Predictions are made through
    /// `1/C` and `1/F`, of which the roots must lie inside this radius.
    pub(super) fn unstable(&self, radius: f64) -> Vec<bool> {
        let within = |p: &[f64], radius: f64| vec![!is_within(p, radius); p.len()];
        let of = |p: &[f64]| within(p, 1.0);
        let mut unstable = vec![false; usize::from(self.differences == 0)];
        unstable.extend(of(&self.a));
        for input in &self.inputs {
            unstable.extend(input.b.iter().map(|_| false));
            unstable.extend(within(&input.f, radius));
        }
        unstable.extend(within(&self.c, radius));
        unstable.extend(of(&self.d));
        unstable
    }

    /// The same with roots outside of the unit circle reflected into it, and those of `C` and `F` inside this radius.
    pub(super) fn stabilised(mut self, radius: f64) -> Self {
        for p in self.inputs.iter_mut().map(|input| &mut input.f) {
            *p = reflected(p, radius);
        }
        for p in [&mut self.a, &mut self.d] {
            *p = reflected(p, 1.0);
        }
        self.c = reflected(&self.c, radius);
        self
    }

    /// The same with those `F` and `C` of which coefficients are held, in the order of [`flat`](Self::flat), at the edge of what
    /// is stable within this radius.
    pub(super) fn on_edge(mut self, held: &[bool], radius: f64) -> Self {
        let mut at = usize::from(self.differences == 0) + self.a.len();
        let mut edge = |p: &mut Vec<f64>, skipped: usize| {
            at += skipped;
            if held[at..at + p.len()].contains(&true) {
                *p = on_edge(p, radius);
            }
            at += p.len();
        };
        for input in &mut self.inputs {
            edge(&mut input.f, input.b.len());
        }
        edge(&mut self.c, 0);
        self
    }

    /// All coefficients one after the other: level, `A`, `B` and `F` of each input, `C`, `D`.
    pub(super) fn flat(&self) -> Vec<f64> {
        let level = (self.differences == 0).then_some(self.level);
        let inputs = self.inputs.iter().flat_map(|of| of.b.iter().chain(&of.f));
        let all = self.a.iter().chain(inputs).chain(&self.c).chain(&self.d);
        level.into_iter().chain(all.copied()).collect()
    }

    /// The same model with other coefficients, in the order of [`flat`](Self::flat).
    pub(super) fn with(&self, flat: &[f64]) -> Self {
        let mut model = self.clone();
        let mut flat = flat.iter().copied();
        let mut next = |place: &mut f64| {
            if let Some(value) = flat.next() {
                *place = value;
            }
        };
        if model.differences == 0 {
            next(&mut model.level);
        }
        model.a.iter_mut().for_each(&mut next);
        for input in &mut model.inputs {
            input.b.iter_mut().chain(&mut input.f).for_each(&mut next);
        }
        model.c.iter_mut().chain(&mut model.d).for_each(&mut next);
        model
    }

    /// The same with coefficients less so much, in the order of [`flat`](Self::flat).
    pub(super) fn moved(&self, by: &[f64]) -> Self {
        let moved = self.flat().into_iter().zip(by).map(|(at, by)| at - by);
        self.with(&moved.collect::<Vec<_>>())
    }

    /// Which of the coefficients, in the order of [`flat`](Self::flat), are of a `B`.
    pub(super) fn penalised(&self) -> Vec<bool> {
        let level = usize::from(self.differences == 0) + self.a.len();
        let mut of_b = vec![false; level];
        for input in &self.inputs {
            of_b.extend(input.b.iter().map(|_| true));
            of_b.extend(input.f.iter().map(|_| false));
        }
        of_b.extend(self.c.iter().chain(&self.d).map(|_| false));
        of_b
    }
}
