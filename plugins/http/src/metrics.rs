//! `/metrics`: the text format of Prometheus.

use std::fmt::Write as _;
use std::sync::atomic::Ordering;

use athermal_core::engine::Engine;
use athermal_serve::connector::LeftOut;
use athermal_serve::service::{ChannelSamples, Service};

use crate::hub::Known;
use crate::status::{age_s, behind_s};

/// What it is called.
pub const CONTENT_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

/// A text that grows by whole families.
struct Page {
    text: String,
    machine: String,
}

impl Page {
    /// A family: what it is, its help, and a line for each of its values. What is absent has no line.
    fn family<'a>(
        &mut self,
        name: &str,
        kind: &str,
        help: &str,
        values: impl IntoIterator<Item = (Vec<(&'static str, &'a str)>, Option<f64>)>,
    ) {
        let mut has_head = false;
        for (labels, value) in values {
            let Some(value) = value.filter(|value| !value.is_nan()) else {
                continue;
            };
            if !has_head {
                let _ = writeln!(self.text, "# HELP {name} {help}\n# TYPE {name} {kind}");
                has_head = true;
            }
            let _ = write!(self.text, "{name}{{machine=\"{}\"", self.machine);
            for (label, of) in labels {
                let _ = write!(self.text, ",{label}=\"{}\"", escaped(of));
            }
            let _ = writeln!(self.text, "}} {}", number(value));
        }
    }

    fn counter(&mut self, name: &str, help: &str, value: u64) {
        self.family(name, "counter", help, [(vec![], Some(value as f64))]);
    }

    fn gauge(&mut self, name: &str, help: &str, value: Option<f64>) {
        self.family(name, "gauge", help, [(vec![], value)]);
    }
}

fn escaped(label: &str) -> String {
    label
        .replace('\\', "\\\\")
        .replace('"', "\\\"")
        .replace('\n', "\\n")
}

fn number(value: f64) -> String {
    match value {
        f64::INFINITY => "+Inf".to_owned(),
        f64::NEG_INFINITY => "-Inf".to_owned(),
        value => value.to_string(),
    }
}

/// The whole text. `created` is when the model that runs was fitted, as RFC 3339 writes it.
pub fn text(
    machine: &str,
    service: &mut Service,
    known: &Known,
    turned_away: u64,
    created: Option<&str>,
) -> String {
    let mut page = Page {
        text: String::new(),
        machine: escaped(machine),
    };
    ticks(&mut page, service, known);
    channels(&mut page, service);
    connectors(&mut page, service);
    watched(&mut page, service);
    predictions(&mut page, known);
    kept(&mut page, service, known);
    model(&mut page, service, known, created);
    page.counter(
        "athermal_control_refused_connections_total",
        "Connections to the control interface that there was no room for.",
        turned_away,
    );
    page.gauge(
        "athermal_control_listeners",
        "Streams of events that are open.",
        Some(known.listeners as f64),
    );
    page.counter(
        "athermal_control_dropped_items_total",
        "Events and ticks that listeners were too slow for.",
        known.dropped,
    );
    page.text
}

fn ticks(page: &mut Page, service: &Service, known: &Known) {
    let snapshot = service.snapshot();
    page.gauge(
        "athermal_uptime_seconds",
        "Time since the service started.",
        Some(service.uptime().as_secs_f64()),
    );
    page.counter(
        "athermal_ticks_total",
        "Ticks that samples made since the service started.",
        snapshot.ticks,
    );
    page.counter(
        "athermal_beats_total",
        "Ticks that time alone made since the service started.",
        snapshot.beats,
    );
    page.gauge(
        "athermal_undecided_samples",
        "Samples that are far ahead, and wait until it is known what time it is.",
        Some(snapshot.waiting as f64),
    );
    page.counter(
        "athermal_missed_ticks_total",
        "Ticks, beats, breaks and freezes that the control thread missed.",
        known.missed,
    );
    page.gauge(
        "athermal_behind_seconds",
        "How far the last tick lies behind the newest stamp and the time since.",
        behind_s(snapshot.newest, snapshot.last),
    );
    page.counter(
        "athermal_hurried_ticks_total",
        "Ticks that were cut early because too many samples waited.",
        snapshot.hurried,
    );
    page.counter(
        "athermal_engine_beats_total",
        "How often the engine thread has gone round.",
        service.beat(),
    );
}

