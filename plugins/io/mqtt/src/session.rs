//! One connection of a source, from its beginning to its end. It never waits for the engine: messages that have not been taken are not
//! acknowledged, which is what slows the broker down.

use std::collections::{HashMap, VecDeque};
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration as Wait;

use athermal_core::time::Instant;
use athermal_serve::bell::Bell;
use athermal_serve::connector::{Outflow, Stop};
use athermal_serve::host::time_of_day;
use tokio::sync::Notify;
use tokio::time::{sleep, timeout};

use crate::client::{Connection, Ended, Event, Message, Sender};
use crate::source::{Ack, MqttInlet, Retained};
use athermal_messages::acknowledgements::Acknowledgements;
use athermal_messages::gap::Gap;
use athermal_messages::payload::{Reading, Reason};

/// How often is looked whether the engine has room where it had none.
const LOOK: Wait = Wait::from_millis(2);
/// How often is looked at acknowledgements for which nobody rings, and at subscriptions without an answer.
const AGAIN: (Wait, Wait) = (Wait::from_millis(250), Wait::from_secs(1));
/// How long nothing may be due.
const LONGEST: Wait = Wait::from_secs(3600);
/// How long is waited for the broker at the end.
const LEAVE: Wait = Wait::from_millis(200);
/// How many messages wait for the engine at most. Then the connection is given up, and the broker sends them again.
const WAITING: usize = 100_000;
/// For how many topics is remembered which messages are meant.
const TOPICS: usize = 10_000;

/// A connection at work.
pub(crate) struct Session<'a> {
    inlet: &'a mut MqttInlet,
    out: &'a mut Outflow,
    stop: &'a Stop,
    pub(crate) was_connected: bool,
    /// Messages that the engine has not taken.
    waiting: VecDeque<Waiting>,
    acknowledgements: Acknowledgements,
    /// Whether any of them is to come.
    awaits: Arc<AtomicBool>,
    /// By topic: which routes mean it.
    meant: HashMap<String, Vec<usize>>,
    values: Vec<f64>,
}

/// A message on its way to the engine.
struct Waiting {
    /// Its readings, by their times.
    readings: Vec<Reading>,
    /// How many of them have been given.
    given: usize,
    packet: Option<u16>,
}

impl<'a> Session<'a> {
    pub(crate) fn new(inlet: &'a mut MqttInlet, out: &'a mut Outflow, stop: &'a Stop) -> Self {
        Self {
            values: vec![f64::NAN; inlet.channels],
            inlet,
            out,
            stop,
            was_connected: false,
            waiting: VecDeque::new(),
            acknowledgements: Acknowledgements::default(),
            awaits: Arc::default(),
            meant: HashMap::new(),
        }
    }

    /// Runs until it is to stop.
    pub(crate) async fn run(&mut self) -> Result<(), Ended> {
        let mut connection = Connection::new(&self.inlet.settings).map_err(Ended::Other)?;
        let sender = connection.sender();
        let rung = Arc::new(Notify::new());
        let [to_stop, to_look] = [(); 2].map(|()| Arc::clone(&rung));
        let (stops, awaits) = (
            Bell::new(move || to_stop.notify_one()),
            Arc::clone(&self.awaits),
        );
        let looks = Bell::new(move || {
            if awaits.load(Ordering::Acquire) {
                to_look.notify_one();
            }
        });
        self.stop.wakes(&stops);
        self.out.wakes(&looks);
        // It may have been to stop before.
        rung.notify_one();
        loop {
            // A connection that is being made takes longer than a look: it is not to be given up for one.
            let mut next = pin!(connection.next());
            let event = loop {
                // Soon: a broker with Nagle's algorithm sends the next message once the one before is acknowledged.
                tokio::select! {
                    event = &mut next => break Some(event?),
                    () = rung.notified() => {}
                    () = sleep(self.due()) => {}
                }
                self.look(&sender);
                if self.stop.is_asked() {
                    break None;
                }
            };
            match event {
                Some(event) => self.handle(event, &sender)?,
                None => break,
            }
            if self.waiting.len() > WAITING {
                let words = format!(
                    "{WAITING} messages wait for the engine: the connection is given up, and the broker keeps them"
                );
                return Err(Ended::Other(words));
            }
        }
        self.leave(connection, &sender).await;
        Ok(())
    }

    /// Takes leave of the broker, so that it knows at once.
    async fn leave(&mut self, mut connection: Connection, sender: &Sender) {
        self.acknowledge(sender);
        if self.was_connected && sender.disconnect() {
            let leave = async { while connection.next().await.is_ok() {} };
            let _ = timeout(LEAVE, leave).await;
        }
    }

    /// How long until is to be looked again, if nobody rings.
    fn due(&self) -> Wait {
        let is_asking = self.was_connected && !self.inlet.subscriptions.is_done();
        match (!self.waiting.is_empty(), self.acknowledgements.are_due()) {
            (true, _) => LOOK,
            (false, true) => AGAIN.0,
            (false, false) if is_asking => AGAIN.1,
            (false, false) => LONGEST,
        }
    }

    fn look(&mut self, sender: &Sender) {
        self.give();
        self.acknowledge(sender);
        if self.was_connected {
            self.inlet.subscriptions.pass(sender);
        }
    }

