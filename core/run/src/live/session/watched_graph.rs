//! When a graph has changed on disk: in its own file, in one that it extends or takes modules from, or in the model that it names.

use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::diagnostic::{Diagnostics, Sources};
use crate::document::{self, Disk, FileReader};
use crate::model::{content_of, named_model};

/// When a file was written, and its content: files that are placed by link, or made to be reproduced, may share time and length. None
/// where there is no file.
type Written = Option<(SystemTime, u64, Option<String>)>;

/// Files of more bytes are known by their times and lengths alone.
const READ: u64 = 64 << 20;

/// Where a file went.
pub(super) enum Went {
    /// Nowhere to be seen.
    Away(PathBuf),
    /// To where it was, unchanged.
    Back(PathBuf),
}

/// A graph on disk, as it was when it was last looked at.
#[derive(Debug)]
pub struct WatchedGraph {
    /// Its own file.
    path: PathBuf,
    files: Vec<(PathBuf, Written)>,
    /// How files that have changed were at the last look.
    changing: Option<Vec<Written>>,
    /// Whether something else ran when it was first looked at.
    is_unlike: bool,
    /// A file that was not there at the last look.
    gone: Option<PathBuf>,
    /// One that has been reported.
    reported_gone: Option<PathBuf>,
}

impl WatchedGraph {
    /// The graph or model in a file, as it is now.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        let noting = Noting::default();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            // Mistakes are reported when the graph is staged; its files are watched all the same.
            let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
            let read = document::load(path, &noting, &mut sources, &mut diagnostics);
            let model = read.and_then(|read| named_model(&read.tree, &sources));
            if let Some((model, _)) = model {
                noting.note(&model);
            }
        } else {
            noting.note(path);
        }
        Self {
            path: path.to_owned(),
            files: noting.files.into_inner(),
            changing: None,
            is_unlike: false,
            gone: None,
            reported_gone: None,
        }
    }

    /// The same where something else runs, so that it has changed as soon as it is there.
    #[must_use]
    pub fn unlike(mut self) -> Self {
        for (_, seen) in &mut self.files {
            *seen = None;
        }
        self.is_unlike = true;
        self
    }

    /// Its own file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether something else ran when it was first looked at.
    #[must_use]
    pub fn is_unlike(&self) -> bool {
        self.is_unlike
    }

    /// Whether a file has been written since, and none is being written: they are as they were at the last look. Half of a graph
    /// may be a graph too. A file that is gone is about to be written again.
    pub(super) fn changed(&mut self) -> bool {
        let now = self.now();
        if !self.differ(&now) {
            self.changing = None;
            return false;
        }
        let is_done = self.changing.as_ref() == Some(&now);
        self.changing = Some(now);
        is_done
    }

    /// Whether a file is not as it was when it was read, be it that it is still being written.
    pub(super) fn differs(&self) -> bool {
        self.differ(&self.now())
    }

    /// Where a file went, once. One that is away at one look alone is being written.
    pub(super) fn went(&mut self) -> Option<Went> {
        let mut files = self.files.iter();
        let gone = files.find(|(path, seen)| seen.is_some() && written(path).is_none());
        let gone = gone.map(|(path, _)| path.clone());
        let before = std::mem::replace(&mut self.gone, gone.clone());
        if gone != before || gone == self.reported_gone {
            return None;
        }
        let reported = std::mem::replace(&mut self.reported_gone, gone.clone());
        gone.map(Went::Away).or(reported.map(Went::Back))
    }

    fn now(&self) -> Vec<Written> {
        self.files.iter().map(|(path, _)| written(path)).collect()
    }

    fn differ(&self, now: &[Written]) -> bool {
        let mut pairs = now.iter().zip(&self.files);
        pairs.any(|(now, (_, seen))| now.is_some() && now != seen)
    }
}

/// Notes which files are read, those that are missing too, and when each was written.
#[derive(Default)]
struct Noting {
    files: RefCell<Vec<(PathBuf, Written)>>,
}

impl Noting {
    fn note(&self, path: &Path) {
        self.files
            .borrow_mut()
            .push((path.to_owned(), written(path)));
    }
}

impl FileReader for Noting {
    fn read(&self, path: &Path) -> Result<String, io::Error> {
        self.note(path);
        Disk.read(path)
    }

    fn read_named(&self, path: &Path) -> Result<String, io::Error> {
        self.note(path);
        Disk.read_named(path)
    }

    fn beside(&self, path: &Path) -> Vec<String> {
        Disk.beside(path)
    }
}

fn written(path: &Path) -> Written {
    let facts = std::fs::metadata(path).ok()?;
    let content = (facts.len() <= READ).then(|| content_of(path).ok());
    let content = content.flatten().map(|(_, hash)| hash);
    Some((facts.modified().ok()?, facts.len(), content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_still_being_written_has_not_changed_yet() {
        let name = format!("athermal-watched-{}.toml", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, "schema = 1\n").unwrap();
        let mut watched = WatchedGraph::of(&path);
        assert!(!watched.changed());
        std::fs::write(&path, "schema = 1\nname = \"half").unwrap();
        assert!(!watched.changed(), "it may be half of it");
        std::fs::write(&path, "schema = 1\nname = \"half of it\"\n").unwrap();
        assert!(!watched.changed(), "it was");
        assert!(watched.changed());
        std::fs::remove_file(&path).unwrap();
        assert!(!watched.changed());
    }

    #[test]
    fn a_file_of_the_same_time_and_length_has_changed_if_its_content_has() {
        let name = format!("athermal-watched-twin-{}.toml", std::process::id());
        let path = std::env::temp_dir().join(name);
        let write = |text: &str| {
            std::fs::write(&path, text).unwrap();
            let file = std::fs::File::options().write(true).open(&path).unwrap();
            file.set_modified(SystemTime::UNIX_EPOCH).unwrap();
        };
        write("schema = 1\nname = \"a\"\n");
        let mut watched = WatchedGraph::of(&path);
        assert!(!watched.changed() && !watched.changed());
        write("schema = 1\nname = \"b\"\n");
        assert!(!watched.changed(), "it may be half of it");
        assert!(watched.changed());
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn a_graph_has_changed_when_the_model_that_it_names_has() {
        let file = |ending: &str| {
            let name = format!("athermal-watched-model-{}.{ending}", std::process::id());
            std::env::temp_dir().join(name)
        };
        let (graph, model) = (file("toml"), file("json"));
        let text = format!("schema = 1\nmodel = {:?}\n", model.file_name().unwrap());
        std::fs::write(&graph, text).unwrap();
        let mut watched = WatchedGraph::of(&graph);
        assert!(!watched.changed() && !watched.changed());
        std::fs::write(&model, "{}").unwrap();
        assert!(!watched.changed(), "it may be half of it");
        assert!(watched.changed());
        std::fs::remove_file(&graph).unwrap();
        std::fs::remove_file(&model).unwrap();
    }
}
