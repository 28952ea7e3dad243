//! Which known name an unknown one may have meant; it never decides that a name is wrong.

/// Longest name that is compared, in bytes: a longer text is not a misspelt name, and comparing takes time in the product of the lengths.
const LONGEST: usize = 64;

/// Shortest name that another may continue, in bytes.
const SHORTEST: usize = 3;

/// The candidate that is spelt most like `name`, if one is near enough to be meant.
///
/// Near is a Damerau–Levenshtein distance of at most a third of the longer name, at least 1, capital letters aside; the first of equals is taken.
/// A name that only continues or shortens a candidate of three letters or more counts as near too.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if name.is_empty() || name.len() > LONGEST {
        return None;
    }
    let wanted = name.to_lowercase();
    let mut best: Option<(usize, &str)> = None;
    for candidate in candidates {
        if candidate.len() > LONGEST || candidate == name {
            continue;
        }
        let known = candidate.to_lowercase();
        let (one, other) = (wanted.chars().count(), known.chars().count());
        let longer = one.max(other);
        let farthest = (longer / 3).max(1);
        let shorter = wanted.len().min(known.len());
        let continues =
            shorter >= SHORTEST && (wanted.starts_with(&known) || known.starts_with(&wanted));
        // Names whose lengths differ by more are farther apart, and a file of many names has many such.
        if !continues && one.abs_diff(other) > farthest {
            continue;
        }
        let distance = strsim::damerau_levenshtein(&wanted, &known);
        let near = distance <= farthest && distance < longer;
        if (near || continues) && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn a_slip_of_the_finger_finds_its_name() {
        let names = ["thermal", "motion", "both", "vote"];
        assert_eq!(nearest("themal", names), Some("thermal"));
        assert_eq!(nearest("motoin", names), Some("motion"));
        assert_eq!(nearest("Vote", names), Some("vote"));
        assert_eq!(nearest("therm", names), Some("thermal"));
    }

    #[test]
    fn a_name_of_its_own_finds_nothing() {
        assert_eq!(nearest("pressure", ["thermal", "motion"]), None);
        assert_eq!(nearest("", ["a"]), None);
        assert_eq!(nearest("x", ["y"]), None);
        assert_eq!(nearest(&"x".repeat(1000), ["x"]), None);
    }

    #[test]
    fn the_nearest_of_several_is_taken_and_the_first_of_equals() {
        assert_eq!(nearest("x12", ["x1", "x2"]), Some("x1"));
        assert_eq!(nearest("windws", ["window", "windows"]), Some("windows"));
    }
}
