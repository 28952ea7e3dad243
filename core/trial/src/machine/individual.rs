//! Which machine of its type is simulated: how far its parameters are from those of the design; not which parameters it has.

use std::fmt;
use std::str::FromStr;

use athermal_core::prng::Prng;

/// One machine of a type, drawn around the design.
///
/// Each physical parameter is that of the design times `exp(s n)`, with the spread `s` and a standard normal `n` of the parameter's own
/// stream of the seed: a log-normal distribution with the design as its median. A sensor's offset is `s n` times a width. So parameters
/// keep their sign, and one more parameter leaves the others as they were. A spread of 0 is the design, to the bit.
///
/// ```
/// use athermal_trial::machine::{Individual, Spread};
///
/// let machine = Individual { spread: "30%".parse()?, seed: 7 };
/// assert_eq!(machine.factor("stage expansion"), machine.factor("stage expansion"));
/// assert_ne!(machine.factor("stage expansion"), machine.factor("frame expansion"));
/// assert_eq!(Individual::DESIGN.factor("stage expansion"), 1.0);
/// # Ok::<(), athermal_trial::machine::SpreadError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Individual {
    /// How far parameters are from the design.
    pub spread: Spread,
    /// The seed of the parameters, apart from that of weather, motions and noise.
    pub seed: u64,
}

impl Individual {
    /// The machine as designed.
    pub const DESIGN: Self = Self {
        spread: Spread(0.0),
        seed: 1,
    };

    /// What the parameter of that name is multiplied with.
    #[must_use]
    pub fn factor(&self, parameter: &str) -> f64 {
        libm::exp(self.offset(parameter))
    }

    /// What is added to a parameter of that name, in units of its width.
    #[must_use]
    pub fn offset(&self, parameter: &str) -> f64 {
        let Spread(spread) = self.spread;
        if spread == 0.0 {
            return 0.0;
        }
        spread * Prng::stream(self.seed, &format!("individual {parameter}")).normal()
    }
}

/// The standard deviation of the logarithm of a parameter over machines, 0 to 1: `30%`, or as a share `0.3`.
#[derive(Debug, Clone, Copy, Default, PartialEq, PartialOrd)]
pub struct Spread(f64);

impl Spread {
    /// As a share.
    #[must_use]
    pub fn share(self) -> f64 {
        self.0
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // What is written as a percentage is one to so many places.
        write!(f, "{}%", (self.0 * 1e8).round() / 1e6)
    }
}

impl FromStr for Spread {
    type Err = SpreadError;

    fn from_str(text: &str) -> Result<Self, SpreadError> {
        let (number, unit) = match text.trim().strip_suffix('%') {
            Some(percent) => (percent.trim_end(), 100.0),
            None => (text.trim(), 1.0),
        };
        let share = number.parse::<f64>().map(|number| number / unit);
        let allowed = share.ok().filter(|share| (0.0..=1.0).contains(share));
        // No negative zero.
        allowed.map(|share| Self(share + 0.0)).ok_or(SpreadError)
    }
}

/// A spread is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SpreadError;

impl fmt::Display for SpreadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected a spread from 0% to 100%, such as 30%")
    }
}

impl std::error::Error for SpreadError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_a_percentage_or_a_share() {
        for (text, shown) in [
            ("30%", "30%"),
            ("0.3", "30%"),
            (" 2.5 % ", "2.5%"),
            ("-0%", "0%"),
        ] {
            assert_eq!(text.parse::<Spread>().unwrap().to_string(), shown);
        }
        for text in ["30", "-1%", "101%", "NaN", "%", "", "a lot"] {
            assert_eq!(text.parse::<Spread>(), Err(SpreadError), "{text}");
        }
    }

    #[test]
    fn the_logarithms_of_factors_have_the_spread() {
        let spread: Spread = "30%".parse().unwrap();
        let logs: Vec<f64> = (0..4000)
            .map(|seed| Individual { spread, seed }.factor("expansion").ln())
            .collect();
        let n = logs.len() as f64;
        let mean = logs.iter().sum::<f64>() / n;
        let deviation = (logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / n).sqrt();
        // Standard errors: 0.0047 of the mean, 0.0034 of the deviation.
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((deviation - 0.3).abs() < 0.015, "{deviation}");
    }
}
