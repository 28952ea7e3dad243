//! What a service reports, as an event for programs: its name, its facts, and a sentence.

use athermal_run::live::Notice;
use athermal_serve::sequencer::{Admission, Refusal};
use athermal_serve::service::ServiceEvent;
use serde_json::{Value, json};

/// An event by name, with its facts and a sentence.
pub fn described(event: &ServiceEvent) -> (&'static str, Value, String) {
    match event {
        ServiceEvent::SourceFailed {
            source,
            error,
            again_s,
        } => (
            "source_failed",
            json!({ "source": source, "again_s": again_s }),
            format!("source `{source}`: {error}"),
        ),
        ServiceEvent::SourceRemark { source, words } => (
            "source_remark",
            json!({ "source": source }),
            format!("source `{source}`: {words}"),
        ),
        ServiceEvent::SourceEnded { source } => (
            "source_ended",
            json!({ "source": source }),
            format!("source `{source}` has ended"),
        ),
        ServiceEvent::SinkFailed { sink, error } => (
            "sink_failed",
            json!({ "sink": sink }),
            format!("sink `{sink}`: {error}"),
        ),
        ServiceEvent::SinkBack { sink } => (
            "sink_back",
            json!({ "sink": sink }),
            format!("sink `{sink}` puts out again"),
        ),
        ServiceEvent::NotAccepted { admission, count } => {
            let (reason, channel) = reason(*admission);
            (
                "not_accepted",
                json!({ "reason": reason, "channel": channel, "count": count }),
                format!("a sample was left out: {reason}, {count} so far"),
            )
        }
        ServiceEvent::Swap(Notice::TookOver { revision, tick, .. }) => (
            "took_over",
            json!({ "revision": revision, "tick": tick }),
            format!("revision {revision} took over before tick {tick}"),
        ),
        ServiceEvent::Swap(Notice::SentBack) => (
            "sent_back",
            Value::Null,
            "the new graph came too late and was sent back; commit it again".to_owned(),
        ),
        ServiceEvent::Swap(Notice::Missed { ticks }) => (
            "missed",
            json!({ "ticks": ticks }),
            format!("{ticks} ticks were missed by the control thread"),
        ),
        ServiceEvent::Staged { revision, .. } => (
            "staged",
            json!({ "revision": revision }),
            format!("the machine file has another graph: {revision} takes over"),
        ),
        ServiceEvent::NotStaged(reason) => (
            "not_staged",
            Value::Null,
            format!("the machine file has another graph, which cannot take over: {reason}"),
        ),
        ServiceEvent::Compared { revision, verdict } => (
            "compared",
            json!({ "revision": revision, "verdict": verdict }),
            match verdict.ratio {
                Some(ratio) => format!(
                    "{revision} in the shadow: its error is {ratio:.3} times that of what runs"
                ),
                None => format!("{revision} in the shadow: there was nothing to compare"),
            },
        ),
        ServiceEvent::NotTakenOver(reason) => (
            "not_taken_over",
            Value::Null,
            format!("the staged graph does not take over: {reason}"),
        ),
        ServiceEvent::HostClock { is_synchronised } => (
            "host_clock",
            json!({ "is_synchronised": is_synchronised }),
            match is_synchronised {
                true => "the host's clock is synchronised".to_owned(),
                false => "the host's clock is not synchronised yet".to_owned(),
            },
        ),
        ServiceEvent::NoCheckpoint(error) => (
            "no_checkpoint",
            Value::Null,
            format!("no checkpoint: {error}"),
        ),
        ServiceEvent::Journal(status) => (
            "journal",
            json!({ "is_degraded": status.is_degraded, "lost": status.lost }),
            match (&status.error, status.is_degraded) {
                (Some(error), true) => format!("the journal cannot be written: {error}"),
                (None, true) => "the journal cannot be written: the disk hangs".to_owned(),
                (_, false) => "the journal is written again".to_owned(),
            },
        ),
        ServiceEvent::NodeGivenUp(panic) => ("node_given_up", Value::Null, panic.clone()),
        ServiceEvent::EngineFailed(reason) => (
            "engine_failed",
            Value::Null,
            format!("the engine cannot go on: {reason}"),
        ),
    }
}

fn reason(admission: Admission) -> (&'static str, Option<u32>) {
    match admission {
        Admission::Late(sample) => ("late", Some(sample.channel)),
        Admission::Twice(sample) => ("repeated", Some(sample.channel)),
        Admission::Refused(sample, Refusal::Future { .. }) => ("future", Some(sample.channel)),
        Admission::Refused(sample, Refusal::Clock { .. }) => ("clock", Some(sample.channel)),
        Admission::Refused(_, Refusal::NoChannel) => ("no channel", None),
        Admission::Accepted(_) | Admission::Held => ("waits", None),
    }
}
