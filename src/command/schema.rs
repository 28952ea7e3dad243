//! `athermal schema`: the JSON Schema of graph files, for editors.

use std::path::PathBuf;

use athermal::schema::graph_schema;
use clap::Args;

use super::aside::write_aside;
use crate::terminal::{Answer, Failure, Terminal};

/// Write the JSON Schema of graph files, for editors
///
/// It describes exactly the node types of this program. An editor that finds `#:schema ./athermal.schema.json` in the first line of
/// a graph completes and checks while one types.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal schema -o athermal.schema.json\n  athermal schema | less"
)]
pub struct Schema {
    /// Where the schema goes; `-` is standard output
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

impl Schema {
    /// Writes the schema.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let text = format!("{:#}\n", graph_schema());
        if self.output.as_os_str() == "-" {
            print!("{text}");
            return Ok(Answer::Fine);
        }
        write_aside(&self.output, text)?;
        terminal.note(format_args!("wrote {}", self.output.display()));
        Ok(Answer::Fine)
    }
}
