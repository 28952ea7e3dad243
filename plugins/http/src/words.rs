//! What a service reports: its name and its facts for programs, a sentence for people. The terminal and the control interface say the same.

use athermal_analysis::figures::{instant, seconds};
use athermal_command::{Message, findings};
use athermal_core::diagnostic::{count, counted};
use athermal_run::live::Notice;
use athermal_serve::sequencer::{Admission, Leader, Refusal};
use athermal_serve::service::ServiceEvent;
use serde_json::{Value, json};

/// An event of a service with these channels, and whether it is a fault. Sensors that fail `together` are one for people, and programs
/// take one for each.
#[must_use]
pub fn described(
    event: &ServiceEvent,
    channels: &[String],
    together: bool,
) -> Vec<(bool, Message)> {
    match event {
        ServiceEvent::Found(at, finding) => {
            let at_s = seconds(*at);
            findings::messages(finding, (&instant(at_s), at_s), together)
        }
        other => one(other, channels).into_iter().collect(),
    }
}

fn one(event: &ServiceEvent, channels: &[String]) -> Option<(bool, Message)> {
    let of_source = |source| json!({ "source": source });
    let of_sink = |sink| json!({ "sink": sink });
    Some(match event {
        ServiceEvent::Found(..) => return None,
        ServiceEvent::SourceFailed {
            source,
            error,
            again_s,
        } => fault(
            "source_failed",
            json!({ "source": source, "again_s": again_s }),
            format!("source `{source}`: {error}; tried again in {again_s:.1} s"),
        ),
        ServiceEvent::SourceRemark { source, words } => fault(
            "source_remark",
            of_source(source),
            format!("source `{source}`: {words}"),
        ),
        ServiceEvent::SourceEnded { source } => note(
            "source_ended",
            of_source(source),
            format!("source `{source}` has ended"),
        ),
        ServiceEvent::SinkFailed { sink, error } => fault(
            "sink_failed",
            of_sink(sink),
            format!("sink `{sink}`: {error}; tried again, rows wait meanwhile"),
        ),
        ServiceEvent::SinkBack { sink } => note(
            "sink_back",
            of_sink(sink),
            format!("sink `{sink}` puts out again"),
        ),
        ServiceEvent::NotAccepted {
            admission,
            count,
            leader,
        } => not_accepted(*admission, *count, leader.as_ref(), channels),
        ServiceEvent::WentBack { last, to } => {
            let (last, to) = (seconds(*last), seconds(*to));
            fault(
                "went_back",
                json!({ "last_s": last, "to_s": to }),
                format!(
                    "the last tick, at {}, was of the future: it is {}; a segment begins there",
                    instant(last),
                    instant(to)
                ),
            )
        }
        ServiceEvent::Swap(of) => notice(of),
        ServiceEvent::Staged { revision, .. } => note(
            "staged",
            json!({ "revision": revision }),
            format!("another graph than the one that ran last was given: {revision} takes over"),
        ),
        ServiceEvent::NotStaged(reason) => fault(
            "not_staged",
            Value::Null,
            format!(
                "another graph than the one that ran last was given, and cannot take over: {reason}; what ran last goes on"
            ),
        ),
        ServiceEvent::Compared { revision, verdict } => note(
            "compared",
            json!({ "revision": revision, "verdict": verdict }),
            match verdict.ratio {
                Some(ratio) => format!(
                    "{revision} in the shadow: its error is {ratio:.3} times that of what runs"
                ),
                None => format!("{revision} in the shadow: there was nothing to compare"),
            },
        ),
        ServiceEvent::NotTakenOver(reason) => fault(
            "not_taken_over",
            Value::Null,
            format!("the staged graph does not take over: {reason}; what runs goes on"),
        ),
        ServiceEvent::HostClock { is_synchronised } => note(
            "host_clock",
            json!({ "is_synchronised": is_synchronised }),
            match is_synchronised {
                true => "the host's clock is synchronised: stamps are compared with it from now on",
                false => {
                    "the host's clock is not synchronised: until it is, the clocks of sources are not judged by it, and what is of the future is known from sources alone"
                }
            },
        ),
        ServiceEvent::NoCheckpoint(error) => fault(
            "no_checkpoint",
            Value::Null,
            format!("no checkpoint: {error}; tried again"),
        ),
        ServiceEvent::Journal(of) => {
            let facts = json!({ "is_degraded": of.is_degraded, "lost": of.lost });
            let why = of.error.as_deref().unwrap_or("the disk hangs");
            let words = match of.is_degraded {
                true => format!(
                    "the journal cannot be written: {why}; the service goes on without it, and tries again"
                ),
                false => format!(
                    "the journal is written again; {} lost",
                    counted(of.lost, "record")
                ),
            };
            (of.is_degraded, Message::new("journal", facts, words))
        }
        ServiceEvent::NodeGivenUp(panic) => fault(
            "node_given_up",
            Value::Null,
            format!("{panic}; it gives nothing from now on"),
        ),
        ServiceEvent::EngineFailed(reason) => fault(
            "engine_failed",
            Value::Null,
            format!("the engine cannot go on: {reason}"),
        ),
    })
}

