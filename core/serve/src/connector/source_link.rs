//! What lies between the thread of a source and the engine thread: a bounded ring, on which neither waits for the other's work.

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Thread;
use std::time::Duration as Wait;

use athermal_run::recording::Thinning;
use rtrb::{Consumer, Producer, RingBuffer};
use schemars::JsonSchema;
use serde::Serialize;

use super::thin::Thin;
use super::{LeftOut, LeftOutCounts, Stamps, Stop, WiredChannel};
use crate::bell::{Bell, Mailbox};
use crate::journal::Progress;
use crate::sequencer::Sample;
use crate::time::{Duration, Instant};

/// What comes from a source.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Arrival {
    Sample(Sample),
    /// The next so many samples are of one row.
    Row(usize),
    /// What follows is left of so many samples.
    Thinned(u64),
    Connected,
    Away,
    /// The times of what follows may start again.
    Segment,
    Ended,
}

/// Where a source reports what it leaves out.
#[derive(Debug, Clone)]
pub struct Remarks {
    source: String,
    to: Mailbox<(String, String)>,
}

impl Remarks {
    /// Those of a source.
    pub(crate) fn new(source: &str, to: &Mailbox<(String, String)>) -> Self {
        Self {
            source: source.to_owned(),
            to: to.clone(),
        }
    }

    /// Reports something that does not stop the source: what was left out and why, once of each kind.
    pub fn report(&self, words: impl fmt::Display) {
        self.to.send((self.source.clone(), words.to_string()));
    }
}

/// What a source counts.
#[derive(Debug, Default)]
pub struct SourceCounts {
    /// Samples that were given.
    pub given: AtomicU64,
    /// Samples that came, where they are thinned: what is left of them is given.
    pub thinned: AtomicU64,
    /// How often time began again, since it had been that of the future.
    turns: AtomicU64,
    /// Samples that were dropped because the engine thread was behind.
    pub dropped: AtomicU64,
    /// How often it was started again: after a failure, or because it was connected and silent.
    pub restarts: AtomicU64,
    /// How often it said that it is connected to something that lives.
    alive: AtomicU64,
    is_connected: AtomicBool,
    was_connected: AtomicBool,
    has_ended: AtomicBool,
    /// What it left out, by its channels.
    pub left_out: LeftOutCounts,
    /// How its channels are, in its own words; empty where it says nothing.
    states: Mutex<Vec<String>>,
    /// The places of its channels in the feed.
    places: Vec<u32>,
    /// So many samples have been taken by the engine thread…
    taken: AtomicU64,
    /// …and stand in the journal once it has so many records.
    records: AtomicU64,
}

impl SourceCounts {
    /// How a channel is, by its number, as the source says; none where it says nothing.
    #[must_use]
    pub fn state(&self, channel: usize) -> Option<String> {
        let states = self.states.lock().unwrap_or_else(PoisonError::into_inner);
        states.get(channel).filter(|of| !of.is_empty()).cloned()
    }

    /// How many samples wait for the engine thread.
    #[must_use]
    pub fn waiting(&self) -> u64 {
        let taken = self.taken.load(Ordering::Acquire);
        self.given.load(Ordering::Acquire).saturating_sub(taken)
    }

    /// Whether it is connected.
    #[must_use]
    pub fn is_connected(&self) -> bool {
        self.is_connected.load(Ordering::Relaxed)
    }

    /// How its connection is.
    #[must_use]
    pub fn connection(&self) -> Connection {
        let is = |of: &AtomicBool| of.load(Ordering::Relaxed);
        match () {
            () if is(&self.has_ended) => Connection::Ended,
            () if self.is_connected() => Connection::Connected,
            () if is(&self.was_connected) => Connection::Away,
            () => Connection::Never,
        }
    }

    /// Notes whether it is connected.
    pub(crate) fn set_connected(&self, is_connected: bool) {
        self.was_connected.fetch_or(is_connected, Ordering::Relaxed);
        self.is_connected.store(is_connected, Ordering::Relaxed);
    }

    /// The number of a channel of the feed among those of the source.
    pub(crate) fn channel(&self, place: usize) -> Option<usize> {
        self.places.iter().position(|of| *of as usize == place)
    }

    /// Grows with every sign of life.
    pub(crate) fn signs(&self) -> u64 {
        [&self.given, &self.thinned, &self.dropped, &self.alive]
            .iter()
            .map(|count| count.load(Ordering::Relaxed))
            .sum()
    }
}

/// How the connection of a source is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Connection {
    /// It has not been connected since the service started.
    Never,
    /// It is connected.
    Connected,
    /// It was connected, and is not any more.
    Away,
    /// It has come to its end.
    Ended,
}

