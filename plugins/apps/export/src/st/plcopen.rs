//! What the files in Structured Text declare, as one project in PLCopen XML (TC6, version 2.01): types, interfaces and values as elements,
//! bodies as text, and a task that calls the program. It is made from the texts, so that it says what they say.

use std::fmt::Write as _;

use super::word;
use crate::Exported;
use crate::c::File;
use crate::fmu::escaped;

/// Units of organization: how they begin, and what PLCopen calls them.
const UNITS: [(&str, &str); 3] = [
    ("FUNCTION", "function"),
    ("FUNCTION_BLOCK", "functionBlock"),
    ("PROGRAM", "program"),
];

/// Lists of their variables, likewise.
const SECTIONS: [(&str, &str); 4] = [
    ("VAR_INPUT\n", "inputVars"),
    ("VAR_OUTPUT\n", "outputVars"),
    ("VAR_IN_OUT\n", "inOutVars"),
    ("VAR\n", "localVars"),
];

/// The declarations of the files as elements, by the place that they have in a project.
#[derive(Default)]
struct Declarations {
    types: String,
    units: String,
    globals: String,
}

/// The files of a graph as a project. Its date is always the same, so that the same model gives the same file.
#[must_use]
pub fn plcopen(exported: &Exported) -> File {
    let form = &exported.form;
    let graph = word(&form.name);
    let mut all = Declarations::default();
    for file in &exported.files {
        all.read(&file.text, file.path.trim_end_matches(".st"));
    }
    let interval = match form.period_ns {
        ns if ns % 1_000_000_000 == 0 => format!("T#{}s", ns / 1_000_000_000),
        ns => format!("T#{}ms", ns as f64 / 1e6),
    };
    let notes = exported.files.get(1).and_then(|own| {
        let (_, notes) = own.text.split_once("\n\n")?;
        Some(notes.split_once("*)")?.0.trim())
    });
    // What users have written comes last, so that nothing is put in its place.
    let text = include_str!("project.xml.in")
        .replace("@types@", &all.types)
        .replace("@globals@", &all.globals)
        .replace("@units@", &all.units)
        .replace("@version@", env!("CARGO_PKG_VERSION"))
        .replace("@name@", &escaped(&form.name))
        .replace("@graph@", &graph)
        .replace("@interval@", &interval)
        .replace("@title@", &escaped(&form.title))
        .replace("@revision@", &escaped(&form.revision))
        .replace("@notes@", &escaped(notes.unwrap_or_default()));
    File {
        path: format!("{}.xml", form.name),
        text,
    }
}

/// A comment that a text begins with, and what follows.
fn comment(text: &str) -> Option<(&str, &str)> {
    let (comment, after) = text.strip_prefix("(*")?.split_once("*)")?;
    Some((comment.trim(), after))
}

/// Text as PLCopen has it within an element; no element where there is none.
fn formatted(tag: &str, text: &str) -> String {
    let open = "<xhtml xmlns=\"http://www.w3.org/1999/xhtml\">";
    match text {
        "" => String::new(),
        text => format!("<{tag}>{open}{}</xhtml></{tag}>", escaped(text)),
    }
}

impl Declarations {
    /// What a file declares; constants of all get its name.
    fn read(&mut self, text: &str, file: &str) {
        let (mut rest, mut remark) = (text, "");
        loop {
            rest = rest.trim_start();
            if let Some((found, after)) = comment(rest) {
                // A headline stands apart from what follows.
                remark = if after.starts_with("\n\n") { "" } else { found };
                rest = after;
                continue;
            }
            let Some((head, after)) = rest.split_once('\n') else {
                return;
            };
            let (kind, head) = head.split_once(' ').unwrap_or((head, ""));
            let end = match kind {
                "VAR_GLOBAL" => "END_VAR\n".to_owned(),
                _ => format!("\nEND_{kind}\n"),
            };
            let Some((declared, after)) = after.split_once(&end) else {
                return;
            };
            rest = after;
            let remark = formatted("documentation", std::mem::take(&mut remark));
            let (name, result) = head.split_once(" : ").unwrap_or((head, ""));
            let unit = UNITS.iter().find(|(word, _)| *word == kind);
            let _ = if let Some((_, unit)) = unit {
                let (interface, body) = interface(declared, result);
                let body = formatted("ST", body);
                writeln!(
                    self.units,
                    "<pou name=\"{name}\" pouType=\"{unit}\">\n{interface}<body>{body}</body>\n{remark}</pou>"
                )
            } else if kind == "TYPE" {
                let name = head.trim_end_matches(" :");
                let fields = declared.trim_start_matches("STRUCT\n");
                let fields = variables(fields.trim_end_matches("END_STRUCT"));
                writeln!(
                    self.types,
                    "<dataType name=\"{name}\"><baseType><struct>\n{fields}</struct></baseType>{remark}</dataType>"
                )
            } else {
                let constants = variables(declared);
                writeln!(
                    self.globals,
                    "<globalVars name=\"{file}\" constant=\"true\">\n{constants}{remark}</globalVars>"
                )
            };
        }
    }
}

