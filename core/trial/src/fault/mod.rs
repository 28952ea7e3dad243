//! Decides what can be wrong with a sensor and how a fault changes the values of a channel, in any recording; not which recording.

mod error;
mod kind;
mod recording;
mod spec;

pub use error::FaultError;
pub use kind::FaultKind;
pub use recording::WithFaults;
pub use spec::FaultSpec;

use crate::prng::Prng;

const HOUR_NS: f64 = 3600e9;
/// One value in so many is hit by a spike.
const ONE_SPIKE_IN: f64 = 20.0;

/// A fault of one channel during a span of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Index of the channel in the rows.
    pub channel: usize,
    /// What is wrong.
    pub kind: FaultKind,
    /// When it starts, in ns after the first row.
    pub from_ns: i64,
    /// How long it lasts, in ns.
    pub for_ns: i64,
    /// How large it is, in the unit of the channel (per hour for `drift`); not used by `missing` and `stuck`.
    pub size: f64,
}

/// Faults of a recording, applied row by row in the order of time. Several faults of one channel act one after the other, in the order given.
#[derive(Debug, Clone)]
pub struct Faults {
    faults: Vec<(Fault, Prng, f64)>,
    first_ns: Option<i64>,
}

impl Faults {
    /// Faults of rows with `width` channels. The same seed gives the same spikes and noise.
    ///
    /// # Errors
    /// The first fault that names no channel, or whose span or size makes no sense.
    pub fn new(faults: Vec<Fault>, width: usize, seed: u64) -> Result<Self, FaultError> {
        for (fault, what) in faults.iter().enumerate() {
            let &Fault {
                channel,
                kind,
                from_ns,
                for_ns,
                size,
            } = what;
            if channel >= width {
                return Err(FaultError::Channel {
                    fault,
                    channel,
                    width,
                });
            }
            if from_ns < 0 || for_ns <= 0 {
                return Err(FaultError::Span {
                    fault,
                    from_ns,
                    for_ns,
                });
            }
            let negative = kind == FaultKind::Noise && size < 0.0;
            if kind.has_size() && (!size.is_finite() || negative) {
                return Err(FaultError::Size { fault, kind, size });
            }
        }
        let stream = |index: usize| Prng::stream(seed, &format!("fault {index}"));
        Ok(Self {
            faults: faults
                .into_iter()
                .enumerate()
                .map(|(index, fault)| (fault, stream(index), f64::NAN))
                .collect(),
            first_ns: None,
        })
    }

    /// What follows is another segment: its times may start again, and faults count from its first row.
    pub fn restart(&mut self) {
        self.first_ns = None;
        for (_, _, held) in &mut self.faults {
            *held = f64::NAN;
        }
    }

    /// Changes the values of one row, one per channel and NaN where there is none. Rows must come in the order of time; `time_ns` may count from any instant.
    pub fn apply(&mut self, time_ns: i64, values: &mut [f64]) {
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        let since_ns = time_ns.saturating_sub(first_ns);
        for (fault, prng, held) in &mut self.faults {
            let Some(value) = values.get_mut(fault.channel) else {
                continue;
            };
            if !value.is_nan() {
                *value = fault.change(*value, since_ns, prng, held);
            }
        }
    }
}

