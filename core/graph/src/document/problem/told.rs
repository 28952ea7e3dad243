//! How each mistake in reading a graph file is told; which there are stands above.

use std::path::Path;

use super::{DocumentProblem, codes};
use crate::diagnostic::{Code, Names, Place, Problem, listed, nearest};
use crate::document::hint::Hint;
use crate::document::toml_text::DUPLICATE_KEY;
use crate::quantity::QuantityError;

/// At most twelve names in quotes, for a list of what there is.
fn quoted<'a>(names: impl Iterator<Item = &'a str>) -> String {
    listed(names.map(|name| format!("\"{name}\"")), 12)
}

/// "did you mean" or a list of what there is.
fn suggestion(name: &str, known: &[String], there_are: &str) -> Option<String> {
    let known = known.iter().map(String::as_str);
    near_or_all(nearest(name, known.clone()), known, there_are)
}

/// As [`suggestion`], of many.
fn one_of(name: &str, known: &Names, there_are: &str) -> Option<String> {
    near_or_all(known.nearest(name), known.iter(), there_are)
}

fn near_or_all<'a>(
    near: Option<&str>,
    known: impl ExactSizeIterator<Item = &'a str>,
    there_are: &str,
) -> Option<String> {
    match (near, known.len()) {
        (Some(near), _) => Some(format!("did you mean \"{near}\"?")),
        (None, 0) => None,
        (None, 1) => Some(format!("there is only {}", quoted(known))),
        (None, _) => Some(format!("{there_are} {}", quoted(known))),
    }
}

/// Which of some graph files a path may mean: all of them end alike, and that likens none to it.
fn graph_meant<'a>(path: &str, beside: &'a [String]) -> Option<&'a str> {
    let stem = |path| Path::new(path).file_stem()?.to_str();
    let wanted = stem(path)?;
    let stems = || beside.iter().filter_map(|name| stem(name));
    let meant = stems()
        .find(|known| *known == wanted)
        .or_else(|| nearest(wanted, stems()))?;
    let mut names = beside.iter().map(String::as_str);
    names.find(|name| stem(name) == Some(meant))
}

fn for_key(key: Option<&String>) -> String {
    key.map_or_else(String::new, |key| format!(" for \"{key}\""))
}

