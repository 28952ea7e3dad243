//! How the true state of a machine becomes rows. Decides sampling instants, noise, resolution and true drift, not the state.

use athermal_core::prng::Prng;
use athermal_trial::machine::{Channel, Row, SECOND_NS, Setup, Simulation};

/// Seconds between rows: every temperature is sampled in each.
pub const PERIOD_S: i64 = 10;
/// Standard deviation of the noise of a temperature, in K.
const TEMPERATURE_NOISE: f64 = 1e-3;
/// Offset of a sensor of temperature in K, times the spread of machines; 0 as designed.
const TEMPERATURE_OFFSET: f64 = 0.5;
/// Standard deviation of the noise of a position, in nm.
const POSITION_NOISE_NM: f64 = 12.0;
/// Shortest and longest time in s between two alignments; 75 s on average.
const ALIGNMENT_S: [f64; 2] = [62.0, 88.0];
/// Seconds in the window of a drift.
const WINDOW_S: i64 = 300;
/// How far the fine drive of an axis can correct to either side, in nm; beyond it clips.
pub const CORRECTION_NM: f64 = 100_000.0;
/// As many alignments as that window can hold, at 60 s apart.
const IN_WINDOW: usize = 5;
/// Decimal places of a true drift.
pub const DRIFT_DECIMALS: u32 = 3;

/// The physics of a machine, stepped in time.
pub trait Plant: Send {
    /// Seconds per step; a divisor of [`PERIOD_S`].
    const STEP_S: f64;

    /// Advances by one step; `time_ns` is the time reached.
    fn step(&mut self, time_ns: i64);

    /// True temperatures in °C, in the order of the channels.
    fn temperatures(&self, into: &mut [f64]);

    /// True positions of the axes in nm, in the order of the channels.
    fn positions(&self, into: &mut [f64]);
}

/// A simulation that samples a [`Plant`] whose channels are all its temperatures followed by all its axes.
///
/// Positions are measured about every 75 s and stamped with the first row at or after the alignment.
/// With each comes the true drift: the least-squares slope, in nm/min, through the noise-free positions at the alignments of the trailing
/// five minutes `(t − 5 min, t]`, once that window is full. It is the drift of the measured positions without their noise, at the same
/// instants; what a perfect model would predict. Corrections move the measured positions and leave the true drift.
pub struct Recorder<P> {
    plant: P,
    temperatures: usize,
    decimals: Vec<u32>,
    /// Of each temperature.
    offset: Vec<f64>,
    noise: Vec<Prng>,
    alignment: Prng,
    next_alignment_s: f64,
    origin_nm: Vec<f64>,
    position_nm: Vec<f64>,
    /// Corrections in force.
    applied_nm: Vec<f64>,
    /// Instants in s of the newest alignments, newest first, and the noise-free positions then, per axis.
    aligned_s: [i64; IN_WINDOW],
    aligned_nm: Vec<[f64; IN_WINDOW]>,
    first_s: Option<i64>,
    row: u64,
    rows: u64,
}

impl<P: Plant> Recorder<P> {
    /// Records `rows` rows of `plant`, which stands at time 0; positions count from there. The setup is that of the plant.
    pub fn new(plant: P, channels: &[Channel], rows: u64, setup: &Setup) -> Self {
        let (seed, individual) = (setup.seed, setup.individual);
        let axes = channels.iter().filter(|channel| channel.is_axis()).count();
        let mut alignment = Prng::stream(seed, "alignment");
        let mut origin_nm = vec![0.0; axes];
        plant.positions(&mut origin_nm);
        Self {
            plant,
            temperatures: channels.len() - axes,
            decimals: channels.iter().map(|channel| channel.decimals).collect(),
            offset: channels
                .iter()
                .filter(|channel| !channel.is_axis())
                .map(|of| TEMPERATURE_OFFSET * individual.offset(&format!("sensor {}", of.name)))
                .collect(),
            noise: channels
                .iter()
                .map(|channel| Prng::stream(seed, &format!("noise {}", channel.reference())))
                .collect(),
            next_alignment_s: alignment.between(ALIGNMENT_S[0], ALIGNMENT_S[1]),
            alignment,
            position_nm: vec![0.0; axes],
            applied_nm: vec![0.0; axes],
            aligned_s: [i64::MIN; IN_WINDOW],
            aligned_nm: vec![[f64::NAN; IN_WINDOW]; axes],
            first_s: None,
            origin_nm,
            row: 0,
            rows,
        }
    }

