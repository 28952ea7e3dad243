//! Estimators that go on learning while they run:
//! 1) they know of no truth that the embargo withholds, and each truth meets the row of the run that it belongs to;
//! 2) frozen, or offered what would spoil them, they stay as they are and say why;
//! 3) what was learned goes through snapshots, swaps and the mirror of the control thread to the last bit.
//!
//! Decides nothing about how well they learn; the oracles of the recursions do.

mod embargo;
mod freezing;
mod gaps;
mod kept;
mod kinds;
mod leaps;
mod machine;
mod world;
