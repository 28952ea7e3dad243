//! `{axis}` in texts: which placeholders a text has, and the member in their place; choices like `{a,b}` are left alone.

/// The names in braces without a comma, in order.
pub fn names(text: &str) -> impl Iterator<Item = &str> {
    pieces(text).filter_map(|piece| match piece {
        Piece::Placeholder(name) => Some(name),
        Piece::Plain(_) => None,
    })
}

/// The text with each known placeholder replaced by its member.
pub fn fill(text: &str, members: &[(&str, &str)]) -> String {
    if !text.contains('{') {
        return text.to_owned();
    }
    let mut filled = String::with_capacity(text.len());
    for piece in pieces(text) {
        match piece {
            Piece::Plain(plain) => filled.push_str(plain),
            Piece::Placeholder(name) => match members.iter().find(|(set, _)| *set == name) {
                Some((_, member)) => filled.push_str(member),
                None => filled.extend(["{", name, "}"]),
            },
        }
    }
    filled
}

enum Piece<'a> {
    Plain(&'a str),
    Placeholder(&'a str),
}

fn pieces(text: &str) -> impl Iterator<Item = Piece<'_>> {
    let mut rest = text;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (piece, length) = next_piece(rest);
        rest = &rest[length..];
        Some(piece)
    })
}

fn next_piece(text: &str) -> (Piece<'_>, usize) {
    let mut from = 0;
    // The innermost braces are the placeholder, so that `{{axis},room}` is a choice between a member and a name.
    while let Some(open) = text[from..].find('{').map(|at| from + at) {
        let inside = &text[open + 1..];
        match inside.find(['{', '}', ',']) {
            Some(end) if inside.as_bytes()[end] == b'}' => {
                return match open {
                    0 => (Piece::Placeholder(&inside[..end]), end + 2),
                    _ => (Piece::Plain(&text[..open]), open),
                };
            }
            _ => from = open + 1,
        }
    }
    (Piece::Plain(text), text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_take_the_place_of_placeholders() {
        assert_eq!(fill("drift.{axis}", &[("axis", "Z1")]), "drift.Z1");
        assert_eq!(
            fill("{side}{axis}/{side}", &[("side", "1"), ("axis", "X")]),
            "1X/1"
        );
        assert_eq!(fill("plain", &[("axis", "Z1")]), "plain");
    }

    #[test]
    fn choices_stay_and_may_hold_members() {
        assert_eq!(fill("drift.{X1,Y1}", &[("axis", "Z1")]), "drift.{X1,Y1}");
        assert_eq!(
            fill("drift.{{axis},Y1}", &[("axis", "Z1")]),
            "drift.{Z1,Y1}"
        );
        assert_eq!(
            fill("drift.{Y1,{axis}}", &[("axis", "Z1")]),
            "drift.{Y1,Z1}"
        );
    }

    #[test]
    fn names_are_those_in_braces_without_a_comma() {
        let found: Vec<&str> = names("{a}.{b,c}{d} {").collect();
        assert_eq!(found, ["a", "d"]);
        assert_eq!(names("{}").collect::<Vec<_>>(), [""]);
        assert_eq!(names("}{").count(), 0);
    }
}
