//! What a service reports while it runs: what can happen, declared once.

use athermal_core::events;
use athermal_run::live::monitor::{Finding, words};
use athermal_run::live::{Notice, Verdict};

use crate::checkpoint::CheckpointError;
use crate::connector::ConnectorError;
use crate::diagnostic::counted;
use crate::engine::NodeCarry;
use crate::event::{Event, EventKind};
use crate::figures::{instant, seconds};
use crate::journal::JournalStatus;
use crate::sequencer::{Admission, Refusal};
use crate::time::{Duration, Instant};

events! {
    /// What happened.
    #[derive(Debug)]
    pub enum ServiceEvent {
        /// A source failed, and is started again after a while.
        SourceFailed {
            /// Its name.
            source: String,
            /// Why.
            error: ConnectorError,
            /// After so many seconds.
            again_s: f64,
        } => "source_failed", fault, { source: String = source, again_s: f64 = again_s },
            format!("source `{source}`: {error}; tried again in {again_s:.1} s");
        /// A source left something out.
        SourceRemark {
            /// Its name.
            source: String,
            /// What, and why.
            words: String,
        } => "source_remark", fault, { source: String = source }, format!("source `{source}`: {words}");
        /// A source has come to its end.
        SourceEnded {
            /// Its name.
            source: String,
        } => "source_ended", note, { source: String = source }, format!("source `{source}` has ended");
        /// A sink cannot put a row out; it is tried again after a while, and rows wait meanwhile.
        SinkFailed {
            /// Its name.
            sink: String,
            /// Why.
            error: ConnectorError,
        } => "sink_failed", fault, { sink: String = sink },
            format!("sink `{sink}`: {error}; tried again, rows wait meanwhile");
        /// A sink that had failed puts out again.
        SinkBack {
            /// Its name.
            sink: String,
        } => "sink_back", note, { sink: String = sink }, format!("sink `{sink}` puts out again");
        /// A sample was not accepted: the first of its channel and reason, the tenth, the hundredth …
        NotAccepted {
            /// Why.
            admission: Admission,
            /// Its channel.
            channel: Option<String>,
            /// How many so far.
            count: u64,
            /// Whose clock is ahead of it, where that is why.
            leader: Option<Ahead>,
        } => "not_accepted", fault, {
                reason: String = reason(*admission).0,
                channel: Option<String> = channel,
                count: u64 = count,
                clock: Option<String> = leader.as_ref().map(|of| &of.source),
                ahead_s: Option<f64> = leader.as_ref().map(|of| of.ahead.secs()),
            }, not_accepted(*admission, channel.as_deref(), *count, leader.as_ref());
        /// The last tick was of the future by the host's clock, or by what most sources have shown for a minute: a segment has begun,
        /// whose times start again.
        WentBack {
            /// The last tick.
            last: Instant,
            /// A stamp of the time that it is.
            to: Instant,
        } => "went_back", fault, { last_s: f64 = seconds(*last), to_s: f64 = seconds(*to) },
            format!(
                "the last tick, at {}, was of the future: it is {}; a segment begins there",
                instant(seconds(*last)),
                instant(seconds(*to))
            );
        /// Another graph than that of the last checkpoint was given, and takes over.
        Staged {
            /// Its revision.
            revision: String,
            /// What becomes of each node.
            carry: Vec<NodeCarry>,
        } => "staged", note, { revision: String = revision },
            format!("another graph than the one that ran last was given: {revision} takes over");
        /// Another graph than that of the last checkpoint was given, and cannot take over: what ran last goes on.
        NotStaged(reason: String) => "not_staged", fault, {},
            format!("another graph than the one that ran last was given, and cannot take over: {reason}; what ran last goes on"),
            counts "athermal_refused_swaps_total" "Graphs that were to take over and did not.";
        /// The comparison of a staged graph with what runs is over.
        Compared {
            /// The revision of the staged graph.
            revision: String,
            /// What it has come to.
            verdict: Verdict,
        } => "compared", note, { revision: String = revision, verdict: Verdict = verdict },
            match verdict.ratio {
                Some(ratio) => format!("{revision} in the shadow: its error is {ratio:.3} times that of what runs"),
                None => format!("{revision} in the shadow: there was nothing to compare"),
            };
        /// A graph was to take over after its comparison, and does not; what runs goes on.
        NotTakenOver(reason: String) => "not_taken_over", fault, {},
            format!("the staged graph does not take over: {reason}; what runs goes on"),
            counts "athermal_refused_swaps_total" "Graphs that were to take over and did not.";
        /// Whether the host's clock is known to be right, where that matters to a source: at the start, and once it is.
        HostClock {
            /// Until it is, clocks of sources are not judged by it: what is of the future is known from sources alone.
            is_synchronised: bool,
        } => "host_clock", note, { is_synchronised: bool = is_synchronised },
            match is_synchronised {
                true => "the host's clock is synchronised: stamps are compared with it from now on",
                false => "the host's clock is not synchronised: until it is, the clocks of sources are not judged by it, and what is of the future is known from sources alone",
            };
        /// A checkpoint was not written; it is tried again.
        NoCheckpoint(error: CheckpointError) => "no_checkpoint", fault, {},
            format!("no checkpoint: {error}; tried again"),
            counts "athermal_checkpoint_failures_total" "Checkpoints that could not be written.";
        /// The journal cannot be written, or can again.
        Journal(of: JournalStatus) => "journal", fault if of.is_degraded,
            { is_degraded: bool = of.is_degraded, lost: u64 = of.lost },
            match of.is_degraded {
                true => format!(
                    "the journal cannot be written: {}; the service goes on without it, and tries again",
                    of.error.as_deref().unwrap_or("the disk hangs")
                ),
                false => format!("the journal is written again; {} lost", counted(of.lost, "record")),
            };
        /// The code of a node panicked: it is absent from then on, and the graph goes on.
        NodeGivenUp(panic: String) => "node_given_up", fault, {}, format!("{panic}; it gives nothing from now on");
        /// The engine cannot go on: the service ends.
        EngineFailed(reason: String) => "engine_failed", fault, {}, format!("the engine cannot go on: {reason}");
    }
    and together {
        /// A monitor has found something at a tick of this instant, or of the graph alone before the first.
        Found(at: Instant, finding: Finding) => {
            let at_s = seconds(*at);
            words::messages(finding, (&instant(at_s), at_s), together)
        };
        /// Something happened at a hand-over.
        Swap(of: Notice) => of.messages(together);
        /// What a companion reports. Its crate declares it with [`events!`](athermal_core::events), and makes it known with
        /// [`register_events!`](crate::register_events).
        Of(of: Box<dyn Event>) => of.messages(together);
    }
}

