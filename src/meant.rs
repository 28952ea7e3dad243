//! What a file on the command line is, and the call that was meant where it is not what is expected there.

use std::ffi::OsString;
use std::path::Path;

use athermal_command::CommandKind;
use athermal_core::registry::{Why, find};
use athermal_jobs::path::Given;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::program::whole;

/// What other programs call a command.
fn synonym(command: &str) -> Option<&'static str> {
    Some(match command {
        "train" | "learn" | "calibrate" => "fit",
        "predict" | "forecast" | "infer" | "apply" => "run",
        "score" | "eval" | "validate" => "evaluate",
        "lint" | "verify" => "check",
        "plot" => "report",
        "start" => "serve",
        _ => return None,
    })
}

/// The same words in the places where the command has them, if that makes a call of them.
fn meant(words: &[OsString]) -> Option<String> {
    let words: Option<Vec<&str>> = words.iter().skip(1).map(|of| of.to_str()).collect();
    let words = words?;
    let (given, rest) = words.split_first()?;
    let command = synonym(given).unwrap_or(given);
    let (mut graphs, mut logs, mut others) = (Vec::new(), Vec::new(), Vec::new());
    let (mut of_option, mut of_data, mut drifting) = (false, false, Vec::new());
    for &word in rest {
        if matches!(word, "--data" | "-d" | "--input" | "-i") {
            (of_option, of_data) = (false, true);
        } else if word.starts_with('-') && word != "-" {
            (of_option, of_data) = (!word.contains('='), false);
            others.push(word);
        } else if std::mem::take(&mut of_option) {
            others.push(word);
        } else {
            match Given::of(Path::new(word)) {
                Some(Given::Graph | Given::Model) => graphs.push(word),
                Some(Given::Log) => logs.push(word),
                // What is no file behind `-d` is a column that drifts, where a log is looked at for the first time.
                _ if of_data && *given == "init" && !Path::new(word).exists() => {
                    drifting.push(word)
                }
                _ if of_data => logs.push(word),
                _ => others.push(word),
            }
        }
    }
    let command = match command {
        "check" | "show" if graphs.is_empty() => "init",
        "fit" if graphs.is_empty() && !logs.is_empty() => "init",
        command => command,
    };
    logs.dedup();
    let option = match command {
        _ if logs.is_empty() => None,
        "init" => None,
        "run" => Some("--input"),
        _ => Some("--data"),
    };
    let is_named = |of: &&str| of.starts_with("-o") || of.starts_with("--output");
    let output = (command == "fit" && !others.iter().any(is_named)).then_some(["-o", "model.json"]);
    if command == "init" && *given != "init" {
        others.clear();
    }
    if !drifting.is_empty() {
        others.push("--drifts");
        others.append(&mut drifting);
    }
    let call = ["athermal", command]
        .into_iter()
        .chain(graphs)
        .chain(option)
        .chain(logs);
    let call: Vec<&str> = call
        .chain(output.into_iter().flatten())
        .chain(others)
        .collect();
    let is_new = call[1..] != words[..];
    if is_new && whole().try_get_matches_from(&call).is_ok() {
        return Some(call.join(" "));
    }
    synonym(given).map(|command| format!("athermal {command}"))
}

/// Ends the program with an error of the command line, with the call that was meant where there is one.
pub fn exit(mut error: clap::Error, words: &[OsString]) -> ! {
    let given = words.get(1).and_then(|word| word.to_str());
    let unknown = given.and_then(|name| find::<CommandKind>(name).err());
    if error.kind() == ErrorKind::InvalidSubcommand
        && let Some(unknown) = unknown.filter(|of| matches!(of.why, Why::Feature(_)))
    {
        error.remove(ContextKind::SuggestedSubcommand);
        let tip = vec![StyledStr::from(unknown.help())];
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tip));
    } else if error.use_stderr()
        && let Some(call) = meant(words)
    {
        // `train` is not `retrain`.
        error.remove(ContextKind::SuggestedSubcommand);
        let tip = vec![StyledStr::from(format!("`{call}`"))];
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tip));
    }
    error.exit()
}