/// Where the samples of a channel go.
#[derive(Debug, Clone, Copy)]
struct FedChannel {
    /// Its place in the feed.
    place: u32,
    conversion: Option<(f64, f64)>,
    /// The newest stamp that is known.
    after: Instant,
}

/// The end that a source holds.
#[derive(Debug)]
pub struct Outflow {
    ring: Producer<Arrival>,
    engine: Thread,
    counts: Arc<SourceCounts>,
    progress: Arc<Progress>,
    remarks: Remarks,
    /// By channel of the source.
    channels: Vec<FedChannel>,
    stamps: Stamps,
    /// None where nothing is thinned.
    thin: Option<Thin>,
    written: Safe,
    synced: Safe,
}

/// How many samples are safe.
#[derive(Debug, Default)]
struct Safe {
    /// What was taken at a look, and the number of records that have it.
    look: (u64, u64),
    samples: u64,
}

impl Safe {
    /// Looks again, where so many records are safe.
    fn after(&mut self, safe: u64, counts: &SourceCounts) -> u64 {
        // What is looked at anew may be safe already.
        for _ in 0..2 {
            let (taken, records) = self.look;
            if safe >= records {
                self.samples = taken;
                let taken = counts.taken.load(Ordering::Acquire);
                self.look = (taken, counts.records.load(Ordering::Acquire));
            }
        }
        self.samples
    }
}

/// The end that the engine thread holds.
#[derive(Debug)]
pub(crate) struct SourceLink {
    ring: Consumer<Arrival>,
    counts: Arc<SourceCounts>,
    taken: u64,
    /// Whether it is held back while nothing is taken from it.
    pub(crate) waits: bool,
}

/// A link of a source to the engine thread, for so many arrivals at once. `places` are those of its channels in the feed.
pub(crate) fn link(
    room: usize,
    channels: &[WiredChannel],
    places: &[u32],
    stamps: Stamps,
    (engine, progress, remarks): (Thread, Arc<Progress>, Remarks),
) -> (Outflow, SourceLink) {
    let (ring, arrivals) = RingBuffer::new(room);
    let counts = Arc::new(SourceCounts {
        left_out: LeftOutCounts::new(channels.len()),
        states: Mutex::new(vec![String::new(); channels.len()]),
        places: places.to_vec(),
        ..SourceCounts::default()
    });
    let wired = channels.iter().zip(places);
    let outflow = Outflow {
        ring,
        engine,
        counts: Arc::clone(&counts),
        progress,
        remarks,
        channels: wired
            .map(|(wired, &place)| FedChannel {
                place,
                conversion: wired.conversion,
                after: wired.after,
            })
            .collect(),
        stamps,
        thin: None,
        written: Safe::default(),
        synced: Safe::default(),
    };
    let link = SourceLink {
        ring: arrivals,
        counts,
        taken: 0,
        waits: stamps == Stamps::Order,
    };
    (outflow, link)
}

impl Outflow {
    /// The source is connected: its channels may be waited for.
    pub fn connected(&mut self) {
        self.alive();
        self.counts.set_connected(true);
        self.send(Arrival::Connected);
    }

    /// The source has lost its connection.
    pub fn away(&mut self) {
        self.counts.set_connected(false);
        self.send(Arrival::Away);
    }

    /// The other side has shown that it lives and that nothing has changed: a keep-alive of a subscription, say. One that only
    /// shows that the connection stands is none.
    pub fn alive(&self) {
        self.counts.alive.fetch_add(1, Ordering::Relaxed);
    }

    /// From now on it is thinned before it is handed over. A stamp further ahead than `future` ends no interval by itself, unless stamps
    /// come in order; an interval is over `wait` behind its end then.
    pub(crate) fn thin(&mut self, thinning: Thinning, (wait, future): (Duration, Duration)) {
        let bounds = match self.stamps {
            Stamps::Order => (Duration::ZERO, None),
            Stamps::Clock => (wait, Some(future)),
        };
        let after = self.channels.iter().map(|of| of.after);
        self.thin = Some(Thin::new(thinning, after, bounds));
    }

    /// Takes a sample that is thinned.
    fn take(&mut self, channel: usize, sample: Sample) {
        let turns = self.counts.turns.load(Ordering::Acquire);
        if self.thin.as_ref().is_some_and(|of| of.turns != turns) {
            self.hand_on(true);
        }
        let Some(thin) = &mut self.thin else { return };
        if std::mem::replace(&mut thin.turns, turns) != turns {
            thin.thinner.begin();
        }
        self.counts.thinned.fetch_add(1, Ordering::Relaxed);
        if thin.take(channel, sample.stamp, sample.value) {
            return;
        }
        let is_given = self.ring.push(Arrival::Sample(sample)).is_ok();
        let counts = [&self.counts.dropped, &self.counts.given][usize::from(is_given)];
        counts.fetch_add(1, Ordering::Relaxed);
        thin.handed_on(self.counts.given.load(Ordering::Relaxed));
    }

