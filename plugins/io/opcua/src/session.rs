//! A source at work: one session after another, until it is to stop. It never waits for the engine.

use std::sync::Arc;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::{Duration, Instant};
use athermal_serve::bell::Bell;
use athermal_serve::connector::{LeftOut, Outflow, Stop};
use athermal_serve::host::time_of_day;
use opcua::types::{DataValue, NodeId, StatusCode};
use tokio::sync::Notify;
use tokio::time::sleep;

use crate::link::{Event, KEPT, Link, status_words};
use crate::source::Plan;
use crate::subscription::{Granted, Note, Subscription};
use crate::value::{code, read, stamp};

/// How often is looked at what is due.
const LOOK: Wait = Wait::from_millis(250);
/// How often nodes that are not there are asked for again.
const AGAIN: Wait = Wait::from_secs(1);
/// How long is waited for the server at the end.
const LEAVE: Wait = Wait::from_millis(300);
/// How many messages may wait.
const WAITING: usize = 100_000;

/// A session at work.
pub(crate) struct Session<'a> {
    plan: &'a mut Plan,
    out: &'a mut Outflow,
    stop: &'a Stop,
    link: Link,
    subscription: Option<Subscription>,
    items: Vec<Item>,
    notes: Vec<Note>,
    /// What is to be given: stamp, channel and value; and a row of all channels.
    readings: Vec<(Instant, usize, f64)>,
    row: Vec<f64>,
    /// When the server last showed that it lives, nodes were last asked for, and was last looked at what is due.
    sign: Clock,
    asked: Clock,
    looked: Clock,
    /// Since when there is no connection.
    lost: Option<Clock>,
    /// How many values a server has thrown away since its queue was full, as far as it says so.
    overflows: u64,
}

/// What is known of a channel.
#[derive(Debug, Default)]
struct Item {
    /// What was granted; none while it waits.
    granted: Option<Granted>,
    /// What is wrong with it, and since when.
    trouble: Option<(String, String)>,
    /// Whether no value has come since it was asked for.
    is_first: bool,
    /// The last value, its stamp, and when it came.
    last: Option<(Instant, f64, Clock)>,
}

impl Item {
    fn words(&self) -> String {
        let trouble = self.trouble.as_ref();
        let trouble = trouble.map(|(what, since)| format!("{what} since {since}"));
        match (&self.granted, trouble) {
            (None, None) => String::new(),
            (None, Some(what)) => format!("waiting: {what}"),
            (Some(granted), None) => granted.to_string(),
            (Some(granted), Some(what)) => format!("{what}; {granted}"),
        }
    }
}

