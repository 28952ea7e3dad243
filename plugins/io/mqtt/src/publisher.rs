//! The thread that publishes: it holds what waits, sends it in order, and sends it again until the broker has it.

use std::collections::VecDeque;
use std::pin::pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::Duration;
use athermal_serve::connector::{BackOff, ConnectorError, Stop};
use serde_json::json;
use tokio::sync::Notify;
use tokio::time::{MissedTickBehavior, interval, timeout};

use crate::broker::Version;
use crate::client::{Connection, Ended, Event, Sender, Settings};
use crate::outgoing::Outgoing;

/// How many messages of a connection are without an answer.
const IN_FLIGHT: usize = 500;
/// How many commands wait for a connection that is slow.
const COMMANDS: usize = 1000;
/// How long the end of what waits is waited for.
const DRAIN: Wait = Wait::from_secs(1);

/// How messages are published.
#[derive(Debug, Clone)]
pub struct Manner {
    /// Until the broker has them, or once.
    pub is_safe: bool,
    /// Whether the broker keeps the last one.
    pub is_retained: bool,
    /// How many bytes may wait.
    pub spool: u64,
    /// Whether what cannot be published at once is not published at all.
    pub is_command: bool,
    /// Under which topic it says that it lives, if it does, and how often.
    pub alive: Option<String>,
    pub every: Duration,
    /// Whether the other version may be tried.
    pub is_version_open: bool,
    /// The longest pause between two connections.
    pub retry: Wait,
}

/// What waits, and how the connection is.
#[derive(Debug, Default)]
struct Spool {
    waiting: VecDeque<Outgoing>,
    bytes: u64,
    /// Of how many ticks they are.
    rows: u64,
    /// How many of them, from the front on, are sent and not answered.
    sent: usize,
    /// How many messages the broker has.
    published: u64,
    /// How many ticks were put.
    ticks: u64,
    /// Why there is no connection; none where there is one.
    away: Option<String>,
    /// What the broker refused last.
    refused: Option<String>,
}

