//! Reading a graph file and the files that it extends into one tree; what the tree declares is decided elsewhere.

use std::collections::HashMap;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::merge::merge;
use super::problem;
use super::toml_text;
use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::{Diagnostics, Names, Place, Problem, SourceId, Sources};

/// The largest file that is read, in bytes.
const LARGEST: usize = 16_000_000;
/// Keys in the tables of nodes whose text is the path of a JSON file: what is in it stands in its place.
const FROM_FILES: [&str; 1] = ["prior"];
/// The table of such a file whose entries are for instances of nodes. Each node gets those of its own.
const OF_INSTANCES: &str = "estimators";
/// The greatest number of files in a chain of `extends`.
const LONGEST_CHAIN: usize = 16;

/// Where files come from.
pub trait FileReader {
    /// The whole text of a file.
    ///
    /// # Errors
    /// What the operating system says, also for a text that is not UTF-8.
    fn read(&self, path: &Path) -> Result<String, io::Error>;

    /// The same of a file that another names, which must be one that can be read again: no pipe and no device.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn read_named(&self, path: &Path) -> Result<String, io::Error> {
        self.read(path)
    }

    /// The names of the graph files in the folder of `path`, in order: one of them may be meant where that is not there.
    fn beside(&self, path: &Path) -> Vec<String>;
}

/// What is said of something that is read again, or must end, and does not.
pub const NO_FILE: &str = "it is a pipe or a device, and must be a file";

/// Whether what stands at a path, if anything, is read to an end without waiting, and again: a pipe or a device may not be.
#[must_use]
pub fn lasts(path: &Path) -> bool {
    std::fs::metadata(path).map_or(true, |of| of.is_file() || of.is_dir())
}

/// The names of the graph files of these, in order.
fn graph_files(paths: impl Iterator<Item = PathBuf>) -> Vec<String> {
    let graphs = paths.filter(|path| path.extension().is_some_and(|ending| ending == "toml"));
    let names = graphs.filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()));
    let mut names: Vec<_> = names.collect();
    names.sort_unstable();
    names
}

/// Files of the operating system.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl FileReader for Disk {
    fn read(&self, path: &Path) -> Result<String, io::Error> {
        let mut text = String::new();
        // One byte more than is allowed tells a file that is too large, without reading an endless one.
        std::fs::File::open(path)?
            .take(LARGEST as u64 + 1)
            .read_to_string(&mut text)?;
        Ok(text)
    }

    fn read_named(&self, path: &Path) -> Result<String, io::Error> {
        match lasts(path) {
            true => self.read(path),
            false => Err(io::Error::other(NO_FILE)),
        }
    }

    fn beside(&self, path: &Path) -> Vec<String> {
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let found = std::fs::read_dir(folder).into_iter().flatten().flatten();
        graph_files(found.map(|entry| entry.path()))
    }
}

/// Files in memory, for tests and embedded programs.
#[derive(Debug, Clone, Default)]
pub struct Memory {
    files: HashMap<PathBuf, String>,
}

impl Memory {
    /// No files.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same with one file more.
    pub fn with(mut self, path: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        self.files.insert(path.into(), text.into());
        self
    }
}

impl FileReader for Memory {
    fn read(&self, path: &Path) -> Result<String, io::Error> {
        self.files
            .get(path)
            .or_else(|| self.files.get(&normal(path)))
            .cloned()
            .ok_or_else(|| io::ErrorKind::NotFound.into())
    }

    fn beside(&self, path: &Path) -> Vec<String> {
        let files = self.files.keys();
        graph_files(files.filter(|file| file.parent() == path.parent()).cloned())
    }
}

/// A graph file merged with what it extends, not yet expanded.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// The file that was asked for.
    pub root: SourceId,
    /// The merged tree: a table without `extends`.
    pub tree: Value,
    /// Inherited nodes that were removed.
    pub(super) removed: Vec<String>,
}

