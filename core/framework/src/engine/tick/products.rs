//! The products of several linear forms, summed at once, in the order in which each form sums its own.

use pulp::{Arch, Simd, WithSimd};

use crate::node::Strands;

/// The first coefficients of several linear forms whose first regressors are the same values.
pub(crate) struct Products {
    /// Of [`ABREAST`] forms at a time, then of one: the coefficients of four regressors, form by form, then those of the next four.
    coefficients: Box<[[f64; 4]]>,
    sums: Box<[Strands]>,
    arch: Arch,
}

/// How many forms are summed at once: as many as the registers of a processor hold the sums of.
const ABREAST: usize = 6;

impl Products {
    /// Of forms by their coefficients, a multiple of four and of each the same number.
    pub(crate) fn new(forms: &[&[f64]]) -> Self {
        let width = forms.first().map_or(0, |form| form.len());
        let mut products = Self {
            coefficients: vec![[0.0; 4]; forms.len() * (width / 4)].into(),
            sums: vec![Strands::default(); forms.len()].into(),
            arch: Arch::new(),
        };
        for (nth, form) in forms.iter().enumerate() {
            products.set(nth, form);
        }
        products
    }

    /// Sets the coefficients of one of the forms.
    pub(crate) fn set(&mut self, nth: usize, form: &[f64]) {
        let fours = form.as_chunks::<4>().0;
        let grouped = self.sums.len() / ABREAST * ABREAST;
        let (group, abreast) = if nth < grouped {
            (nth / ABREAST * ABREAST, ABREAST)
        } else {
            (nth, 1)
        };
        let of_group = self.coefficients[group * fours.len()..].iter_mut();
        for (to, from) in of_group.skip(nth - group).step_by(abreast).zip(fours) {
            *to = *from;
        }
    }

    /// The sums of all forms after as many products as the regressors are.
    #[inline]
    pub(crate) fn sum(&mut self, regressors: &[f64]) -> &[Strands] {
        if regressors.is_empty() {
            return &self.sums;
        }
        self.arch.dispatch(Sum {
            coefficients: &self.coefficients,
            fours: regressors.as_chunks().0,
            sums: &mut self.sums,
        });
        &self.sums
    }
}

/// For the widest vectors that the processor has.
struct Sum<'a> {
    coefficients: &'a [[f64; 4]],
    fours: &'a [[f64; 4]],
    sums: &'a mut [Strands],
}

impl WithSimd for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            mut coefficients,
            fours,
            sums,
        } = self;
        let (abreast, others) = sums.as_chunks_mut::<ABREAST>();
        for sums in abreast {
            let (group, rest) = coefficients.split_at(ABREAST * fours.len());
            sum_group(group, fours, sums);
            coefficients = rest;
        }
        for sum in others {
            let (form, rest) = coefficients.split_at(fours.len());
            sum_group(form, fours, std::array::from_mut(sum));
            coefficients = rest;
        }
    }
}

#[inline(always)]
fn sum_group<const N: usize>(group: &[[f64; 4]], fours: &[[f64; 4]], to: &mut [Strands; N]) {
    let mut sums = [Strands::default(); N];
    for (coefficients, x) in group.as_chunks::<N>().0.iter().zip(fours) {
        for (sum, b) in sums.iter_mut().zip(coefficients) {
            sum.add(b, x);
        }
    }
    *to = sums;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::LinearForm;
    use crate::prng::Prng;

    #[test]
    fn forms_summed_at_once_have_the_bits_of_each_alone_on_every_processor() {
        let mut random = Prng::stream(5, "products");
        for count in 1..=14 {
            for fours in 0..=5 {
                let width = 4 * fours;
                let mut numbers =
                    |count: usize| -> Vec<f64> { (0..count).map(|_| random.normal()).collect() };
                let forms: Vec<_> = (0..count).map(|_| numbers(width + 3)).collect();
                let regressors = numbers(width + 3);
                let (at_once, left) = regressors.split_at(width);
                let firsts: Vec<_> = forms.iter().map(|form| &form[..width]).collect();
                let mut products = Products::new(&firsts);
                for arch in [Arch::Scalar, Arch::new()] {
                    products.arch = arch;
                    let sums = products.sum(at_once).iter();
                    for (sum, form) in sums.zip(&forms) {
                        let alone = LinearForm {
                            constant: 0.5,
                            coefficients: form,
                        };
                        let found = 0.5 + sum.sum(&form[width..], left);
                        assert_eq!(found.to_bits(), alone.at(&regressors).to_bits());
                    }
                }
            }
        }
    }
}
