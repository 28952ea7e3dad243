//! `athermal explain`: what the code of a diagnostic means.

use athermal::core::diagnostic::{Code, codes, explain, nearest};
use clap::Args;
use serde_json::{Value, json};

use crate::terminal::{Answer, Failure, Format, Terminal};

/// Explain the code of a mistake, or list them all
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  athermal explain A052\n  athermal explain")]
pub struct Explain {
    /// The code, such as A052
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