    fn acknowledge(&mut self, sender: &Sender) {
        let safe = match self.inlet.ack {
            Ack::Written => self.out.written(),
            Ack::Synced => self.out.synced(),
        };
        let send = |packet| sender.acknowledge(packet);
        self.acknowledgements.send(safe, send);
        let are_due = self.acknowledgements.are_due() || !self.waiting.is_empty();
        self.awaits.store(are_due, Ordering::Release);
    }

    fn handle(&mut self, event: Event, sender: &Sender) -> Result<(), Ended> {
        let subscriptions = &mut self.inlet.subscriptions;
        match event {
            Event::Connected { session_present } => {
                let was_kept = subscriptions.has_asked;
                subscriptions.connected(session_present, sender);
                self.was_connected = true;
                self.inlet.gaps.connected(time_of_day());
                self.out.connected();
                if was_kept && !session_present {
                    let (broker, id) =
                        (&self.inlet.settings.broker, &self.inlet.settings.client_id);
                    self.out.remarks().report(format_args!(
                        "{broker} has forgotten the session of `{id}`: what it held is lost, unless it is published again"
                    ));
                }
            }
            Event::SubscribeSent(packet) => subscriptions.sent(packet),
            Event::Subscribed(packet, codes) => {
                for words in subscriptions.answered(packet, &codes) {
                    self.out.remarks().report(words);
                }
            }
            Event::UnsubscribeSent(packet) => subscriptions.taken_back_sent(packet),
            Event::Unsubscribed(packet) => subscriptions.taken_back(packet),
            Event::Message(message) => {
                self.take(message);
                self.give();
            }
            Event::PublishSent(_) | Event::Published(..) | Event::Other => {}
        }
        Ok(())
    }

    /// Reads a message. Whether it comes again, as its flag says, does not matter: its time tells.
    fn take(&mut self, message: Message) {
        let Message {
            topic,
            payload,
            is_retained,
            packet,
        } = message;
        let mut readings = Vec::new();
        if is_retained && self.inlet.retained == Retained::Ignore {
            self.leave_out((&[], Reason::Retained), &topic, "");
        } else {
            self.read(&topic, &payload, &mut readings);
        }
        // Before they are given: what they wait for is not missed.
        self.awaits.store(true, Ordering::Release);
        // Each instant is given as a whole.
        readings.sort_by_key(|of: &Reading| of.stamp);
        self.waiting.push_back(Waiting {
            readings,
            given: 0,
            packet,
        });
    }

    fn read(&mut self, topic: &str, payload: &[u8], into: &mut Vec<Reading>) {
        let routes = &self.inlet.routes;
        if !self.meant.contains_key(topic) {
            if self.meant.len() >= TOPICS {
                self.meant.clear();
            }
            let meant = routes
                .iter()
                .enumerate()
                .filter(|(_, of)| of.topic.matches(topic));
            self.meant
                .insert(topic.to_owned(), meant.map(|(nth, _)| nth).collect());
        }
        let meant = self.meant.get(topic).map_or(&[][..], Vec::as_slice);
        let arrival = time_of_day();
        let read: Vec<_> = meant
            .iter()
            .map(|nth| (*nth, self.inlet.routes[*nth].form.read(payload, arrival)))
            .collect();
        if read.is_empty() {
            self.leave_out((&[], Reason::NoMapping), topic, "");
        }
        for (nth, of) in read {
            for left_out in &of.left_out {
                let channels = match left_out.channel {
                    Some(channel) => vec![channel],
                    None => self.inlet.routes[nth].form.channels(),
                };
                self.leave_out((&channels, left_out.reason), topic, &left_out.what);
            }
            let gap = self.inlet.gaps.seen(topic, of.newest, of.sequence, arrival);
            self.report(topic, gap);
            into.extend(of.given);
        }
    }

    fn report(&self, topic: &str, gap: Option<Gap>) {
        let Some(Gap { from, to, missing }) = gap else {
            return;
        };
        let what = match missing {
            Some(1) => format!("a message of `{topic}` is missing by their numbers"),
            Some(count) => format!("{count} messages of `{topic}` are missing by their numbers"),
            None => "nothing of this time came after the connection was interrupted".to_owned(),
        };
        let (from, to) = (shown(from), shown(to));
        self.out
            .remarks()
            .report(format_args!("gap from {from} to {to}: {what}"));
    }

    fn leave_out(&mut self, of: (&[usize], Reason), topic: &str, what: &str) {
        self.inlet.left_out.count(of, topic, &what, self.out);
    }

    /// Gives the engine what it has room for.
    fn give(&mut self) {
        while let Some(waiting) = self.waiting.front_mut() {
            let readings = &waiting.readings;
            while waiting.given < readings.len() {
                if self.out.room() < self.values.len() + 2 {
                    return;
                }
                self.values.fill(f64::NAN);
                let stamp = readings[waiting.given].stamp;
                // A channel has one value at an instant; a second one is for the service to refuse.
                while let Some(of) = readings.get(waiting.given)
                    && of.stamp == stamp
                    && self.values[of.channel].is_nan()
                {
                    self.values[of.channel] = of.value;
                    waiting.given += 1;
                }
                if !self.out.row(stamp, &self.values, self.stop) {
                    return;
                }
            }
            let given = self.out.given();
            if let Some(packet) = waiting.packet {
                self.acknowledgements.given(given, packet);
            }
            self.waiting.pop_front();
        }
    }
}

/// An instant for people: RFC 3339.
pub(crate) fn shown(at: Instant) -> String {
    jiff::Timestamp::from_nanosecond(at.as_ns().into())
        .map_or_else(|_| at.to_string(), |of| of.to_string())
}