impl Document {
    /// A tree that comes from elsewhere than files, e.g. from a model.
    pub fn new(root: SourceId, tree: Value) -> Self {
        Document {
            root,
            tree,
            removed: Vec::new(),
        }
    }
}

/// Reads the file at `path` and all that it extends.
///
/// `None` where one of them is missing or has syntax errors, all of which are reported. Every file read is added to `sources`.
pub fn load(
    path: &Path,
    reader: &dyn FileReader,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<Document> {
    match reader.read(path) {
        Ok(text) => load_text(path, text, reader, sources, diagnostics),
        Err(error) => {
            diagnostics.report(None, not_read(path, &error, reader, &[]));
            None
        }
    }
}

/// The same for a text that is at hand; `name` stands for its path, and what it extends is looked for beside it.
pub fn load_text(
    name: impl AsRef<Path>,
    text: impl Into<String>,
    reader: &dyn FileReader,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<Document> {
    let mut chain = Chain {
        reader,
        sources,
        diagnostics,
        paths: Vec::new(),
        lent: HashMap::new(),
        failed: false,
        removed: Vec::new(),
    };
    let root = SourceId(chain.sources.count());
    let table = chain.read(name.as_ref(), text.into());
    let (failed, removed) = (chain.failed, chain.removed);
    let table = table.filter(|_| !failed)?;
    let tree = Value::new(Place::new(root, 0, 0), Data::Table(table));
    Some(Document {
        root,
        tree,
        removed,
    })
}

struct Chain<'a> {
    reader: &'a dyn FileReader,
    sources: &'a mut Sources,
    diagnostics: &'a mut Diagnostics,
    paths: Vec<PathBuf>,
    /// Files that modules come from, read once.
    lent: HashMap<PathBuf, Option<Table>>,
    /// A file cannot be read, which has been reported.
    failed: bool,
    removed: Vec<String>,
}

impl Chain<'_> {
    fn read(&mut self, path: &Path, text: String) -> Option<Table> {
        self.paths.push(normal(path));
        let table = self.read_and_merge(path, text);
        self.paths.pop();
        self.failed |= table.is_none();
        table
    }

    fn read_and_merge(&mut self, path: &Path, text: String) -> Option<Table> {
        let shown = path.display().to_string();
        if text.len() > LARGEST {
            let source = self.sources.add(shown, "");
            self.diagnostics.report(
                Place::new(source, 0, 0),
                problem::TooLarge { limit: LARGEST },
            );
            return None;
        }
        let text: Arc<str> = text.into();
        let source = self.sources.add(shown, text.clone());
        let mut table = toml_text::parse(source, &text, self.diagnostics)?;
        match table.get("schema") {
            Some(value) if value.as_integer() == Some(1) => {}
            None => self
                .diagnostics
                .report(Place::new(source, 0, 0), problem::SchemaMissing {}),
            Some(value) => {
                let found = value.found();
                self.fail(value.place, problem::SchemaUnknown { found });
            }
        }
        let mut base = match table.remove("extends") {
            Some(entry) => self.other(&entry.value, "extends"),
            None => None,
        };
        self.include_files(&mut table);
        let borrowed = self.borrow_modules(&mut table);
        let inherited = base.as_mut().and_then(|base| base.get_mut("modules"));
        if let Some(inherited) = inherited.and_then(Value::as_table_mut) {
            // A module of another file is another one: it takes the place of the inherited one of its name, whole.
            for name in &borrowed {
                inherited.remove(name);
            }
        }
        Some(merge(base, table, &mut self.removed, self.diagnostics))
    }

    /// Puts what is in JSON files in the place of their names, in the nodes of a graph and of its modules.
    fn include_files(&mut self, table: &mut Table) {
        let names_one = |value: &Value| value.has_key(&FROM_FILES);
        let sections = ["nodes", "modules"];
        for section in sections {
            if !table.get(section).is_some_and(names_one) {
                continue;
            }
            let named = table.get_mut(section).and_then(Value::as_table_mut);
            for (name, entry) in named.into_iter().flat_map(Table::iter_mut) {
                // The instances of a node in a module have names that are not known yet.
                let node = (section == "nodes").then_some(name);
                self.include_in(node, &mut entry.value);
            }
        }
    }

    fn include_in(&mut self, node: Option<&str>, value: &mut Value) {
        let Some(table) = value.as_table_mut() else {
            return;
        };
        for (key, entry) in table.iter_mut() {
            let place = entry.value.place;
            match &entry.value.data {
                Data::Text(path) if FROM_FILES.contains(&key) => {
                    let path = self.sources.resolve(place, path);
                    match self.included(&path, node, place) {
                        Ok(value) => entry.value = value,
                        Err(problem) => self.fail(place, problem),
                    }
                }
                // What stands there are channels, and an input may have any name.
                Data::Table(_) if key != "inputs" => self.include_in(node, &mut entry.value),
                _ => {}
            }
        }
    }

    fn included(
        &self,
        path: &Path,
        node: Option<&str>,
        place: Place,
    ) -> Result<Value, Box<dyn Problem>> {
        let text = self.reader.read_named(path);
        let text = text.map_err(|error| not_read(path, &error, self.reader, &self.paths))?;
        let shown = || path.display().to_string();
        let unusable = |reason: String| problem::Unusable {
            path: shown(),
            reason,
        };
        if text.len() > LARGEST {
            return Err(problem::TooLarge { limit: LARGEST }.into());
        }
        let mut json: serde_json::Value =
            serde_json::from_str(&text).map_err(|error| unusable(format!("no JSON: {error}")))?;
        let of_instances = json.get_mut(OF_INSTANCES);
        if let (Some(node), Some(serde_json::Value::Object(all))) = (node, of_instances) {
            let known: Vec<String> = all.keys().cloned().collect();
            let is_own = |name: &str| {
                let rest = name.strip_prefix(node);
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            };
            all.retain(|name, _| is_own(name));
            if all.is_empty() {
                let known = known.join(", ");
                let reason = format!("it has nothing for node `{node}`; it has {known}");
                return Err(unusable(reason).into());
            }
        }
        let read = Value::from_json(&json, place);
        read.map_err(|error| unusable(error.to_string()).into())
    }

    /// Puts the modules of other files (`modules.NAME.from`) in the place of their names, which it gives.
    fn borrow_modules(&mut self, table: &mut Table) -> Vec<String> {
        let mut borrowed = Vec::new();
        let borrows = |value: &Value| {
            let modules = value.as_table().into_iter().flat_map(Table::iter);
            let mut keys = modules.filter_map(|(_, module)| module.value.as_table());
            keys.any(|keys| keys.contains("from"))
        };
        if !table.get("modules").is_some_and(borrows) {
            return borrowed;
        }
        let Some(modules) = table.get_mut("modules").and_then(Value::as_table_mut) else {
            return borrowed;
        };
        // The modules of each file, listed once for all that are not among them.
        let mut listed: HashMap<String, Arc<Names>> = HashMap::new();
        for (name, entry) in modules.iter_mut() {
            let Some(from) = entry
                .value
                .as_table_mut()
                .and_then(|keys| keys.remove("from"))
            else {
                continue;
            };
            let own = entry.value.as_table_mut();
            let wanted = own.and_then(|keys| keys.remove("module"));
            let (wanted, place) = match &wanted {
                Some(Entry { value, .. }) => (value.as_text().unwrap_or(name), value.place),
                None => (name, from.value.place),
            };
            let (wanted, lent) = (wanted.to_owned(), self.lender(&from.value));
            let Some(lent) = lent else { continue };
            let empty = Table::new();
            let of_file = lent.get("modules").and_then(Value::as_table);
            let of_file = of_file.unwrap_or(&empty);
            let Some(Data::Table(mut module)) =
                of_file.get(&wanted).map(|module| module.data.clone())
            else {
                let file = from.value.as_text().unwrap_or_default();
                let known = listed
                    .entry(file.to_owned())
                    .or_insert_with(|| Arc::new(of_file.keys().map(str::to_owned).collect()));
                let (name, known) = (wanted, Arc::clone(known));
                self.fail(place, problem::UnknownModule { name, known });
                continue;
            };
            if let Some(entry) = lent.entry("modules")
                && !module.contains("modules")
            {
                module.insert("modules", entry.clone());
            }
            borrowed.push(name.to_owned());
            let Some(over) = entry.value.as_table().cloned() else {
                continue;
            };
            // What is inside of a module has no name outside of it.
            let laid = merge(Some(module), over, &mut Vec::new(), self.diagnostics);
            entry.value.data = Data::Table(laid);
        }
        borrowed
    }

    fn lender(&mut self, from: &Value) -> Option<Table> {
        let path = from
            .as_text()
            .map(|name| normal(&self.sources.resolve(from.place, name)));
        if let Some(known) = path.as_ref().and_then(|path| self.lent.get(path)) {
            return known.clone();
        }
        let lent = self.other(from, "from");
        self.lent.extend(path.map(|path| (path, lent.clone())));
        lent
    }

    /// The tables of another file that this one names.
    fn other(&mut self, extends: &Value, key: &str) -> Option<Table> {
        let place = extends.place;
        let Some(name) = extends.as_text() else {
            let (key, expected) = (
                Some(key.to_owned()),
                "the path of a file in quotes".to_owned(),
            );
            self.fail(
                place,
                problem::WrongType {
                    key,
                    expected,
                    found: extends.found(),
                    hint: None,
                },
            );
            return None;
        };
        let path = self.sources.resolve(place, name);
        let wanted = normal(&path);
        if let Some(first) = self.paths.iter().position(|seen| *seen == wanted) {
            let chain = self.paths[first..]
                .iter()
                .chain([&wanted])
                .map(|path| path.display().to_string())
                .collect();
            self.fail(place, problem::ExtendsLoop { chain });
            return None;
        }
        if self.paths.len() >= LONGEST_CHAIN {
            self.fail(
                place,
                problem::LongChain {
                    limit: LONGEST_CHAIN,
                },
            );
            return None;
        }
        match self.reader.read_named(&path) {
            Ok(text) => self.read(&path, text),
            Err(error) => {
                self.fail(place, not_read(&path, &error, self.reader, &self.paths));
                None
            }
        }
    }

    fn fail(&mut self, place: Place, problem: impl Into<Box<dyn Problem>>) {
        self.failed = true;
        self.diagnostics.report(place, problem);
    }
}

