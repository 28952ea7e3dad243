//! The whole text of every mistake that reading a graph file can find.

use super::{many_members, rendered};

mod files;
mod names;
mod nodes;
mod signals;