    fn advance(&mut self, time_s: i64) {
        let steps = (PERIOD_S as f64 / P::STEP_S).round() as i64;
        let step_ns = PERIOD_S * SECOND_NS / steps;
        let from_ns = (time_s - PERIOD_S) * SECOND_NS;
        for step in 1..=steps {
            self.plant.step(from_ns + step * step_ns);
        }
    }

    fn align(&mut self, time_s: i64, row: &mut Row) {
        let first_s = *self.first_s.get_or_insert(time_s);
        let from_s = time_s - WINDOW_S;
        self.aligned_s.rotate_right(1);
        self.aligned_s[0] = time_s;
        let inside = self.aligned_s.partition_point(|at_s| *at_s > from_s);
        self.plant.positions(&mut self.position_nm);
        for (axis, aligned_nm) in self.aligned_nm.iter_mut().enumerate() {
            let truth = self.position_nm[axis] - self.origin_nm[axis];
            let column = self.temperatures + axis;
            let noise = POSITION_NOISE_NM * self.noise[column].normal();
            row.values[column] =
                resolved(truth + self.applied_nm[axis] + noise, self.decimals[column]);
            aligned_nm.rotate_right(1);
            aligned_nm[0] = truth;
            if first_s <= from_s {
                let drift = slope_per_min(&self.aligned_s[..inside], &aligned_nm[..inside]);
                row.true_drift[axis] = resolved(drift, DRIFT_DECIMALS);
            }
        }
    }
}

impl<P: Plant> Simulation for Recorder<P> {
    fn next(&mut self, row: &mut Row) -> bool {
        if self.row == self.rows {
            return false;
        }
        let time_s = self.row as i64 * PERIOD_S;
        if self.row > 0 {
            self.advance(time_s);
        }
        row.time_ns = time_s * SECOND_NS;
        self.plant
            .temperatures(&mut row.values[..self.temperatures]);
        for column in 0..self.temperatures {
            let error = TEMPERATURE_NOISE * self.noise[column].normal() + self.offset[column];
            row.values[column] = resolved(row.values[column] + error, self.decimals[column]);
        }
        row.values[self.temperatures..].fill(f64::NAN);
        row.true_drift.fill(f64::NAN);
        if time_s as f64 >= self.next_alignment_s {
            self.next_alignment_s += self.alignment.between(ALIGNMENT_S[0], ALIGNMENT_S[1]);
            self.align(time_s, row);
        }
        self.row += 1;
        true
    }

    fn correct(&mut self, asked: &[f64], applied: &mut [f64]) {
        for (applied_nm, asked_nm) in self.applied_nm.iter_mut().zip(asked) {
            if asked_nm.is_finite() {
                *applied_nm = asked_nm.clamp(-CORRECTION_NM, CORRECTION_NM);
            }
        }
        applied.copy_from_slice(&self.applied_nm);
    }
}

/// The nearest number with so many decimal places: what a table of that resolution gives back, bit for bit. NaN stays NaN.
fn resolved(value: f64, decimals: u32) -> f64 {
    if value.is_nan() {
        return value;
    }
    let scale = 10_i64.pow(decimals) as f64;
    // By way of an integer, so that there is no negative zero.
    (value * scale).round() as i64 as f64 / scale
}

