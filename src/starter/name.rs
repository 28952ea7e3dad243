//! What the name of a column says: its words, and the unit among them.

use athermal::core::unit::Unit;

/// What a position is called.
pub(super) const POSITIONS: [&str; 10] = [
    "pos",
    "position",
    "displacement",
    "x",
    "y",
    "z",
    "gap",
    "offset",
    "probe",
    "deformation",
];

/// The parts of a column's name.
pub fn words(name: &str) -> Vec<&str> {
    name.split(|c: char| !(c.is_alphanumeric() || c == '°' || c == '%' || c == '/'))
        .filter(|word| !word.is_empty())
        .collect()
}

/// Whether a name ends in a unit, other than of time: `Z_nm`, `Z [nm]`, `Z/nm`.
pub fn ends_in_unit(name: &str) -> bool {
    let words = words(name);
    let last = words.iter().enumerate().next_back();
    last.and_then(unit_of_word).is_some() || inches(name).is_some()
}

/// The last unit in a name.
pub(super) fn unit_in(name: &str) -> Option<Unit> {
    let words = words(name);
    let unit = words.iter().enumerate().rev().find_map(unit_of_word);
    unit.or_else(|| inches(name))
}

/// The unit that a word of a name says which is not the first, or that stands behind its slash.
fn unit_of_word((place, word): (usize, &&str)) -> Option<Unit> {
    let whole = (place > 0).then(|| Unit::in_name(word)).flatten();
    whole.or_else(|| {
        let (quantity, unit) = word.rsplit_once('/')?;
        // A unit per another is no quantity in a unit.
        Unit::in_name(quantity)
            .is_none()
            .then(|| Unit::in_name(unit))?
    })
}

/// The inch, where `in` can be nothing else: in brackets, or behind the name of a position. `T_in` is that of an inlet.
fn inches(name: &str) -> Option<Unit> {
    let lower = name.trim().to_lowercase();
    let in_brackets = lower.ends_with("[in]") || lower.ends_with("(in)");
    let words = words(&lower);
    let (last, rest) = words.split_last()?;
    let is_position = |word: &&str| POSITIONS.contains(&word.trim_end_matches(char::is_numeric));
    let is_unit = in_brackets || *last == "in" && rest.iter().any(is_position);
    is_unit.then(|| Unit::parse("[in_i]").ok())?
}
