//! What turns a message into samples of channels, whatever protocol it comes by.
//!
//! | module | decides |
//! |---|---|
//! | [`message`], [`topic`] | which topics give which channels |
//! | [`payload`] | what a message says, whatever it is |
//! | [`gap`] | what others dropped |
//! | [`left_out`] | how what cannot be used is counted and reported |
//! | [`acknowledgements`] | which messages a sender may forget: those that the journal has |
//!
//! Nothing here knows a connection.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod acknowledgements;
pub mod gap;
pub mod left_out;
pub mod message;
pub mod payload;
pub mod topic;
