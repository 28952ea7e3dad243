//! Calls that mean another: each is named for what it is, with the command that was meant. Whether files are sound is for commands to say.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use crate::invocation::{program, quoted};

/// What other programs call what a command does, with that command and what it takes.
const OTHERWISE: [(&str, &str, &str); 22] = [
    ("train", "fit", "GRAPH --data LOG -o MODEL"),
    ("learn", "fit", "GRAPH --data LOG -o MODEL"),
    ("calibrate", "fit", "GRAPH --data LOG -o MODEL"),
    ("predict", "run", "MODEL --input LOG --output PREDICTED.csv"),
    ("infer", "run", "MODEL --input LOG --output PREDICTED.csv"),
    ("apply", "run", "MODEL --input LOG --output PREDICTED.csv"),
    (
        "forecast",
        "run",
        "MODEL --input LOG --output PREDICTED.csv",
    ),
    ("score", "evaluate", "MODEL --data LOG"),
    ("eval", "evaluate", "MODEL --data LOG"),
    ("validate", "evaluate", "MODEL --data LOG"),
    ("plot", "report", "MODEL --data LOG -o report.html"),
    ("explore", "diagnose", "MODEL --data LOG"),
    ("analyse", "diagnose", "MODEL --data LOG"),
    ("analyze", "diagnose", "MODEL --data LOG"),
    ("lint", "check", "GRAPH"),
    ("verify", "check", "GRAPH"),
    ("create", "init", "LOG -o GRAPH"),
    ("generate", "simulate", "die-tester -o LOG"),
    ("sim", "simulate", "die-tester -o LOG"),
    ("start", "serve", "MACHINE"),
    ("daemon", "serve", "MACHINE"),
    ("info", "show", "MODEL"),
];

/// The commands of which the first word is a graph or a model.
const OF_GRAPHS: [&str; 9] = [
    "fit", "evaluate", "compare", "diagnose", "report", "run", "show", "check", "test",
];

/// What a file is, as far as its name and its beginning say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Is {
    Graph,
    Model,
    Log,
    Folder,
}

impl Is {
    fn of(path: &Path) -> Option<Self> {
        let there = std::fs::metadata(path).ok()?;
        if there.is_dir() {
            return Some(Self::Folder);
        }
        let ending = path
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_lowercase();
        match &*ending {
            "toml" => return Some(Self::Graph),
            "csv" | "tsv" | "jsonl" | "ndjson" | "parquet" | "lvm" => return Some(Self::Log),
            _ if !there.is_file() => return None,
            _ => {}
        }
        let mut begins = Vec::new();
        File::open(path)
            .ok()?
            .take(4096)
            .read_to_end(&mut begins)
            .ok()?;
        let begins = String::from_utf8_lossy(&begins);
        let mut lines = begins
            .lines()
            .filter(|line| !line.trim_start().starts_with('#'));
        let first = lines.find(|line| !line.trim().is_empty())?;
        if begins.contains("\"athermal_model\"") {
            return Some(Self::Model);
        }
        let is_table = first.contains([',', ';', '\t']) && !first.contains(['=', '{', '[']);
        is_table.then_some(Self::Log)
    }
}

/// What was meant by a call that cannot be, in words.
pub fn meant(words: &[String]) -> Option<String> {
    let [_, command, rest @ ..] = words else {
        return None;
    };
    let whole = |command: &str, takes: &str| format!("{} {command} {takes}", program());
    if let Some((_, known, takes)) = OTHERWISE.iter().find(|(name, ..)| name == command) {
        return Some(format!(
            "there is no command `{command}`; `{}` does that",
            whole(known, takes)
        ));
    }
    let values = |options: &[&str]| -> Vec<&String> {
        let behind = rest
            .iter()
            .skip_while(|word| !options.contains(&&***word))
            .skip(1);
        behind.take_while(|word| !word.starts_with('-')).collect()
    };
    let of = |word: &&String| Is::of(Path::new(word));
    for option in ["-o", "--output"] {
        if let Some(output) = values(&[option])
            .first()
            .filter(|of| Is::of(Path::new(of)) == Some(Is::Folder))
        {
            let name = match &**command {
                "fit" => "model.json",
                "init" => "graph.toml",
                "report" => "report.html",
                "simulate" | "run" => "rows.csv",
                _ => continue,
            };
            let file = Path::new(output).join(name);
            return Some(format!(
                "{option} {output}: this is a folder; name a file, such as {option} {}",
                quoted(&file.display().to_string())
            ));
        }
    }
    let option = if command == "run" {
        "--input"
    } else {
        "--data"
    };
    let data = values(&["--data", "-d", "--input", "-i"]);
    let first = rest.first().filter(|word| !word.starts_with('-'));
    let is_first = first.as_ref().and_then(of);
    if command == "init" {
        return match is_first? {
            Is::Model => Some(format!(
                "{} is a model, and init writes a graph for a log: `{}`; `{}` shows what is in a model",
                first?,
                whole("init", "LOG -o GRAPH"),
                whole("show", &quoted(first?))
            )),
            _ => None,
        };
    }
    if !OF_GRAPHS.contains(&&**command) {
        return None;
    }
    let among = data
        .iter()
        .find(|word| matches!(of(word), Some(Is::Model | Is::Graph)));
    let (first, is_first) = (first?, is_first?);
    match (is_first, among) {
        (Is::Log, Some(swapped)) => Some(format!(
            "{first} is a log, and {swapped} is what is to stand in its place: `{}`",
            whole(
                command,
                &format!("{} {option} {}", quoted(swapped), quoted(first))
            )
        )),
        (Is::Log, None) => Some(format!(
            "{first} is a log, and {command} takes a {} first; `{}` writes a graph for a log",
            if command == "fit" || command == "check" || command == "test" {
                "graph"
            } else {
                "model"
            },
            whole("init", &format!("{} -o graph.toml", quoted(first)))
        )),
        (_, Some(model)) if of(model) == Some(Is::Model) => Some(format!(
            "{model} is a model and holds no data; models stand before {option}: `{}`",
            whole(command, &format!("{} {option} LOG", quoted(model)))
        )),
        _ => None,
    }
}
