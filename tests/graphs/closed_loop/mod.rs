//! A correction on a simulated machine, as a loop: bounded, still where it knows nothing, and as good as before once a fault is over.

mod looped;
mod misreported;
mod recipe;
mod remeasured;
mod served;

use std::path::Path;

use crate::workbench::{Scratch, athermal, graph, simulated};
use athermal::core::prng::Prng;
use athermal::trial::machine::{Row, Schedule, Setup, Simulated, Simulation};
use looped::{Looped, output};

fn die_tester() -> Looped {
    Looped::new("die-tester", &graph("die-tester-control"), 200_000.0, 50.0)
}

fn linear_axis() -> Looped {
    Looped::new("linear-axis", &graph("linear-axis-control"), 50_000.0, 50.0)
}

/// A day of random faults of a machine, against the same day without: `moving` are the axes that drift enough to be compared, which
/// the correction must bring below `share` of their own drift.
fn bounded_and_recovering(looped: &Looped, cases: usize, moving: &[usize], share: f64) {
    let mut prng = Prng::stream(11, "cases");
    let channels = looped.machine.channels().iter();
    let temperatures: Vec<String> = channels
        .filter(|c| !c.is_axis())
        .map(|c| c.reference())
        .collect();
    let set = looped.machine.set_points()[0];
    let reach = if set.name == "chuck" {
        [20.0, 70.0]
    } else {
        [20.0, 23.0]
    };
    let kinds = ["missing", "stuck", "offset", "spike", "noise", "drift"];
    let (mut invalid, mut largest_step) = (0, 0.0_f64);
    for case in 0..cases {
        let levels: Vec<f64> = (0..4)
            .map(|_| prng.between(reach[0], reach[1]).round())
            .collect();
        let schedule = Schedule::cycle(set.name, &levels, 3 * 3600);
        let (from, length) = (prng.between(4.0, 12.0), prng.between(0.5, 5.0));
        let (lost, kind) = match case % 4 {
            3 => (
                format!("position.{}", looped.axes[case % looped.axes.len()]),
                "missing",
            ),
            _ => {
                let nth = prng.between(0.0, temperatures.len() as f64) as usize;
                (temperatures[nth].clone(), kinds[case % 6])
            }
        };
        let fault = format!(
            "{lost}={kind},from={:.0}s,for={:.0}s",
            from * 3600.0,
            length * 3600.0
        );
        let seed = 100 + case as u64;
        let good = looped.run(Some(&schedule), seed, None);
        let bad = looped.run(Some(&schedule), seed, Some(&fault));
        invalid += bad.invalid;
        largest_step = largest_step.max(bad.largest_step);
        // Half an hour: the longest window is 23 minutes.
        let after = from + length + 0.5;
        for &axis in moving {
            let name = looped.axes[axis];
            let (undisturbed, recovered) =
                (good.left(axis, after, 24.0), bad.left(axis, after, 24.0));
            assert!(
                recovered <= 1.1 * undisturbed,
                "{fault}, {name}: {undisturbed} → {recovered}"
            );
            let (alone, corrected) = (good.true_rms(axis, 1.0, 24.0), good.left(axis, 1.0, 24.0));
            assert!(
                corrected < share * alone,
                "seed {seed}, {name}: {alone} → {corrected}"
            );
        }
    }
    println!(
        "{invalid} axis-ticks without a prediction; the largest step was {largest_step:.1} nm"
    );
    assert!(
        invalid > 0,
        "no case took the prediction away, so nothing was shown"
    );
}

#[test]
fn over_random_faults_and_schedules_the_loop_is_bounded_and_recovers() {
    // X and Y barely move.
    bounded_and_recovering(&die_tester(), 8, &[2, 5], 0.6);
}

#[test]
fn the_loop_of_the_linear_axis_is_bounded_and_recovers_too() {
    bounded_and_recovering(&linear_axis(), 6, &[0, 1, 2], 0.7);
}

#[test]
fn without_any_position_for_hours_the_correction_goes_on_as_well() {
    for (looped, moving) in [(die_tester(), [2, 5].as_slice()), (linear_axis(), &[1, 2])] {
        let of_axis = |axis: &&str| format!("position.{axis}=missing,from=6h,for=5h");
        let gone: Vec<String> = looped.axes.iter().map(of_axis).collect();
        let good = looped.run(None, 7, None);
        let blind = looped.run(None, 7, Some(&gone.join(" ")));
        assert_eq!(blind.invalid, 0);
        for &axis in moving {
            let (seen, unseen) = (good.left(axis, 11.2, 24.0), blind.left(axis, 11.2, 24.0));
            assert!(
                (unseen / seen - 1.0).abs() < 0.01,
                "{}: {seen} → {unseen}",
                looped.axes[axis]
            );
        }
    }
}

#[test]
fn what_the_machine_applies_is_what_the_graph_is_told() {
    let looped = die_tester();
    let mut simulation = looped.started(0.2, 5, None, None);
    let mut row = Row::empty(looped.machine.channels());
    let mut asked = vec![0.0; 6];
    while simulation.next(&mut row) {
        for (asked, applied) in asked.iter().zip(simulation.applied()) {
            assert!(asked == applied || asked.is_nan());
        }
        asked.copy_from_slice(simulation.asked());
    }
    assert!(
        asked.iter().any(|asked| asked.abs() > 10.0),
        "nothing was ever corrected: {asked:?}"
    );
}