impl Problem for DocumentProblem {
    fn code(&self) -> &'static Code {
        match self {
            Self::Syntax { .. } => &codes::A001,
            Self::Unreadable { .. } => &codes::A002,
            Self::TooLarge { .. }
            | Self::TooDeep { .. }
            | Self::LongList { .. }
            | Self::LongChain { .. } => &codes::A003,
            Self::SchemaMissing | Self::SchemaUnknown { .. } => &codes::A004,
            Self::ExtendsLoop { .. } => &codes::A005,
            Self::UnknownKey { .. } | Self::InputAsKey { .. } => &codes::A006,
            Self::MissingKey { .. } => &codes::A007,
            Self::WrongType { .. } => &codes::A008,
            Self::UnknownChoice { .. } => &codes::A009,
            Self::Refused { .. }
            | Self::NumberTooLarge { .. }
            | Self::NoLength { .. }
            | Self::StepNotPositive => &codes::A010,
            Self::BadName { .. } => &codes::A011,
            Self::DuplicateName { .. } => &codes::A012,
            Self::UnknownSet { .. } => &codes::A013,
            Self::UnknownPlaceholder { .. } => &codes::A014,
            Self::EmptyList { .. } => &codes::A015,
            Self::TooManyInstances { .. } | Self::TooLargeExpanded { .. } => &codes::A016,
            Self::Unit(_) => &codes::A017,
            Self::Duration(_) | Self::Quantity(_) | Self::UnitTwice { .. } => &codes::A018,
            Self::NothingToRemove { .. } => &codes::A019,
            Self::SamplesWithoutClock { .. } => &codes::A020,
            Self::OneColumn { .. } => &codes::A021,
            Self::RangeUnit { .. } | Self::RangeOrder { .. } => &codes::A022,
            Self::UnknownChannel { .. } => &codes::A023,
            Self::TimeContradiction { .. } => &codes::A024,
            Self::UnknownModule { .. } => &codes::A025,
            Self::ModuleLoop { .. } => &codes::A026,
            Self::OutOfReach { .. } => &codes::A027,
            Self::UnknownOutput { .. } => &codes::A028,
        }
    }

    fn message(&self) -> String {
        match self {
            Self::Syntax { reason, .. } => format!("this is not TOML: {reason}"),
            Self::Unreadable { path, reason, .. } => format!("cannot read \"{path}\": {reason}"),
            Self::TooLarge { limit } => format!("the file is larger than {} MB", limit / 1_000_000),
            Self::TooDeep { limit } => format!("keys are nested more than {limit} deep"),
            Self::LongList { limit } => format!("the list has more than {limit} values"),
            Self::LongChain { limit } => format!("more than {limit} files extend one another"),
            Self::ExtendsLoop { chain } => format!(
                "`extends` comes back to its own file: {}",
                chain.join(" → ")
            ),
            Self::SchemaMissing => "the file does not say which schema it follows".to_owned(),
            Self::SchemaUnknown { found } => format!("the schema is 1, found {found}"),
            Self::UnknownKey { key, what, .. } | Self::InputAsKey { key, what, .. } => {
                format!("{what} has no key \"{key}\"")
            }
            Self::MissingKey { key, what, .. } => format!("{what} needs the key \"{key}\""),
            Self::WrongType {
                key,
                expected,
                found,
                ..
            } => format!(
                "expected {expected}{}, found {found}",
                for_key(key.as_ref())
            ),
            Self::UnknownChoice { key, found, .. } => {
                format!("\"{found}\" is not a choice{}", for_key(key.as_ref()))
            }
            Self::Refused {
                key: Some(key),
                reason,
            } => format!("\"{key}\" is refused: {reason}"),
            Self::Refused { key: None, reason } => reason.clone(),
            Self::NumberTooLarge { number } => format!("the number {number} is too large"),
            Self::BadName { role, name, .. } => {
                format!("\"{name}\" cannot be the name of a {role}")
            }
            Self::DuplicateName {
                role,
                name,
                first_role,
                ..
            } => {
                let article = if role == first_role { "another" } else { "a" };
                format!("the {role} \"{name}\" has the name of {article} {first_role}")
            }
            Self::UnknownSet { name, .. } => format!("there is no set \"{name}\""),
            Self::UnknownPlaceholder { name, what, .. } => {
                format!("\"{{{name}}}\" stands for nothing in {what}")
            }
            Self::EmptyList { what } => format!("{what} has no entries"),
            Self::TooManyInstances {
                node,
                instances,
                limit,
            } => {
                format!(
                    "with node \"{node}\" the graph has {instances} instances, more than {limit}"
                )
            }
            Self::TooLargeExpanded { node, limit } => {
                format!("with node \"{node}\" the expanded graph has more than {limit} values")
            }
            Self::Unit(error) => error.reason(),
            Self::Duration(error) => error.reason(),
            Self::Quantity(error) => error.reason(),
            Self::UnitTwice {
                parameter,
                module,
                text,
                ..
            } => {
                format!("module \"{module}\" adds the unit to `{parameter}` itself, as \"{text}\"")
            }
            Self::NothingToRemove { role, name, .. } => {
                format!("there is no inherited {role} \"{name}\" to remove")
            }
            Self::SamplesWithoutClock { text } => {
                format!("\"{text}\" counts samples, and the time of this graph does not")
            }
            Self::OneColumn { pattern, channels } => {
                format!("{channels} channels would all be read from the column \"{pattern}\"")
            }
            Self::RangeUnit { found, unit } => format!(
                "the range is in \"{found}\", which does not convert to the signal's unit \"{unit}\""
            ),
            Self::RangeOrder { low, high, unit } => {
                format!("the range from {low} {unit} to {high} {unit} contains nothing")
            }
            Self::UnknownChannel { name, signal, .. } => {
                format!("signal \"{signal}\" has no channel \"{name}\"")
            }
            Self::TimeContradiction { key, with } => format!("`{key}` has no meaning with {with}"),
            Self::NoLength { key } => format!("`{key}` must be longer than 0"),
            Self::StepNotPositive => {
                "the step from one sample to the next is longer than 0".to_owned()
            }
            Self::UnknownModule { name, .. } => format!("there is no module \"{name}\""),
            Self::ModuleLoop { path, limit } => {
                let (last, before) = path.split_last().map_or(("", &[][..]), |(l, b)| (l, b));
                if before.iter().any(|name| name == last) {
                    format!("a module is part of itself: {}", path.join(" → "))
                } else {
                    format!("modules are nested more than {limit} deep")
                }
            }
            Self::OutOfReach { name, module, .. } => {
                format!("\"{name}\" is not a node of module \"{module}\"")
            }
            Self::UnknownOutput {
                output: None,
                module,
                ..
            } => format!("module \"{module}\" has no outputs"),
            Self::UnknownOutput {
                node,
                output: Some(output),
                module,
                ..
            } => format!(
                "\"{node}\" has no output \"{output}\": it is an instance of module \"{module}\""
            ),
        }
    }

    fn label(&self) -> String {
        match self {
            Self::Syntax { .. } => "here".to_owned(),
            Self::Unreadable { .. } => "named here".to_owned(),
            Self::LongList { .. } => "of this list".to_owned(),
            Self::ExtendsLoop { .. } | Self::LongChain { .. } => "extends this file".to_owned(),
            Self::SchemaMissing => "`schema = 1` is missing".to_owned(),
            Self::SchemaUnknown { .. } => "not 1".to_owned(),
            Self::UnknownKey { .. } | Self::InputAsKey { .. } => "unknown key".to_owned(),
            Self::MissingKey { key, .. } => format!("\"{key}\" is missing"),
            Self::WrongType { expected, .. } => format!("expected {expected}"),
            Self::UnknownChoice { .. } => "not a choice".to_owned(),
            Self::Refused { .. } => "refused".to_owned(),
            Self::BadName { .. } => "not a name".to_owned(),
            Self::DuplicateName { .. } => "this name is taken".to_owned(),
            Self::UnknownSet { .. } => "not a set".to_owned(),
            Self::UnknownPlaceholder { .. } => "stands for nothing".to_owned(),
            Self::EmptyList { .. } => "empty".to_owned(),
            Self::Unit(_) => "not a unit".to_owned(),
            Self::Duration(_) => "not a duration".to_owned(),
            Self::Quantity(QuantityError::Unit(_)) => "the unit is not known".to_owned(),
            Self::Quantity(_) => "not a quantity".to_owned(),
            Self::UnitTwice { .. } => "has a unit already".to_owned(),
            Self::UnknownChannel { .. } => "not a channel".to_owned(),
            Self::RangeUnit { unit, .. } => format!("does not convert to {unit}"),
            Self::UnknownModule { .. } => "not a module".to_owned(),
            Self::ModuleLoop { .. } => "comes back here".to_owned(),
            Self::OutOfReach { .. } => "out of the module's reach".to_owned(),
            Self::UnknownOutput { .. } => "no such output".to_owned(),
            _ => String::new(),
        }
    }

    fn help(&self) -> Option<String> {
        match self {
            Self::SchemaMissing | Self::SchemaUnknown { .. } => {
                Some("begin the file with `schema = 1`".to_owned())
            }
            Self::Syntax {
                foreign: Some(foreign), ..
            } => Some(foreign.help()),
            Self::Syntax { reason, .. } if reason == DUPLICATE_KEY => Some(
                "a key stands once, be it `key = …`, `[key]` or `[[key]]`: take one of the two away"
                    .to_owned(),
            ),
            Self::Syntax { bare, .. } => {
                bare.as_ref()
                    .map(|bare| match bare.to_ascii_lowercase().as_str() {
                        truth @ ("true" | "false") => format!("write {truth} in small letters"),
                        _ => format!("a text stands in quotes: \"{bare}\""),
                    })
            }
            Self::Unreadable {
                path,
                beside,
                named,
                ..
            } => match graph_meant(path, beside) {
                Some(meant) => Some(format!("did you mean \"{meant}\"?")),
                None if beside.is_empty() => named.then(|| {
                    let folder = Path::new(path).parent().map(Path::to_string_lossy);
                    let folder = folder.filter(|folder| !folder.is_empty());
                    format!(
                        "a relative path starts at the file in which it stands, and no other graph is in {}",
                        folder.as_deref().unwrap_or("its folder")
                    )
                }),
                None => {
                    let graphs = quoted(beside.iter().map(String::as_str));
                    Some(format!("in that folder there is {graphs}"))
                }
            },
            Self::LongList { .. } => Some(
                "a graph has no room for so many members; samples stand in a file of data"
                    .to_owned(),
            ),
            Self::UnknownKey { key, known, .. } => suggestion(key, known, "the keys are"),
            Self::InputAsKey { input, .. } => {
                Some(format!("`{input}` is an input: write `inputs.{input} = …`"))
            }
            Self::MissingKey { advice, .. } => advice.clone(),
            Self::WrongType { hint, .. } => hint.as_ref().map(Hint::help),
            Self::UnknownChoice { found, choices, .. } => {
                suggestion(found, choices, "the choices are")
            }
            Self::BadName {
                digit_first: false, ..
            } => Some("a name begins with a letter, then letters, digits, `_` and `-`".to_owned()),
            Self::BadName {
                digit_first: true, ..
            } => Some(
                "a name begins with a letter or digit, then letters, digits, `_` and `-`"
                    .to_owned(),
            ),
            Self::DuplicateName {
                role: "parameter",
                first_role,
                ..
            } if *first_role != "parameter" => {
                Some("give the parameter a name that nothing else has".to_owned())
            }
            Self::DuplicateName {
                role, first_role, ..
            } if role != first_role => {
                Some("nodes, sets and signals share one name space".to_owned())
            }
            Self::UnknownSet { name, known, or } => {
                let help = one_of(name, known, "the sets are");
                let help = help.unwrap_or_else(|| "declare it under `[sets]`".to_owned());
                let or = or.as_ref().filter(|_| !help.ends_with('?'));
                Some(or.map_or(help.clone(), |or| format!("{help}, or {or}")))
            }
            Self::UnknownPlaceholder {
                instead: Some(instead),
                ..
            } => Some(format!(
                "here a reference stands for all members: write \"{instead}\""
            )),
            Self::UnknownPlaceholder { name, known, .. } => {
                match nearest(name, known.iter().map(String::as_str)) {
                    Some(near) => Some(format!("did you mean \"{{{near}}}\"?")),
                    None if known.is_empty() => {
                        Some("only a node with `each` has members to stand for".to_owned())
                    }
                    None => Some(format!(
                        "it may be {}",
                        known
                            .iter()
                            .map(|name| format!("\"{{{name}}}\""))
                            .collect::<Vec<_>>()
                            .join(", ")
                    )),
                }
            }
            Self::TooManyInstances { .. } | Self::TooLargeExpanded { .. } => {
                Some(
                    "use fewer members, repeat less of what a module is given, or split the graph into several"
                        .to_owned(),
                )
            }
            Self::Unit(error) => error.help(),
            Self::Duration(error) => error.help(),
            Self::Quantity(error) => error.help(),
            Self::UnitTwice {
                parameter,
                given,
                unit,
                ..
            } => Some(match given.in_unit(unit) {
                Some(number) => format!("give the number alone: {parameter} = {number}"),
                None => format!("give a number alone, in {unit}"),
            }),
            Self::NothingToRemove {
                role,
                name,
                inherited,
            } => {
                let which = format!("the inherited {role}s are");
                one_of(name, inherited, &which)
                    .or_else(|| Some("leave it out; nothing is inherited here".to_owned()))
            }
            Self::SamplesWithoutClock { .. } => Some(
                "write a duration like \"5min\", or count samples: `[time] unit = \"sample\"`"
                    .to_owned(),
            ),
            Self::OneColumn { .. } => Some("put `{channel}` into the pattern".to_owned()),
            Self::RangeUnit { unit, .. } => Some(unit.scale_meant().map_or_else(
                || format!("write it in {unit}, or correct the signal's unit"),
                str::to_owned,
            )),
            Self::RangeOrder { .. } => Some("write the lower limit first".to_owned()),
            Self::UnknownChannel { name, known, .. } => one_of(name, known, "its channels are"),
            Self::EmptyList { .. } => Some("name at least one".to_owned()),
            Self::TimeContradiction { key: "format", .. } => {
                Some("leave out one of the two".to_owned())
            }
            Self::TimeContradiction { key: "zone", .. } => Some(
                "leave it out; dates and times have one, by `unit = \"rfc3339\"` or a `format` without `%z`"
                    .to_owned(),
            ),
            Self::TimeContradiction { key, .. } => {
                Some(format!("leave out `{key}`, or write `unit = \"sample\"`"))
            }
            Self::ExtendsLoop { .. } => {
                Some("one of these files must extend none of the others".to_owned())
            }
            Self::UnknownModule { name, known } => one_of(name, known, "the modules are")
                .or_else(|| Some(format!("describe it under `[modules.{name}]`"))),
            Self::ModuleLoop { .. } => Some("take one of the modules apart".to_owned()),
            Self::OutOfReach { name, known, .. } => Some(match known.nearest(name) {
                Some(near) => format!("did you mean \"{near}\"?"),
                None => format!(
                    "name it under the module's `inputs`; there it has {}",
                    quoted(known.iter())
                ),
            }),
            Self::UnknownOutput { output, known, .. } => {
                one_of(output.as_deref().unwrap_or_default(), known, "its outputs are").or_else(
                    || Some("say which, e.g. `outputs = { predicted = \"vote\" }`".to_owned()),
                )
            }
            _ => None,
        }
    }

    fn related(&self) -> Vec<(Place, String)> {
        match self {
            Self::DuplicateName {
                first: Some(place),
                first_role,
                ..
            } => vec![(*place, format!("the {first_role} is here"))],
            _ => Vec::new(),
        }
    }
}
