//! How many threads a command works with.

use clap::Args;
use schemars::JsonSchema;
use serde::Deserialize;

use athermal_command::numbers;

/// The threads that were asked for.
#[derive(Debug, Clone, Copy, Default, Args, Deserialize, JsonSchema)]
pub struct Threads {
    /// Threads to work with; 0 takes one for each core. The result does not depend on it
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true,
        value_parser = numbers::read::<usize>("a whole number of threads, 0 for one per core")
    )]
    #[serde(default)]
    threads: usize,
}

impl Threads {
    /// How many there are to be, at least one.
    pub fn count(self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            threads => threads,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn none_asked_for_are_as_many_as_there_are_cores() {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        assert_eq!(Threads { threads: 0 }.count(), cores);
        assert_eq!(Threads { threads: 3 }.count(), 3);
    }
}
