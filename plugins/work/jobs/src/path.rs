//! What a file is that stands among options, by how it ends or begins, and a word for a shell.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use athermal_core::failure::Failure;
use athermal_files::Format;
use clap::builder::{PathBufValueParser, TypedValueParser};

/// What a file shows itself to be, by how it ends or begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Given {
    /// A folder.
    Folder,
    /// A graph file.
    Graph,
    /// A model.
    Model,
    /// Recorded data.
    Log,
}

const ENDINGS_OF_LOGS: [&str; 9] = [
    "csv", "tsv", "txt", "dat", "log", "lvm", "jsonl", "ndjson", "parquet",
];
/// The first key of a model.
const MARK: &str = "\"athermal_model\"";

impl Given {
    /// What there is at a path, where that shows.
    pub fn of(path: &Path) -> Option<Self> {
        if path.is_dir() {
            return Some(Self::Folder);
        }
        let ending = path.extension().and_then(|of| of.to_str()).unwrap_or("");
        let ending = ending.to_ascii_lowercase();
        if ending == "toml" {
            return Some(Self::Graph);
        }
        // What is read from a pipe is gone.
        let is_file = path.metadata().is_ok_and(|of| of.is_file());
        let file = is_file.then(|| File::open(path).ok()).flatten();
        let mut begin = Vec::new();
        let _ = file.map(|file| file.take(64).read_to_end(&mut begin));
        if String::from_utf8_lossy(&begin).contains(MARK) {
            return Some(Self::Model);
        }
        ENDINGS_OF_LOGS
            .contains(&ending.as_str())
            .then_some(Self::Log)
    }
}

/// A path, unless the file there is what cannot stand in its place.
fn path_but(refuse: fn(&Path, Given) -> Option<String>) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |path| {
        let refused = Given::of(&path).and_then(|given| refuse(&path, given));
        refused.map_or(Ok(path), Err)
    })
}

/// Reads the path of a graph or a model.
pub fn graph_or_model() -> impl TypedValueParser<Value = PathBuf> {
    path_but(|_, given| {
        let words = "this is a log, and a graph or model stands here; `athermal init` writes a graph for a log, and `athermal fit` a model";
        (given == Given::Log).then(|| words.to_owned())
    })
}

/// Reads the path of a recording. An option that takes several swallows a graph that comes behind them.
pub fn recording() -> impl TypedValueParser<Value = PathBuf> {
    path_but(|_, given| match given {
        Given::Graph => {
            Some("this is a graph and holds no data; name graphs before this option".to_owned())
        }
        Given::Model => {
            Some("this is a model and holds no data; name models before this option".to_owned())
        }
        Given::Folder | Given::Log => None,
    })
}

/// Reads the path of a log that is looked at for the first time.
pub fn new_log() -> impl TypedValueParser<Value = PathBuf> {
    path_but(|_, given| {
        let what = match given {
            Given::Graph => "a graph, which init writes,",
            Given::Model => "a model, which fit writes,",
            Given::Folder | Given::Log => return None,
        };
        Some(format!(
            "this is {what} and holds no data; give it a log, and the graph to write with -o"
        ))
    })
}

/// Reads the path of a file that is written.
pub fn written() -> impl TypedValueParser<Value = PathBuf> {
    path_but(|path, given| {
        let inside = path.join("NAME");
        (given == Given::Folder)
            .then(|| format!("this is a folder; name a file in it: {}", inside.display()))
    })
}

/// A word for a shell.
#[must_use]
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+:@%,=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Checks that the ending of a file that is to be written names a format; one without an ending is CSV.
///
/// # Errors
/// When there is an ending that names none.
pub fn check_ending(output: &Path) -> Result<(), Failure> {
    match output.extension() {
        Some(ending) if Format::from_path(output).is_none() => Err(Failure::Request(format!(
            "{}: the ending `.{}` names no format; `.csv`, `.tsv` and `.txt` are CSV, `.jsonl`, `.ndjson` and `.json` are \
             JSON lines, and `.parquet` is Parquet of a program built with `--features parquet`",
            output.display(),
            ending.display()
        ))),
        _ => Ok(()),
    }
}
