//! What is disturbed changes as stated, from then on and until then; everything else keeps its bits.

use athermal_core::registry::find;
use athermal_simulation::{Disturbance, disturbed};
use athermal_trial::machine::{KnownMachine, Row, Setup};

const PLATE1: usize = 0;
const HOLDER1: usize = 1;
const ROOM: usize = 4;

/// The rows of a quarter of a day.
fn rows(name: &str, by: &[&str]) -> Vec<Row> {
    let by: Vec<Disturbance> = by.iter().map(|text| text.parse().unwrap()).collect();
    let disturbed = disturbed(name, &by).unwrap();
    let same = find::<KnownMachine>(name).unwrap().machine;
    let machine = disturbed.as_deref().unwrap_or(same);
    let setup = Setup {
        days: 0.25,
        seed: 3,
        ..Setup::default()
    };
    let mut simulation = machine.start(&setup).unwrap();
    let mut row = Row::empty(machine.channels());
    let mut rows = Vec::new();
    while simulation.next(&mut row) {
        rows.push(row.clone());
    }
    rows
}

fn bits(row: &Row, but: Option<usize>) -> Vec<u64> {
    let all = row.values.iter().chain(&row.true_drift).enumerate();
    let others = all.filter(|(column, _)| Some(*column) != but);
    others.map(|(_, value)| value.to_bits()).collect()
}

/// The row of a minute.
fn at(minute: usize) -> usize {
    minute * 6
}

#[test]
fn a_loose_sensor_reads_so_much_of_the_room_and_nothing_else_changes() {
    let (sound, loose) = (
        rows("die-tester", &[]),
        rows("die-tester", &["loose=holder1,from=2h,for=1h,size=0.5"]),
    );
    for (nth, (sound, loose)) in sound.iter().zip(&loose).enumerate() {
        assert_eq!(bits(sound, Some(HOLDER1)), bits(loose, Some(HOLDER1)));
        let (body, air) = (sound.values[HOLDER1], sound.values[ROOM]);
        if (at(120)..at(180)).contains(&nth) {
            // Twice the noise of a sensor of 1 mK, six standard deviations of it.
            let off = loose.values[HOLDER1] - (0.5 * body + 0.5 * air);
            assert!(off.abs() < 0.012, "row {nth} is off by {off} K");
        } else {
            assert_eq!(loose.values[HOLDER1].to_bits(), body.to_bits(), "row {nth}");
        }
    }
    let apart = sound.iter().zip(&loose);
    let apart = apart.map(|(sound, loose)| (sound.values[HOLDER1] - loose.values[HOLDER1]).abs());
    let apart = apart.fold(0.0, f64::max);
    assert!(apart > 0.05, "nothing was loose: {apart} K at most");
}

#[test]
fn a_lamp_heats_the_first_stage_at_its_rate_from_its_beginning() {
    for (machine, column) in [("die-tester", PLATE1), ("linear-axis", 1)] {
        let (dark, lit) = (
            rows(machine, &[]),
            rows(machine, &["lamp,from=1h,for=2h,size=0.6 mK/s"]),
        );
        let before = dark.iter().zip(&lit).take(at(60));
        assert!(
            before
                .into_iter()
                .all(|(a, b)| bits(a, None) == bits(b, None))
        );
        let warmer =
            |minute: usize| lit[at(minute)].values[column] - dark[at(minute)].values[column];
        // 0.36 K in ten minutes, of which a little has left for the air and the neighbours.
        assert!(
            (0.24..0.37).contains(&warmer(70)),
            "{machine}: {} K",
            warmer(70)
        );
        assert!(warmer(240) < 0.6 * warmer(180), "{machine}: it stays lit");
    }
}

#[test]
fn an_open_door_brings_all_bodies_closer_to_the_air() {
    for (machine, bodies, air) in [
        ("die-tester", vec![0, 1, 2, 3], ROOM),
        ("linear-axis", vec![0, 1, 2], 3),
    ] {
        let (shut, open) = (rows(machine, &[]), rows(machine, &["door,from=2h,size=4"]));
        let before = shut.iter().zip(&open).take(at(120));
        assert!(
            before
                .into_iter()
                .all(|(a, b)| bits(a, None) == bits(b, None))
        );
        for body in bodies {
            let apart = |rows: &[Row]| -> f64 {
                let rows = &rows[at(150)..];
                rows.iter()
                    .map(|row| (row.values[body] - row.values[air]).abs())
                    .sum()
            };
            let (shut, open) = (apart(&shut), apart(&open));
            assert!(
                open < 0.9 * shut,
                "{machine}, body {body}: {open} of {shut}"
            );
        }
    }
}

#[test]
fn what_cannot_be_disturbed_is_refused_with_what_can() {
    let refused = |text: &str| text.parse::<Disturbance>().unwrap_err().to_string();
    for (text, expected) in [
        ("door", "expected `door,size=3`"),
        ("door,size=40", "0.1 to 10"),
        ("door=room,size=3", "expected `door,size=3`"),
        ("lamp,size=0.6", "`lamp,size=0.6 mK/s`"),
        ("lamp,size=1 K/s", "at most 10 mK/s"),
        ("loose,size=0.5", "`loose=SENSOR,size=0.5`"),
        ("loose=plate1,size=1.1", "0 to 1"),
        ("loose=plate1,size=NaN", "0 to 1"),
        ("window,size=1", "expected `door,size=3`"),
        (
            "door,size=3,until=4h",
            "`until=4h`: expected `from`, `for` or `size`",
        ),
        ("door,size=3,from=-1h", "`from=-1h`"),
        ("door,size=3,for=long", "`for=long`"),
    ] {
        let found = refused(text);
        assert!(found.contains(expected), "{text}: {found}");
    }
    let by = |text: &str| [text.parse::<Disturbance>().unwrap()];
    for (machine, text, expected) in [
        (
            "die-tester",
            "loose=room,size=0.5",
            "plate1, holder1, plate2, holder2, chuck",
        ),
        ("linear-axis", "loose=t4,size=0.5", "t1, t2, t3"),
        ("spindle", "door,size=3", "die-tester and linear-axis"),
    ] {
        let found = disturbed(machine, &by(text)).err().unwrap().to_string();
        assert!(found.contains(expected), "{machine}, {text}: {found}");
    }
}
