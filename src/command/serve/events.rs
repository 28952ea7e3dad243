//! What a service reports, in words for the terminal.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use athermal::serve::recovery::{RecoveryReport, Start};
use athermal::serve::sequencer::{Admission, Refusal, Sample};
use athermal::serve::service::{ServiceEvent, SinkCounts};

use crate::command::run::swap_words;
use crate::terminal::Terminal;
use athermal_analysis::figures::{counted, instant, seconds};

/// A service's way to the terminal.
pub struct Events<'a> {
    pub terminal: Terminal,
    pub channels: &'a [String],
}

impl Events<'_> {
    /// Reports an event.
    pub fn report(&self, event: ServiceEvent) {
        let terminal = &self.terminal;
        match event {
            ServiceEvent::SourceFailed {
                source,
                error,
                again_s,
            } => terminal.warning(format_args!(
                "source `{source}`: {error}; tried again in {again_s:.1} s"
            )),
            ServiceEvent::SourceRemark { source, words } => {
                terminal.warning(format_args!("source `{source}`: {words}"));
            }
            ServiceEvent::SourceEnded { source } => {
                terminal.note(format_args!("source `{source}` has ended"));
            }
            ServiceEvent::SinkFailed { sink, error } => terminal.warning(format_args!(
                "sink `{sink}`: {error}; tried again, rows wait meanwhile"
            )),
            ServiceEvent::SinkBack { sink } => {
                terminal.note(format_args!("sink `{sink}` puts out again"));
            }
            ServiceEvent::NotAccepted { admission, count } => self.not_accepted(admission, count),
            ServiceEvent::Swap(notice) => swap_words::notice(terminal, notice),
            ServiceEvent::Staged { revision, carry } => {
                terminal.note(format_args!(
                    "another graph than the one that ran last was given: {revision} takes over"
                ));
                swap_words::carry(terminal, &carry);
            }
            ServiceEvent::NotStaged(reason) => terminal.warning(format_args!(
                "another graph than the one that ran last was given, and cannot take over: {reason}; what ran last goes on"
            )),
            ServiceEvent::Compared { verdict, .. } => terminal.note(swap_words::shadow(&verdict)),
            ServiceEvent::NotTakenOver(reason) => terminal.warning(format_args!(
                "the staged graph does not take over: {reason}; what runs goes on"
            )),
            ServiceEvent::HostClock { is_synchronised } => terminal.note(if is_synchronised {
                "the host's clock is synchronised: stamps are compared with it from now on"
            } else {
                "the host's clock is not synchronised: until it is, the clocks of sources are not judged, and the first stamp may be any"
            }),
            ServiceEvent::NoCheckpoint(error) => {
                terminal.warning(format_args!("no checkpoint: {error}; tried again"));
            }
            ServiceEvent::Journal(status) if status.is_degraded => {
                let why = status.error.unwrap_or_else(|| "the disk hangs".to_owned());
                terminal.warning(format_args!(
                    "the journal cannot be written: {why}; the service goes on without it, and tries again"
                ));
            }
            ServiceEvent::Journal(status) => terminal.note(format_args!(
                "the journal is written again; {} lost",
                counted(status.lost, "record")
            )),
            ServiceEvent::NodeGivenUp(panic) => {
                terminal.warning(format_args!("{panic}; it gives nothing from now on"));
            }
            ServiceEvent::EngineFailed(reason) => {
                terminal.warning(format_args!("the engine cannot go on: {reason}"));
            }
        }
    }

    fn not_accepted(&self, admission: Admission, count: u64) {
        let (sample, why): (Sample, String) = match admission {
            Admission::Late(sample) => (sample, "came after its tick".to_owned()),
            Admission::Twice(sample) => (sample, "is not after the one before".to_owned()),
            Admission::Refused(sample, Refusal::Future { ahead }) => (
                sample,
                format!("is {ahead} ahead of the newest one and the time since"),
            ),
            Admission::Refused(sample, Refusal::Clock { off }) => {
                (sample, format!("is {off} from the time of its arrival"))
            }
            Admission::Refused(_, Refusal::NoChannel)
            | Admission::Accepted(_)
            | Admission::Held => return,
        };
        let unknown = "a channel".to_owned();
        let channel = self
            .channels
            .get(sample.channel as usize)
            .unwrap_or(&unknown);
        let so_far = match count {
            1 => "others like it are counted".to_owned(),
            count => format!("{count} so far"),
        };
        self.terminal.warning(format_args!(
            "{channel} at {}: left out, since it {why}; {so_far}",
            instant(seconds(sample.stamp))
        ));
    }
}

/// Reports how a service was found.
pub fn recovered(terminal: &Terminal, state: &Path, report: &RecoveryReport) {
    let shown = state.display();
    match report.start {
        Start::Nothing => {
            terminal.note(format_args!("{shown}: not there yet, the service begins cold"));
        }
        Start::Beginning | Start::Checkpoint(_) => terminal.note(format_args!(
            "{shown}: goes on where it ended; {} stepped again",
            counted(report.stepped, "tick")
        )),
        Start::Cold => terminal.warning(format_args!(
            "{shown}: no checkpoint can be used, and the journal does not go back to the beginning: the service begins cold at its oldest tick"
        )),
    }
    damaged(terminal, report);
    if let Some(difference) = report.difference {
        terminal.warning(format_args!(
            "the tick at {} does not give the bits that were written, on this processor or by this release",
            instant(seconds(difference.at))
        ));
    }
}

/// Reports what of a state cannot be used, or differs.
pub fn damaged(terminal: &Terminal, report: &RecoveryReport) {
    for refused in &report.refused {
        terminal.warning(format_args!("{refused}; an older one is tried"));
    }
    if let Some(torn) = &report.torn {
        terminal.warning(format_args!("{torn}"));
    }
    for gap in &report.gaps {
        terminal.warning(format_args!("{gap}"));
    }
    for revision in &report.swaps {
        terminal.note(format_args!("{revision} took over before"));
    }
}

/// Reports what sinks did not put out.
pub fn sinks(terminal: &Terminal, sinks: &[(String, Arc<SinkCounts>)]) {
    for (sink, counts) in sinks {
        let dropped = counts.dropped.load(Ordering::Relaxed);
        if dropped > 0 {
            terminal.warning(format_args!(
                "sink `{sink}`: {} lost, because it was behind",
                counted(dropped, "row")
            ));
        }
        let behind = counts.behind.load(Ordering::Relaxed);
        if behind > 0 {
            terminal.note(format_args!(
                "sink `{sink}`: {} not sent, because they were too old",
                counted(behind, "command")
            ));
        }
    }
}
