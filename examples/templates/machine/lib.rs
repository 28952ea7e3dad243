//! A machine of athermal: a body on a heated chuck, and an axis that grows with it.

use athermal_core::prng::Prng;
use athermal_trial::machine::schedule::Track;
use athermal_trial::machine::{
    Channel, Machine, Row, SECOND_NS, Schedule, SetPoint, Setup, SetupError, Simulation, rows_of,
};

/// The machine `my-node`.
///
/// The body follows the chuck with one time constant, `dT/dt = (T_chuck − T) / τ`, and the axis grows in proportion to it.
/// Temperatures are measured every ten seconds, the position every minute.
pub struct MyNode;

const CHANNELS: [Channel; 3] = [
    Channel::temperature("chuck"),
    Channel::temperature("body"),
    Channel::position("Z"),
];
const CHUCK: SetPoint = SetPoint {
    name: "chuck",
    default: 25.0,
    range: [0.0, 100.0],
};
/// Seconds between rows.
const PERIOD_S: i64 = 10;
/// Rows from one position to the next, and in the five minutes of a true drift.
const MINUTE: u64 = 6;
const FIVE_MINUTES: usize = 30;
/// The time constant of the body in seconds.
const FOLLOW_S: f64 = 1200.0;
const GROWTH_NM_PER_K: f64 = 400.0;
/// Standard deviations of what is measured.
const TEMPERATURE_NOISE: f64 = 1e-3;
const POSITION_NOISE_NM: f64 = 5.0;
/// How far the axis can be corrected to either side.
const CORRECTION_NM: f64 = 20_000.0;

impl Machine for MyNode {
    fn name(&self) -> &'static str {
        "my-node"
    }

    fn summary(&self) -> &'static str {
        "A body on a heated chuck: one axis, two temperatures."
    }

    fn channels(&self) -> &[Channel] {
        &CHANNELS
    }

    fn set_points(&self) -> &[SetPoint] {
        const { &[CHUCK] }
    }

    /// Another level of the chuck every two hours.
    fn schedule(&self, seed: u64) -> Option<Schedule> {
        let mut prng = Prng::stream(seed, "levels");
        let levels: [f64; 84] = std::array::from_fn(|_| prng.between(20.0, 40.0));
        Some(Schedule::cycle(CHUCK.name, &levels, 7200))
    }

    fn start(&self, setup: &Setup) -> Result<Box<dyn Simulation>, SetupError> {
        let period_ns = PERIOD_S * SECOND_NS;
        let rows = rows_of(self.name(), self.set_points(), setup, period_ns)?;
        let own = || self.schedule(setup.seed);
        let schedule = setup.schedule.clone().or_else(own).unwrap_or_default();
        let chuck = schedule.track(&CHUCK);
        Ok(Box::new(Warming {
            // Settled: it has stood there for long.
            body: chuck.at(0),
            chuck,
            positions: [f64::NAN; FIVE_MINUTES + 1],
            applied_nm: 0.0,
            // A stream for each channel: one more sensor leaves the noise of the others as it was.
            noise: CHANNELS.map(|channel| Prng::stream(setup.seed, channel.name)),
            row: 0,
            rows,
        }))
    }
}

athermal_trial::register_machine!(MyNode, "my-node");

/// The machine as it runs.
struct Warming {
    chuck: Track,
    body: f64,
    /// The true positions of the last five minutes, the newest last; NaN before there were any.
    positions: [f64; FIVE_MINUTES + 1],
    applied_nm: f64,
    noise: [Prng; 3],
    row: u64,
    rows: u64,
}

impl Simulation for Warming {
    fn next(&mut self, row: &mut Row) -> bool {
        if self.row == self.rows {
            return false;
        }
        row.time_ns = self.row as i64 * PERIOD_S * SECOND_NS;
        let chuck = self.chuck.at(row.time_ns);
        if self.row > 0 {
            self.body += (chuck - self.body) * (PERIOD_S as f64 / FOLLOW_S);
        }
        let position = GROWTH_NM_PER_K * (self.body - CHUCK.default);
        self.positions.rotate_left(1);
        self.positions[FIVE_MINUTES] = position;
        row.values[0] = self.measured(0, chuck, TEMPERATURE_NOISE);
        row.values[1] = self.measured(1, self.body, TEMPERATURE_NOISE);
        row.values[2] = f64::NAN;
        row.true_drift[0] = f64::NAN;
        if self.row.is_multiple_of(MINUTE) {
            // A correction moves what is measured. The drift is what there would be without it.
            row.values[2] = self.measured(2, position + self.applied_nm, POSITION_NOISE_NM);
            row.true_drift[0] = (position - self.positions[0]) / 5.0;
        }
        self.row += 1;
        true
    }

