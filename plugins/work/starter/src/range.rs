//! Decides between which values a starter graph takes samples, and how that is written: as a range, or as a proposal of one.

use athermal_core::unit::Unit;

use athermal_analysis::figures::number;

/// By how much a machine may be warmer or colder than in its log, in K: less than what a broken wire or a full scale seems to be.
const PLAUSIBLE_K: f64 = 100.0;

/// A range in which temperatures can be, as these have been; of other quantities it is only proposed, unless it leaves out what
/// stands for `nothing`.
pub fn line(unit: &str, (low, high): (f64, f64), nothing: &[f64]) -> String {
    let half = (high - low) / 2.0;
    let per_kelvin = Unit::parse(unit).ok();
    let per_kelvin = per_kelvin.and_then(|unit| Unit::kelvin().factor_to(&unit));
    if let Some(factor) = per_kelvin {
        let margin = half.max(PLAUSIBLE_K * factor);
        let (mut from, mut to) = ((low - margin).floor(), (high + margin).ceil());
        for &nothing in nothing {
            // To a tenth, since temperatures may lie near what stands for none.
            if (from..low).contains(&nothing) {
                from = (5.0 * (nothing + low)).ceil() / 10.0;
            } else if nothing > high && nothing <= to {
                to = (5.0 * (nothing + high)).floor() / 10.0;
            }
        }
        let seen = format!("seen: {} to {}", number(low), number(high));
        return format!(
            "range = [\"{from} {unit}\", \"{to} {unit}\"]  # {seen}; a value outside is a fault, and left out\n"
        );
    }
    if let Some(margin) = margin(low, high, nothing) {
        let (range, seen) = written(unit, (low, high), margin);
        return format!(
            "range = {range}  # {seen}; {} stands for no value, and is left out\n",
            number(nothing[0])
        );
    }
    if half > 0.0 {
        let (range, seen) = written(unit, (low, high), half);
        return format!("# range = {range}  # {seen}; a value outside would be left out\n");
    }
    String::new()
}

/// How far beyond its ends a range may reach that leaves out what stands for nothing; none where that lies between them.
fn margin(low: f64, high: f64, nothing: &[f64]) -> Option<f64> {
    let away = nothing.iter().map(|of| (low - of).max(of - high));
    let nearest = away.reduce(f64::min).filter(|away| *away > 0.0)?;
    let wide = Some(10.0 * (high - low)).filter(|wide| *wide > 0.0);
    Some(wide.map_or(0.5 * nearest, |wide| wide.min(0.5 * nearest)))
}

/// The range that reaches so far beyond what was seen, and what was seen: to so many digits that the margin is kept to a tenth.
fn written(unit: &str, (low, high): (f64, f64), margin: f64) -> (String, String) {
    let step = 10_f64.powf(margin.log10().floor() - 1.0);
    let decimals = (-step.log10()).round();
    let text = |value: f64| {
        if (0.0..=9.0).contains(&decimals) {
            format!("{value:.*}", decimals as usize)
        } else if decimals < 0.0 && value.abs() < 1e15 {
            format!("{value:.0}")
        } else {
            format!("{value:e}")
        }
    };
    let (from, to) = (low - margin, high + margin);
    let (from, to) = ((from / step).floor() * step, (to / step).ceil() * step);
    (
        format!("[\"{} {unit}\", \"{} {unit}\"]", text(from), text(to)),
        format!("seen: {} to {}", text(low), text(high)),
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// The ends of a range that is written.
    fn ends(line: &str) -> (f64, f64) {
        let (_, list) = line.split_once("= [").unwrap();
        let mut ends = list
            .split('"')
            .filter_map(|part| part.split(' ').next()?.parse().ok());
        (ends.next().unwrap(), ends.next().unwrap())
    }

    #[test]
    fn a_range_holds_what_was_seen_and_leaves_out_what_stands_for_nothing_whatever_the_size() {
        for size in [1e-12, 3e-5, 1.0, 1234.624, 7.7e8, 1e16] {
            for width in [0.0, 1e-7, 1e-3, 0.4] {
                for nothing in [0.0, -9999.0 * size] {
                    let (low, high) = (size, size + width * size);
                    let line = line("um", (low, high), &[nothing]);
                    assert!(line.starts_with("range"), "{line}");
                    let (from, to) = ends(&line);
                    assert!(from < low && high < to && from < to, "{line}");
                    assert!(!(from..=to).contains(&nothing), "{line}");
                }
            }
        }
    }

    #[test]
    fn a_proposal_holds_what_was_seen_and_of_what_never_changes_there_is_none() {
        let (from, to) = ends(&line("um", (1234.624, 1234.625), &[]));
        assert!(from < 1234.624 && to > 1234.625 && to - from < 0.01);
        assert_eq!(line("um", (3.0, 3.0), &[]), "");
        assert_eq!(
            line("nm", (-20.4, 81.3), &[]),
            "# range = [\"-72 nm\", \"133 nm\"]  # seen: -20 to 81; a value outside would be left out\n"
        );
    }
}
