//! Where a value is given to a node in another unit than it has: by a factor, never by an offset.
//!
//! A conversion is inserted where what is meant is not in doubt:
//!
//! - voters of a combiner are given in the unit of the truth, or where there is none in that of the first voter;
//! - an input port that declares a unit is given its channels in it;
//! - what a loop-closing node reads is given in the unit that it says.
//!
//! Points on a temperature scale (`Cel`) and differences (`K`) are different things: neither is taken for the other, and no
//! scale is turned into another, since that takes an offset.

use super::plan::Conversion;
use super::problem;
use crate::diagnostic::Problem;
use crate::unit::Unit;

/// The conversions that give channels of these units and names in `target`.
///
/// # Errors
/// For each channel that does not convert, why.
pub(super) fn conversions<'a>(
    channels: impl Iterator<Item = (&'a str, &'a Unit)>,
    target: &Unit,
    wanted_by: &str,
) -> Result<Vec<Conversion>, Vec<Box<dyn Problem>>> {
    let (mut conversions, mut problems) = (Vec::new(), Vec::new());
    for (entry, (name, unit)) in channels.enumerate() {
        match factor(unit, target) {
            Some(1.0) => {}
            Some(factor) => conversions.push(Conversion::new(entry, factor)),
            None => problems.push(mismatch(name, unit, wanted_by, target)),
        }
    }
    if problems.is_empty() {
        Ok(conversions)
    } else {
        Err(problems)
    }
}

/// The factor from one unit to another, where a factor is all that it takes.
pub(super) fn factor(from: &Unit, to: &Unit) -> Option<f64> {
    if from == to {
        return Some(1.0);
    }
    let is_plain = !from.is_temperature_point() && !to.is_temperature_point();
    from.factor_to(to).filter(|_| is_plain)
}

/// Why a channel cannot be given in a unit.
pub(super) fn mismatch(
    channel: &str,
    unit: &Unit,
    wanted_by: &str,
    wanted: &Unit,
) -> Box<dyn Problem> {
    if unit.measures_same(wanted) && unit.is_temperature_point() != wanted.is_temperature_point() {
        Box::new(problem::PointOrDifference {
            channel: channel.to_owned(),
            unit: unit.clone(),
            wanted_by: wanted_by.to_owned(),
            wanted: wanted.clone(),
        })
    } else {
        Box::new(problem::Units {
            first: wanted_by.to_owned(),
            first_unit: wanted.clone(),
            second: channel.to_owned(),
            second_unit: unit.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(text: &str) -> Unit {
        text.parse().unwrap()
    }

    #[test]
    fn a_factor_is_found_and_an_offset_never() {
        assert_eq!(factor(&unit("um/min"), &unit("nm/min")), Some(1000.0));
        assert_eq!(factor(&unit("K/s"), &unit("mK/min")), Some(60_000.0));
        assert_eq!(factor(&unit("Cel"), &unit("degC")), Some(1.0));
        for (from, to) in [
            ("Cel", "K"),
            ("K", "Cel"),
            ("Cel", "[degF]"),
            ("nm", "nm/min"),
        ] {
            assert_eq!(factor(&unit(from), &unit(to)), None, "{from} to {to}");
        }
    }
}
