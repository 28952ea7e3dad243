//! What is usual elsewhere and no TOML: decimal commas, the quotes of word processors, backslashes in paths. Decides whether a syntax
//! error comes of it, and what to write instead; not what the parser says.

use std::ops::Range;

/// What is usual elsewhere, and no TOML.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ForeignSyntax {
    /// A number with a decimal comma.
    DecimalComma {
        /// The number with a point.
        number: String,
    },
    /// A text in the quotes of a word processor.
    CurlyQuotes {
        /// The text within.
        text: String,
    },
    /// A backslash in a text, of which it makes something else.
    Backslash {
        /// The text with slashes.
        text: String,
    },
}

const CURLY: [char; 10] = [
    '\u{201c}', '\u{201d}', '\u{201e}', '\u{201f}', '\u{2018}', '\u{2019}', '\u{201a}', '\u{201b}',
    '\u{ab}', '\u{bb}',
];

impl ForeignSyntax {
    /// What to write instead.
    pub(super) fn help(&self) -> String {
        match self {
            Self::DecimalComma { number } => {
                format!("a number has a decimal point: {number}")
            }
            Self::CurlyQuotes { text } => format!("quotes are straight: \"{text}\""),
            Self::Backslash { text } => format!(
                "in a text a backslash begins a special sign; write a path with slashes: \"{text}\""
            ),
        }
    }
}

/// What the text of a syntax error is, if it is such.
pub(super) fn of(text: &str, bytes: &Range<usize>) -> Option<ForeignSyntax> {
    let before = text.get(..bytes.start)?;
    let begin = before.rfind('\n').map_or(0, |at| at + 1);
    let rest = &text[begin..];
    let line = &rest[..rest.find('\n').unwrap_or(rest.len())];
    let at = bytes.start - begin;
    curly_quotes(line, at)
        .or_else(|| decimal_comma(line, at))
        .or_else(|| backslash(line, at))
}

fn curly_quotes(line: &str, at: usize) -> Option<ForeignSyntax> {
    let found = line.get(at..)?;
    let inner = found.strip_prefix(CURLY)?;
    let text = &inner[..inner.find(CURLY).unwrap_or(inner.len())];
    Some(ForeignSyntax::CurlyQuotes {
        text: text.trim_end().to_owned(),
    })
}

/// A number with a comma behind an equals sign, with digits on both sides of the comma.
fn decimal_comma(line: &str, at: usize) -> Option<ForeignSyntax> {
    line.match_indices('=')
        .filter(|(equals, _)| *equals < at)
        .find_map(|(equals, _)| {
            let value = line[equals + 1..].trim_start();
            let (whole, rest) = value.split_once(',')?;
            let digits = rest.find(|c: char| !c.is_ascii_digit());
            let fraction = &rest[..digits.unwrap_or(rest.len())];
            let is_whole = whole.trim_start_matches(['+', '-']);
            let is_number =
                |digits: &str| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
            (is_number(is_whole) && is_number(fraction)).then(|| ForeignSyntax::DecimalComma {
                number: format!("{whole}.{fraction}"),
            })
        })
}

/// A text in double quotes in which a backslash before the error begins no sign that there is.
fn backslash(line: &str, at: usize) -> Option<ForeignSyntax> {
    let (mut open, mut bad) = (None, false);
    let mut rest = line.char_indices();
    while let Some((place, c)) = rest.next() {
        match (c, open) {
            ('"', None) => open = Some(place + 1),
            ('"', Some(begin)) if bad => {
                return Some(ForeignSyntax::Backslash {
                    text: line[begin..place].replace('\\', "/"),
                });
            }
            ('"', Some(_)) => open = None,
            ('\\', Some(_)) if !bad => match is_escape(&line[place + 1..]) {
                true => drop(rest.next()),
                false => bad = place <= at,
            },
            _ => {}
        }
    }
    None
}

/// Whether what stands behind a backslash makes a sign with it.
fn is_escape(behind: &str) -> bool {
    let has_digits = |many: usize| {
        let digits = behind.get(1..=many);
        digits.is_some_and(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit()))
    };
    match behind.bytes().next() {
        Some(b'x') => has_digits(2),
        Some(b'u') => has_digits(4),
        Some(b'U') => has_digits(8),
        Some(c) => b"btnfre\"\\".contains(&c),
        None => false,
    }
}
