//! A positive ratio kept as `n/d × 2^a × 5^b`, so that factors between decimal units are exact; it knows no units.

/// A positive ratio. `numerator` and `denominator` have no common divisor and none of 2 and 5, so that equal ratios are equal field by field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ratio {
    numerator: u128,
    denominator: u128,
    twos: i32,
    fives: i32,
    /// What did not fit into the integers; 1 in all but absurd units.
    remainder: f64,
}

/// Integers up to here are exact doubles.
const EXACT: u128 = 1 << 53;

impl Ratio {
    const ONE: Ratio = Ratio {
        numerator: 1,
        denominator: 1,
        twos: 0,
        fives: 0,
        remainder: 1.0,
    };

    pub(super) fn whole(number: u64) -> Self {
        Ratio {
            numerator: u128::from(number.max(1)),
            ..Self::ONE
        }
        .reduced()
    }

    pub(super) fn power_of_ten(exponent: i32) -> Self {
        Ratio {
            twos: exponent,
            fives: exponent,
            ..Self::ONE
        }
    }

    /// The shortest decimal that reads back as `factor`: 1e-9 is taken for 10⁻⁹, which is what a table of units means by it.
    pub(super) fn from_f64(factor: f64) -> Self {
        // A table that multiplies doubles makes 0.0010000000000000002 of the litre; three zeros in the last places are no coincidence.
        let rounded = format!("{factor:.14e}");
        let text = match rounded.split_once('e') {
            Some((mantissa, _)) if mantissa.ends_with("000") => rounded,
            _ => format!("{factor:e}"),
        };
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits = format!("{whole}{fraction}").parse::<u128>();
        match (
            digits,
            exponent.parse::<i32>(),
            i32::try_from(fraction.len()),
        ) {
            (Ok(numerator), Ok(exponent), Ok(decimals)) if numerator > 0 => {
                let shift = exponent - decimals;
                Ratio {
                    numerator,
                    twos: shift,
                    fives: shift,
                    ..Self::ONE
                }
                .reduced()
            }
            _ => Ratio {
                remainder: factor,
                ..Self::ONE
            },
        }
    }

    pub(super) fn times(self, other: Ratio) -> Self {
        let across = gcd(self.numerator, other.denominator);
        let along = gcd(other.numerator, self.denominator);
        let numerator = (self.numerator / across).checked_mul(other.numerator / along);
        let denominator = (self.denominator / along).checked_mul(other.denominator / across);
        match (numerator, denominator) {
            (Some(numerator), Some(denominator)) => Ratio {
                numerator,
                denominator,
                twos: self.twos.saturating_add(other.twos),
                fives: self.fives.saturating_add(other.fives),
                remainder: self.remainder * other.remainder,
            },
            _ => Ratio {
                remainder: self.value() * other.value(),
                ..Self::ONE
            },
        }
    }

    pub(super) fn power(self, exponent: i32) -> Self {
        let base = if exponent < 0 {
            Ratio {
                numerator: self.denominator,
                denominator: self.numerator,
                twos: -self.twos,
                fives: -self.fives,
                remainder: 1.0 / self.remainder,
            }
        } else {
            self
        };
        // Dimensions end at i8, so that larger exponents are refused later; there is no use in multiplying them out.
        (0..exponent.unsigned_abs().min(256)).fold(Self::ONE, |product, _| product.times(base))
    }

    /// The nearest double: exact division of two integers wherever both are below 2^53.
    pub(super) fn value(self) -> f64 {
        // 2^a 5^b as a power of ten and what is left over keeps both sides small.
        let integers = || {
            let (mut above, mut below) = (self.numerator, self.denominator);
            for (prime, exponent) in [(2u128, self.twos), (5, self.fives)] {
                let power = prime.checked_pow(exponent.unsigned_abs())?;
                let side = if exponent < 0 { &mut below } else { &mut above };
                *side = side.checked_mul(power)?;
            }
            let common = gcd(above, below);
            Some((above / common, below / common))
        };
        match integers() {
            Some((above, below)) if above <= EXACT && below <= EXACT => {
                above as f64 / below as f64 * self.remainder
            }
            _ => {
                // Decimal text is rounded once by the standard parser, which is what the largest and smallest units need.
                let shift = self.twos.min(self.fives);
                let above = self.numerator as f64
                    * 2f64.powi(self.twos - shift)
                    * 5f64.powi(self.fives - shift);
                let decimal = format!("{above:e}");
                let scaled = decimal
                    .split_once('e')
                    .and_then(|(mantissa, exponent)| {
                        Some((mantissa, exponent.parse::<i32>().ok()?))
                    })
                    .and_then(|(mantissa, exponent)| {
                        format!("{mantissa}e{}", exponent.saturating_add(shift))
                            .parse::<f64>()
                            .ok()
                    })
                    .unwrap_or(above * 10f64.powi(shift));
                scaled / self.denominator as f64 * self.remainder
            }
        }
    }

    /// `number` times the ratio, by a division where that is exact: a thousandth is no double, a thousand is.
    pub(super) fn of(self, number: f64) -> f64 {
        let inverse = self.power(-1).value();
        if inverse > 1.0 && inverse.fract() == 0.0 {
            number / inverse
        } else {
            number * self.value()
        }
    }

    fn reduced(mut self) -> Self {
        for (prime, exponent) in [(2, &mut self.twos), (5, &mut self.fives)] {
            while self.numerator.is_multiple_of(prime) {
                self.numerator /= prime;
                *exponent += 1;
            }
            while self.denominator.is_multiple_of(prime) {
                self.denominator /= prime;
                *exponent -= 1;
            }
        }
        let common = gcd(self.numerator, self.denominator);
        self.numerator /= common;
        self.denominator /= common;
        self
    }
}

fn gcd(mut a: u128, mut b: u128) -> u128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a.max(1)
}
