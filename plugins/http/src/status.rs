//! What is known of a service, as JSON.

use std::sync::atomic::Ordering;

use athermal_core::engine::Engine;
use athermal_core::time::Instant;
use athermal_run::live::monitor::{OutsideFit, SensorFault};
use athermal_serve::connector::{Connection, LeftOut, LeftOutCounts};
use athermal_serve::service::{ChannelSamples, Service};
use serde_json::{Map, Value, json};

use crate::hub::Known;

/// How it is, and what happened last.
pub fn status(name: &str, service: &mut Service, known: &Known) -> Value {
    let snapshot = service.snapshot();
    let journal = service.journal();
    let running = service.running();
    let panics: Vec<_> = running
        .map_or(&[][..], Engine::panics)
        .iter()
        .map(ToString::to_string)
        .collect();
    let is_whole = service.lacking().is_empty() && panics.is_empty() && running.is_some();
    let is_degraded = journal.is_degraded || !is_whole;
    let state = if is_degraded { "degraded" } else { "running" };
    let staged = service
        .staged()
        .map(|of| json!({ "revision": of.revision(), "nodes": of.carry() }));
    json!({
        "name": name,
        "version": env!("CARGO_PKG_VERSION"),
        "state": state,
        "uptime_s": service.uptime().as_secs_f64(),
        "revision": running.map(Engine::revision),
        "previous": service.previous().map(Engine::revision),
        "staged": staged,
        "verdict": service.verdict(),
        "frozen": running.map(Engine::frozen),
        "happenings": snapshot.happenings,
        "ticks": snapshot.ticks,
        "beats": snapshot.beats,
        "undecided": snapshot.waiting,
        "last_s": time(Some(snapshot.last)),
        "behind_s": behind_s(snapshot.newest, snapshot.last),
        "hurried": snapshot.hurried,
        "host_clock_synchronised": snapshot.is_synchronised,
        "beat": service.beat(),
        "last_checkpoint": service.last_checkpoint(),
        "held": service.held().map(|of| json!({ "bytes": of.bytes, "bytes_full": of.full, "ticks_hz": of.rate })),
        "journal": {
            "written": journal.written,
            "synced": journal.synced,
            "lost": journal.lost,
            "failures": journal.failures,
            "is_degraded": journal.is_degraded,
            "error": journal.error,
        },
        "sources": sources(service),
        "sinks": sinks(service),
        "watched": watched(service),
        "given_up": panics,
        "events": known.recent,
    })
}

/// The channels: what became of their samples, by reason, and how old the newest one is.
pub fn channels(service: &mut Service) -> Value {
    let newest = service.snapshot().newest;
    let channel = |of: ChannelSamples| {
        let mut row = json!({
            "source": of.source,
            "channel": of.channel,
            "accepted": of.accepted,
            "age_s": age_s(newest, of.stamp),
        });
        for (reason, count) in of.left_out {
            row[reason.name()] = json!(count);
        }
        row
    };
    let all: Vec<_> = service.samples().into_iter().map(channel).collect();
    json!({ "channels": all })
}

/// What monitors have found of the graph that runs; the same as a run reports.
fn watched(service: &Service) -> Value {
    let Some(watch) = service.watched() else {
        return Value::Null;
    };
    let warnings = watch.warnings();
    let warnings = warnings
        .map(|(kind, channel, count)| json!({ "kind": kind, "channel": channel, "count": count }));
    let fault = |(channel, fault): (&str, SensorFault)| {
        let (since_s, value) = match fault {
            SensorFault::Silent { from_s } => (from_s, None),
            SensorFault::Stuck(of) => (of.from_s, Some(of.value)),
        };
        json!({ "channel": channel, "fault": fault.kind(), "since_s": since_s, "value": value })
    };
    let outside = |of: &OutsideFit| {
        json!({
            "channel": of.usual.channel,
            "samples": of.samples,
            "lowest": of.lowest,
            "highest": of.highest,
            "lowest_in_fit": of.usual.lowest,
            "highest_in_fit": of.usual.highest,
        })
    };
    let none = service.running().and_then(|of| watch.no_output(of));
    json!({
        "warnings": warnings.collect::<Vec<_>>(),
        "faults": watch.faults().map(fault).collect::<Vec<_>>(),
        "outside_fit": watch.outside_fit().map(outside).collect::<Vec<_>>(),
        "no_output": none.map(|of| json!({ "ticks": of.rows, "first_silent": of.first_silent })),
        "feeds_back": watch.fed_back(),
    })
}

