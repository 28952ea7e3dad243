//! What of a text with syntax errors stands as it was meant, and where something is lost; the errors themselves are told by the parser.
//!
//! A parser that goes on behind an error takes what follows for what it is not. So the statements that an error touches are
//! left out, and the rest is read again.

use std::ops::Range;

use toml::de::DeTable;

/// How often the rest is read again. A turn leaves out at least one statement; a text that needs more is hopeless.
const MOST_TURNS: usize = 20;

/// A text without the statements that syntax errors touch; everything else stands at its place.
#[derive(Debug)]
pub(super) struct Salvaged {
    pub(super) text: String,
    pub(super) lost: Vec<Lost>,
    /// The errors that none of the others brought about: where, and what the parser says.
    pub(super) errors: Vec<(Range<usize>, String)>,
}

/// A statement that was left out.
#[derive(Debug, PartialEq)]
pub(super) struct Lost {
    /// The keys from the file down to what it would have said; none where they cannot be made out.
    pub(super) way: Option<Vec<String>>,
    /// The bytes under all headers that lead to the same named thing.
    pub(super) around: Vec<Range<usize>>,
}

impl Lost {
    /// Whether `schema` may have stood there.
    pub(super) fn may_be_schema(&self) -> bool {
        let way = self.way.as_deref();
        way.is_none_or(|way| way.first().is_some_and(|key| key == "schema"))
    }
}

/// A key with its value, or a header.
#[derive(Debug)]
struct Statement {
    bytes: Range<usize>,
    /// Whether its brackets and quotes are closed.
    closed: bool,
    is_header: bool,
    /// Whether a header stands inside of it, as in a text of several lines that ends where another should begin.
    swallows: bool,
}

/// What is left of a `text` with errors; `None` where it cannot be told what they touch.
pub(super) fn salvage(text: &str) -> Option<Salvaged> {
    let statements = statements(text);
    // A parser takes what follows an open bracket for a part of it, so that its errors there say nothing.
    let mut left_out: Vec<bool> = statements.iter().map(|one| !one.closed).collect();
    // A quote that is not closed also leaves the brackets around it open.
    let first = |one: &Statement| {
        let found = errors(&text[one.bytes.clone()], one.bytes.start);
        found.into_iter().min_by_key(|(bytes, _)| bytes.start)
    };
    let open = statements.iter().filter(|one| !one.closed);
    let mut told: Vec<_> = open.filter_map(first).collect();
    let statement_at = |at: usize| {
        // An error behind the last statement is one of it.
        let behind = statements.partition_point(|one| one.bytes.start <= at);
        behind.saturating_sub(1)
    };
    for turn in 0..MOST_TURNS {
        let homeless = leave_out_homeless(&statements, &mut left_out);
        if turn == 1 {
            // What is said of keys under a wrong header may be meant of those under another.
            told.retain(|(bytes, _)| !homeless[statement_at(bytes.start)]);
        }
        let rest = without(text, &statements, &left_out);
        let found = errors(&rest, 0);
        if found.is_empty() {
            return Some(Salvaged {
                lost: lost(text, &statements, &left_out),
                text: rest,
                errors: told,
            });
        }
        let mut goes_on = false;
        for (bytes, _) in &found {
            let out = left_out.get_mut(statement_at(bytes.start))?;
            goes_on |= !std::mem::replace(out, true);
        }
        if !goes_on {
            return None;
        }
        if turn == 0 {
            told.extend(found);
        }
    }
    None
}

/// Leaves out what stands under a header that is left out, and gives which statements those are.
fn leave_out_homeless(statements: &[Statement], left_out: &mut [bool]) -> Vec<bool> {
    let mut no_home = false;
    let each = statements.iter().zip(left_out).map(|(statement, out)| {
        if statement.is_header {
            no_home = false;
        }
        let homeless = no_home;
        *out |= homeless;
        no_home |= *out && (statement.is_header || statement.swallows);
        homeless
    });
    each.collect()
}

/// What the parser says of a text that begins at a byte of a file.
pub(super) fn errors(text: &str, start: usize) -> Vec<(Range<usize>, String)> {
    let (_, errors) = DeTable::parse_recoverable(text);
    let placed = |error: &toml::de::Error| {
        let bytes = error.span().unwrap_or(text.len()..text.len());
        (
            start + bytes.start..start + bytes.end,
            error.message().to_owned(),
        )
    };
    errors.iter().map(placed).collect()
}