/// What a unit gives and the lists of variables that it begins with, and its body.
fn interface<'a>(declared: &'a str, result: &str) -> (String, &'a str) {
    let (mut text, mut rest) = ("<interface>\n".to_owned(), declared);
    if !result.is_empty() {
        let _ = writeln!(text, "<returnType>{}</returnType>", type_of(result));
    }
    while let Some((section, after, tag)) = SECTIONS.iter().find_map(|(begin, tag)| {
        let (section, after) = rest.strip_prefix(begin)?.split_once("END_VAR\n")?;
        Some((section, after, tag))
    }) {
        let _ = writeln!(text, "<{tag}>\n{}</{tag}>", variables(section));
        rest = after;
    }
    (text + "</interface>\n", rest)
}

/// Variables with what stands in comments: behind one on its line, or before it on a line of its own.
fn variables(declared: &str) -> String {
    let (mut text, mut rest, mut before) = (String::new(), declared, "");
    loop {
        rest = rest.trim_start();
        if let Some((found, after)) = comment(rest) {
            (before, rest) = (found, after);
            continue;
        }
        let Some((variable, after)) = rest.split_once(';') else {
            return text;
        };
        let own = comment(after.trim_start_matches(' '));
        let (own, after) = own.unwrap_or(("", after));
        rest = after;
        let remark = format!("{} {own}", std::mem::take(&mut before));
        let (name, kind) = variable.split_once(" : ").unwrap_or((variable, ""));
        let (kind, initial) = kind.split_once(" := ").unwrap_or((kind, ""));
        let initial = match initial {
            "" => String::new(),
            initial => format!("<initialValue>{}</initialValue>", value(initial)),
        };
        let _ = writeln!(
            text,
            "<variable name=\"{name}\"><type>{}</type>{initial}{}</variable>",
            type_of(kind),
            formatted("documentation", remark.trim())
        );
    }
}

fn type_of(name: &str) -> String {
    let array = name.strip_prefix("ARRAY[");
    if let Some((range, of)) = array.and_then(|of| of.split_once("] OF ")) {
        let (lower, upper) = range.split_once("..").unwrap_or((range, range));
        let of = type_of(of);
        return format!(
            "<array><dimension lower=\"{lower}\" upper=\"{upper}\"/><baseType>{of}</baseType></array>"
        );
    }
    match name.trim() {
        name @ ("BOOL" | "DINT" | "LINT" | "LREAL") => format!("<{name}/>"),
        name => format!("<derived name=\"{name}\"/>"),
    }
}

/// A number, a list, or a structure with the names of its fields.
fn value(text: &str) -> String {
    let text = text.trim();
    let within = |open: char, close: char| text.strip_prefix(open)?.strip_suffix(close);
    if let Some(list) = within('[', ']') {
        let mut depth = 0_i32;
        let values = list.split(|c: char| {
            depth += i32::from(c == '(') - i32::from(c == ')');
            c == ',' && depth == 0
        });
        let values: String = values
            .map(|of| format!("<value>{}</value>", value(of)))
            .collect();
        return format!("<arrayValue>{values}</arrayValue>");
    }
    let Some(fields) = within('(', ')') else {
        return format!("<simpleValue value=\"{text}\"/>");
    };
    let fields = fields.split(", ").filter_map(|of| of.split_once(" := "));
    let fields: String = fields
        .map(|(name, of)| format!("<value member=\"{name}\">{}</value>", value(of)))
        .collect();
    format!("<structValue>{fields}</structValue>")
}
