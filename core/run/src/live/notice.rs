//! What happens at a hand-over.

use athermal_core::events;

use crate::figures::{count, counted, seconds};
use crate::time::Instant;

events! {
    /// What has happened since the last look.
    #[derive(Debug, Clone, PartialEq)]
    pub enum Notice {
        /// A committed graph took over before the tick of this number.
        TookOver {
            /// Its revision.
            revision: String,
            /// The first tick that it stepped.
            tick: u64,
            /// The instant of that tick.
            time: Instant,
        } => "took_over", note,
            { revision: String = revision, tick: u64 = tick, time_s: f64 = seconds(*time) },
            format!("revision {revision} took over before tick {}", count(tick)),
            counts "athermal_swaps_total" "Graphs that took over since the start.";
        /// The engine thread sent a graph back because it came too late; it can be committed again.
        SentBack => "sent_back", fault, {}, "the new graph came too late and was sent back";
        /// Ticks, segment breaks or commands were missed: states can no longer be carried, until a graph warmed by the retained past
        /// takes over.
        Missed {
            /// How many.
            ticks: u64,
        } => "missed", fault, { ticks: u64 = ticks },
            format!("{} {} missed", counted(*ticks, "tick"), if *ticks == 1 { "was" } else { "were" }),
            counts "athermal_missed_ticks_total" "Ticks, beats, breaks and freezes that the control thread missed." by *ticks;
        /// What runs is known again after something was missed.
        Mirrored => "mirrored", note, {}, "what runs is known again: checkpoints and swaps go on";
    }
}
