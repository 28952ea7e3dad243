//! Decides which commands there are; each says in a file of its own what it does.

mod check;
mod data;
mod evaluate;
mod fit;
mod nodes;
mod run;
mod schema;
mod swap;
mod test;

use clap::Subcommand;

use crate::terminal::{Answer, Failure, Terminal};

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Look for mistakes in a graph file
    Check(check::Check),
    /// List the node types, or explain one
    Nodes(nodes::Nodes),
    /// Fit a graph's estimators on recorded data
    Fit(fit::Fit),
    /// Score a model's predictions on recorded data
    Evaluate(evaluate::Evaluate),
    /// Run a model: rows in, predictions out
    Run(run::Run),
    /// Run the tests that graph files carry
    Test(test::Test),
    /// Write the JSON Schema of graph files, for editors
    Schema(schema::Schema),
}

impl Command {
    /// Does what was asked for.
    ///
    /// # Errors
    /// When it cannot be done.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        match self {
            Self::Check(command) => command.run(terminal),
            Self::Nodes(command) => command.run(terminal),
            Self::Fit(command) => command.run(terminal),
            Self::Evaluate(command) => command.run(terminal),
            Self::Run(command) => command.run(terminal),
            Self::Test(command) => command.run(terminal),
            Self::Schema(command) => command.run(terminal),
        }
    }
}