fn channels(page: &mut Page, service: &Service) {
    let (newest, all) = (service.snapshot().newest, service.samples());
    fn labels(of: &ChannelSamples) -> Vec<(&'static str, &str)> {
        let source = of.source.as_deref().map(|name| ("source", name));
        source
            .into_iter()
            .chain([("channel", &*of.channel)])
            .collect()
    }
    page.family(
        "athermal_samples_total",
        "counter",
        "Samples that were accepted.",
        all.iter().map(|of| (labels(of), Some(of.accepted as f64))),
    );
    let left_out = all.iter().flat_map(|of| {
        of.left_out.map(|(reason, count)| {
            let mut labels = labels(of);
            labels.push(("reason", reason.name()));
            (labels, Some(count as f64))
        })
    });
    let unknown = service.sources().iter().flat_map(|(name, of)| {
        let counts = LeftOut::ALL.map(|reason| (reason, of.left_out.of(None, reason)));
        let some = counts.into_iter().filter(|(_, count)| *count > 0);
        some.map(|(reason, count)| {
            let labels = vec![("source", name.as_str()), ("reason", reason.name())];
            (labels, Some(count as f64))
        })
    });
    page.family(
        "athermal_dropped_samples_total",
        "counter",
        "Samples that were left out, by reason; without a channel where none is known. What is out_of_range was accepted, and is absent.",
        left_out.chain(unknown),
    );
    page.family(
        "athermal_channel_age_seconds",
        "gauge",
        "How old the newest sample is that was stepped.",
        all.iter().map(|of| (labels(of), age_s(newest, of.stamp))),
    );
}

/// What monitors have found, as a run reports it.
fn watched(page: &mut Page, service: &Service) {
    let Some(watch) = service.watched() else {
        return;
    };
    page.family(
        "athermal_warnings_total",
        "counter",
        "Warnings about the data and the graph, as the log has them.",
        watch.warnings().map(|(kind, channel, count)| {
            let channel = channel.map(|name| ("channel", name));
            let labels = [("kind", kind)].into_iter().chain(channel).collect();
            (labels, Some(count as f64))
        }),
    );
    page.family(
        "athermal_sensor_fault",
        "gauge",
        "1 while a sensor is stuck or silent.",
        watch.faults().map(|(channel, fault)| {
            let labels = vec![("channel", channel), ("fault", fault.kind())];
            (labels, Some(1.0))
        }),
    );
    page.family(
        "athermal_outside_fit_samples_total",
        "counter",
        "Samples far outside of those of the fit.",
        watch.outside_fit().map(|of| {
            let labels = vec![("channel", of.usual.channel.as_str())];
            (labels, Some(of.samples as f64))
        }),
    );
    let none = service.running().map(|of| watch.no_output(of).is_some());
    page.gauge(
        "athermal_no_output",
        "1 while there were ticks and no output has had a value.",
        none.map(|of| f64::from(u8::from(of))),
    );
    page.gauge(
        "athermal_fed_back_channels",
        "Channels that the correction moves and goes by.",
        Some(watch.fed_back().len() as f64),
    );
}

fn connectors(page: &mut Page, service: &Service) {
    macro_rules! each {
        ($all:expr, $label:literal, $name:literal, $kind:literal, $help:literal, $value:expr) => {
            page.family(
                $name,
                $kind,
                $help,
                $all.iter().map(|(name, of)| {
                    let value: u64 = $value(of);
                    (vec![($label, name.as_str())], Some(value as f64))
                }),
            );
        };
    }
    type Source = std::sync::Arc<athermal_serve::connector::SourceCounts>;
    let sources = service.sources();
    each!(
        sources,
        "source",
        "athermal_source_samples_total",
        "counter",
        "Samples that a source gave.",
        |of: &Source| of.given.load(Ordering::Relaxed)
    );
    each!(
        sources,
        "source",
        "athermal_source_dropped_samples_total",
        "counter",
        "Samples of a source that there was no room for.",
        |of: &Source| of.dropped.load(Ordering::Relaxed)
    );
    each!(
        sources,
        "source",
        "athermal_source_restarts_total",
        "counter",
        "How often a source was started again after a failure.",
        |of: &Source| of.restarts.load(Ordering::Relaxed)
    );
    each!(
        sources,
        "source",
        "athermal_source_connected",
        "gauge",
        "1 while a source is connected.",
        |of: &Source| u64::from(of.is_connected())
    );
    each!(
        sources,
        "source",
        "athermal_source_queue_length",
        "gauge",
        "Samples that wait for the engine thread.",
        |of: &Source| of.waiting()
    );
    type Sink = std::sync::Arc<athermal_serve::service::SinkCounts>;
    let sinks = service.sinks();
    each!(
        sinks,
        "sink",
        "athermal_sink_rows_total",
        "counter",
        "Rows that a sink put out.",
        |of: &Sink| of.put.load(Ordering::Relaxed)
    );
    each!(
        sinks,
        "sink",
        "athermal_sink_dropped_rows_total",
        "counter",
        "Commands that a sink was too far behind for, and rows of a log that could not be made again.",
        |of: &Sink| of.dropped.load(Ordering::Relaxed)
    );
    each!(
        sinks,
        "sink",
        "athermal_sink_old_commands_total",
        "counter",
        "Commands that were not sent because they were too old.",
        |of: &Sink| of.behind.load(Ordering::Relaxed)
    );
    each!(
        sinks,
        "sink",
        "athermal_sink_superseded_commands_total",
        "counter",
        "Commands that were not sent because a newer one was due at the same time.",
        |of: &Sink| of.superseded.load(Ordering::Relaxed)
    );
    each!(
        sinks,
        "sink",
        "athermal_sink_spooled_rows",
        "gauge",
        "Rows of a log that the journal has and that have not left.",
        |of: &Sink| of.spooled()
    );
    each!(
        sinks,
        "sink",
        "athermal_sink_failures_total",
        "counter",
        "How often a sink failed.",
        |of: &Sink| of.failures.load(Ordering::Relaxed)
    );
    each!(
        sinks,
        "sink",
        "athermal_sink_queue_length",
        "gauge",
        "Rows that wait for a sink.",
        |of: &Sink| of.waiting()
    );
}

