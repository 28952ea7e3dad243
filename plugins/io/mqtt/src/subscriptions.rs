//! What a client has asked a broker for. A topic is asked for until the broker has answered, across connections; what was asked for
//! before and is no longer wanted is taken back, also after a restart.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant as Clock};

use athermal_run::live::store::write_whole;
use serde::{Deserialize, Serialize};

use crate::client::Sender;

/// How long the answer to a subscription may take.
const ANSWER: Duration = Duration::from_secs(10);
/// How long a topic that was refused is left alone: at first, and at most.
const REFUSED: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(30));
/// How many topics stand in one packet.
const TOGETHER: usize = 100;

/// What was last asked of which broker.
#[derive(Debug, Serialize, Deserialize, PartialEq)]
struct Known {
    broker: String,
    client_id: String,
    topics: BTreeSet<String>,
}

/// Subscriptions of a client.
#[derive(Debug)]
pub struct Subscriptions {
    wanted: BTreeSet<String>,
    /// Those that the broker has confirmed to this process.
    confirmed: BTreeSet<String>,
    /// Those that an earlier process asked for, and are no longer wanted.
    left_over: BTreeSet<String>,
    /// Why topics were refused.
    refused: BTreeMap<String, String>,
    /// What was asked and has no number yet, in order.
    asked: VecDeque<Vec<String>>,
    /// What was asked under a number.
    sent: HashMap<u16, Vec<String>>,
    /// The same of what was taken back.
    taken_back: VecDeque<String>,
    taken_back_sent: HashMap<u16, String>,
    again: Clock,
    pause: Duration,
    path: PathBuf,
    known: Known,
    /// Whether anything was asked of this broker before, so that it should have a session.
    pub has_asked: bool,
}

impl Subscriptions {
    /// Those of a client, whose state stands in a folder.
    pub fn new(broker: &str, client_id: &str, wanted: BTreeSet<String>, folder: &Path) -> Self {
        let path = folder.join("subscriptions.json");
        let read = std::fs::read(&path).ok();
        let known = read.and_then(|bytes| serde_json::from_slice::<Known>(&bytes).ok());
        let known = known.filter(|known| known.broker == broker && known.client_id == client_id);
        let has_asked = known.is_some();
        let known = known.unwrap_or_else(|| Known {
            broker: broker.to_owned(),
            client_id: client_id.to_owned(),
            topics: BTreeSet::new(),
        });
        Self {
            left_over: known.topics.difference(&wanted).cloned().collect(),
            wanted,
            confirmed: BTreeSet::new(),
            refused: BTreeMap::new(),
            asked: VecDeque::new(),
            sent: HashMap::new(),
            taken_back: VecDeque::new(),
            taken_back_sent: HashMap::new(),
            again: Clock::now(),
            pause: REFUSED.0,
            path,
            known,
            has_asked,
        }
    }

    /// A connection has begun. A broker that has no session has no subscriptions.
    pub fn connected(&mut self, session_present: bool, sender: &Sender) {
        self.asked.clear();
        self.sent.clear();
        self.taken_back.clear();
        self.taken_back_sent.clear();
        if !session_present {
            self.confirmed.clear();
            self.left_over.clear();
        }
        self.has_asked = true;
        // Before it is asked: what stands at the broker is never more than what is known.
        self.keep();
        self.ask(sender);
    }

    /// Asks for what is wanted and not confirmed, and takes back what is not wanted.
    fn ask(&mut self, sender: &Sender) {
        self.again = Clock::now() + self.pause.max(ANSWER * u32::from(self.refused.is_empty()));
        let pending: Vec<_> = self.wanted.difference(&self.confirmed).cloned().collect();
        for topics in pending.chunks(TOGETHER) {
            if sender.subscribe(topics) {
                self.asked.push_back(topics.to_vec());
            }
        }
        for topic in &self.left_over {
            if sender.unsubscribe(topic) {
                self.taken_back.push_back(topic.clone());
            }
        }
    }

    /// Asks again for what has not been confirmed, once it is time.
    pub fn pass(&mut self, sender: &Sender) {
        if Clock::now() >= self.again && !self.is_done() {
            self.pause = (self.pause * 2).min(REFUSED.1);
            self.ask(sender);
        }
    }

    /// Whether all is as it is wanted.
    pub fn is_done(&self) -> bool {
        self.left_over.is_empty() && self.wanted.is_subset(&self.confirmed)
    }

    /// What was asked next has this number.
    pub fn sent(&mut self, packet: u16) {
        if let Some(topics) = self.asked.pop_front() {
            self.sent.insert(packet, topics);
        }
    }

    /// The broker has answered. Gives what is to be reported: what it refuses, each the first time, and what it grants less of.
    pub fn answered(&mut self, packet: u16, codes: &[Result<u8, String>]) -> Vec<String> {
        let mut reports = Vec::new();
        let topics = self.sent.remove(&packet).unwrap_or_default();
        for (topic, code) in topics.into_iter().zip(codes) {
            match code {
                Ok(qos) => {
                    self.refused.remove(&topic);
                    if self.confirmed.insert(topic.clone()) && *qos == 0 {
                        reports.push(format!(
                            "the broker grants `{topic}` with QoS 0, where QoS 1 was asked: what comes while the connection is interrupted is lost"
                        ));
                    }
                }
                Err(why) => {
                    if self.refused.insert(topic.clone(), why.clone()).is_none() {
                        self.pause = REFUSED.0;
                        self.again = Clock::now() + self.pause;
                        reports.push(format!(
                            "the broker refuses `{topic}`: {why}; it is asked again, the others go on"
                        ));
                    }
                }
            }
        }
        reports
    }

    /// What was taken back next has this number.
    pub fn taken_back_sent(&mut self, packet: u16) {
        if let Some(topic) = self.taken_back.pop_front() {
            self.taken_back_sent.insert(packet, topic);
        }
    }

    /// The broker gives no more of it.
    pub fn taken_back(&mut self, packet: u16) {
        if let Some(topic) = self.taken_back_sent.remove(&packet) {
            self.left_over.remove(&topic);
            self.keep();
        }
    }

    /// Keeps what the broker may have.
    fn keep(&mut self) {
        let topics = self.wanted.union(&self.left_over).cloned().collect();
        if self.known.topics == topics && self.path.exists() {
            return;
        }
        self.known.topics = topics;
        // Where it cannot be kept, the next start asks for all all the same.
        let write = || -> std::io::Result<()> {
            if let Some(folder) = self.path.parent() {
                std::fs::create_dir_all(folder)?;
            }
            write_whole(&self.path, &serde_json::to_vec(&self.known)?)
        };
        let _ = write();
    }
}
