//! Decimal text as an exact number, so that 0.3 s is 300,000,000 ns and not one less. Not for measured values, which are `f64`.

/// More digits than this are beyond a nanosecond in any time that fits into 64 bits.
const DIGITS: u32 = 28;

/// `±mantissa × 10^exponent`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Decimal {
    negative: bool,
    mantissa: u128,
    exponent: i32,
}

impl Decimal {
    /// Reads `12`, `-1.5`, `.5`, `1e3` or `1.5E-3`; anything else is `None`.
    pub fn parse(text: &[u8]) -> Option<Self> {
        let (negative, text) = match text.split_first()? {
            (b'-', rest) => (true, rest),
            (b'+', rest) => (false, rest),
            _ => (false, text),
        };
        let mut mantissa: u128 = 0;
        let mut exponent: i32 = 0;
        let (mut kept, mut any, mut fraction) = (0, false, false);
        let mut at = 0;
        while let Some(&byte) = text.get(at) {
            match byte {
                b'0'..=b'9' => {
                    any = true;
                    if kept < DIGITS {
                        mantissa = mantissa * 10 + u128::from(byte - b'0');
                        kept += u32::from(mantissa != 0);
                        exponent = exponent.checked_sub(i32::from(fraction))?;
                    } else {
                        exponent = exponent.checked_add(i32::from(!fraction))?;
                    }
                }
                b'.' if !fraction => fraction = true,
                b'e' | b'E' if any => {
                    exponent = exponent.checked_add(signed(&text[at + 1..])?)?;
                    break;
                }
                _ => return None,
            }
            at += 1;
        }
        any.then_some(Self {
            negative,
            mantissa,
            exponent,
        })
    }

    /// The number times `factor`, rounded to the nearest whole number, halves away from zero; `None` when it does not fit.
    pub fn times(self, factor: i64) -> Option<i64> {
        i64::try_from(self.product(factor)?).ok()
    }

    /// The same in 128 bits.
    pub fn product(self, factor: i64) -> Option<i128> {
        let negative = self.negative != (factor < 0);
        let factor = u128::from(factor.unsigned_abs());
        let (mut mantissa, mut exponent) = (self.mantissa, self.exponent);
        let mut product = loop {
            match mantissa.checked_mul(factor) {
                Some(product) => break product,
                None => (mantissa, exponent) = (mantissa / 10, exponent.checked_add(1)?),
            }
        };
        if product == 0 {
            return Some(0);
        }
        match 10_u128.checked_pow(exponent.unsigned_abs()) {
            Some(power) if exponent >= 0 => product = product.checked_mul(power)?,
            Some(power) => product = rounded_quotient(product, power),
            None if exponent >= 0 => return None,
            None => product = 0,
        }
        let size = i128::try_from(product).ok()?;
        Some(if negative { -size } else { size })
    }

    /// Whether nothing stands behind the decimal point but zeros.
    pub fn is_whole(self) -> bool {
        if self.exponent >= 0 || self.mantissa == 0 {
            return true;
        }
        10_u128
            .checked_pow(self.exponent.unsigned_abs())
            .is_some_and(|power| self.mantissa.is_multiple_of(power))
    }
}

fn signed(text: &[u8]) -> Option<i32> {
    std::str::from_utf8(text).ok()?.parse().ok()
}

/// Division of 128 bits is slow and nearly always needless here.
fn rounded_quotient(number: u128, by: u128) -> u128 {
    let (quotient, rest) = match (u64::try_from(number), u64::try_from(by)) {
        (Ok(number), Ok(by)) => (u128::from(number / by), u128::from(number % by)),
        _ => (number / by, number % by),
    };
    quotient + u128::from(rest >= by - rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ns(text: &str) -> Option<i64> {
        Decimal::parse(text.as_bytes())?.times(1_000_000_000)
    }

    #[test]
    fn decimal_seconds_become_exact_nanoseconds() {
        assert_eq!(ns("0.3"), Some(300_000_000));
        assert_eq!(ns("604790.0"), Some(604_790_000_000_000));
        assert_eq!(ns("1e3"), Some(1_000_000_000_000));
        assert_eq!(ns("1.5E-3"), Some(1_500_000));
        assert_eq!(ns("+.5"), Some(500_000_000));
        assert_eq!(ns("-7."), Some(-7_000_000_000));
        assert_eq!(ns("1700000000.123456789"), Some(1_700_000_000_123_456_789));
        assert_eq!(
            ns("00000000000000000000000000000000000001"),
            Some(1_000_000_000)
        );
    }

    #[test]
    fn digits_below_a_nanosecond_round_to_the_nearest() {
        assert_eq!(ns("0.0000000014"), Some(1));
        assert_eq!(ns("0.0000000015"), Some(2));
        assert_eq!(ns("-0.0000000015"), Some(-2));
        assert_eq!(ns("1e-400"), Some(0));
        assert_eq!(
            ns("1700000000.12345678949999999999999999999999"),
            Some(1_700_000_000_123_456_789)
        );
    }

    #[test]
    fn a_factor_that_is_large_keeps_every_nanosecond() {
        let hour = 3_600_000_000_000;
        let time = Decimal::parse(b"472222.222222222222222222222222");
        assert_eq!(
            time.and_then(|t| t.times(hour)),
            Some(1_700_000_000_000_000_000)
        );
    }

    #[test]
    fn what_does_not_fit_or_is_no_number_is_none() {
        for text in [
            "",
            "-",
            ".",
            "e3",
            "1e",
            "1.2.3",
            "1e99",
            "9223372037",
            "0x1",
            "1 ",
            "nan",
            "1e99999999999",
        ] {
            assert_eq!(ns(text), None, "{text:?}");
        }
    }

    #[test]
    fn only_whole_numbers_are_whole() {
        let whole = |text: &str| Decimal::parse(text.as_bytes()).map(Decimal::is_whole);
        assert_eq!(whole("3.00"), Some(true));
        assert_eq!(whole("1.5e1"), Some(true));
        assert_eq!(whole("0.000"), Some(true));
        assert_eq!(whole("3.5"), Some(false));
        assert_eq!(whole("1e-400"), Some(false));
    }
}