impl Session<'_> {
    /// Runs until it is to stop.
    ///
    /// # Errors
    /// Why it cannot go on.
    pub(crate) async fn run(plan: &mut Plan, out: &mut Outflow, stop: &Stop) -> Result<(), String> {
        let rung = Arc::new(Notify::new());
        let rings = Arc::clone(&rung);
        let bell = Bell::new(move || rings.notify_one());
        stop.wakes(&bell);
        let stopped = async {
            while !stop.is_asked() {
                rung.notified().await;
            }
        };
        let link = tokio::select! {
            link = Link::open(&plan.settings) => link?,
            () = stopped => return Ok(()),
        };
        let now = Clock::now();
        let mut session = Session {
            items: plan.channels.iter().map(|_| Item::default()).collect(),
            row: vec![f64::NAN; plan.channels.len()],
            readings: Vec::new(),
            plan,
            out,
            stop,
            link,
            subscription: None,
            notes: Vec::new(),
            sign: now,
            asked: now,
            looked: now,
            lost: None,
            overflows: 0,
        };
        let ended = session.work(&rung).await;
        session.link.leave(LEAVE).await;
        ended
    }

    async fn work(&mut self, rung: &Notify) -> Result<(), String> {
        self.begin().await?;
        while !self.stop.is_asked() {
            self.give();
            let (link, subscription) = (&mut self.link, &mut self.subscription);
            let next = async {
                match subscription {
                    Some(of) => of.next().await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                () = rung.notified() => {}
                () = sleep(LOOK) => {}
                event = link.next() => {
                    let event = event?;
                    self.handle(event).await?;
                }
                message = next => {
                    if let (Some(message), Some(of)) = (message, &mut self.subscription) {
                        self.sign = Clock::now();
                        self.out.alive();
                        of.take(&mut self.link, message, &mut self.notes).await?;
                    }
                }
            }
            if self.looked.elapsed() >= LOOK {
                self.looked = Clock::now();
                self.look().await?;
            }
        }
        Ok(())
    }

    /// Subscribes, and asks for all nodes.
    async fn begin(&mut self) -> Result<(), String> {
        self.subscription = None;
        self.subscription = Some(Subscription::begin(&mut self.link, self.plan.sampling).await?);
        for item in &mut self.items {
            item.granted = None;
        }
        self.ask(true).await?;
        self.connected();
        Ok(())
    }

    fn connected(&mut self) {
        (self.sign, self.lost) = (Clock::now(), None);
        self.out.connected();
    }

    /// Asks for the nodes that are not there yet.
    async fn ask(&mut self, is_news: bool) -> Result<(), String> {
        self.asked = Clock::now();
        let Some(subscription) = &self.subscription else {
            return Ok(());
        };
        let namespaces = self.link.namespaces().await?;
        let (mut wanted, mut answers) = (Vec::new(), Vec::new());
        for (nth, item) in self.items.iter().enumerate() {
            if item.granted.is_none() {
                match self.plan.channels[nth].node.resolve(&namespaces) {
                    Ok(id) => wanted.push((nth as u32, id)),
                    Err(why) => answers.push((nth, Err(why))),
                }
            }
        }
        let wanted: Vec<(u32, NodeId)> = wanted;
        for (number, answer) in subscription.ask(&mut self.link, wanted).await? {
            answers.push((number as usize, answer.map_err(code)));
        }
        let (mut waiting, mut first, mut other) = (0, String::new(), None);
        for (nth, answer) in answers {
            match answer {
                Ok(granted) => {
                    let asked = self.plan.sampling;
                    if granted.sampling.max(granted.publishing) > asked.sampling.mul_f64(1.01) {
                        other.get_or_insert(granted);
                    }
                    let item = &mut self.items[nth];
                    (item.granted, item.trouble, item.is_first) = (Some(granted), None, true);
                }
                Err(why) => {
                    waiting += 1;
                    if first.is_empty() {
                        first = format!("{}: {why}", self.plan.channels[nth].node);
                    }
                    self.trouble(nth, why);
                }
            }
            self.show(nth);
        }
        let remarks = self.out.remarks();
        if is_news && waiting > 0 {
            let all = self.items.len();
            remarks.report(format_args!(
                "{waiting} of {all} nodes are not there, and are asked for each second; {first}"
            ));
        }
        if let Some(granted) = other.filter(|_| is_news) {
            remarks.report(format_args!(
                "the server looks less often than each {:?}: {granted}",
                self.plan.sampling.sampling
            ));
        }
        Ok(())
    }

    async fn handle(&mut self, event: Event) -> Result<(), String> {
        match event {
            Event::Begun => {
                self.out.remarks().report(
                    "the server does not know the session any more: what it had queued is lost, and nodes are asked for again",
                );
                self.begin().await?;
            }
            Event::TakenUp => {
                let Some(of) = &mut self.subscription else {
                    return self.begin().await;
                };
                of.again(&mut self.link, None, &mut self.notes).await?;
                self.link.session.trigger_publish_now();
                self.connected();
            }
            Event::Lost(why) => {
                if self.lost.is_none() {
                    self.lost = Some(Clock::now());
                    self.out.away();
                    let words = format_args!("the connection is lost, and made anew: {why}");
                    self.out.remarks().report(words);
                }
            }
            // What has nothing to do with the line does not get better by itself.
            Event::NotYet(why) if !is_of_the_line(why) => return Err(status_words(why)),
            Event::NotYet(_) => {}
            Event::Forgotten => self.begin().await?,
        }
        Ok(())
    }

    /// Looks at what is due.
    async fn look(&mut self) -> Result<(), String> {
        let waiting = self.subscription.as_ref().map_or(0, Subscription::waiting);
        if waiting > WAITING {
            return Err(format!(
                "{waiting} messages wait: the session is begun anew"
            ));
        }
        if let Some(lost) = self.lost {
            return match lost.elapsed() > KEPT {
                true => Err("nobody has answered for a minute".to_owned()),
                false => Ok(()),
            };
        }
        let alive = self.subscription.as_ref().map_or(Wait::ZERO, |of| of.alive);
        let dead = self.plan.dead.max(alive.mul_f64(2.5));
        if self.sign.elapsed() > dead {
            let words = format_args!("no sign of life for {dead:?}: the connection is cut");
            self.out.remarks().report(words);
            self.sign = Clock::now();
            self.link.cut();
            return Ok(());
        }
        if self.asked.elapsed() >= AGAIN && self.items.iter().any(|of| of.granted.is_none()) {
            self.ask(false).await?;
        }
        // Nothing is made up once the server says nothing.
        if self.sign.elapsed() <= alive.mul_f64(2.0).max(LOOK) {
            self.repeat();
        }
        Ok(())
    }

    /// Lets values that have not changed count again.
    fn repeat(&mut self) {
        let Some(every) = self.plan.repeat else {
            return;
        };
        for (nth, item) in self.items.iter_mut().enumerate() {
            if let Some((stamp, value, came)) = &mut item.last
                && came.elapsed() >= every
            {
                *stamp = *stamp + Duration::from_ns(came.elapsed().as_nanos() as i64);
                *came = Clock::now();
                self.out.sample(nth, *stamp, *value);
                self.plan.channels[nth].after = *stamp;
            }
        }
    }

    /// Gives what has come.
    fn give(&mut self) {
        let mut notes = std::mem::take(&mut self.notes);
        for note in notes.drain(..) {
            match note {
                Note::Alive => {}
                Note::Value(number, value) => self.value(number as usize, &value),
                Note::Missing(count) => self.out.remarks().report(format_args!(
                    "gap: {count} messages are missing, and the server does not have them any more"
                )),
                Note::Ended(why) => {
                    let words =
                        format_args!("the server has ended the subscription: {}", code(why));
                    self.out.remarks().report(words);
                    // So that all is asked for again.
                    self.link.cut();
                    self.subscription = None;
                }
            }
        }
        self.notes = notes;
        self.give_rows();
    }

    /// Gives what was read instant by instant, each as a whole: a message has the values of one node after those of another.
    fn give_rows(&mut self) {
        // What comes later of a node is behind what came before.
        self.readings.sort_by_key(|(stamp, ..)| *stamp);
        for of in self.readings.chunk_by(|a, b| a.0 == b.0) {
            let has_room = self.out.room() > self.row.len() + 2;
            self.row.fill(f64::NAN);
            let mut is_row = false;
            for &(stamp, channel, value) in of {
                // In a row there is no value that is absent, and none twice; where there is no room it is dropped and counted.
                if of.len() == 1 || !has_room || value.is_nan() || !self.row[channel].is_nan() {
                    self.out.sample(channel, stamp, value);
                } else {
                    self.row[channel] = value;
                    is_row = true;
                }
            }
            if is_row && !self.out.row(of[0].0, &self.row, self.stop) {
                break;
            }
        }
        self.readings.clear();
    }

    fn value(&mut self, nth: usize, of: &DataValue) {
        let (Some(item), Some(asked)) = (self.items.get_mut(nth), self.plan.channels.get_mut(nth))
        else {
            return;
        };
        let status = of.status.unwrap_or(StatusCode::Good);
        if status.overflow() {
            self.overflows += 1;
            if is_round(self.overflows) {
                let (node, count) = (&asked.node, self.overflows);
                self.out.remarks().report(format_args!(
                    "gap: the server's queue was full {count} times, now of {node}: raise `queue`, or `sampling`"
                ));
            }
        }
        let arrival = time_of_day();
        let reading = read(of, self.plan.uncertain, asked.is_plain);
        let stamp = stamp(of, self.plan.time, arrival);
        // A node that is asked for again says what it said before.
        let is_first = std::mem::take(&mut item.is_first);
        if stamp.is_some_and(|of| of == asked.after || is_first && of < asked.after) {
            return;
        }
        let (value, reason, why) = match (reading, stamp) {
            (Ok(value), Some(stamp)) => {
                asked.after = stamp;
                item.last = Some((stamp, value, Clock::now()));
                self.readings.push((stamp, nth, value));
                if item.trouble.take().is_some() {
                    self.show(nth);
                }
                return;
            }
            (Ok(_), None) => (None, LeftOut::NoTime, "no time".to_owned()),
            (Err((reason, why)), stamp) => (Some(stamp.unwrap_or(arrival)), reason, why),
        };
        item.last = None;
        if status == StatusCode::BadNodeIdUnknown {
            item.granted = None;
        }
        if let Some(stamp) = value {
            asked.after = stamp;
            self.readings.push((stamp, nth, f64::NAN));
        }
        self.out.left_out(Some(nth), reason, 1);
        self.trouble(nth, why);
        self.show(nth);
    }

    fn trouble(&mut self, nth: usize, why: String) {
        let trouble = &mut self.items[nth].trouble;
        if trouble.as_ref().is_none_or(|(before, _)| *before != why) {
            let time = jiff::Timestamp::now().strftime("%H:%M UTC").to_string();
            *trouble = Some((why, time));
        }
    }

    fn show(&self, nth: usize) {
        self.out.state(nth, self.items[nth].words());
    }
}

/// Whether a code is of the line, and not of what is asked on it.
fn is_of_the_line(of: StatusCode) -> bool {
    matches!(
        of,
        StatusCode::BadCommunicationError
            | StatusCode::BadConnectionClosed
            | StatusCode::BadConnectionRejected
            | StatusCode::BadTimeout
            | StatusCode::BadRequestTimeout
            | StatusCode::BadTcpEndpointUrlInvalid
            | StatusCode::BadNotConnected
            | StatusCode::BadServerNotConnected
            | StatusCode::BadSecureChannelClosed
            | StatusCode::BadServerHalted
            | StatusCode::BadShutdown
            | StatusCode::BadUnexpectedError
            | StatusCode::BadEndOfStream
    )
}

/// Whether a count is 1, 10, 100, and so on.
fn is_round(count: u64) -> bool {
    count == 10_u64.pow(count.ilog10())
}
