//! Estimators that go on learning while they run:
//! 1) they know of no truth that the embargo withholds, and each truth meets the row of the run that it belongs to;
//! 2) frozen, or offered what would spoil them, they stay as they are and say why;
//! 3) what was learned goes through snapshots, swaps and the mirror of the control thread to the last bit;
//! 4) where a machine changes they follow, and where truths lie for an hour they are hardly worse than the same graph without learning.

mod changes;
mod embargo;
mod freezing;
mod gaps;
mod kept;
mod kinds;
mod leaps;
mod leapt;
mod machine;
mod ridge;
mod world;
mod yields;
