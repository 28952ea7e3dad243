//! Graph files as plans with tests; all mistakes of all files are reported together.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal::core::compile::Plan;
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::trial::{self, DataSet, On, Trial};

use crate::command::check::plan_and_tests;
use crate::terminal::{Failure, Terminal, status_of};

/// A graph file and its tests.
pub(super) struct Suite {
    /// The path as it was given.
    pub(super) path: String,
    /// The graph's name, or its path.
    pub(super) name: String,
    /// The graph, with every port that a test looks at.
    pub(super) plan: Arc<Plan>,
    /// The tests, in the order of the file.
    pub(super) trials: Vec<Trial>,
    /// The line on which each test begins, by its name.
    lines: Vec<(String, usize)>,
}

impl Suite {
    /// The line on which a test begins.
    pub(super) fn line(&self, trial: &Trial) -> usize {
        let found = self.lines.iter().find(|(name, _)| *name == trial.name);
        found.map_or(1, |(_, line)| *line)
    }

    /// The recorded data that tests are fitted on and run over.
    pub(super) fn data(&self) -> impl Iterator<Item = &Path> {
        let sets = self.trials.iter().flat_map(|trial| {
            let on = match &trial.on {
                On::Data(data) => Some(data),
                On::Synthetic(_) => None,
            };
            trial.fit.iter().chain(on)
        });
        let files = sets.flat_map(|data| match data {
            DataSet::Files(files) => files.as_slice(),
            DataSet::Simulated(_) => &[],
        });
        files.map(PathBuf::as_path)
    }
}

/// Reads and compiles the files.
///
/// # Errors
/// When any has a mistake.
pub(super) fn load(graphs: &[PathBuf], terminal: &Terminal) -> Result<Vec<Suite>, Failure> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let mut suites = Vec::new();
    for path in graphs {
        let mut of_file = Diagnostics::new();
        let planned = plan_and_tests(path, &mut sources, &mut of_file);
        let broken = of_file.has_errors();
        diagnostics.extend(of_file);
        if let Some((mut plan, trials)) = planned.filter(|_| !broken) {
            trial::observe(&mut plan, &trials);
            let line = |trial: &Trial| (trial.name.clone(), sources.line_column(trial.place).0);
            let path = path.display().to_string();
            suites.push(Suite {
                name: plan.name.clone().unwrap_or_else(|| path.clone()),
                path,
                lines: trials.iter().map(line).collect(),
                plan: Arc::new(plan),
                trials,
            });
        }
    }
    if diagnostics.has_errors() {
        terminal.diagnostics(&diagnostics, &sources);
        return Err(Failure::Exit(status_of(&diagnostics)));
    }
    terminal.doubts(&diagnostics, &sources);
    Ok(suites)
}
