//! The facts of a service.

use std::sync::atomic::Ordering::Relaxed;

use athermal_run::live::Verdict;
use athermal_run::live::monitor::{OutsideFit, SensorFault, Watch};
use athermal_run::model::Card;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::{Counts, Known, Reasons, Sections, words};
use crate::compile::{Plan, PlannedNode, PlannedOutput};
use crate::connector::{Connection, SourceCounts};
use crate::engine::{NodeCarry, who_speaks};
use crate::journal::JournalStatus;
use crate::message::Message;
use crate::service::{ChannelSamples, Held, Seen, Service, SinkCounts, Snapshot};
use crate::time::Instant;

/// A service, as it is at the moment at which it is looked at.
#[derive(Debug)]
pub struct Look<'a> {
    service: &'a Service,
    snapshot: Snapshot,
    journal: JournalStatus,
    panics: Vec<String>,
}

impl<'a> Look<'a> {
    /// Looks at a service.
    #[must_use]
    pub fn at(service: &'a Service) -> Self {
        Self {
            snapshot: service.snapshot(),
            journal: service.journal(),
            panics: service.given_up().to_vec(),
            service,
        }
    }

    fn behind_s(&self) -> Option<f64> {
        age_s(self.snapshot.newest, self.snapshot.last)
    }

    fn state(&self) -> State {
        match self.service.is_degraded() {
            true => State::Degraded,
            false => State::Running,
        }
    }
}

/// How a service is, in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// All is as it should be.
    Running,
    /// The journal cannot be written, a node was given up, ticks were missed by what looks on, a source has not been connected since the
    /// start, or none is.
    Degraded,
}

impl Known for State {}
impl Known for Connection {}
impl Known for Verdict {}