    fn correct(&mut self, asked: &[f64], applied: &mut [f64]) {
        // NaN leaves the axis as it is.
        if asked[0].is_finite() {
            self.applied_nm = asked[0].clamp(-CORRECTION_NM, CORRECTION_NM);
        }
        applied[0] = self.applied_nm;
    }
}

impl Warming {
    /// A value with the noise and the resolution of its channel.
    fn measured(&mut self, channel: usize, value: f64, deviation: f64) -> f64 {
        let scale = 10_i64.pow(CHANNELS[channel].decimals) as f64;
        ((value + deviation * self.noise[channel].normal()) * scale).round() / scale
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::time::Duration;
    use athermal_trial::machine::Announcements;

    use super::*;

    fn setup(seed: u64, schedule: Option<&str>) -> Setup {
        Setup {
            days: 0.1,
            seed,
            schedule: schedule.map(|text| Schedule::parse(text, &[CHUCK]).unwrap()),
            ..Setup::default()
        }
    }

    fn rows(seed: u64, schedule: Option<&str>) -> Vec<Row> {
        let mut simulation = MyNode.start(&setup(seed, schedule)).unwrap();
        let (mut row, mut rows) = (Row::empty(&CHANNELS), Vec::new());
        while simulation.next(&mut row) {
            rows.push(row.clone());
        }
        rows
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
        let bytes = |seed| -> Vec<u8> {
            let rows = rows(seed, None);
            let bytes = |row: &Row| [row.values.as_slice(), &row.true_drift].concat();
            let values = rows.iter().flat_map(bytes);
            values.flat_map(f64::to_ne_bytes).collect()
        };
        assert_eq!(bytes(1), bytes(1));
        assert_ne!(bytes(1), bytes(2));
    }

    #[test]
    fn the_chuck_does_what_is_announced_of_the_seed() {
        let (setup, at_once) = (setup(2, None), Duration::from_ns(0));
        let mut plan = Announcements::ahead(&MyNode, &setup, CHUCK.name, at_once).unwrap();
        let mut levels = Vec::new();
        for row in rows(2, None) {
            levels.extend(plan.next(row.time_ns).map(|(level, _)| level));
            assert!((row.values[0] - levels[levels.len() - 1]).abs() < 0.01);
        }
        assert_eq!(levels.len(), 2);
    }

    #[test]
    fn the_body_follows_the_chuck_with_its_time_constant() {
        let rows = rows(1, Some("time_min,chuck_degC\n0,20\n10,30\n"));
        let body_at = |second: usize| rows[second / 10].values[1];
        assert!((body_at(590) - 20.0).abs() < 0.01);
        // One time constant after the step 1 − 1/e of it is done.
        let expected = 20.0 + 10.0 * (1.0 - (-1.0_f64).exp());
        assert!((body_at(600 + 1200) - expected).abs() < 0.05);
    }

    #[test]
    fn the_true_drift_is_the_growth_of_five_minutes() {
        let rows = rows(1, Some("time_min,chuck_degC\n0,20\n10,30\n"));
        assert!(rows[24].true_drift[0].is_nan() && rows[30].true_drift[0] == 0.0);
        // Five minutes after the step the body is a quarter of its time constant on.
        let growth = GROWTH_NM_PER_K * 10.0 * (1.0 - (-0.25_f64).exp());
        assert!((rows[90].true_drift[0] - growth / 5.0).abs() < 1.5);
    }

    #[test]
    fn a_correction_moves_the_axis_as_far_as_it_can() {
        let mut simulation = MyNode.start(&Setup::default()).unwrap();
        let mut applied = [0.0];
        for (asked, expected) in [(500.0, 500.0), (f64::NAN, 500.0), (1e9, CORRECTION_NM)] {
            simulation.correct(&[asked], &mut applied);
            assert_eq!(applied[0], expected);
        }
    }
}