    /// Hands on what is left of the intervals that are over, as far as there is room; or of all.
    fn hand_on(&mut self, all: bool) {
        while let Some(thin) = &mut self.thin
            && thin.thinner.first().is_some()
            && (all || thin.thinner.is_over())
        {
            if self.ring.slots() < self.channels.len() + 2 {
                self.engine.unpark();
                if !all || self.ring.is_abandoned() {
                    return;
                }
                std::thread::sleep(Wait::from_millis(1));
                continue;
            }
            let mut left = Vec::with_capacity(self.channels.len());
            let popped = thin.thinner.pop(|nth, value| left.push((nth, value)));
            let Some((stamp, samples)) = popped else {
                return;
            };
            let row = left.iter().map(|&(nth, value)| {
                Arrival::Sample(Sample {
                    channel: self.channels[nth].place,
                    stamp,
                    value,
                })
            });
            let head = [Arrival::Thinned(samples), Arrival::Row(left.len())];
            if let Ok(chunk) = self.ring.write_chunk_uninit(left.len() + 2) {
                chunk.fill_from_iter(head.into_iter().chain(row));
            }
            let more = left.len() as u64;
            let given = self.counts.given.fetch_add(more, Ordering::Relaxed) + more;
            thin.handed_on(given);
            self.engine.unpark();
        }
    }

    /// How many samples came: what [`written`](Self::written) and [`synced`](Self::synced) are compared with.
    #[must_use]
    pub fn given(&self) -> u64 {
        let given = || self.counts.given.load(Ordering::Relaxed);
        self.thin.as_ref().map_or_else(given, |of| of.came_in)
    }

    /// The times of what follows may start again.
    pub fn segment(&mut self) {
        self.hand_on(true);
        if let Some(thin) = &mut self.thin {
            thin.thinner.begin();
        }
        for channel in &mut self.channels {
            channel.after = Instant::MIN;
        }
        self.send(Arrival::Segment);
    }

    /// Hands a sample over without waiting: the channel by its number in [`SourceWiring::channels`](super::SourceWiring), the value in
    /// the source's unit, NaN where the source says that there is none. False where there is no room, and the sample was dropped and
    /// counted.
    pub fn sample(&mut self, channel: usize, stamp: Instant, value: f64) -> bool {
        let Some(sample) = wired(&self.channels, self.stamps, channel, stamp, value) else {
            return true;
        };
        if self.thin.is_some() {
            self.take(channel, sample);
            self.hand_on(false);
            return true;
        }
        let is_given = self.ring.push(Arrival::Sample(sample)).is_ok();
        let counts = if is_given {
            &self.counts.given
        } else {
            self.left_out(Some(channel), LeftOut::NoRoom, 1);
            &self.counts.dropped
        };
        counts.fetch_add(1, Ordering::Relaxed);
        self.engine.unpark();
        is_given
    }

    /// Hands a row over, with a value for each channel of the source, NaN where there is none. Waits for room; false where it is to
    /// stop meanwhile. For sources that can hold back.
    #[must_use]
    pub fn row(&mut self, stamp: Instant, values: &[f64], stop: &Stop) -> bool {
        while self.ring.slots() < values.len() + 2 {
            self.engine.unpark();
            if !stop.wait(Wait::from_millis(1)) {
                return false;
            }
        }
        // Time passes also where nothing is measured.
        let is_empty = values.iter().all(|value| value.is_nan());
        if self.thin.is_some() {
            for (channel, value) in values.iter().enumerate() {
                let is_there = !value.is_nan() || is_empty && channel == 0;
                let sample = wired(&self.channels, self.stamps, channel, stamp, *value);
                if let Some(sample) = sample.filter(|_| is_there) {
                    self.take(channel, sample);
                }
            }
            self.hand_on(false);
            return true;
        }
        let Self {
            ring,
            channels,
            stamps,
            ..
        } = self;
        let samples = values.iter().enumerate().filter_map(|(channel, value)| {
            let is_there = !value.is_nan() || is_empty && channel == 0;
            let sample = wired(channels, *stamps, channel, stamp, *value);
            sample.filter(|_| is_there)
        });
        let count = samples.clone().count();
        if count == 0 {
            return true;
        }
        // All of it can be seen at once: no tick is cut in the middle of a row.
        if let Ok(chunk) = ring.write_chunk_uninit(count + 1) {
            let row = std::iter::once(Arrival::Row(count));
            chunk.fill_from_iter(row.chain(samples.map(Arrival::Sample)));
        }
        self.counts.given.fetch_add(count as u64, Ordering::Relaxed);
        self.engine.unpark();
        true
    }

