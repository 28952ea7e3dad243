//! What the name of a column says: its words, and the unit among them.

use athermal_core::unit::Unit;

/// What a position is called.
pub(super) const POSITIONS: &str = "pos position displacement x y z gap offset probe deformation";

/// Whether a word, without a number at its end, is among these with blanks between them.
pub(super) fn is_among(known: &str, word: &str) -> bool {
    let word = word.trim_end_matches(|c: char| c.is_ascii_digit());
    known.split(' ').any(|of| of == word)
}

/// The parts of a column's name.
pub fn words(name: &str) -> Vec<&str> {
    name.split(|c: char| !(c.is_alphanumeric() || c == '°' || c == '%' || c == '/'))
        .filter(|word| !word.is_empty())
        .collect()
}

/// Whether a name ends in a unit, other than of time and of what may count its samples: `Z_nm`, `Z [nm]`, `Z/nm`.
pub fn ends_in_unit(name: &str) -> bool {
    let words = words(name);
    let last = words.iter().enumerate().next_back();
    let at_end = name.trim_end().ends_with([']', ')']);
    let bracketed = at_end.then(|| in_brackets(name)).flatten();
    let unit = bracketed.or_else(|| last.and_then(unit_of_word));
    unit.or_else(|| inches(name))
        .is_some_and(|unit| !(unit.measures_same(&Unit::second()) || is_count(&unit)))
}

/// The last unit in a name.
pub(super) fn unit_in(name: &str) -> Option<Unit> {
    let words = words(name);
    let last = || words.iter().enumerate().rev().find_map(unit_of_word);
    in_brackets(name).or_else(last).or_else(|| inches(name))
}

/// Whether a unit measures the same as another, which is given by its code.
pub(super) fn measures(unit: &Unit, what: &str) -> bool {
    Unit::parse(what).is_ok_and(|what| unit.measures_same(&what))
}

/// Whether a unit is that of a number of steps or the like, which have none of their own.
pub(super) fn is_count(unit: &Unit) -> bool {
    unit.text() == "1"
}

/// Words in brackets that are units, and as often something else: a minimum, degrees of either kind, what is measured and what is set.
const OTHERWISE: [&str; 5] = ["min", "deg", "PV", "MV", "N/A"];

/// The unit in the last brackets of a name that hold one: `Speed [1/min]`, `Speed (mm/s)`.
fn in_brackets(name: &str) -> Option<Unit> {
    let groups = name.match_indices(['[', '(']).collect::<Vec<_>>();
    groups.into_iter().rev().find_map(|(at, open)| {
        let close = if open == "[" { ']' } else { ')' };
        let rest = &name[at + 1..];
        unit_in_brackets(open, &rest[..rest.find(close)?])
    })
}

/// The unit that stands between brackets, which may number or name instead: `(a)`, `[1]`, `(T1)`, `(L/R)`.
pub(super) fn unit_in_brackets(open: &str, text: &str) -> Option<Unit> {
    let text = text.trim();
    if OTHERWISE.contains(&text) {
        return None;
    }
    let may_be_code = match text.split_once('/') {
        Some((_, below)) => text.len() > 3 || ["s", "h", "m"].contains(&below),
        // A single letter as often says which of several it is, such as the left one.
        None if text.chars().count() == 1 => open == "[" && text == "N",
        None => open == "[" && !is_label(text),
    };
    let has_letters = text.contains(|c: char| c.is_alphabetic() || "%°'".contains(c));
    let code = || (may_be_code && has_letters).then(|| Unit::in_words(text))?;
    Unit::in_name(text).or_else(code)
}

/// Whether a text is letters and a number, and no length to a power: `T1`, not `mm2`.
fn is_label(text: &str) -> bool {
    let letters = text.trim_end_matches(|c: char| c.is_ascii_digit());
    let is_length = Unit::in_name(letters).is_some_and(|unit| measures(&unit, "m"));
    letters.len() < text.len() && !is_length
}

/// The unit that a word of a name says which is not the first, or that stands behind its slash.
fn unit_of_word((place, word): (usize, &&str)) -> Option<Unit> {
    let whole = (place > 0).then(|| Unit::in_name(word)).flatten();
    whole.or_else(|| {
        let (quantity, unit) = word.rsplit_once('/')?;
        let is_named = Unit::in_name(quantity).is_some();
        let is_per_time = ["s", "min", "h"].contains(&unit);
        if is_per_time && place > 0 && (is_named || ["1", "l", "L"].contains(&quantity)) {
            return Unit::parse(word).ok();
        }
        // Of what else is per another, one may be a quantity: `A/mm`.
        (!is_named).then(|| Unit::in_name(unit))?
    })
}

/// The inch, where `in` can be nothing else: in brackets, or behind the name of a position. `T_in` is that of an inlet.
fn inches(name: &str) -> Option<Unit> {
    let lower = name.trim().to_lowercase();
    let in_brackets = lower.ends_with("[in]") || lower.ends_with("(in)");
    let words = words(&lower);
    let (last, rest) = words.split_last()?;
    let is_position = |word: &&str| is_among(POSITIONS, word);
    let is_unit = in_brackets || *last == "in" && rest.iter().any(is_position);
    is_unit.then(|| Unit::parse("[in_i]").ok())?
}