/// What both threads share.
#[derive(Debug, Default)]
struct Shared {
    spool: Mutex<Spool>,
    /// Something has left.
    left: Condvar,
    /// Something has come.
    came: Notify,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Spool> {
        self.spool.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The end that a sink holds.
#[derive(Debug)]
pub struct Publisher {
    shared: Arc<Shared>,
    manner: Manner,
    broker: String,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl Publisher {
    /// Starts the thread, which connects.
    ///
    /// # Errors
    /// When the system has no resources for it.
    pub fn start(settings: Settings, manner: Manner) -> Result<Self, ConnectorError> {
        let shared = Arc::new(Shared::default());
        let broker = settings.broker.to_string();
        shared.lock().away = Some("not yet connected".to_owned());
        let stop = Stop::default();
        let failed = |error| {
            ConnectorError::new(format_args!(
                "the system has no resources for a connection: {error}"
            ))
        };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(failed)?;
        let mut work = Work {
            shared: Arc::clone(&shared),
            settings,
            manner: manner.clone(),
            stop: stop.clone(),
            count: 0,
        };
        let thread = Builder::new()
            .name("mqtt".to_owned())
            .spawn(move || runtime.block_on(work.run()))
            .map_err(failed)?;
        Ok(Self {
            shared,
            manner,
            broker,
            stop,
            thread: Some(thread),
        })
    }

    /// Whether what waits is published after a restart too.
    pub fn keeps(&self) -> bool {
        !self.manner.is_command
    }

    /// Takes the messages of a tick.
    ///
    /// # Errors
    /// When commands cannot be published at once, or nothing more may wait.
    pub fn put(&mut self, messages: &mut Vec<Outgoing>) -> Result<(), ConnectorError> {
        let mut spool = self.shared.lock();
        if self.manner.is_command {
            if let Some(why) = &spool.away {
                return Err(self.away(why));
            }
            if spool.waiting.len() >= COMMANDS {
                let broker = &self.broker;
                return Err(ConnectorError::new(format_args!(
                    "{broker} does not take commands as fast as they come"
                )));
            }
        } else if spool.bytes >= self.manner.spool {
            let why = spool.away.as_deref().unwrap_or("it is slow");
            let (broker, waiting) = (&self.broker, spool.waiting.len());
            return Err(ConnectorError::new(format_args!(
                "{broker}: {why}, and the `spool` is full with {waiting} messages"
            )));
        }
        spool.ticks += 1;
        for message in messages.drain(..) {
            spool.bytes += size(&message);
            spool.rows += u64::from(message.ends_row);
            spool.waiting.push_back(message);
        }
        drop(spool);
        self.shared.came.notify_one();
        Ok(())
    }

    /// Of how many ticks something waits.
    pub fn rows(&self) -> u64 {
        self.shared.lock().rows
    }

    /// Whether there is a connection, and the broker takes what is published.
    ///
    /// # Errors
    /// Why not.
    pub fn state(&mut self) -> Result<(), ConnectorError> {
        let mut spool = self.shared.lock();
        if let Some(why) = spool.refused.take() {
            return Err(ConnectorError::new(format_args!(
                "{} refuses a message, which is set aside: {why}",
                self.broker
            )));
        }
        match &spool.away {
            Some(why) => Err(self.away(why)),
            None => Ok(()),
        }
    }

    fn away(&self, why: &str) -> ConnectorError {
        ConnectorError::new(format_args!("not connected to {}: {why}", self.broker))
    }

    /// How many messages the broker has, once nothing waits.
    ///
    /// # Errors
    /// When something still waits.
    pub fn drained(&mut self) -> Result<u64, ConnectorError> {
        let began = Clock::now();
        let mut spool = self.shared.lock();
        loop {
            if spool.waiting.is_empty() {
                return Ok(spool.published);
            }
            let left = DRAIN.saturating_sub(began.elapsed());
            if left.is_zero() || spool.away.is_some() {
                let waiting = spool.waiting.len();
                return Err(ConnectorError::new(format_args!(
                    "{waiting} messages wait for {}",
                    self.broker
                )));
            }
            let waited = self.shared.left.wait_timeout(spool, left);
            spool = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Drop for Publisher {
    /// What still waits is sent, if that is done within a moment.
    fn drop(&mut self) {
        let _ = self.drained();
        self.stop.ask();
        self.shared.came.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn size(message: &Outgoing) -> u64 {
    (message.topic.len() + message.payload.len()) as u64
}

/// The thread's own.
struct Work {
    shared: Arc<Shared>,
    settings: Settings,
    manner: Manner,
    stop: Stop,
    count: u64,
}

impl Work {
    async fn run(&mut self) {
        let mut back_off = BackOff::up_to(self.manner.retry);
        while !self.stop.is_asked() {
            let mut connected = None;
            let ended = self.connection(&mut connected).await;
            let Err(ended) = ended else { return };
            let lasted = connected.map_or(Wait::ZERO, |since: Clock| since.elapsed());
            let is_open = self.manner.is_version_open && connected.is_none();
            if is_open && matches!(ended, Ended::Version(_) | Ended::Closed(_)) {
                self.settings.version = match self.settings.version {
                    Version::Five => Version::Three,
                    Version::Three => Version::Five,
                };
            }
            let words = match ended {
                Ended::TakenOver => format!(
                    "another client has the id `{}`: give one of them another `client_id`",
                    self.settings.client_id
                ),
                Ended::Version(words) | Ended::Closed(words) | Ended::Other(words) => words,
            };
            self.ended(words);
            let mut left = back_off.after(lasted);
            let until = Clock::now() + left;
            while !left.is_zero() && !self.stop.is_asked() {
                // Rows that come meanwhile wait.
                let _ = timeout(left, self.shared.came.notified()).await;
                left = until.saturating_duration_since(Clock::now());
            }
        }
    }

    /// There is no connection any more: what was sent without an answer is sent again, and an old command is none.
    fn ended(&self, why: String) {
        let mut spool = self.shared.lock();
        spool.away = Some(why);
        spool.sent = 0;
        if self.manner.is_command {
            spool.waiting.clear();
            (spool.bytes, spool.rows) = (0, 0);
        }
    }

    async fn connection(&mut self, connected: &mut Option<Clock>) -> Result<(), Ended> {
        let mut connection = Connection::new(&self.settings).map_err(Ended::Other)?;
        let sender = connection.sender();
        let every = Wait::from_nanos(self.manner.every.as_ns().max(1) as u64);
        let mut beats = interval(every);
        beats.set_missed_tick_behavior(MissedTickBehavior::Delay);
        // Numbers of messages that were sent: of the spool, or of a beat.
        let (mut queued, mut sent) = (VecDeque::new(), VecDeque::new());
        loop {
            let mut next = pin!(connection.next());
            let event = loop {
                tokio::select! {
                    event = &mut next => break Some(event?),
                    () = self.shared.came.notified() => {
                        if self.stop.is_asked() {
                            break None;
                        }
                        if connected.is_some() {
                            self.send(&sender, &mut queued);
                        }
                    }
                    _ = beats.tick() => {
                        if connected.is_some() && self.beat(&sender) {
                            queued.push_back(false);
                        }
                    }
                }
            };
            match event {
                None => break,
                Some(Event::Connected { .. }) => {
                    *connected = Some(Clock::now());
                    self.shared.lock().away = None;
                    if self.beat(&sender) {
                        queued.push_back(false);
                    }
                    self.send(&sender, &mut queued);
                }
                Some(Event::PublishSent(packet)) => {
                    let is_row = queued.pop_front().unwrap_or(false);
                    match packet {
                        0 if is_row => self.answered(Ok(())),
                        0 => {}
                        packet => sent.push_back((packet, is_row)),
                    }
                    self.send(&sender, &mut queued);
                }
                Some(Event::Published(packet, taken)) => {
                    // A broker answers in order.
                    let place = sent.iter().position(|(of, _)| *of == packet);
                    if place
                        .and_then(|place| sent.remove(place))
                        .is_some_and(|(_, is_row)| is_row)
                    {
                        self.answered(taken);
                    }
                    self.send(&sender, &mut queued);
                }
                Some(_) => {}
            }
        }
        // The last will is for those who do not take leave.
        if let Some(topic) = &self.manner.alive {
            sender.publish(topic, true, true, b"{\"alive\":false}");
        }
        sender.disconnect();
        let leave = async { while connection.next().await.is_ok() {} };
        let _ = timeout(Wait::from_millis(300), leave).await;
        Ok(())
    }

    /// Sends what waits, as far as there may be more without an answer.
    fn send(&self, sender: &Sender, queued: &mut VecDeque<bool>) {
        let mut spool = self.shared.lock();
        while spool.sent < spool.waiting.len().min(IN_FLIGHT) {
            let message = &spool.waiting[spool.sent];
            let Manner {
                is_safe,
                is_retained,
                ..
            } = self.manner;
            if !sender.publish(&message.topic, is_safe, is_retained, &message.payload) {
                return;
            }
            queued.push_back(true);
            spool.sent += 1;
        }
    }

    /// The first of what was sent has been answered.
    fn answered(&self, taken: Result<(), String>) {
        let mut spool = self.shared.lock();
        // A message that is refused does not hold back those behind it.
        spool.refused = taken.err().or(spool.refused.take());
        if let Some(message) = spool.waiting.pop_front() {
            spool.bytes = spool.bytes.saturating_sub(size(&message));
            spool.rows -= u64::from(message.ends_row);
            spool.sent = spool.sent.saturating_sub(1);
            spool.published += 1;
        }
        drop(spool);
        self.shared.left.notify_all();
    }

    /// Says that it lives.
    fn beat(&mut self, sender: &Sender) -> bool {
        let Some(topic) = &self.manner.alive else {
            return false;
        };
        self.count += 1;
        let (ticks, waiting) = {
            let spool = self.shared.lock();
            (spool.ticks, spool.waiting.len())
        };
        let alive =
            json!({ "alive": true, "count": self.count, "ticks": ticks, "waiting": waiting });
        sender.publish(topic, false, true, alive.to_string().as_bytes())
    }
}
