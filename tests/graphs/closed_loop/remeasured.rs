//! A corrected machine that is aligned anew when `remeasure` asks for it, against fixed intervals: as near with fewer alignments.

use athermal::trial::machine::{Row, SECOND_NS, Simulation};

use super::looped::{Looped, output};
use crate::workbench::{Scratch, graph};

/// An alignment that the machine could make: when, where its axes stand under correction, and whether it has been asked for one.
struct Chance {
    at_s: f64,
    position: Vec<f64>,
    asked: bool,
}

/// How many alignments are made where `is_due` says so, of a chance and the seconds since the one before; how far axes depart from
/// where they were aligned, as a root mean square of the farthest axis, and at most.
fn aligned(chances: &[Chance], is_due: impl Fn(&Chance, f64) -> bool) -> (usize, f64, f64) {
    let (mut from, mut count) = (&chances[0], 0);
    let (mut squares, mut largest) = (0.0, 0.0_f64);
    for chance in &chances[1..] {
        let axes = chance.position.iter().zip(&from.position);
        let off = axes
            .map(|(now, then)| (now - then).abs())
            .fold(0.0, f64::max);
        squares += off * off;
        largest = largest.max(off);
        if is_due(chance, chance.at_s - from.at_s) {
            (from, count) = (chance, count + 1);
        }
    }
    (
        count,
        (squares / (chances.len() - 1) as f64).sqrt(),
        largest,
    )
}

#[test]
fn a_machine_that_is_aligned_when_it_asks_needs_fewer_alignments_to_stay_as_near() {
    let scratch = Scratch::new("a_machine_that_is_aligned_when_it_asks");
    // What it computes, beside the correction that a closed loop needs.
    let text = std::fs::read_to_string(graph("die-tester-realign")).unwrap();
    let control = graph("die-tester-control").display().to_string();
    let text = text.replace("die-tester-compensate.toml", &control);
    let looped = Looped::new(
        "die-tester",
        &scratch.file("again.toml", text),
        200_000.0,
        50.0,
    );
    let channels = looped.machine.channels();
    let temperatures = channels.len() - looped.axes.len();
    let mut under = looped.started(1.0, 2, None, None);
    let mut row = Row::empty(channels);
    let (mut chances, mut asked) = (Vec::new(), false);
    while under.next(&mut row) {
        asked |= output(under.engine(), "ask.ask") == 1.0;
        let position = &row.values[temperatures..];
        let at_s = row.time_ns as f64 / SECOND_NS as f64;
        // From the second hour on all windows are full.
        if at_s > 3600.0 && position.iter().all(|position| !position.is_nan()) {
            chances.push(Chance {
                at_s,
                position: position.to_vec(),
                asked: std::mem::take(&mut asked),
            });
        }
    }

    let (count, rms, largest) = aligned(&chances, |chance, _| chance.asked);
    println!("asked for: {count} alignments, {rms:.0} nm RMS, {largest:.0} nm at most");
    let mut fewest = None;
    for minutes in [1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 60] {
        let due = f64::from(60 * minutes);
        let fixed = aligned(&chances, |_, since_s| since_s >= due);
        println!(
            "every {minutes} min: {} alignments, {:.0} nm RMS, {:.0} nm at most",
            fixed.0, fixed.1, fixed.2
        );
        if fixed.1 <= rms && fixed.2 <= largest {
            fewest = Some(fixed.0);
        }
    }
    let fewest = fewest.expect("an alignment at each chance is the nearest that there is");
    assert!(
        2 * count < fewest,
        "{count} alignments that were asked for, and {fewest} at fixed intervals"
    );
}
