//! A graph file, with what it extends, as a tree with places and then as typed declarations; whether the graph makes sense is decided by the compiler.
//!
//! [`load`] reads and merges files into a [`Document`]; [`declare`] checks names, expands sets and `each`, and gives a
//! [`GraphFile`]; [`decode`] turns a table into the parameters of whoever owns it.

mod declare;
mod decode;
mod foreign_syntax;
mod graph_file;
mod hint;
mod json;
mod merge;
mod pattern;
pub mod problem;
mod read;
mod toml_text;
mod tree;

pub use declare::Section;
pub use declare::declare;
pub use declare::is_name;
pub use declare::{Arrangement, DecimalMark, Encoding, Separator, TableBase, TableFormat};
pub use declare::{TIME_UNITS, is_misspelt, known_keys};
pub use declare::{fill_placeholders, placeholders};
pub use decode::decode;
pub use decode::decode_beside;
pub use foreign_syntax::ForeignSyntax;
pub use graph_file::{
    GraphFile, InputDecl, InstanceDecl, NodeDecl, OutputDecl, SignalDecl, TimeBase, TimeForm,
};
pub use hint::Hint;
pub use json::JsonError;
pub use pattern::Pattern;
pub use read::unreadable;
pub use read::{Disk, Document, FileReader, Memory, NO_FILE, lasts, load, load_text};
pub use tree::{Data, Entry, Table, Value};

#[cfg(test)]
mod tests;
