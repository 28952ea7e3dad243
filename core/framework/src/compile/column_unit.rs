//! Whether the columns of a signal are named for another unit than the signal's.

use crate::unit::Unit;

/// The unit at the end of a column pattern, as in `{channel}_degC` or `Z [mm]`. A single letter is none but for `K` and `%`: `_m` may as
/// well stand for measured. A number is none, nor what stands in brackets with a serial number.
fn of_name(column: &str) -> Option<Unit> {
    let ending = match column.rsplit_once('}') {
        Some((_, ending)) => ending,
        None => column.rsplit_once(['_', ' ', '[', '('])?.1,
    };
    let ending = ending.trim_matches(['_', ' ', '-', '.', '[', ']', '(', ')']);
    if ending.chars().count() < 2 && !["K", "%"].contains(&ending) {
        return None;
    }
    let behind = column
        .rsplit_once(['[', '('])
        .map_or("", |(_, behind)| behind);
    let is_serial = ["S/N", "SN:", "serial", "Serial"]
        .iter()
        .any(|of| behind.contains(of));
    let letters = ending.trim_end_matches(|c: char| c.is_ascii_digit());
    let is_label = letters.is_empty() || ending.len() - letters.len() > 1;
    Unit::in_words(ending).filter(|_| !is_serial && !is_label)
}

/// The unit that columns are named for, where it is another one than the signal's that measures the same, or the scale of
/// temperature that was meant by its letter.
pub(super) fn other_than(unit: &Unit, column: &str) -> Option<Unit> {
    let meant = |named: &Unit| unit.scale_meant().is_some() && named.measures_same(&Unit::kelvin());
    of_name(column).filter(|named| named.is_another_than(unit) || meant(named))
}

#[cfg(test)]
mod tests {
    use super::other_than;
    use crate::unit::Unit;

    fn other(unit: &str, column: &str) -> Option<String> {
        let unit = Unit::parse(unit).expect("a unit");
        other_than(&unit, column).map(|named| named.to_string())
    }

    #[test]
    fn columns_that_are_named_for_another_unit_of_the_same_kind_are_found() {
        assert_eq!(other("nm", "{channel}_um").as_deref(), Some("um"));
        assert_eq!(other("K", "T_{channel}_degC").as_deref(), Some("Cel"));
        assert_eq!(other("Cel", "{channel}_K").as_deref(), Some("K"));
        assert_eq!(other("um", "Z [mm]").as_deref(), Some("mm"));
        assert_eq!(other("1", "{channel} (%)").as_deref(), Some("%"));
        assert_eq!(other("1", "{channel}_pct").as_deref(), Some("%"));
        assert_eq!(other("C", "{channel}_degC").as_deref(), Some("Cel"));
        assert_eq!(other("F", "{channel}_degF").as_deref(), Some("[degF]"));
    }

    #[test]
    fn columns_that_are_named_for_the_same_unit_or_for_none_are_not() {
        for (unit, column) in [
            ("um", "{channel}_µm"),
            ("Cel", "{channel}_degC"),
            ("um", "{channel}_m"),
            ("C", "{channel}_kWh"),
            ("um", "{channel}"),
            ("um", "{channel}_pos"),
            ("V", "heater_degC"),
            ("nm", "position"),
        ] {
            assert_eq!(other(unit, column), None, "{column} in {unit}");
        }
    }
}