/// The outputs of what runs, with their values after the last tick that was taken in.
pub fn outputs(service: &mut Service) -> Value {
    let outputs = service.running().map_or_else(Vec::new, |engine| {
        let plan = engine.plan();
        let outputs = plan.outputs.iter().zip(engine.outputs());
        let output = |(of, value): (&athermal_core::compile::PlannedOutput, &f64)| {
            let channel = &plan.channels[of.slot];
            json!({
                "output": of.name,
                "unit": channel.channel.unit.text(),
                "predicts": channel.predicts.map(|slot| &plan.channels[slot].name),
                "value": value,
            })
        };
        outputs.map(output).collect()
    });
    json!({ "outputs": outputs })
}

/// The nodes of what runs, and what is known of their predictions.
pub fn nodes(service: &mut Service, known: &Known) -> Value {
    let nodes = service.running().map_or_else(Vec::new, |engine| {
        let plan = engine.plan();
        let node = |node: &athermal_core::compile::PlannedNode| {
            let instance = node.instance();
            let novelty = known.novelty.iter().find(|(name, _)| *name == instance);
            let channels: Vec<_> = node
                .slots
                .clone()
                .map(|slot| &*plan.channels[slot].name)
                .collect();
            let errors = known
                .errors
                .iter()
                .filter(|of| channels.contains(&&*of.name));
            let errors: Vec<_> = errors
                .map(|of| json!({ "prediction": of.name, "unit": of.unit, "rmse": of.rmse() }))
                .collect();
            json!({
                "node": instance,
                "channels": channels,
                "novelty": novelty.map(|(_, value)| value),
                "errors": errors,
            })
        };
        plan.nodes.iter().map(node).collect()
    });
    json!({ "nodes": nodes })
}

fn sources(service: &Service) -> Vec<Value> {
    let source = |(name, of): &(
        String,
        std::sync::Arc<athermal_serve::connector::SourceCounts>,
    )| {
        json!({
            "source": name,
            "given": of.given.load(Ordering::Relaxed),
            "dropped": of.dropped.load(Ordering::Relaxed),
            "connected": of.is_connected(),
            "connection": connection(of.connection()),
            "restarts": of.restarts.load(Ordering::Relaxed),
            "waiting": of.waiting(),
            "left_out": left_out(&of.left_out),
            "thinned": of.thinned.load(Ordering::Relaxed),
        })
    };
    service.sources().iter().map(source).collect()
}

fn connection(of: Connection) -> &'static str {
    match of {
        Connection::Never => "never",
        Connection::Connected => "connected",
        Connection::Away => "away",
        Connection::Ended => "ended",
    }
}

/// What a source left out of which it knows no channel, by reason.
fn left_out(of: &LeftOutCounts) -> Value {
    let all = LeftOut::ALL.map(|reason| (reason.name(), of.of(None, reason)));
    let some = all.into_iter().filter(|(_, count)| *count > 0);
    some.map(|(name, count)| (name.to_owned(), json!(count)))
        .collect::<Map<_, _>>()
        .into()
}

fn sinks(service: &Service) -> Vec<Value> {
    let sink = |(name, of): &(String, std::sync::Arc<athermal_serve::service::SinkCounts>)| {
        json!({
            "sink": name,
            "put": of.put.load(Ordering::Relaxed),
            "dropped": of.dropped.load(Ordering::Relaxed),
            "behind": of.behind.load(Ordering::Relaxed),
            "superseded": of.superseded.load(Ordering::Relaxed),
            "failures": of.failures.load(Ordering::Relaxed),
            "error": of.error(),
            "waiting": of.waiting(),
            "spooled": of.spooled(),
        })
    };
    service.sinks().iter().map(sink).collect()
}

fn time(at: Option<Instant>) -> Option<f64> {
    let at = at.filter(|at| *at > Instant::MIN)?;
    Some(at.as_ns() as f64 / 1e9)
}

/// How far the last tick lies behind the newest stamp and the time since.
pub fn behind_s(newest: Option<Instant>, last: Instant) -> Option<f64> {
    age_s(newest, last)
}

/// How old what has a stamp is; none where there is nothing.
pub fn age_s(newest: Option<Instant>, stamp: Instant) -> Option<f64> {
    let newest = newest.filter(|_| stamp > Instant::MIN)?;
    Some((newest - stamp).as_ns().max(0) as f64 / 1e9)
}