/// Events that another crate declares.
#[derive(Debug)]
pub struct OwnEvents(pub &'static [EventKind]);

inventory::collect!(OwnEvents);

/// Makes events known that a crate declares and a companion reports.
#[macro_export]
macro_rules! register_events {
    ($events:ty) => {
        $crate::__private::inventory::submit! {
            $crate::service::OwnEvents(<$events>::KINDS)
        }
    };
}

/// All that a service of this program can report.
pub fn event_kinds() -> impl Iterator<Item = &'static EventKind> {
    let own = inventory::iter::<OwnEvents>.into_iter().map(|of| of.0);
    let all = [ServiceEvent::KINDS, Notice::KINDS, words::KINDS];
    all.into_iter().chain(own).flatten()
}

/// A source whose clock is ahead of that of a sample.
#[derive(Debug, Clone)]
pub struct Ahead {
    /// The source.
    pub source: String,
    /// The channel that shows it.
    pub channel: String,
    /// By how much it is ahead.
    pub ahead: Duration,
}

/// Why a sample was left out, for programs and for people, and when it was taken where that is known.
fn reason(admission: Admission) -> (&'static str, String, Option<Instant>) {
    match admission {
        Admission::Late(of) => ("late", "came after its tick".to_owned(), Some(of.stamp)),
        Admission::Twice(of) => (
            "repeated",
            "is not after the one before".to_owned(),
            Some(of.stamp),
        ),
        Admission::Refused(of, Refusal::Future { ahead }) => (
            "future",
            format!("is {ahead} ahead of what time it is"),
            Some(of.stamp),
        ),
        Admission::Refused(of, Refusal::Clock { off }) => (
            "clock",
            format!("is {off} from the time of its arrival"),
            Some(of.stamp),
        ),
        Admission::Refused(_, Refusal::NoChannel)
        | Admission::Accepted(_)
        | Admission::Waits(_)
        | Admission::Held => ("no channel", "is of no channel".to_owned(), None),
    }
}

/// A sample that was left out, and how many like it.
fn not_accepted(
    admission: Admission,
    channel: Option<&str>,
    count: u64,
    leader: Option<&Ahead>,
) -> String {
    let (_, why, stamp) = reason(admission);
    let name = channel.unwrap_or("a sample");
    let at = stamp.map_or_else(String::new, |at| format!(" at {}", instant(seconds(at))));
    let so_far = match count {
        1 => "others like it are counted".to_owned(),
        count => format!("{count} so far"),
    };
    let clock = leader.map_or_else(String::new, |of| {
        format!(
            "; the clock of source `{}` is ahead by {}: {}",
            of.source, of.ahead, of.channel
        )
    });
    format!("{name}{at}: left out, since it {why}{clock}; {so_far}")
}