/// How far the simulated axis can correct, in nm.
const CLIPS_NM: f64 = 100_000.0;

#[test]
fn a_correction_that_the_axis_clips_fools_nobody() {
    let scratch = Scratch::new("a_correction_that_the_axis_clips");
    // A graph that asks for a hundred times too much, so that the axis reaches its end within hours.
    let text = format!(
        "schema = 1\nextends = {:?}\nname = \"boastful\"\n\
         [nodes.boast]\ntype = \"scale\"\ninputs.signal = \"rate\"\nfactor = 100.0\n\
         [nodes.compensate]\ninputs.rate = {{ from = \"boast\", max_age = \"1min\" }}\nmax_rate = \"10000 nm/min\"\nmax_slew = \"500 nm/s\"\n\
         [outputs]\nuncorrected = \"uncorrected\"\n",
        graph("die-tester-control")
    );
    let looped = Looped::new(
        "die-tester",
        &scratch.file("boastful.toml", text),
        200_000.0,
        50.0,
    );
    let channels = looped.machine.channels();
    let mut under = looped.started(0.5, 3, None, None);
    let setup = Setup {
        days: 0.5,
        seed: 3,
        ..Setup::default()
    };
    let mut alone = Simulated::new(looped.machine, setup).start().unwrap();
    let mut as_alone = looped.model.engine().unwrap();
    let (mut row, mut row_alone) = (Row::empty(channels), Row::empty(channels));
    let (mut asked, mut clipped, mut left_the_end) = (0.0_f64, 0, false);
    while under.next(&mut row) && alone.next(&mut row_alone) {
        let z1 = under.applied()[2];
        assert!(z1.abs() <= CLIPS_NM);
        asked = asked.max(under.asked()[2].abs());
        if z1.abs() == CLIPS_NM {
            clipped += 1;
        } else {
            left_the_end |= clipped > 0;
        }
        // What the axis did, not what was asked of it, is taken off again.
        let position = row_alone.values[8];
        if !position.is_nan() {
            let uncorrected = output(under.engine(), "uncorrected.Z1");
            assert!(
                (uncorrected - position).abs() < 0.11,
                "{uncorrected} and {position} at {} ns",
                row.time_ns
            );
        }
        // So what is learned and predicted is the same as without any correction: the loop does not fight itself.
        let mut samples = row_alone.values.clone();
        samples.resize(as_alone.plan().sources.len(), f64::NAN);
        let time = athermal::Instant::from_ns(row_alone.time_ns);
        as_alone.step(time, &samples).unwrap();
        let both = [under.engine(), &as_alone].map(|engine| output(engine, "predicted.Z1"));
        assert!(
            (both[0] - both[1]).abs() < 1.0 || both.iter().all(|p| p.is_nan()),
            "{both:?} at {} ns",
            row.time_ns
        );
    }
    assert!(asked > CLIPS_NM && asked <= 200_000.0, "{asked}");
    assert!(
        clipped > 100 && left_the_end,
        "{clipped} ticks at the end of the axis"
    );
}

/// The numbers of a column of a table, NaN where a cell is empty.
fn column(table: &Path, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(table).unwrap();
    let mut rows = text.lines().map(|line| line.split(','));
    let place = rows.next().unwrap().position(|column| column == name);
    let cells = rows.map(|mut row| row.nth(place.unwrap()).unwrap());
    cells.map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
}

#[test]
fn what_simulate_is_told_to_correct_moves_the_axes_that_it_writes() {
    let scratch = Scratch::new("simulate-compensates");
    let week = simulated(&scratch, "week.csv", "die-tester", 3.0, 1);
    let alone = simulated(&scratch, "alone.csv", "die-tester", 1.0, 2);
    let [model, corrected] = ["model.json", "corrected.csv"].map(|name| scratch.path(name));
    let graph = graph("die-tester-control");
    athermal(&[&"fit", &graph, &"--data", &week, &"-o", &model]).ended(0);
    athermal(&[
        &"simulate",
        &"die-tester",
        &"--days",
        &"1",
        &"--seed",
        &"2",
        &"--compensate",
        &model,
        &"-o",
        &corrected,
    ])
    .ended(0);
    let applied = column(&corrected, "Z1_applied_nm");
    let measured = [&corrected, &alone].map(|table| column(table, "Z1_nm"));
    let moved = measured[0]
        .iter()
        .zip(&measured[1])
        .map(|(with, without)| with - without);
    let off = moved.zip(&applied).map(|(moved, applied)| moved - applied);
    let off: Vec<f64> = off.filter(|off| !off.is_nan()).collect();
    let far = off.iter().filter(|off| off.abs() > 1.0).count();
    assert!(
        off.len() > 1000 && far * 100 < off.len(),
        "{far} of {}",
        off.len()
    );
    let largest = applied.iter().fold(0.0, |most: f64, of| most.max(of.abs()));
    assert!(largest > 1000.0, "the largest correction is {largest} nm");
}