/// What happened at a hand-over, and whether it is a fault.
#[must_use]
pub fn notice(notice: &Notice) -> (bool, Message) {
    match notice {
        Notice::TookOver {
            revision,
            tick,
            time,
        } => note(
            "took_over",
            json!({ "revision": revision, "tick": tick, "time_s": seconds(*time) }),
            format!("revision {revision} took over before tick {}", count(tick)),
        ),
        Notice::SentBack => fault(
            "sent_back",
            Value::Null,
            "the new graph came too late and was sent back",
        ),
        Notice::Missed { ticks } => {
            let were = if *ticks == 1 { "was" } else { "were" };
            let words = format!("{} {were} missed", counted(*ticks, "tick"));
            fault("missed", json!({ "ticks": ticks }), words)
        }
        Notice::Mirrored => note(
            "mirrored",
            Value::Null,
            "what runs is known again: checkpoints and swaps go on",
        ),
    }
}

fn note(name: &'static str, facts: Value, words: impl std::fmt::Display) -> (bool, Message) {
    (false, Message::new(name, facts, words))
}

fn fault(name: &'static str, facts: Value, words: impl std::fmt::Display) -> (bool, Message) {
    (true, Message::new(name, facts, words))
}

/// A sample that was left out, and how many like it.
fn not_accepted(
    admission: Admission,
    count: u64,
    leader: Option<&(String, Leader)>,
    channels: &[String],
) -> (bool, Message) {
    let (reason, sample, why) = match admission {
        Admission::Late(sample) => ("late", Some(sample), "came after its tick".to_owned()),
        Admission::Twice(sample) => (
            "repeated",
            Some(sample),
            "is not after the one before".to_owned(),
        ),
        Admission::Refused(sample, Refusal::Future { ahead }) => {
            let why = format!("is {ahead} ahead of what time it is");
            ("future", Some(sample), why)
        }
        Admission::Refused(sample, Refusal::Clock { off }) => (
            "clock",
            Some(sample),
            format!("is {off} from the time of its arrival"),
        ),
        Admission::Refused(_, Refusal::NoChannel)
        | Admission::Accepted(_)
        | Admission::Waits(_)
        | Admission::Held => ("no channel", None, "is of no channel".to_owned()),
    };
    let channel = sample.and_then(|of| channels.get(of.channel as usize));
    let name = channel.map_or("a sample", String::as_str);
    let at = sample.map_or_else(String::new, |of| {
        format!(" at {}", instant(seconds(of.stamp)))
    });
    let so_far = match count {
        1 => "others like it are counted".to_owned(),
        count => format!("{count} so far"),
    };
    let clock = leader.map_or_else(String::new, |(source, of)| {
        let leading = channels.get(of.channel).map_or("", String::as_str);
        format!(
            "; the clock of source `{source}` is ahead by {}: {leading}",
            of.ahead
        )
    });
    fault(
        "not_accepted",
        json!({
            "reason": reason,
            "channel": channel,
            "count": count,
            "clock": leader.map(|(source, _)| source),
            "ahead_s": leader.map(|(_, of)| of.ahead.secs()),
        }),
        format!("{name}{at}: left out, since it {why}{clock}; {so_far}"),
    )
}