/// None of those that are being read can be meant.
fn not_read(
    path: &Path,
    error: &io::Error,
    reader: &dyn FileReader,
    being_read: &[PathBuf],
) -> problem::Unreadable {
    let mut beside = match error.kind() {
        io::ErrorKind::NotFound => reader.beside(path),
        _ => Vec::new(),
    };
    beside.retain(|name| !being_read.contains(&normal(&path.with_file_name(name))));
    problem::Unreadable {
        path: path.display().to_string(),
        reason: unreadable(error),
        beside,
        named: error.kind() == io::ErrorKind::NotFound && !being_read.is_empty(),
    }
}

/// Why a file cannot be read, in words.
pub fn unreadable(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "there is no such file".to_owned(),
        io::ErrorKind::PermissionDenied => "reading it is not permitted".to_owned(),
        io::ErrorKind::IsADirectory => "it is a folder".to_owned(),
        io::ErrorKind::InvalidData => "it is not text in UTF-8; save it as that".to_owned(),
        _ => error.to_string(),
    }
}

/// The path without `.` and, where that does not depend on the file system, without `..`.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir
                if matches!(normal.components().next_back(), Some(Component::Normal(_))) =>
            {
                normal.pop();
            }
            other => normal.push(other),
        }
    }
    normal
}
