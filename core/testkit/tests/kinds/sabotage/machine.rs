//! A machine that is sound, and the same with one fault at a time.

use std::sync::atomic::{AtomicU64, Ordering};

use athermal_core::prng::Prng;
use athermal_testkit::{assert_every_machine_conforms, broken_machine};
use athermal_trial::machine::{
    Channel, Machine, Row, SECOND_NS, SetPoint, Setup, SetupError, Simulation, rows_of,
};

/// A plate that follows what it is set to, and an axis that grows with it.
struct Plate(Fault);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// Has two channels of one name, one of them in no unit.
    Misnamed,
    /// By default, it is set to what it cannot be.
    BadDefault,
    /// Runs for no time at all.
    AnyLength,
    /// Takes schedules of other machines.
    AnySchedule,
    /// Panics where it is hot.
    Panics,
    /// Its time goes back.
    GoesBack,
    /// Two rows have the same time.
    Stands,
    /// Measures infinity.
    Infinite,
    /// Never measures its position.
    Blind,
    /// Does not know its drift.
    Driftless,
    /// No two of them are the same.
    Unseeded,
    /// Begins again after its end.
    Endless,
    /// Clears the row at its end.
    Clears,
    /// Takes nothing for zero.
    NanIsZero,
    /// Applies what cannot be.
    Unclipped,
    /// Does not say what it applies.
    Silent,
    /// Takes a correction for drift.
    Corrected,
}

const PLATE: SetPoint = SetPoint {
    name: "plate",
    default: 20.0,
    range: [10.0, 80.0],
};

impl Machine for Plate {
    fn name(&self) -> &'static str {
        "sabotaged-plate"
    }

    fn summary(&self) -> &'static str {
        "A plate that follows what it is set to: one axis, one temperature."
    }

    fn channels(&self) -> &[Channel] {
        const SOUND: [Channel; 2] = [Channel::temperature("plate"), Channel::position("Z")];
        const UNSOUND: [Channel; 2] = [
            Channel::position("Z"),
            Channel {
                unit: "ell",
                ..Channel::position("Z")
            },
        ];
        if self.0 == Fault::Misnamed {
            &UNSOUND
        } else {
            &SOUND
        }
    }

    fn set_points(&self) -> &[SetPoint] {
        const UNSOUND: SetPoint = SetPoint {
            default: 0.0,
            ..PLATE
        };
        if self.0 == Fault::BadDefault {
            const { &[UNSOUND] }
        } else {
            const { &[PLATE] }
        }
    }

    fn start(&self, setup: &Setup) -> Result<Box<dyn Simulation>, SetupError> {
        static STARTS: AtomicU64 = AtomicU64::new(0);
        let mut asked = setup.clone();
        if self.0 == Fault::AnyLength && !(setup.days > 0.0 && setup.days < 3000.0) {
            asked.days = 1.0;
        }
        if self.0 == Fault::AnySchedule {
            asked.schedule = None;
        }
        let rows = rows_of(self.name(), self.set_points(), &asked, SECOND_NS)?;
        let plate = setup.schedule.clone().unwrap_or_default().track(&PLATE);
        let starts = STARTS.fetch_add(1, Ordering::Relaxed);
        let seed = if self.0 == Fault::Unseeded {
            starts
        } else {
            setup.seed
        };
        Ok(Box::new(Following {
            fault: self.0,
            plate,
            applied_nm: 0.0,
            noise: Prng::stream(seed, "plate"),
            row: 0,
            rows,
        }))
    }
}

struct Following {
    fault: Fault,
    plate: athermal_trial::machine::schedule::Track,
    applied_nm: f64,
    noise: Prng,
    row: u64,
    rows: u64,
}

