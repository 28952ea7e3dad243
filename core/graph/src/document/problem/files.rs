//! Mistakes about files as a whole: what is no TOML, cannot be read, is too large, or extends itself.

use std::path::Path;
use std::sync::Arc;

use super::{nearest_of_many, quoted};
use crate::diagnostic::{Names, nearest, problem};
use crate::document::foreign_syntax::ForeignSyntax;
use crate::document::toml_text::DUPLICATE_KEY;

problem! {
    /// Not TOML.
    A001 Syntax {
        /// What the TOML parser reports.
        reason: String,
        /// The value without quotes that it stumbled over, where it is one.
        bare: Option<String>,
        /// What is usual elsewhere and stands there instead of TOML.
        foreign: Option<ForeignSyntax>,
    }
    error: "syntax",
    explanation: "The file is not TOML. Every syntax error is shown; nothing else is checked until there is none.",
    message: format!("this is not TOML: {reason}"),
    label: "here",
    help: match (foreign, bare) {
        (Some(foreign), _) => Some(foreign.help()),
        _ if reason == DUPLICATE_KEY => Some(
            "a key stands once, be it `key = …`, `[key]` or `[[key]]`: take one of the two away".to_owned(),
        ),
        (None, Some(bare)) => Some(match bare.to_ascii_lowercase().as_str() {
            truth @ ("true" | "false") => format!("write {truth} in small letters"),
            _ => format!("a text stands in quotes: \"{bare}\""),
        }),
        (None, None) => None,
    },
}

problem! {
    /// A file cannot be read.
    A002 Unreadable {
        /// The path as it was tried.
        path: String,
        /// What the operating system reports.
        reason: String,
        /// The graph files in its folder, where it is not there.
        beside: Vec<String>,
        /// Whether another file names it.
        named: bool,
    }
    error: "unreadable file",
    explanation: "A file named on the command line, by `extends` or by `prior` cannot be read, is not UTF-8, or is not what is needed there.",
    message: format!("cannot read \"{path}\": {reason}"),
    label: "named here",
    help: match graph_meant(path, beside) {
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
}

problem! {
    /// A JSON file that a node names can be read, and is not what it needs.
    A002 Unusable {
        /// The path as it was tried.
        path: String,
        /// Why it is not.
        reason: String,
    }
    message: format!("cannot use \"{path}\": {reason}"),
    label: "named here",
    help: "a prior is what `athermal fleet fit --pooled` writes",
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

problem! {
    /// A file is too large.
    A003 TooLarge {
        /// The largest size in bytes.
        limit: usize,
    }
    error: "too large",
    explanation: "Files have at most 16 MB, lists 200,000 values, tables nest at most 64 deep, and `extends` chains have at most 16 \
        files.",
    message: format!("the file is larger than {} MB", limit / 1_000_000),
    label: "",
    help: None,
}

problem! {
    /// Tables or lists are nested too deeply.
    A003 TooDeep { limit: usize }
    message: format!("keys are nested more than {limit} deep"),
    label: "",
    help: None,
}

problem! {
    /// A list has too many values.
    A003 LongList { limit: usize }
    message: format!("the list has more than {limit} values"),
    label: "of this list",
    help: "a graph has no room for so many members; samples stand in a file of data",
}

problem! {
    /// Too many files extend one another.
    A003 LongChain { limit: usize }
    message: format!("more than {limit} files extend one another"),
    label: "extends this file",
    help: None,
}

problem! {
    /// `schema` is missing.
    A004 SchemaMissing {}
    error: "schema",
    explanation: "Every graph file has `schema = 1`, so that a later version of the language is never misread.",
    message: "the file does not name the schema that it follows",
    label: "`schema = 1` is missing",
    help: "begin the file with `schema = 1`",
}

problem! {
    /// `schema` is not one that this version reads.
    A004 SchemaUnknown { found: String }
    message: format!("the schema is 1, found {found}"),
    label: "not 1",
    help: "begin the file with `schema = 1`",
}

problem! {
    /// A chain of `extends` comes back to itself.
    A005 ExtendsLoop {
        /// The paths from the first file back to it.
        chain: Vec<String>,
    }
    error: "extends",
    explanation: "`extends` names one file. A chain of files that comes back to itself has no beginning.",
    message: format!("`extends` comes back to its own file: {}", chain.join(" → ")),
    label: "extends this file",
    help: "one of these files must extend none of the others",
}

problem! {
    /// `nodes.NAME = false` or `outputs.NAME = false` without one of that name that is inherited.
    A019 NothingToRemove {
        /// `node`, `output`, `source` or `sink`.
        role: &'static str,
        name: String,
        inherited: Arc<Names>,
    }
    error: "nothing to remove",
    explanation: "`nodes.NAME = false` removes an inherited node, and so with `outputs`, `sources` and `sinks`: there is none of that \
        name.",
    message: format!("there is no inherited {role} \"{name}\" to remove"),
    label: "",
    help: nearest_of_many(name, inherited, &format!("the inherited {role}s are"))
        .unwrap_or_else(|| "leave it out; nothing is inherited here".to_owned()),
}
