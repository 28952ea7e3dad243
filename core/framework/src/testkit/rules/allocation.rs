//! Decides whether the steady state allocates.

use super::super::samples::{Coming, samples};
use super::Subject;
use crate::channel::ABSENT;
use crate::recording::Event;

/// Ticks that warm the node.
const WARM: usize = 1_500;
/// Ticks that must not allocate: so many that a list which grows at every tick has to double its room meanwhile.
const STEADY: usize = WARM + 1;
/// Ticks after them of which some channels are missing, which is no reason to allocate either.
const GAPS: usize = 200;

pub(super) fn allocation(subject: &Subject<'_>) -> Result<(), String> {
    let mut engine = subject.engine();
    let ticks = WARM + STEADY + GAPS;
    let mut table = samples(subject.kind, &subject.given, ticks, Coming::Always);
    let gaps = table.events_mut().iter_mut().skip(WARM + STEADY);
    for (tick, (_, row)) in gaps.enumerate() {
        for (channel, value) in row.iter_mut().enumerate() {
            if (tick / 7 + channel) % 3 == 0 || tick % 41 == 40 {
                *value = ABSENT;
            }
        }
    }
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
            "{count} allocations, {} bytes, in {} ticks after {WARM} that warmed it, of which the last {GAPS} lack samples",
            allocated.bytes_total,
            STEADY + GAPS
        )),
    }
}
