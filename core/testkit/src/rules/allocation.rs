//! Decides whether the steady state allocates.

use super::Subject;
use crate::channel::ABSENT;
use crate::recording::Event;

/// Ticks after them of which some channels are missing, which is no reason to allocate either.
const GAPS: usize = 200;

pub(super) fn allocation(subject: &Subject<'_>) -> Result<(), String> {
    let mut engine = subject.engine();
    // Afterwards so many that a list which grows at every tick has to double its room meanwhile.
    let warm = subject.ticks() / 2 * 5;
    let steady = warm + 1;
    let mut table = subject.without_gaps(warm + steady + GAPS);
    // The first gap of all may make room, once: one lies in the ticks that warm.
    let gaps = |nth: usize| (warm / 2..warm / 2 + GAPS).contains(&nth) || nth >= warm + steady;
    let events = table.events_mut().iter_mut().enumerate();
    for (tick, (_, row)) in events.filter(|(nth, _)| gaps(*nth)) {
        for (channel, value) in row.iter_mut().enumerate() {
            if (tick / 7 + channel) % 3 == 0 || tick % 41 == 40 {
                *value = ABSENT;
            }
        }
    }
    let (first, rest) = table.events().split_at(warm);
    let mut step = |events: &[(Event, Vec<f64>)]| {
        for (event, values) in events {
            if let Event::Row(now) = event {
                let _ = engine.step(*now, values);
            }
        }
    };
    step(first);
    let allocated = allocation_counter::measure(|| step(rest));
    match allocated.count_total {
        0 => Ok(()),
        count => Err(format!(
            "{count} allocations, {} bytes, in {} ticks after {warm} that warmed it, of which the last {GAPS} lack samples",
            allocated.bytes_total,
            steady + GAPS
        )),
    }
}
