//! The service around an engine: messages of several senders become ticks, and nothing that was accepted is lost.
//!
//! What a graph means is decided in `athermal-core`; sessions and swaps in `athermal-run`. Protocols are the business of plugins.
//!
//! # A reader's path
//!
//! [`LiveGraph`](athermal_run::live::LiveGraph) first: a graph at work, without a thread, a file or a clock. Then [`journal::Record`], which
//! is a decision of it in the journal, and [`replay::Replay`], which applies it again. [`service`] is its host with threads,
//! [`keeper::Keeper`] what the control thread does beside it, and [`recovery::Recovered`] what a start does.
//!
//! # The layers
//!
//! | layer | decides |
//! |---|---|
//! | [`connector`] | what a source and a sink implement, and how their kinds become known |
//! | [`deployment`] | what a machine file says of them, and of time |
//! | [`moment`] | time that the host's clock does not touch |
//! | [`host`] | the host's clock, and whether it is right |
//! | [`journal`] | how decisions are written, how much of them survives what, and how damage is noticed |
//! | [`replay`] | a log through an engine, to the same bits |
//! | [`folder`], [`checkpoint`], [`keeper`] | what a state folder holds, and when it is written |
//! | [`recovery`] | from there to where the service was |
//! | [`service`] | all of it at work, with its threads |
//! | [`mod@facts`] | what is known of it, each fact declared once |
//! | [`shown`] | what of a tick whoever looks on may name |
//! | [`companion`] | what runs beside it and asks it things |

/// Makes errors of other parts into those of one.
macro_rules! from {
    ($into:ident: $($error:ident => $variant:ident),* $(,)?) => {
        $(impl From<$error> for $into {
            fn from(error: $error) -> Self {
                Self::$variant(error)
            }
        })*
    };
}

mod aside;
pub mod bell;
pub mod checkpoint;
pub mod companion;
pub mod connector;
pub mod deployment;
pub mod facts;
pub mod folder;
pub mod host;
pub mod journal;
pub mod keeper;
pub mod moment;
pub mod recovery;
pub mod replay;
pub mod service;
pub mod shown;
pub mod testkit;

// The layers below, by the names that they have for everybody.
use athermal_core::{
    channel, compile, diagnostic, document, engine, event, figures, message, node, quantity,
    registry, time, unit,
};
pub use athermal_run::live::sequencer;

#[cfg(test)]
mod tests;

/// What macros of this crate make use of.
#[doc(hidden)]
pub mod __private {
    pub use super::document::Section;
    pub use athermal_core::__private::{list, no_schema, schema_of};
    pub use inventory;
}
