//! What of a text with syntax errors stands as it was meant, and where something is lost; the errors themselves are told by the parser.
//!
//! A parser that goes on behind an error takes what follows for what it is not. So the statements that an error touches are
//! left out, and the rest is read again.

mod statements;
#[cfg(test)]
mod tests;

use std::ops::Range;

use toml::de::DeTable;

use statements::{Statement, header, key, statements};

/// How often the rest is read again. A turn leaves out at least one statement; a text that needs more is hopeless.
const MOST_TURNS: usize = 20;

/// A text without the statements that syntax errors touch; everything else stands at its place.
#[derive(Debug)]
pub(super) struct Salvaged {
    pub(super) text: String,
    pub(super) lost: Vec<Lost>,
    /// The errors that none of the others brought about.
    pub(super) errors: Vec<SyntaxError>,
}

/// What the parser says of a place.
#[derive(Debug, Clone)]
pub(super) struct SyntaxError {
    pub(super) bytes: Range<usize>,
    pub(super) reason: String,
    /// The value without quotes that it stumbled over, where it is one.
    pub(super) bare: Option<String>,
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

/// What is left of a `text` with errors; `None` where it cannot be told what they touch.
pub(super) fn salvage(text: &str) -> Option<Salvaged> {
    let statements = statements(text);
    // A parser takes what follows an open bracket for a part of it, so that its errors there say nothing.
    let mut left_out: Vec<bool> = statements.iter().map(|one| !one.closed).collect();
    let statement_at = |at: usize| {
        // An error behind the last statement is one of it.
        let behind = statements.partition_point(|one| one.bytes.start <= at);
        behind.saturating_sub(1)
    };
    let open = statements.iter().filter(|one| !one.closed);
    let mut told: Vec<SyntaxError> = open
        .flat_map(|one| causes(&errors(&text[one.bytes.clone()], one.bytes.start)).to_vec())
        .collect();
    for turn in 0..MOST_TURNS {
        let homeless = leave_out_homeless(&statements, &mut left_out);
        if turn == 1 {
            // What is said of keys under a wrong header may be meant of those under another.
            told.retain(|error| !homeless[statement_at(error.bytes.start)]);
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
        for error in &found {
            let out = left_out.get_mut(statement_at(error.bytes.start))?;
            goes_on |= !std::mem::replace(out, true);
        }
        if !goes_on {
            return None;
        }
        if turn == 0 {
            let same = |a: &SyntaxError, b: &SyntaxError| {
                statement_at(a.bytes.start) == statement_at(b.bytes.start)
            };
            told.extend(found.chunk_by(same).flat_map(causes).cloned());
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

/// What the parser says of a key that stands twice.
pub(super) const DUPLICATE_KEY: &str = "duplicate key";

/// What the parser says of a text that begins at a byte of a file, in order.
pub(super) fn errors(text: &str, start: usize) -> Vec<SyntaxError> {
    let (_, errors) = DeTable::parse_recoverable(text);
    let placed = |error: &toml::de::Error| {
        let bytes = error.span().unwrap_or(text.len()..text.len());
        SyntaxError {
            bare: bare(text, &bytes).filter(|_| error.message() != DUPLICATE_KEY),
            bytes: start + bytes.start..start + bytes.end,
            reason: error.message().to_owned(),
        }
    };
    let mut errors: Vec<_> = errors.iter().map(placed).collect();
    errors.sort_by_key(|error| error.bytes.start);
    errors
}

/// Those errors of one statement that do not follow from its first: each text without quotes is a mistake of its own.
fn causes(errors: &[SyntaxError]) -> &[SyntaxError] {
    let own = errors.iter().take_while(|error| error.bare.is_some());
    &errors[..own.count().max(1).min(errors.len())]
}

/// The text of a value that has no quotes, where it should have.
fn bare(text: &str, span: &Range<usize>) -> Option<String> {
    let found = text.get(span.clone())?;
    let is_value = text[..span.start].trim_end().ends_with(['=', '[', ',']);
    let is_key = text[span.end..].trim_start().starts_with(['=', '.']);
    let is_word = found.starts_with(char::is_alphanumeric)
        && found.contains(char::is_alphabetic)
        && !found.contains(['"', '\'', '\n']);
    (is_value && !is_key && is_word).then(|| found.to_owned())
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
            (false, Some(above)) if statement.keys > 1 && above.len() < 2 => None,
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