crate::facts! {
    /// How a service is, and what happened last.
    StatusFacts["{name}: {state}, up {uptime_s}, revision {revision}"](of: &Look<'_>) {
        /// The name of the machine.
        name: String = of.service.name().to_owned();
        /// The release of the program.
        version: &'static str = env!("CARGO_PKG_VERSION");
        /// How it is.
        state: State = of.state();
        /// Time since the service started.
        uptime_s: f64 [gauge "athermal_uptime_seconds"] = of.service.uptime().as_secs_f64();
        /// The revision of the graph that runs; `null` after ticks were missed.
        revision: Option<String> [info "athermal_graph_info"] = of.service.running().map(|of| of.revision.to_owned());
        /// When the model that runs was fitted.
        fitted_s: Option<f64> [gauge "athermal_model_fitted_timestamp_seconds"] = of.service.fitted_s();
        /// How it was fitted.
        card: Option<CardFacts> = of.service.card().map(CardFacts::read);
        /// Ticks that samples made since the service started.
        ticks: u64 [counter "athermal_ticks_total"] [made words::ticks] = of.snapshot.ticks;
        /// Ticks that time alone made since the service started.
        beats: u64 [counter "athermal_beats_total"] = of.snapshot.beats;
        /// Ticks, beats, breaks and freezes, those of earlier runs included.
        happenings: u64 = of.snapshot.happenings;
        /// Samples that are far ahead, and wait until it is known what time it is.
        undecided: usize [gauge "athermal_undecided_samples"]
            [line "{undecided} samples are far ahead, and wait until it is known what time it is"] = of.snapshot.waiting;
        /// The instant of the last tick.
        last_s: Option<f64> = seconds(of.snapshot.last);
        /// How far the last tick lies behind the newest stamp and the time since.
        behind_s: Option<f64> [gauge "athermal_behind_seconds"] = of.behind_s();
        /// Ticks that were cut early because too many samples waited.
        hurried: u64 [counter "athermal_hurried_ticks_total"] = of.snapshot.hurried;
        /// Whether the host's time is known to be right.
        host_clock_synchronised: bool = of.snapshot.is_synchronised;
        /// How often the engine thread has gone round.
        beat: u64 [counter "athermal_engine_beats_total"] = of.service.beat();
        /// What the graph keeps of the past at the last checkpoint; `null` before the second one.
        held: Option<HeldFacts> [made words::held] = of.service.held().map(|of| HeldFacts::read(&of));
        /// Whether learning is frozen.
        frozen: Option<bool> [gauge "athermal_learning_frozen"] [line "learning is frozen"] = of.service.running().map(|of| of.frozen);
        /// The graph that is staged.
        staged: Option<StagedFacts> [gauge "athermal_graph_staged" |of: &Self| Some(f64::from(u8::from(of.staged.is_some())))]
            [line "staged: {staged.revision}"]
            = of.service.staged().map(|of| StagedFacts::read(of.revision(), of.carry()));
        /// What the comparison of the staged graph has come to.
        verdict: Option<Verdict> [made words::verdict] = of.service.verdict();
        /// The revision of the graph that can be taken back.
        previous: Option<String> [line "can be taken back to {previous}"] = of.service.previous().map(|of| of.revision().to_owned());
        /// After how many ticks, beats, breaks and freezes the last checkpoint was saved.
        last_checkpoint: u64 = of.service.last_checkpoint();
        /// Ticks, beats, breaks and freezes since the last checkpoint.
        checkpoint_behind: u64 [gauge "athermal_checkpoint_behind_ticks"]
            = of.snapshot.happenings.saturating_sub(of.service.last_checkpoint());
        /// The journal.
        journal: JournalFacts = JournalFacts::read(&of.journal);
        /// Nodes that panicked, and give nothing.
        given_up: Vec<String> [gauge "athermal_nodes_given_up" |of: &Self| of.revision.as_ref().map(|_| of.given_up.len() as f64)]
            [made words::given_up] = of.panics.clone();
        /// The sources.
        sources: Vec<SourceFacts> = of.service.sources().iter().map(|(name, of)| SourceFacts::read(name, of)).collect();
        /// The sinks.
        sinks: Vec<SinkFacts> = of.service.sinks().iter().map(|(name, of)| SinkFacts::read(name, of)).collect();
        /// What monitors have found of the graph that runs, as a run reports it.
        watched: Option<WatchedFacts> = of.service.watched().map(|watch| WatchedFacts::read(watch, of.service));
        /// What learns of its own, since a truth came.
        learners: Vec<LearnerFacts> = {
            let seen = of.service.watcher().seen();
            let said = seen.learning.iter().filter(|(.., said)| !said.is_nan());
            said.map(|(name, _, said)| LearnerFacts::read(name, *said)).collect()
        };
        /// What companions know.
        companions: Sections = of.service.sections();
        /// How many events there were, by their names.
        counts: Counts [counter "athermal_events_total"] = Counts(of.service.watcher().seen().counts.clone());
        /// The last events.
        events: Vec<EventFacts> [made words::events] = {
            let seen = of.service.watcher().seen();
            seen.recent.iter().map(|(is_fault, of, at_s)| EventFacts::read(*is_fault, of, *at_s)).collect()
        };
    }

    /// How a model was fitted.
    CardFacts(of: &Card) {
        /// The release of the program that fitted it.
        release: String = of.athermal.clone();
        /// The files that it was fitted on; empty of rows that came from elsewhere.
        data: Vec<String> = of.data.iter().map(|of| of.path.clone()).collect();
        /// How many rows they have.
        rows: u64 = of.data.iter().map(|of| of.rows).sum();
        /// Of how many ticks the fit is.
        ticks: u64 = of.ticks;
    }

    /// What goes on learning.
    LearnerFacts["{learner}: {speaks}"](name: &str, said: f64) {
        /// Its name.
        learner: String [label] = name.to_owned();
        /// What its port `learning` said last.
        says: f64 [gauge "athermal_learner_says"] = said;
        /// Who speaks, it or its fit.
        speaks: &'static str = who_speaks(said);
    }

    /// What a graph keeps of the past.
    HeldFacts(of: &Held) {
        /// How many bytes, as a checkpoint has them.
        bytes: u64 = of.bytes;
        /// How many once all windows are full, at this rate of ticks.
        bytes_full: u64 = of.full;
        /// The rate of ticks in this run.
        ticks_hz: f64 = of.rate;
    }

    /// A graph that is staged.
    StagedFacts(revision: &str, carry: &[NodeCarry]) {
        /// Its revision.
        revision: String = revision.to_owned();
        /// What becomes of its nodes.
        nodes: Vec<NodeCarry> = carry.to_vec();
    }

    /// The journal.
    JournalFacts(of: &JournalStatus) {
        /// Records that were written.
        written: u64 [counter "athermal_journal_records_total"] = of.written;
        /// Records that are on the disk.
        synced: u64 = of.synced;
        /// Records that are written and not on the disk yet.
        unsynced: u64 [gauge "athermal_journal_unsynced_records"] = of.written.saturating_sub(of.synced);
        /// 1 while the service goes on without its journal.
        is_degraded: bool [gauge "athermal_journal_degraded"] [line "the journal cannot be written: {error}"] = of.is_degraded;
        /// Records that were never written.
        lost: u64 [counter "athermal_journal_lost_records_total"] [line "{lost} records were never written to the journal"] = of.lost;
        /// How often writing failed.
        failures: u64 [counter "athermal_journal_failures_total"] = of.failures;
        /// What the system said last.
        error: Option<String> = of.error.clone();
    }

    /// A source.
    SourceFacts["source {source}: "](name: &str, of: &SourceCounts) {
        /// Its name.
        source: String [label] = name.to_owned();
        /// 1 while a source is connected.
        connected: bool [gauge "athermal_source_connected"] [more words::connection] = of.is_connected();
        /// Its connection.
        connection: Connection = of.connection();
        /// Samples that a source gave.
        given: u64 [counter "athermal_source_samples_total"] [part "{given} samples"] = of.given.load(Relaxed);
        /// Samples that wait for the engine thread.
        waiting: u64 [gauge "athermal_source_queue_length"] [part "{waiting} wait"] = of.waiting();
        /// Samples of a source that there was no room for.
        dropped: u64 [counter "athermal_source_dropped_samples_total"] [part "{dropped} dropped"] = of.dropped.load(Relaxed);
        /// How often a source was started again after a failure.
        restarts: u64 [counter "athermal_source_restarts_total"] [part "{restarts} restarts"] = of.restarts.load(Relaxed);
        /// Samples of which no channel is known, by reason.
        left_out: Reasons<false> [counter "athermal_dropped_samples_total"] [more words::left_out_at_source] = Reasons::of_none(&of.left_out);
        /// How many samples came, where they are thinned; 0 where they are not.
        thinned: u64 [line "  thinned, from {thinned}"] = of.thinned.load(Relaxed);
    }

    /// A sink.
    SinkFacts["sink {sink}: "](name: &str, of: &SinkCounts) {
        /// Its name.
        sink: String [label] = name.to_owned();
        /// Rows that a sink put out.
        put: u64 [counter "athermal_sink_rows_total"] [part "{put} rows"] = of.put.load(Relaxed);
        /// Rows that wait for a sink.
        waiting: u64 [gauge "athermal_sink_queue_length"] [part "{waiting} wait"] = of.waiting();
        /// Rows of a log that the journal has and that have not left.
        spooled: u64 [gauge "athermal_sink_spooled_rows"] [part "{spooled} in the spool"] = of.spooled();
        /// Commands that a sink was too far behind for, and rows of a log that could not be made again.
        dropped: u64 [counter "athermal_sink_dropped_rows_total"] [part "{dropped} dropped"] = of.dropped.load(Relaxed);
        /// Commands that were not sent because they were too old.
        behind: u64 [counter "athermal_sink_old_commands_total"] [part "{behind} too old"] = of.behind.load(Relaxed);
        /// Commands that were not sent because a newer one was due at the same time.
        superseded: u64 [counter "athermal_sink_superseded_commands_total"] [part "{superseded} superseded"] = of.superseded.load(Relaxed);
        /// How often a sink failed.
        failures: u64 [counter "athermal_sink_failures_total"] [part "{failures} failures"] = of.failures.load(Relaxed);
        /// Why it cannot put out at the moment.
        error: Option<String> [line "  {error}; tried again"] = of.error();
    }

    /// What monitors have found.
    WatchedFacts(watch: &Watch, service: &Service) {
        /// Warnings about the data and the graph, as the log has them.
        warnings: Vec<WarningFacts> = watch.warnings().map(WarningFacts::read).collect();
        /// Sensors that fail at present.
        faults: Vec<FaultFacts> = watch.faults().map(|(name, of)| FaultFacts::read(name, of)).collect();
        /// Channels of which samples lay far outside of those of the fit.
        outside_fit: Vec<OutsideFitFacts> = watch.outside_fit().map(OutsideFitFacts::read).collect();
        /// 1 while there were ticks and no output has had a value.
        no_output: Option<NoOutputFacts>
            [gauge "athermal_no_output" |of: &Self| of.is_known.then(|| f64::from(u8::from(of.no_output.is_some())))]
            [line "no output has had a value in {no_output.ticks} ticks and beats; the first to lack one is {no_output.first_silent}"]
            = service.replica().and_then(|of| watch.no_output(of)).map(|of| NoOutputFacts::read(of.rows, of.first_silent));
        /// Whether it is known what runs.
        is_known: bool = service.running().is_some();
    }

    /// How often was warned of something.
    WarningFacts(of: (&'static str, Option<&str>, u64)) {
        /// Of what: an event.
        kind: &'static str [label] = of.0;
        /// Of which channel; `null` of a whole graph.
        channel: Option<String> [label] = of.1.map(str::to_owned);
        /// Warnings about the data and the graph, as the log has them.
        count: u64 [counter "athermal_warnings_total"] = of.2;
    }

    /// A sensor that fails.
    FaultFacts(channel: &str, of: SensorFault) {
        /// Its channel.
        channel: String [label] = channel.to_owned();
        /// 1 while a sensor is stuck or silent.
        fault: &'static str [label] [gauge "athermal_sensor_fault" |_: &Self| Some(1.0)] [made words::fault] = of.kind();
        /// Since when, in s.
        since_s: f64 = match of {
            SensorFault::Silent { from_s } => from_s,
            SensorFault::Stuck(of) => of.from_s,
        };
        /// The value at which it is stuck.
        value: Option<f64> = match of {
            SensorFault::Silent { .. } => None,
            SensorFault::Stuck(of) => Some(of.value),
        };
    }

    /// Samples far outside of those of the fit.
    OutsideFitFacts(of: &OutsideFit) {
        /// Their channel.
        channel: String [label] = of.usual.channel.clone();
        /// Samples far outside of those of the fit.
        samples: u64 [counter "athermal_outside_fit_samples_total"] [made words::outside_fit] = of.samples;
        /// The lowest of them.
        lowest: f64 = of.lowest;
        /// The highest of them.
        highest: f64 = of.highest;
        /// The lowest sample of the fit.
        lowest_in_fit: f64 = of.usual.lowest;
        /// The highest sample of the fit.
        highest_in_fit: f64 = of.usual.highest;
    }

    /// That nothing comes out.
    NoOutputFacts(ticks: u64, first_silent: String) {
        /// Of how many ticks and beats.
        ticks: u64 = ticks;
        /// The first node that lacks a value.
        first_silent: String = first_silent;
    }

    /// An event.
    EventFacts(is_fault: bool, of: &Message, host_time_s: f64) {
        /// Its name.
        event: &'static str = of.name();
        /// How grave it is: `note` or `warning`.
        level: &'static str = if is_fault { "warning" } else { "note" };
        /// When the host's clock said so, in s since 1970.
        host_time_s: f64 = host_time_s;
        /// What happened, for people.
        message: String = of.to_string();
        /// What is known of it.
        facts: Value = of.facts();
    }

    /// The channels.
    ChannelsFacts(of: &Look<'_>) {
        /// What became of the samples of each channel, and how old the newest one is.
        channels: Vec<ChannelFacts> = of.service.samples().into_iter().map(|channel| ChannelFacts::read(channel, of)).collect();
    }

    /// A channel.
    ChannelFacts["{channel}: "](of: ChannelSamples, look: &Look<'_>) {
        /// Its source; `null` where the machine file names none.
        source: Option<String> [label] = of.source.clone();
        /// Its name.
        channel: String [label] = of.channel.clone();
        /// How it is, as its source says: `waiting: …`, or what was granted; `null` where that says nothing.
        state: Option<String> [more words::channel_state] = of.state.clone();
        /// Samples that were accepted.
        accepted: u64 [counter "athermal_samples_total"] [part "{accepted} samples of {source}"] = of.accepted;
        /// How old the newest sample is that was stepped.
        age_s: Option<f64> [gauge "athermal_channel_age_seconds"] [part "age {age_s}"] = age_s(look.snapshot.newest, of.stamp);
        /// Samples that were left out, by reason. What is `out_of_range` was accepted, and is absent.
        #[serde(flatten)]
        left_out: Reasons<true> [counter "athermal_dropped_samples_total"] [more words::left_out] = Reasons::of(&of.left_out);
    }

    /// The outputs.
    OutputsFacts(of: &Look<'_>) {
        /// The outputs of what runs, with their values after the last tick that was taken in.
        outputs: Vec<OutputFacts> = of.service.running().map_or_else(Vec::new, |runs| {
            let seen = of.service.watcher().seen();
            let outputs = runs.plan.outputs.iter();
            outputs.map(|of| OutputFacts::read(of, seen.last.value(&of.name), runs.plan)).collect()
        });
    }

    /// An output.
    OutputFacts(of: &PlannedOutput, value: Option<f64>, plan: &Plan) {
        /// Its name.
        output: String = of.name.clone();
        /// The unit of its values.
        unit: String = plan.channels[of.slot].channel.unit.text().to_owned();
        /// The channel that it predicts.
        predicts: Option<String> = plan.channels[of.slot].predicts.map(|slot| plan.channels[slot].name.clone());
        /// Its value; `null` where it has none.
        value: Option<f64> = value;
    }

    /// The last ticks.
    TicksFacts(of: &Look<'_>) {
        /// The outputs, in the order of the values of a tick.
        outputs: Vec<String> = of.service.watcher().seen().last.outputs.clone();
        /// The last ticks, the oldest first.
        ticks: Vec<TickFacts> = {
            let seen = of.service.watcher().seen();
            seen.last.ticks.iter().map(|(at, values)| TickFacts::read(*at, values)).collect()
        };
    }

    /// A tick.
    TickFacts(at: Instant, values: &[f64]) {
        /// Its instant, in s.
        time_s: f64 = at.as_ns() as f64 / 1e9;
        /// The values of the outputs; `null` where one has none.
        values: Vec<Option<f64>> = values.iter().map(|of| Some(*of).filter(|of| !of.is_nan())).collect();
    }

    /// The nodes.
    NodesFacts(of: &Look<'_>) {
        /// The nodes of what runs, and what is known of their predictions.
        nodes: Vec<NodeFacts> = of.service.running().map_or_else(Vec::new, |runs| {
            let seen = of.service.watcher().seen();
            runs.plan.nodes.iter().map(|node| NodeFacts::read(node, runs.plan, &seen)).collect()
        });
    }

    /// A node.
    NodeFacts(of: &PlannedNode, plan: &Plan, seen: &Seen) {
        /// Its name.
        node: String [label] = of.instance();
        /// The channels that it gives.
        channels: Vec<String> = of.slots.clone().map(|slot| plan.channels[slot].name.clone()).collect();
        /// How far the regressors of an estimator lie outside of those of its fit; above 1 they do.
        novelty: Option<f64> [gauge "athermal_novelty_ratio"]
            = seen.novelty.iter().find(|(name, _)| *name == of.instance()).map(|(_, value)| *value).filter(|of| !of.is_nan());
        /// The errors of its predictions.
        errors: Vec<ErrorFacts> [apart] = {
            let channel = |name: &str| of.slots.clone().any(|slot| plan.channels[slot].name == name);
            let own = seen.errors.iter().filter(|of| channel(&of.name));
            own.map(|of| ErrorFacts::read(&of.name, &of.unit, of.rmse())).collect()
        };
    }

    /// The error of a prediction.
    ErrorFacts(prediction: &str, unit: &str, rmse: Option<f64>) {
        /// The channel that predicts.
        prediction: String [label] = prediction.to_owned();
        /// The unit of its errors.
        unit: String [label] = unit.to_owned();
        /// Root mean square error of a prediction over the last hours, in the unit of its label.
        rmse: Option<f64> [gauge "athermal_prediction_error_rms"] = rmse;
    }
}

fn seconds(at: Instant) -> Option<f64> {
    (at > Instant::MIN).then(|| at.as_ns() as f64 / 1e9)
}

/// How old what has a stamp is; none where there is nothing.
fn age_s(newest: Option<Instant>, stamp: Instant) -> Option<f64> {
    let newest = newest.filter(|_| stamp > Instant::MIN)?;
    Some((newest - stamp).as_ns().max(0) as f64 / 1e9)
}
