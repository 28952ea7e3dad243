//! What a service reports, in words for the terminal.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use athermal::core::engine::NodeCarry;
use athermal::core::event::Event as _;
use athermal::core::watch::Watch;
use athermal::run::live::Report;
use athermal::serve::recovery::{RecoveryReport, Start};
use athermal::serve::service::{ServiceEvent, SinkCounts};

use crate::terminal::Terminal;
use athermal_analysis::figures::{counted, instant, seconds};

/// A service's way to the terminal.
pub struct Events(pub Terminal);

impl Events {
    /// Reports an event.
    pub fn report(&self, event: ServiceEvent) {
        let Self(terminal) = self;
        let all = match &event {
            ServiceEvent::Compared { verdict, .. } => {
                Report::Shadow(verdict.clone()).messages(!terminal.events)
            }
            event => event.messages(!terminal.events),
        };
        let host: &dyn Watch = terminal;
        all.into_iter().for_each(|of| host.report(of));
        if let ServiceEvent::Staged { carry, .. } = &event {
            let text = NodeCarry::words(carry);
            if !text.is_empty() {
                terminal.note(text.trim_start());
            }
        }
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
            steps(report)
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

/// How much was stepped again.
pub fn steps(report: &RecoveryReport) -> String {
    let ticks = counted(report.stepped - report.beats, "tick");
    match report.beats {
        0 => ticks,
        beats => format!("{ticks} and {}", counted(beats, "beat")),
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
            let were = if behind == 1 { "it was" } else { "they were" };
            terminal.note(format_args!(
                "sink `{sink}`: {} not sent, because {were} too old",
                counted(behind, "command")
            ));
        }
    }
}
