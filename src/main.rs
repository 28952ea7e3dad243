//! The command line of athermal.

use std::process::ExitCode;

fn main() -> ExitCode {
    athermal::command_line()
}
