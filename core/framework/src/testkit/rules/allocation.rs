//! Decides whether the steady state allocates.

use super::super::samples::{Coming, samples};
use super::Subject;
use crate::recording::Event;

/// Ticks that warm the node.
const WARM: usize = 1_500;
/// Ticks that must not allocate: so many that a list which grows at every tick has to double its room meanwhile.
const STEADY: usize = WARM + 1;

pub(super) fn allocation(subject: &Subject<'_>) -> Result<(), String> {
    let mut engine = subject.engine();
    let table = samples(subject.kind, &subject.given, WARM + STEADY, Coming::Always);
    let (warm, steady) = table.events().split_at(WARM);
    let mut step = |events: &[(Event, Vec<f64>)]| {
        for (event, values) in events {
            if let Event::Row(now) = event {
                let _ = engine.step(*now, values);
            }
        }
    };
    step(warm);
    let allocated = allocation_counter::measure(|| step(steady));
    match allocated.count_total {
        0 => Ok(()),
        count => Err(format!(
            "{count} allocations, {} bytes, in {STEADY} ticks after {WARM} that warmed it",
            allocated.bytes_total
        )),
    }
}