/// The text with blanks for what is left out, so that all else keeps its place.
fn without(text: &str, statements: &[Statement], left_out: &[bool]) -> String {
    let mut rest = String::with_capacity(text.len());
    let mut at = 0;
    for (statement, _) in statements.iter().zip(left_out).filter(|(_, out)| **out) {
        rest.push_str(&text[at..statement.bytes.start]);
        let blank = |byte| if byte == b'\n' { '\n' } else { ' ' };
        rest.extend(text[statement.bytes.clone()].bytes().map(blank));
        at = statement.bytes.end;
    }
    rest.push_str(&text[at..]);
    rest
}

fn lost(text: &str, statements: &[Statement], left_out: &[bool]) -> Vec<Lost> {
    let sections = sections(text, statements);
    let says_something = |statement: &Statement| {
        let line = text[statement.bytes.clone()].trim_start();
        !line.is_empty() && !line.starts_with('#')
    };
    let each = || statements.iter().zip(left_out);
    let is_there = |way: &Option<Vec<String>>| {
        let mut headers = each().filter(|(one, out)| one.is_header && !**out);
        headers.any(|(one, _)| header(&text[one.bytes.clone()]) == *way)
    };
    let is_list_header =
        |statement: &Statement| text[statement.bytes.clone()].trim_start().starts_with("[[");
    let lost = each().filter(|(statement, out)| **out && says_something(statement));
    lost.map(|(statement, _)| {
        let behind =
            sections.partition_point(|section| section.bytes.start <= statement.bytes.start);
        let section = &sections[behind.saturating_sub(1)];
        let way = match (statement.is_header, &section.way) {
            _ if statement.swallows => None,
            // A table that stands twice may be meant for any other.
            (true, way) if !is_list_header(statement) && is_there(way) => None,
            (true, way) => way.clone(),
            (false, Some(above)) => key(&text[statement.bytes.clone()])
                .map(|below| [&above[..], &below].concat())
                // Below a named thing it does not matter which key it was.
                .or_else(|| (above.len() > 1).then(|| above.clone())),
            (false, None) => None,
        };
        let named = way.as_deref().and_then(|way| way.get(..2));
        let of_same = sections.iter().filter(|section| {
            let its = section.way.as_deref().and_then(|way| way.get(..2));
            named.is_some() && its == named
        });
        let mut around: Vec<_> = of_same.map(|section| section.bytes.clone()).collect();
        if !around.contains(&section.bytes) {
            around.push(section.bytes.clone());
        }
        Lost { way, around }
    })
    .collect()
}

/// A header and what stands under it, up to the next; the first has no header.
struct Section {
    bytes: Range<usize>,
    way: Option<Vec<String>>,
}

fn sections(text: &str, statements: &[Statement]) -> Vec<Section> {
    let headers = statements.iter().filter(|one| one.is_header);
    let starts = headers.map(|one| (one.bytes.start, header(&text[one.bytes.clone()])));
    let starts: Vec<_> = std::iter::once((0, Some(Vec::new())))
        .chain(starts)
        .collect();
    let ends = starts
        .iter()
        .skip(1)
        .map(|(start, _)| *start)
        .chain([text.len()]);
    let sections = starts.iter().zip(ends);
    sections
        .map(|((start, way), end)| Section {
            bytes: *start..end,
            way: way.clone(),
        })
        .collect()
}

/// The keys of a header such as `[nodes.thermal]`, closed or not.
fn header(text: &str) -> Option<Vec<String>> {
    let text = text.trim_start().trim_start_matches('[');
    keys(text.split([']', '#', '\n']).next()?)
}

