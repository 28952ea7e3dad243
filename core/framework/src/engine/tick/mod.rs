//! One tick: where values lie, what each node reads of them, and what it gives.
//!
//! Bottom up: [`slots`], [`history`] and [`gather`] hold and read values; [`estimate`], [`vote`] and [`runner`] are the nodes at
//! work; [`context`] runs one of them; [`bank`] runs several linear estimators at once; [`output_slots`] puts out.

mod bank;
mod context;
mod edge;
mod estimate;
mod gather;
mod history;
mod output_slots;
mod part;
mod planned;
mod products;
mod runner;
mod slots;
mod vote;

pub(crate) use bank::{Work, work};
pub(crate) use context::TickContext;
pub(crate) use estimate::Estimate;
pub(crate) use gather::Gathered;
pub use history::{Cursor, History};
pub(crate) use output_slots::OutputSlots;
pub(crate) use planned::PlannedSlot;
pub(crate) use runner::{NodeRunner, runners};
pub(crate) use slots::Slots;