    /// Counts samples that the source leaves out: the channel by its number, none where it is not known.
    pub fn left_out(&self, channel: Option<usize>, reason: LeftOut, samples: u64) {
        self.counts.left_out.count(channel, reason, samples);
    }

    /// Says how a channel is, such as `waiting: BadNodeIdUnknown since 10:31` or `granted 100 ms, queue 20`: a status shows it.
    pub fn state(&self, channel: usize, words: impl fmt::Display) {
        let states = self.counts.states.lock();
        let mut states = states.unwrap_or_else(PoisonError::into_inner);
        if let Some(of) = states.get_mut(channel) {
            *of = words.to_string();
        }
    }

    /// Where it reports what it leaves out.
    #[must_use]
    pub fn remarks(&self) -> &Remarks {
        &self.remarks
    }

    /// How many samples there is room for.
    #[must_use]
    pub fn room(&self) -> usize {
        self.ring.slots()
    }

    /// How many of the samples that were given are written into the journal: so many may be acknowledged.
    pub fn written(&mut self) -> u64 {
        let written = self.while_journalled(self.progress.written());
        let safe = self.written.after(written, &self.counts);
        self.thin.as_mut().map_or(safe, |of| of.safe(safe))
    }

    /// The same of samples that survive a power cut too.
    pub fn synced(&mut self) -> u64 {
        let synced = self.while_journalled(self.progress.synced());
        let safe = self.synced.after(synced, &self.counts);
        self.thin.as_mut().map_or(safe, |of| of.safe(safe))
    }

    /// From now on it rings where more of what was given may be [written](Self::written) or [synced](Self::synced).
    pub fn wakes(&self, bell: &Bell) {
        self.progress.wakes(bell);
    }

    /// Where the disk has failed the service goes on without its journal: a broker is not to wait for what will not be written.
    fn while_journalled(&self, records: u64) -> u64 {
        if self.progress.failed() {
            u64::MAX
        } else {
            records
        }
    }

    /// What is counted.
    #[must_use]
    pub fn counts(&self) -> &Arc<SourceCounts> {
        &self.counts
    }

    /// It has come to its end, and nothing more belongs to an interval that is open.
    pub(crate) fn finish(&mut self) {
        self.hand_on(true);
    }

    pub(crate) fn end(&mut self) {
        self.counts.has_ended.store(true, Ordering::Relaxed);
        self.send(Arrival::Ended);
    }

    /// What is sent without a stamp is few, and the engine thread takes what is there many times a second.
    fn send(&mut self, arrival: Arrival) {
        while self.ring.push(arrival).is_err() {
            self.engine.unpark();
            if self.ring.is_abandoned() {
                return;
            }
            std::thread::sleep(Wait::from_millis(1));
        }
        self.engine.unpark();
    }
}

fn wired(
    channels: &[FedChannel],
    stamps: Stamps,
    channel: usize,
    stamp: Instant,
    value: f64,
) -> Option<Sample> {
    let FedChannel {
        place,
        conversion,
        after,
    } = *channels.get(channel)?;
    // What is read again after a start is not new.
    if stamps == Stamps::Order && stamp <= after {
        return None;
    }
    let value = conversion.map_or(value, |(factor, offset)| value * factor + offset);
    Some(Sample {
        channel: place,
        stamp,
        value,
    })
}

impl SourceLink {
    /// What came next.
    pub(crate) fn next(&mut self) -> Option<Arrival> {
        let arrival = self.ring.pop().ok()?;
        self.taken += u64::from(matches!(arrival, Arrival::Sample(_)));
        Some(arrival)
    }

    /// Whether what comes next is a sample, or a row of them.
    pub(crate) fn is_giving(&self) -> bool {
        let next = self.ring.peek();
        matches!(
            next,
            Ok(Arrival::Sample(_) | Arrival::Row(_) | Arrival::Thinned(_))
        )
    }

    /// Time begins again.
    pub(crate) fn turn(&self) {
        self.counts.turns.fetch_add(1, Ordering::AcqRel);
    }

    /// All that was taken stands in the journal once it has so many records.
    pub(crate) fn recorded(&self, records: u64) {
        // In this order: whoever sees the first sees the second, or a later one.
        self.counts.records.store(records, Ordering::Release);
        self.counts.taken.store(self.taken, Ordering::Release);
    }
}
