//! The service around an engine: messages of several senders become ticks, and nothing that was accepted is lost.
//!
//! What a graph means is decided in `athermal-core`; sessions and swaps in `athermal-run`. Protocols are the business of plugins.
//!
//! # A reader's path
//!
//! [`sequencer::Sequencer`] first: it decides which samples make a tick, and when.
//!
//! # The layers
//!
//! | layer | decides |
//! |---|---|
//! | [`moment`] | time that the host's clock does not touch |
//! | [`sequencer`] | when ticks are cut, and which samples are late, repeated or refused |

pub mod moment;
pub mod sequencer;

// The layers below, by the names that they have for everybody.
use athermal_core::{channel, time};
