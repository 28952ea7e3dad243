//! What moves something: only what is recent, and never in a step.

use crate::connector::OutRow;
use crate::time::{Duration, Instant};

/// Passes commands on at no more than a rate, from what is applied.
#[derive(Debug)]
pub(super) struct CommandGate {
    /// A tick that lies further behind is no command, and a time without commands counts for no more.
    behind: Option<Duration>,
    /// By how much each command may change per second.
    rates: Vec<Option<f64>>,
    /// What is applied, as far as that is known; NaN where nothing has been.
    applied: Vec<f64>,
    last: Option<Instant>,
    /// What is put out.
    outputs: Vec<f64>,
    /// Whether the machine may be elsewhere than `applied` says: after a start, a failure, and ticks that were no commands.
    is_unsure: bool,
}

impl CommandGate {
    pub(super) fn new(behind: Option<Duration>, rates: Vec<Option<f64>>) -> Self {
        Self {
            behind,
            applied: vec![f64::NAN; rates.len()],
            outputs: vec![f64::NAN; rates.len()],
            rates,
            last: None,
            is_unsure: true,
        }
    }

    /// What the machine says is applied, or what was applied when the service ended; NaN where that is not known.
    pub(super) fn start_from(&mut self, applied: &[f64]) {
        let known = self.applied.iter_mut().zip(applied);
        for (known, applied) in known.filter(|(_, applied)| !applied.is_nan()) {
            *known = *applied;
        }
    }

    /// What is applied, as far as that is known.
    pub(super) fn applied(&self) -> &[f64] {
        &self.applied
    }

    /// The row as it may be put out; none where it is too old. It counts as applied once it [is put out](Self::is_put). The machine is
    /// asked for what is applied where it may be elsewhere than is known here.
    pub(super) fn pass<'a>(
        &'a mut self,
        row: &OutRow<'a>,
        ask: impl FnOnce() -> Option<Vec<f64>>,
    ) -> Option<OutRow<'a>> {
        let last = self.last.replace(row.at);
        if self.behind.is_some_and(|behind| row.behind > behind) {
            self.is_unsure = true;
            return None;
        }
        if self.is_unsure
            && let Some(applied) = ask()
        {
            self.start_from(&applied);
        }
        let passed = last.map_or(Duration::ZERO, |last| row.at - last);
        // What could not be commanded for an hour is not made up for in one step.
        let passed = self.behind.map_or(passed, |behind| passed.min(behind));
        let seconds = passed.as_ns().max(0) as f64 / 1e9;
        let asked = row.outputs.iter().zip(&self.rates);
        let known = self.applied.iter().zip(&mut self.outputs);
        for ((&asked, rate), (&applied, output)) in asked.zip(known) {
            *output = asked;
            if let Some(rate) = rate {
                // What was never commanded is where it was: at zero.
                let from = if applied.is_nan() { 0.0 } else { applied };
                let most = rate * seconds;
                *output = from + (asked - from).clamp(-most, most);
            }
        }
        Some(OutRow {
            outputs: &self.outputs,
            ..*row
        })
    }

    /// Whether what was passed on last has been put out. Where it was not, the machine may have taken it all the same.
    pub(super) fn is_put(&mut self, is_put: bool) {
        self.is_unsure = !is_put;
        if is_put {
            let put = self.applied.iter_mut().zip(&self.outputs);
            for (applied, put) in put.filter(|(_, put)| !put.is_nan()) {
                *applied = *put;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(seconds: i64, behind_s: i64, outputs: &[f64]) -> OutRow<'_> {
        OutRow {
            at: Instant::from_ns(seconds * 1_000_000_000),
            is_beat: false,
            behind: Duration::from_ns(behind_s * 1_000_000_000),
            revision: 0,
            is_degraded: false,
            outputs,
        }
    }

    /// What is put out of a row; nothing fails.
    fn put(gate: &mut CommandGate, row: OutRow<'_>) -> Vec<f64> {
        let put = gate.pass(&row, || None).unwrap().outputs.to_vec();
        gate.is_put(true);
        put
    }

    #[test]
    fn a_command_starts_from_what_is_applied_and_passes_to_what_is_asked_at_its_rate() {
        let mut gate = CommandGate::new(None, vec![Some(2.0), None]);
        gate.start_from(&[10.0, 1.0]);
        assert_eq!(put(&mut gate, row(5, 0, &[20.0, 7.0])), [10.0, 7.0]);
        assert_eq!(put(&mut gate, row(6, 0, &[20.0, 7.0])), [12.0, 7.0]);
        assert_eq!(put(&mut gate, row(9, 0, &[20.0, 7.0])), [18.0, 7.0]);
        assert_eq!(put(&mut gate, row(12, 0, &[19.0, 7.0])), [19.0, 7.0]);
    }

    #[test]
    fn an_absent_output_is_no_command_and_what_follows_starts_from_what_is_applied() {
        let mut gate = CommandGate::new(None, vec![Some(1.0)]);
        gate.start_from(&[3.0]);
        assert!(put(&mut gate, row(0, 0, &[f64::NAN]))[0].is_nan());
        assert_eq!(put(&mut gate, row(1, 0, &[9.0])), [4.0]);
        assert_eq!(gate.applied(), [4.0]);
    }

    #[test]
    fn what_lies_behind_is_no_command_and_what_follows_moves_by_one_tick() {
        let mut gate = CommandGate::new(Some(Duration::from_ns(5_000_000_000)), vec![Some(1.0)]);
        assert_eq!(put(&mut gate, row(0, 0, &[9.0])), [0.0]);
        for second in 1..60 {
            assert!(
                gate.pass(&row(second, 6, &[9.0]), || panic!("it is too old"))
                    .is_none()
            );
        }
        assert!(gate.is_unsure);
        assert_eq!(put(&mut gate, row(60, 5, &[9.0])), [1.0]);
    }

    #[test]
    fn a_time_without_ticks_or_with_a_machine_that_is_away_is_not_made_up_for_in_a_step() {
        let mut gate = CommandGate::new(Some(Duration::from_ns(5_000_000_000)), vec![Some(1.0)]);
        gate.start_from(&[0.0]);
        put(&mut gate, row(0, 0, &[99.0]));
        assert_eq!(put(&mut gate, row(3_600, 0, &[99.0])), [5.0]);
        for second in 3_601..3_700 {
            assert_eq!(
                gate.pass(&row(second, 0, &[99.0]), || None)
                    .unwrap()
                    .outputs,
                [6.0]
            );
            gate.is_put(false);
            assert!(gate.is_unsure);
        }
        assert_eq!(gate.applied(), [5.0]);
        // It says that it took one of them.
        gate.start_from(&[6.0]);
        assert_eq!(put(&mut gate, row(3_700, 0, &[99.0])), [7.0]);
        assert!(!gate.is_unsure);
    }
}
