//! `athermal explain`: what the code of a diagnostic means, or what a machine file says of its service.

use std::path::Path;

use athermal::core::diagnostic::{Code, Diagnostics, Sources, codes, explain, nearest};
use athermal_serve::deployment::Deployment;
use clap::Args;
use serde_json::{Value, json};

use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_jobs::model::load_to_fit;

/// Explain the code of a mistake, or what a machine file wires; or list all codes
///
/// Of a machine file: which source gives each channel, and in which unit; which outputs each sink is given, and at which rate.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal explain A052\n  athermal explain machine.toml\n  athermal explain"
)]
pub struct Explain {
    /// The code, such as A052, or a machine file
    #[arg(value_name = "CODE|FILE")]
    code: Option<String>,
}

impl Explain {
    /// Explains or lists.
    ///
    /// # Errors
    /// When there is no such code.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let json = terminal.format == Format::Json;
        match &self.code {
            None if json => {
                let all: Vec<_> = codes().iter().map(describe).collect();
                println!("{:#}", json!({ "codes": all }));
            }
            None => {
                for entry in codes() {
                    println!("{}  {}", entry.code, entry.title);
                }
            }
            Some(file) if Path::new(file).is_file() => wiring(Path::new(file), terminal)?,
            Some(code) => match explain(code) {
                Some(entry) if json => println!("{:#}", describe(entry)),
                Some(entry) => print!("{}", page(entry)),
                None => {
                    let near = nearest(code, codes().iter().map(|entry| entry.code));
                    let near =
                        near.map_or_else(String::new, |near| format!(", did you mean {near}?"));
                    let message = format!(
                        "there is no code {code}{near} (`athermal explain` lists them all)"
                    );
                    return Err(Failure::Request(message));
                }
            },
        }
        Ok(Answer::Fine)
    }
}

/// What a machine file says of its service.
fn wiring(path: &Path, terminal: &Terminal) -> Result<(), Failure> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let model = load_to_fit(path, &mut sources, terminal)?;
    let plan = &model.plan;
    let Some(read) = Deployment::read(&model.graph, plan, &sources, &mut diagnostics) else {
        let (diagnostics, sources) = (Box::new(diagnostics), Box::new(sources));
        return Err(Failure::Graph {
            diagnostics,
            sources,
        });
    };
    if terminal.format == Format::Json {
        println!("{:#}", read.to_json(plan));
    } else {
        let mut text = String::new();
        // A text can always be written to.
        let _ = read.describe(plan, &mut text);
        print!("{text}");
    }
    Ok(())
}

fn page(entry: &Code) -> String {
    let mut page = format!("{}: {}\n\n{}\n", entry.code, entry.title, entry.explanation);
    for (title, example) in [("Wrong", entry.wrong), ("Right", entry.right)] {
        page += &format!("\n{title}:\n\n");
        for line in example.lines() {
            page += format!("    {line}").trim_end();
            page.push('\n');
        }
    }
    page
}

fn describe(entry: &Code) -> Value {
    json!({
        "code": entry.code,
        "title": entry.title,
        "explanation": entry.explanation,
        "wrong": entry.wrong,
        "right": entry.right,
    })
}
