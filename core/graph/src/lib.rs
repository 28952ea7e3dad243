//! Graph files of athermal, from text to checked declarations. What a node is and how nodes are wired is decided in `athermal-core`.
//!
//! Each layer uses only those above it in this list, and this crate uses no other crate of athermal:
//!
//! | layer | decides |
//! |---|---|
//! | [`diagnostic`] | how a mistake in a file is reported: code, place, reason, a way out |
//! | [`time`], [`mod@unit`], [`quantity`], [`channel`] | instants, durations, units, named channels with unit and span |
//! | [`figures`], [`message`], [`event`] | numbers and tables for people; what is reported, and what can happen |
//! | [`failure`], [`watch`] | why work that somebody asked for was not done; what is remarked on the way, and how far it has come |
//! | [`registry`] | what a name may mean: one table of all that linked crates bring |
//! | [`document`] | a file, with what it extends, as a tree with places, expanded into declarations |
//!
//! A reader begins with [`document::load`](document), and follows one table of the file into the declaration that it becomes.

pub mod channel;
mod decimal_comma;
pub mod diagnostic;
pub mod document;
pub mod event;
pub mod failure;
pub mod figures;
pub mod message;
pub mod quantity;
pub mod registry;
mod schema;
pub mod time;
pub mod unit;
pub mod watch;

/// What macros of this crate make use of.
#[doc(hidden)]
pub mod __private {
    pub use {inventory, schemars, serde_json};
}
