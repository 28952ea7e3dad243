//! The steady state.

use super::*;

#[test]
fn once_warm_neither_samples_nor_ticks_nor_beats_allocate() {
    let mut rules = plain(8);
    (rules.most, rules.heartbeat) = (256, Some(ms(50)));
    let mut sequencer = connected(rules);
    let mut ticks = 0_u64;
    let mut round = |nth: i64| {
        let now = at(100 * nth);
        for channel in 0..8 {
            let stamp = 100 * nth - i64::from(channel) % 3;
            sequencer.arrive(sample(channel, stamp, 1.0), now);
        }
        while let Some(decision) = sequencer.pass(now) {
            ticks += u64::from(matches!(decision, Decision::Tick { .. }));
        }
    };
    (0..1_000).for_each(&mut round);
    let counted = allocation_counter::measure(|| (1_000..2_000).for_each(&mut round));
    assert_eq!(counted.count_total, 0);
    assert!(ticks > 5_000, "{ticks}");
}