impl Fault {
    fn change(&self, value: f64, since_ns: i64, prng: &mut Prng, held: &mut f64) -> f64 {
        let inside_ns = since_ns - self.from_ns;
        if inside_ns < 0 || inside_ns >= self.for_ns {
            *held = value;
            return value;
        }
        match self.kind {
            FaultKind::Missing => f64::NAN,
            FaultKind::Stuck => {
                if held.is_nan() {
                    *held = value;
                }
                *held
            }
            FaultKind::Offset => value + self.size,
            FaultKind::Spike => match prng.uniform() * ONE_SPIKE_IN {
                draw if draw < 0.5 => value - self.size,
                draw if draw < 1.0 => value + self.size,
                _ => value,
            },
            FaultKind::Drift => value + self.size * (inside_ns as f64 / HOUR_NS),
            FaultKind::Noise => value + self.size * prng.normal(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE_NS: i64 = 60_000_000_000;

    fn fault(kind: FaultKind, size: f64) -> Fault {
        Fault {
            channel: 1,
            kind,
            from_ns: 60 * MINUTE_NS,
            for_ns: 120 * MINUTE_NS,
            size,
        }
    }

    /// Five hours of minutes that start at some other time: channel 0 and 1 say the minute, and channel 1 is absent in every tenth.
    fn run(faults: Vec<Fault>, seed: u64) -> Vec<[f64; 2]> {
        let mut faults = Faults::new(faults, 2, seed).unwrap();
        (0..300)
            .map(|minute| {
                let value = minute as f64;
                let mut row = [value, if minute % 10 == 9 { f64::NAN } else { value }];
                faults.apply(1_000 * MINUTE_NS + minute * MINUTE_NS, &mut row);
                row
            })
            .collect()
    }

    /// The values of channel 1 during the fault, with what they should be; asserts that all else is untouched.
    fn during(kind: FaultKind, size: f64) -> Vec<(f64, f64)> {
        let rows = run(vec![fault(kind, size)], 1);
        let mut inside = Vec::new();
        for (minute, row) in rows.iter().enumerate() {
            assert_eq!(row[0], minute as f64, "the other channel");
            if minute % 10 == 9 {
                assert!(row[1].is_nan(), "an absent value stays absent");
            } else if (60..180).contains(&minute) {
                inside.push((minute as f64, row[1]));
            } else {
                assert_eq!(
                    row[1], minute as f64,
                    "minute {minute} is outside the fault"
                );
            }
        }
        assert_eq!(inside.len(), 108);
        inside
    }

    #[test]
    fn a_missing_sensor_has_no_values() {
        assert!(during(FaultKind::Missing, 0.0).iter().all(|v| v.1.is_nan()));
    }

    #[test]
    fn a_stuck_sensor_keeps_its_last_value() {
        assert!(during(FaultKind::Stuck, 0.0).iter().all(|v| v.1 == 58.0));
    }

    #[test]
    fn a_sensor_stuck_from_the_start_keeps_its_first_value() {
        let from_start = Fault {
            from_ns: 0,
            ..fault(FaultKind::Stuck, 0.0)
        };
        let rows = run(vec![from_start], 1);
        assert_eq!(rows[118][1], 0.0);
        assert_eq!(rows[120][1], 120.0);
    }

    #[test]
    fn an_offset_is_added() {
        assert!(
            during(FaultKind::Offset, 2.5)
                .iter()
                .all(|v| v.1 == v.0 + 2.5)
        );
    }

    #[test]
    fn a_spike_hits_one_value_in_twenty_either_way() {
        let ten_days = Fault {
            for_ns: i64::MAX,
            from_ns: 0,
            ..fault(FaultKind::Spike, 7.0)
        };
        let mut faults = Faults::new(vec![ten_days], 2, 1).unwrap();
        let mut hits = [0, 0, 0];
        for minute in 0..20_000 {
            let mut row = [0.0, 0.0];
            faults.apply(minute * MINUTE_NS, &mut row);
            match row[1] {
                0.0 => hits[0] += 1,
                7.0 => hits[1] += 1,
                -7.0 => hits[2] += 1,
                other => panic!("{other}"),
            }
        }
        // 500 expected each way, standard error 22.
        assert!(hits[1..].iter().all(|n| (400..600).contains(n)), "{hits:?}");
    }

    #[test]
    fn a_drift_grows_by_its_size_per_hour() {
        for (minute, value) in during(FaultKind::Drift, 3.0) {
            let expected = minute + 3.0 * (minute - 60.0) / 60.0;
            assert!((value - expected).abs() < 1e-9, "{value} at {minute}");
        }
    }

    #[test]
    fn noise_has_its_size_as_standard_deviation() {
        let inside = during(FaultKind::Noise, 2.0);
        let rms = (inside.iter().map(|v| (v.1 - v.0).powi(2)).sum::<f64>() / 108.0).sqrt();
        assert!((rms - 2.0).abs() < 0.6, "{rms}");
    }

    #[test]
    fn the_same_seed_gives_the_same_noise_and_another_another() {
        let noise = |seed| run(vec![fault(FaultKind::Noise, 2.0)], seed)[100][1];
        assert_eq!(noise(1), noise(1));
        assert_ne!(noise(1), noise(2));
    }

    #[test]
    fn several_faults_act_in_their_order() {
        let rows = run(
            vec![fault(FaultKind::Offset, 1.0), fault(FaultKind::Stuck, 0.0)],
            1,
        );
        assert_eq!(rows[100][1], 58.0);
    }

    #[test]
    fn faults_that_make_no_sense_are_refused_with_a_reason() {
        let sound = fault(FaultKind::Noise, 1.0);
        for (wrong, expected) in [
            (
                Fault {
                    channel: 2,
                    ..sound.clone()
                },
                "fault 1: channel 2 of a recording that has 2",
            ),
            (
                Fault {
                    for_ns: 0,
                    ..sound.clone()
                },
                "fault 1: from 1h for 0s; the start must not be negative and the length must be above 0",
            ),
            (
                Fault {
                    size: f64::NAN,
                    kind: FaultKind::Offset,
                    ..sound.clone()
                },
                "fault 1: a size of NaN for `offset`; it must be finite",
            ),
            (
                Fault {
                    size: -1.0,
                    ..sound
                },
                "fault 1: a size of -1 for `noise`; it must be finite and not negative",
            ),
        ] {
            let error = Faults::new(vec![wrong], 2, 1).map(|_| ()).unwrap_err();
            assert_eq!(error.to_string(), expected);
        }
    }
}