impl Simulation for Following {
    fn next(&mut self, row: &mut Row) -> bool {
        if self.row == self.rows {
            if self.fault == Fault::Clears {
                row.values.fill(f64::NAN);
            }
            if self.fault == Fault::Endless {
                self.row = 0;
            }
            return false;
        }
        row.time_ns = self.row as i64 * SECOND_NS;
        match self.fault {
            Fault::GoesBack if self.row == 500 => row.time_ns -= 10 * SECOND_NS,
            Fault::Stands if self.row == 500 => row.time_ns -= SECOND_NS,
            _ => {}
        }
        let plate = self.plate.at(row.time_ns);
        assert!(!(self.fault == Fault::Panics && plate > 70.0), "it is hot");
        row.values[0] = plate + 0.001 * self.noise.normal();
        row.values[1] = 100.0 * (plate - 20.0) + self.applied_nm;
        let drift = if self.row < 300 { f64::NAN } else { 0.0 };
        row.true_drift.fill(drift);
        match self.fault {
            Fault::Infinite if self.row == 500 => row.values[0] = f64::INFINITY,
            Fault::Blind => row.values[1] = f64::NAN,
            Fault::Driftless => row.true_drift[0] = f64::NAN,
            Fault::Corrected => row.true_drift[0] += self.applied_nm,
            _ => {}
        }
        self.row += 1;
        true
    }

    fn correct(&mut self, asked: &[f64], applied: &mut [f64]) {
        if asked[0].is_finite() {
            self.applied_nm = asked[0].clamp(-1e4, 1e4);
        } else if self.fault == Fault::NanIsZero {
            self.applied_nm = 0.0;
        }
        match self.fault {
            Fault::Silent => {}
            Fault::Unclipped => applied.fill(asked[0] * 1e300),
            _ => applied.fill(self.applied_nm),
        }
    }
}

athermal_trial::register_machine!(Plate(Fault::None), "sabotaged-plate");

/// Asserts that one rule is broken, and what is found contains these words.
#[track_caller]
fn breaks(fault: Fault, rule: &str, words: &str) {
    let broken = broken_machine(&Plate(fault));
    let rules: Vec<&str> = broken.iter().map(|broken| broken.rule).collect();
    assert_eq!(rules, [rule], "{broken:#?}");
    let told = broken[0].to_string();
    assert!(told.starts_with("`sabotaged-plate`, "), "{told}");
    assert!(told.contains(words), "`{words}` is not in: {told}");
    assert!(told.contains("\n  to do: "), "{told}");
}

#[test]
fn a_sound_machine_breaks_no_rule() {
    assert_eq!(broken_machine(&Plate(Fault::None)), []);
    assert_every_machine_conforms(env!("CARGO_PKG_NAME"));
}

#[test]
fn a_machine_is_described_by_names_units_and_ranges_that_can_be() {
    let found = "the channel `position.Z` is there twice\n  the channel `position.Z` is in `ell`, which is no unit";
    breaks(Fault::Misnamed, "described", found);
    breaks(
        Fault::BadDefault,
        "described",
        "the set point `plate` is 0 by default, which is not in a range from 10 to 80",
    );
}

#[test]
fn what_no_machine_can_be_asked_for_is_refused() {
    breaks(Fault::AnyLength, "setups", "a recording of 0 days is begun");
    breaks(
        Fault::AnySchedule,
        "setups",
        "which it does not have, is taken",
    );
    breaks(
        Fault::Panics,
        "setups",
        "it panics: it is hot\n  to do: a machine answers with",
    );
}

#[test]
fn rows_go_on_in_time_and_say_something_finite() {
    let told = "a row at 490000000000 ns follows one at 499000000000 ns";
    breaks(Fault::GoesBack, "rows", told);
    let told = "a row at 499000000000 ns follows one at 499000000000 ns";
    breaks(Fault::Stands, "rows", told);
    let broken = broken_machine(&Plate(Fault::Infinite));
    assert!(broken.iter().any(|broken| {
        broken.rule == "rows" && broken.found == "the row at 500000000000 ns has the value inf"
    }));
    breaks(
        Fault::Blind,
        "rows",
        "`position.Z` has no value in 43200 rows",
    );
    breaks(Fault::Driftless, "rows", "`position.Z` has no true drift");
}

#[test]
fn the_same_seed_is_the_same_machine() {
    breaks(Fault::Unseeded, "repeats", "simulated again, the same seed");
}

#[test]
fn the_end_is_an_end() {
    breaks(Fault::Endless, "ends", "another row comes after the last");
    breaks(Fault::Clears, "ends", "the row is changed");
}

#[test]
fn a_correction_is_clipped_told_and_no_drift() {
    breaks(
        Fault::NanIsZero,
        "corrections",
        "asked for nothing it applies",
    );
    breaks(Fault::Unclipped, "corrections", "it applies");
    breaks(Fault::Silent, "corrections", "it applies NaN");
    breaks(Fault::Corrected, "corrections", "its true drift at");
}
