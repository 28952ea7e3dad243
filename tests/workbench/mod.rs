//! What the tests share: where recorded data are, a graph from text, an engine stepped by hand, an estimator fitted on rows, the
//! program as a user calls it. Decides nothing that is expected.

#![allow(dead_code, unused_imports)] // each test file uses its part

mod bench;
mod live;
mod program;
mod regression;
mod simulated;
mod text;

pub use bench::{Bench, Read, compiled, linear, plan, problems, secs, slot};
pub use live::Live;
pub use program::{
    Finished, Folder, Scratch, athermal, athermal_fed, athermal_on, athermal_unread,
};
pub use regression::{coefficients, fitted, numbers, regression};
pub use simulated::simulated;
pub use text::Graph;

use std::path::{Path, PathBuf};

/// The folder of recorded data, or nothing, with a remark, where this machine lacks it.
pub fn data() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let folder = std::env::var_os("ATHERMAL_SHARED").map_or_else(beside, PathBuf::from);
    let data = folder.join("data");
    if data.is_dir() {
        return Some(data);
    }
    eprintln!("skipped: {} is not there", data.display());
    None
}

/// The folder of a case: a log as somebody has it, with what is right; nothing, with a remark, where this machine lacks it.
pub fn case(name: &str) -> Option<PathBuf> {
    let case = data()?.with_file_name("cases").join(name);
    if case.is_dir() {
        return Some(case);
    }
    eprintln!("skipped: {} is not there", case.display());
    None
}

/// The die tester's graph of the one axis Z1, which is fitted and looked at in a sixth of the time.
pub fn one_axis(scratch: &Scratch) -> PathBuf {
    let graph = graph("die-tester");
    scratch.file(
        "one-axis.toml",
        format!("schema = 1\nextends = {graph:?}\nsets.axis = [\"Z1\"]\ntests = []\n"),
    )
}

/// A graph file of this project.
pub fn graph(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs");
    folder.join(name).with_extension("toml")
}

/// The graph files in a folder of this project, such as `graphs`, in the order of their names.
pub fn graphs(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let files = std::fs::read_dir(folder).unwrap();
    let mut graphs: Vec<_> = files
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .collect();
    graphs.sort();
    graphs
}

/// A file under this project's own `tests/oracles`, whose `generate.py` wrote it.
pub fn own_oracle(file: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracles");
    folder.join(file)
}

/// A file of reference results, as text; nothing, with a remark, where this machine lacks it.
pub fn oracle(file: &str) -> Option<String> {
    let path = data()?.with_file_name("oracles").join(file);
    Some(std::fs::read_to_string(path).unwrap())
}
