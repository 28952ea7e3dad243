//! What moves something: only what is recent, and never in a step.

use crate::connector::OutRow;
use crate::time::{Duration, Instant};

/// Passes commands on at no more than a rate, from what is applied.
#[derive(Debug)]
pub(super) struct CommandGate {
    /// A tick that lies further behind is no command.
    behind: Option<Duration>,
    /// By how much each command may change per second.
    rates: Vec<Option<f64>>,
    /// What is applied, as far as that is known; NaN where nothing has been.
    applied: Vec<f64>,
    last: Option<Instant>,
    /// What is put out.
    outputs: Vec<f64>,
}

impl CommandGate {
    pub(super) fn new(behind: Option<Duration>, rates: Vec<Option<f64>>) -> Self {
        Self {
            behind,
            applied: vec![f64::NAN; rates.len()],
            outputs: vec![f64::NAN; rates.len()],
            rates,
            last: None,
        }
    }

    /// What the machine says is applied, or what was applied when the service ended. Time passes from the next row on.
    pub(super) fn start_from(&mut self, applied: &[f64]) {
        for (known, applied) in self.applied.iter_mut().zip(applied) {
            *known = *applied;
        }
        self.last = None;
    }

    /// What is applied, as far as that is known.
    pub(super) fn applied(&self) -> &[f64] {
        &self.applied
    }

    /// The row as it may be put out; none where it is too old.
    pub(super) fn pass<'a>(&'a mut self, row: &OutRow<'a>) -> Option<OutRow<'a>> {
        if self.behind.is_some_and(|behind| row.behind > behind) {
            return None;
        }
        let passed = self.last.map_or(Duration::ZERO, |last| row.at - last);
        let seconds = passed.as_ns().max(0) as f64 / 1e9;
        self.last = Some(row.at);
        let asked = row.outputs.iter().zip(&self.rates);
        let known = self.applied.iter_mut().zip(&mut self.outputs);
        for ((&asked, rate), (applied, output)) in asked.zip(known) {
            *output = asked;
            if asked.is_nan() {
                continue;
            }
            if let Some(rate) = rate {
                // What was never commanded is where it was: at zero.
                let from = if applied.is_nan() { 0.0 } else { *applied };
                let most = rate * seconds;
                *output = from + (asked - from).clamp(-most, most);
            }
            *applied = *output;
        }
        Some(OutRow {
            outputs: &self.outputs,
            ..*row
        })
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
            outputs,
        }
    }

    #[test]
    fn a_command_starts_from_what_is_applied_and_passes_to_what_is_asked_at_its_rate() {
        let mut gate = CommandGate::new(None, vec![Some(2.0), None]);
        gate.start_from(&[10.0, 1.0]);
        assert_eq!(
            gate.pass(&row(5, 0, &[20.0, 7.0])).unwrap().outputs,
            [10.0, 7.0]
        );
        assert_eq!(
            gate.pass(&row(6, 0, &[20.0, 7.0])).unwrap().outputs,
            [12.0, 7.0]
        );
        assert_eq!(
            gate.pass(&row(9, 0, &[20.0, 7.0])).unwrap().outputs,
            [18.0, 7.0]
        );
        assert_eq!(
            gate.pass(&row(12, 0, &[19.0, 7.0])).unwrap().outputs,
            [19.0, 7.0]
        );
    }

    #[test]
    fn an_absent_output_is_no_command_and_what_follows_starts_from_what_is_applied() {
        let mut gate = CommandGate::new(None, vec![Some(1.0)]);
        gate.start_from(&[3.0]);
        assert!(gate.pass(&row(0, 0, &[f64::NAN])).unwrap().outputs[0].is_nan());
        assert_eq!(gate.pass(&row(1, 0, &[9.0])).unwrap().outputs, [4.0]);
        assert_eq!(gate.applied(), [4.0]);
    }

    #[test]
    fn what_lies_behind_is_no_command() {
        let mut gate = CommandGate::new(Some(Duration::from_ns(5_000_000_000)), vec![None]);
        assert!(gate.pass(&row(0, 6, &[1.0])).is_none());
        assert!(gate.pass(&row(1, 5, &[1.0])).is_some());
    }
}