/// The keys before `=`.
fn key(text: &str) -> Option<Vec<String>> {
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
fn statements(text: &str) -> Vec<Statement> {
    let mut statements: Vec<Statement> = Vec::new();
    let mut open = Open::default();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let bytes = at..at + line.len();
        at = bytes.end;
        let begins = match open.innermost() {
            _ if open.text.is_some() => false,
            None => true,
            // In a list stands no key, and no key in brackets of its own behind nothing.
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
                    is_header: line.trim_start().starts_with('['),
                    swallows: false,
                });
            }
        }
        let sound = open.follow(line);
        if let Some(last) = statements.last_mut() {
            last.closed &= sound;
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

/// What is open at the end of a line.
#[derive(Default)]
struct Open {
    brackets: Vec<char>,
    /// The quotes of a text of several lines.
    text: Option<&'static str>,
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
            let Some(at) = rest.find(['"', '\'', '[', ']', '{', '}', '#']) else {
                return true;
            };
            let found = &rest[at..];
            let mark = found.chars().next().unwrap_or_default();
            rest = &found[1..];
            match mark {
                '#' => return true,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The text that is left, without blank lines, and the ways to what is lost.
    fn left(text: &str) -> (Vec<String>, Vec<String>) {
        let salvaged = salvage(text).expect("it is plain what the errors touch");
        assert_eq!(salvaged.text.len(), text.len());
        let lines = salvaged.text.lines().map(str::trim_end);
        let lines = lines.filter(|line| !line.is_empty()).map(str::to_owned);
        let ways = salvaged.lost.iter();
        let ways = ways.map(|lost| {
            lost.way
                .as_ref()
                .map_or("?".to_owned(), |way| way.join("."))
        });
        (lines.collect(), ways.collect())
    }

    #[test]
    fn a_value_without_quotes_costs_its_key_alone() {
        let (lines, lost) = left("schema = 1\nname = x y\n[sets]\naxis = [\"X\"]\n");
        assert_eq!(lines, ["schema = 1", "[sets]", "axis = [\"X\"]"]);
        assert_eq!(lost, ["name"]);
    }

    #[test]
    fn a_list_of_several_lines_is_lost_whole_and_what_follows_an_open_one_is_not() {
        let (lines, lost) = left("[sets]\naxis = [\n  \"X\",\n  Y,\n]\nside = [\"a\"]\n");
        assert_eq!(lines, ["[sets]", "side = [\"a\"]"]);
        assert_eq!(lost, ["sets.axis"]);
        let (lines, lost) = left("[nodes.a]\nwindows = [\"1min\",\nunit = \"K\"\n[nodes.b]\nx = 1");
        assert_eq!(lines, ["[nodes.a]", "unit = \"K\"", "[nodes.b]", "x = 1"]);
        assert_eq!(lost, ["nodes.a.windows"]);
    }

    #[test]
    fn a_header_that_is_not_closed_takes_what_stands_under_it_along() {
        let (lines, lost) = left("[nodes.a\nx = 1\n[nodes.b]\nx = 2 # [\"\n");
        assert_eq!(lines, ["[nodes.b]", "x = 2 # [\""]);
        assert_eq!(lost, ["nodes.a", "nodes.a.x"]);
    }

    #[test]
    fn a_quote_that_is_not_closed_ends_with_its_line() {
        let (lines, lost) = left("a = \"b\nc = \"d\"\ne = '''\nf = \n'''\n\"g\" = 1 2");
        assert_eq!(lines, ["c = \"d\"", "e = '''", "f =", "'''"]);
        assert_eq!(lost, ["a", "g"]);
    }

    #[test]
    fn what_follows_a_header_that_stands_twice_or_is_swallowed_is_lost() {
        let (lines, lost) = left("[nodes.a]\nx = 1\n[nodes.a]\nx = 2\n[nodes.b]\n");
        assert_eq!(lines, ["[nodes.a]", "x = 1", "[nodes.b]"]);
        assert_eq!(lost, ["?", "nodes.a.x"]);
        let (lines, lost) = left("a = \"\"\"b\"\n[nodes.a]\nx = \"\"\"c\"\ny = 1\n[nodes.b]\n");
        assert_eq!(lines, ["[nodes.b]"]);
        assert_eq!(lost, ["?", "y"]);
    }

    #[test]
    fn all_sections_of_a_named_thing_stand_around_what_it_lost() {
        let text = "[nodes.a]\nx = y\n[nodes.b]\n[nodes.a.inputs]\n";
        let salvaged = salvage(text).expect("one statement is wrong");
        let around: Vec<_> = salvaged.lost[0]
            .around
            .iter()
            .map(|bytes| &text[bytes.clone()])
            .collect();
        assert_eq!(around, ["[nodes.a]\nx = y\n", "[nodes.a.inputs]\n"]);
    }
}
