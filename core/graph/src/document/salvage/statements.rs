//! A text as statements: where a key with its value or a header begins and ends, also where brackets and quotes are wrong.

use std::ops::Range;

/// A key with its value, or a header.
#[derive(Debug)]
pub(super) struct Statement {
    pub(super) bytes: Range<usize>,
    /// Whether its brackets and quotes are closed.
    pub(super) closed: bool,
    pub(super) is_header: bool,
    /// Whether a header stands inside of it, as in a text of several lines that ends where another should begin.
    pub(super) swallows: bool,
    /// How many keys stand in it outside of brackets: more than one where lines run together.
    pub(super) keys: usize,
}

/// The keys of a header such as `[nodes.thermal]`, closed or not.
pub(super) fn header(text: &str) -> Option<Vec<String>> {
    let text = text.trim_start().trim_start_matches('[');
    keys(text.split([']', '#', '\n']).next()?)
}

/// The keys before `=`.
pub(super) fn key(text: &str) -> Option<Vec<String>> {
    keys(text.split_once('=')?.0)
}

/// Dotted keys; `None` where they hold anything that no name does.
fn keys(text: &str) -> Option<Vec<String>> {
    let plain = |key: &str| {
        let key = key.trim();
        let quoted = |quote: char| key.strip_prefix(quote)?.strip_suffix(quote);
        let key = quoted('"').or_else(|| quoted('\'')).unwrap_or(key);
        let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
        (!key.is_empty() && key.chars().all(is_name)).then(|| key.to_owned())
    };
    text.split('.').map(plain).collect()
}

/// The statements of a text in order, each up to where the next begins.
pub(super) fn statements(text: &str) -> Vec<Statement> {
    let mut statements: Vec<Statement> = Vec::new();
    let mut open = Open::default();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let bytes = at..at + line.len();
        at = bytes.end;
        let begins = match open.innermost() {
            _ if open.text.is_some() => false,
            // With these nothing begins: what they belong to has lost a bracket, or has one too many.
            None if is_half_header(line) => true,
            _ if line.trim_start().starts_with(['{', '}', ']', ',']) => false,
            None => true,
            // A list holds no keys, and nothing in brackets that has no quotes: it was not closed.
            Some('[') => is_header(line) || key(line).is_some(),
            Some(_) => is_header(line),
        };
        match statements.last_mut() {
            Some(last) if !begins => {
                last.bytes.end = bytes.end;
                last.swallows |= is_header(line);
            }
            last => {
                if let Some(last) = last {
                    last.closed &= open.brackets.is_empty();
                }
                open = Open::default();
                statements.push(Statement {
                    bytes,
                    closed: true,
                    is_header: line.trim_start().starts_with('[') || is_half_header(line),
                    swallows: false,
                    keys: 0,
                });
            }
        }
        let sound = open.follow(line);
        if let Some(last) = statements.last_mut() {
            last.closed &= sound;
            last.swallows |= ends_in_header(line);
            last.keys += std::mem::take(&mut open.keys);
        }
    }
    if let Some(last) = statements.last_mut() {
        last.closed &= open.brackets.is_empty() && open.text.is_none();
    }
    statements
}

/// Whether a line is a header and nothing else; a list of texts or numbers is none.
fn is_header(line: &str) -> bool {
    let line = line.split('#').next().unwrap_or_default().trim();
    let inside = line
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'));
    inside.is_some_and(|inside| inside.starts_with(|c: char| c.is_alphabetic() || c == '['))
        && header(line).is_some()
}

/// Whether a line may be a header that has lost its first bracket, or has something before it.
fn is_half_header(line: &str) -> bool {
    let line = line.split('#').next().unwrap_or_default().trim();
    line.ends_with(']') && line.contains(char::is_alphabetic) && !line.contains('=')
}

/// Whether a line goes over into a header, where the two should be lines of their own.
fn ends_in_header(line: &str) -> bool {
    let line = line.split('#').next().unwrap_or_default().trim();
    let (before, _) = line.split_at(line.rfind('[').unwrap_or(0));
    let before = before.trim_end_matches('[');
    let is_value = before.trim_end().ends_with(['=', ',']);
    !before.is_empty() && !is_value && is_header(&line[before.len()..])
}

/// What is open at the end of a line.
#[derive(Default)]
struct Open {
    brackets: Vec<char>,
    /// The quotes of a text of several lines.
    text: Option<&'static str>,
    /// How many keys stood outside of brackets.
    keys: usize,
}

impl Open {
    fn innermost(&self) -> Option<char> {
        self.brackets.last().copied()
    }

    /// Goes on by a line; false where a quote or a bracket has no other.
    fn follow(&mut self, line: &str) -> bool {
        let mut rest = line;
        loop {
            if let Some(quotes) = self.text {
                let Some(behind) = behind(rest, quotes) else {
                    return true;
                };
                (rest, self.text) = (behind, None);
            }
            let Some(at) = rest.find(['"', '\'', '[', ']', '{', '}', '#', '=']) else {
                return true;
            };
            let found = &rest[at..];
            let mark = found.chars().next().unwrap_or_default();
            rest = &found[1..];
            match mark {
                '#' => return true,
                '=' => self.keys += usize::from(self.brackets.is_empty()),
                '[' | '{' => self.brackets.push(mark),
                ']' | '}' => {
                    let opening = if mark == ']' { '[' } else { '{' };
                    if self.brackets.pop() != Some(opening) {
                        return false;
                    }
                }
                _ => {
                    let several = if mark == '"' { "\"\"\"" } else { "'''" };
                    if found.starts_with(several) {
                        (rest, self.text) = (&found[3..], Some(several));
                    } else {
                        let quote = &several[..1];
                        let Some(behind) = behind(rest, quote) else {
                            return false;
                        };
                        rest = behind;
                    }
                }
            }
        }
    }
}

/// What follows the end of a text in quotes, where it ends here.
fn behind<'a>(text: &'a str, quotes: &str) -> Option<&'a str> {
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        if let Some(behind) = rest.strip_prefix(quotes) {
            return Some(behind);
        }
        let mut characters = rest.chars();
        at += characters.next().map_or(1, char::len_utf8);
        if rest.starts_with('\\') && quotes.starts_with('"') {
            at += characters.next().map_or(0, char::len_utf8);
        }
    }
    None
}