fn predictions(page: &mut Page, known: &Known) {
    let novelty = known.novelty.iter();
    page.family(
        "athermal_novelty_ratio",
        "gauge",
        "How far the regressors of an estimator lie outside of those of its fit; above 1 they do.",
        novelty.map(|(name, value)| (vec![("node", name.as_str())], Some(*value))),
    );
    let errors = known.errors.iter();
    page.family(
        "athermal_prediction_error_rms",
        "gauge",
        "Root mean square error of a prediction over the last hours, in the unit of its label.",
        errors.map(|of| {
            let labels = vec![("prediction", of.name.as_str()), ("unit", of.unit.as_str())];
            (labels, of.rmse())
        }),
    );
}

fn kept(page: &mut Page, service: &Service, known: &Known) {
    let journal = service.journal();
    page.counter(
        "athermal_journal_records_total",
        "Records that were written.",
        journal.written,
    );
    page.gauge(
        "athermal_journal_unsynced_records",
        "Records that are written and not on the disk yet.",
        Some(journal.written.saturating_sub(journal.synced) as f64),
    );
    page.counter(
        "athermal_journal_lost_records_total",
        "Records that were never written.",
        journal.lost,
    );
    page.counter(
        "athermal_journal_failures_total",
        "How often writing failed.",
        journal.failures,
    );
    page.gauge(
        "athermal_journal_degraded",
        "1 while the service goes on without its journal.",
        Some(f64::from(u8::from(journal.is_degraded))),
    );
    let happenings = service.snapshot().happenings;
    let behind = happenings.saturating_sub(service.last_checkpoint());
    page.gauge(
        "athermal_checkpoint_behind_ticks",
        "Ticks, beats, breaks and freezes since the last checkpoint.",
        Some(behind as f64),
    );
    page.counter(
        "athermal_checkpoint_failures_total",
        "Checkpoints that could not be written.",
        known.no_checkpoint,
    );
}

fn model(page: &mut Page, service: &Service, known: &Known, created: Option<&str>) {
    page.counter(
        "athermal_swaps_total",
        "Graphs that took over since the start.",
        known.swaps,
    );
    page.counter(
        "athermal_refused_swaps_total",
        "Graphs that were to take over and did not.",
        known.refused_swaps,
    );
    let running = service.running();
    let revision = running.map(Engine::revision).unwrap_or_default();
    page.family(
        "athermal_graph_info",
        "gauge",
        "1, with the revision of the graph that runs.",
        [(vec![("revision", revision)], running.map(|_| 1.0))],
    );
    page.gauge(
        "athermal_graph_staged",
        "1 while a graph is staged.",
        Some(f64::from(u8::from(service.staged().is_some()))),
    );
    page.gauge(
        "athermal_learning_frozen",
        "1 while learning is frozen.",
        running.map(|of| f64::from(u8::from(of.frozen()))),
    );
    page.gauge(
        "athermal_nodes_given_up",
        "Nodes that panicked, and give nothing.",
        running.map(|of| of.panics().len() as f64),
    );
    page.gauge(
        "athermal_model_fitted_timestamp_seconds",
        "When the model that runs was fitted.",
        created.and_then(unix_seconds),
    );
}

/// The seconds since 1970 of a time as RFC 3339 writes it in UTC.
fn unix_seconds(text: &str) -> Option<f64> {
    let at: jiff::Timestamp = text.parse().ok()?;
    Some(at.as_second() as f64)
}