/// Least-squares slope per minute of `values` at `instants_s`; NaN for less than two.
fn slope_per_min(instants_s: &[i64], values: &[f64]) -> f64 {
    let n = instants_s.len() as f64;
    let mean_s = instants_s.iter().sum::<i64>() as f64 / n;
    let mean = values.iter().sum::<f64>() / n;
    let (mut covariance, mut variance) = (0.0, 0.0);
    for (instant_s, value) in instants_s.iter().zip(values) {
        let since_s = *instant_s as f64 - mean_s;
        covariance += since_s * (value - mean);
        variance += since_s * since_s;
    }
    60.0 * covariance / variance
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHANNELS: [Channel; 2] = [Channel::temperature("t"), Channel::position("Z")];

    /// 21 °C, and an axis that drifts by 30 nm/min.
    struct Ramp(i64);

    impl Plant for Ramp {
        const STEP_S: f64 = 5.0;

        fn step(&mut self, time_ns: i64) {
            assert_eq!(time_ns - self.0, 5 * SECOND_NS);
            self.0 = time_ns;
        }

        fn temperatures(&self, into: &mut [f64]) {
            into[0] = 21.0;
        }

        fn positions(&self, into: &mut [f64]) {
            into[0] = 1000.0 + 0.5 * self.0 as f64 / SECOND_NS as f64;
        }
    }

    fn rows(count: u64) -> Vec<Row> {
        let setup = Setup {
            seed: 4,
            ..Setup::default()
        };
        let mut recorder = Recorder::new(Ramp(0), &CHANNELS, count, &setup);
        let mut row = Row::empty(&CHANNELS);
        let mut rows = Vec::new();
        while recorder.next(&mut row) {
            rows.push(row.clone());
        }
        rows
    }

    #[test]
    fn rows_are_ten_seconds_apart_and_as_many_as_asked_for() {
        let rows = rows(100);
        assert_eq!(rows.len(), 100);
        assert_eq!(rows[0].time_ns, 0);
        assert!(
            rows.windows(2)
                .all(|w| w[1].time_ns - w[0].time_ns == 10 * SECOND_NS)
        );
    }

    #[test]
    fn noise_has_the_stated_spread() {
        let rows = rows(60_000);
        let rms = |errors: &[f64]| {
            (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
        };
        let temperature: Vec<f64> = rows.iter().map(|row| row.values[0] - 21.0).collect();
        let position: Vec<f64> = rows
            .iter()
            .filter(|row| !row.values[1].is_nan())
            .map(|row| row.values[1] - 0.5 * row.time_ns as f64 / SECOND_NS as f64)
            .collect();
        assert!((rms(&temperature) / 1e-3 - 1.0).abs() < 0.03);
        assert!((rms(&position) / 12.0 - 1.0).abs() < 0.05);
    }

    #[test]
    fn positions_come_at_irregular_times_about_every_75_seconds() {
        let times: Vec<i64> = rows(60_000)
            .iter()
            .filter(|row| !row.values[1].is_nan())
            .map(|row| row.time_ns / SECOND_NS)
            .collect();
        let gaps: Vec<i64> = times.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(gaps.iter().all(|gap| (60..=90).contains(gap)));
        assert!([60, 70, 80, 90].iter().all(|gap| gaps.contains(gap)));
        let mean = gaps.iter().sum::<i64>() as f64 / gaps.len() as f64;
        assert!((mean - 75.0).abs() < 0.5, "{mean}");
    }

    #[test]
    fn the_true_drift_stands_beside_each_position_once_five_minutes_are_full() {
        let rows = rows(500);
        let first = rows.iter().position(|row| !row.values[1].is_nan());
        let full_ns = first.map_or(0, |row| rows[row].time_ns) + WINDOW_S * SECOND_NS;
        for row in rows {
            let expected = !row.values[1].is_nan() && row.time_ns >= full_ns;
            assert_eq!(!row.true_drift[0].is_nan(), expected, "{row:?}");
            assert!(!expected || row.true_drift[0] == 30.0, "{row:?}");
        }
    }

    #[test]
    fn values_have_the_resolution_of_their_channel_and_no_negative_zero() {
        assert_eq!(resolved(21.123_449, 4), 21.1234);
        assert_eq!(resolved(-0.04, 1).to_bits(), 0.0_f64.to_bits());
        assert!(resolved(f64::NAN, 1).is_nan());
    }
}
