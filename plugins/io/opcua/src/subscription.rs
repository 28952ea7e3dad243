//! What is asked of a server: one subscription with an item for each node. Messages are handed on in the order of their numbers, each once;
//! one that is missing is asked for again.

use std::sync::Arc;
use std::time::Duration as Wait;

use opcua::client::services::Republish;
use opcua::client::{MonitoredItemMap, OnSubscriptionNotificationCore, UARequest};
use opcua::types::{
    AttributeId, DataChangeFilter, DataChangeNotification, DataChangeTrigger, DataValue,
    ExtensionObject, MonitoredItemCreateRequest, MonitoringMode, MonitoringParameters, NodeId,
    NotificationMessage, ReadValueId, StatusChangeNotification, StatusCode, TimestampsToReturn,
};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

use crate::link::{KEPT, Link, error_words};

/// How many items are asked for at once.
const AT_ONCE: usize = 100;
/// How many messages are asked for again at most, one after the other.
const AGAIN: u32 = 10_000;

/// How nodes are sampled.
#[derive(Debug, Clone, Copy)]
pub struct Sampling {
    /// How often the server looks at a node, and how often it sends what has changed.
    pub sampling: Wait,
    pub publishing: Wait,
    /// How many values it keeps of a node in between.
    pub queue: u32,
    /// By how much a value has to change.
    pub deadband: Option<f64>,
    /// After how long without a change it says that it lives.
    pub alive: Wait,
}

/// What a server granted of it for a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Granted {
    pub sampling: Wait,
    pub publishing: Wait,
    pub queue: u32,
}

impl std::fmt::Display for Granted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // A server that samples as often as it publishes says 0, or so.
        let every = self.sampling.max(Wait::from_millis(1));
        write!(f, "granted {every:?}, queue {}", self.queue)?;
        if self.publishing != self.sampling {
            write!(f, ", sent each {:?}", self.publishing)?;
        }
        Ok(())
    }
}

/// What comes of a subscription.
#[derive(Debug)]
pub enum Note {
    /// The value of an item, by its number.
    Value(u32, DataValue),
    /// The server lives.
    Alive,
    /// It has ended the subscription.
    Ended(StatusCode),
    /// Messages that it does not have any more.
    Missing(u32),
}

/// A subscription of a session.
pub struct Subscription {
    id: u32,
    publishing: Wait,
    /// After how long without a change the server says that it lives, as granted.
    pub alive: Wait,
    sampling: Sampling,
    came: UnboundedReceiver<NotificationMessage>,
    /// The number of the last message that had something in it; 0 before the first.
    last: u32,
}

/// Where the crate that speaks the protocol puts what comes; nothing of ours runs while it holds its lock.
struct Inbox(UnboundedSender<NotificationMessage>);

impl OnSubscriptionNotificationCore for Inbox {
    fn on_subscription_notification(
        &mut self,
        message: NotificationMessage,
        _: MonitoredItemMap<'_>,
    ) {
        let _ = self.0.send(message);
    }
}

fn ms(of: Wait) -> f64 {
    of.as_secs_f64() * 1e3
}

fn wait(ms: f64) -> Wait {
    Wait::try_from_secs_f64((ms / 1e3).clamp(0.0, 1e6)).unwrap_or_default()
}

impl Subscription {
    /// Asks for one.
    ///
    /// # Errors
    /// When the server gives none.
    pub async fn begin(link: &mut Link, sampling: Sampling) -> Result<Self, String> {
        let (inbox, came) = unbounded_channel();
        let publishing = sampling.publishing.max(Wait::from_millis(1));
        let counted = |of: Wait| (of.as_secs_f64() / publishing.as_secs_f64()).ceil() as u32;
        let alive = counted(sampling.alive).max(1);
        // The server keeps it as long as the session.
        let lifetime = counted(KEPT).max(alive.saturating_mul(3));
        let session = Arc::clone(&link.session);
        let create = async move {
            let inbox = Inbox(inbox);
            session
                .create_subscription(publishing, lifetime, alive, 0, 0, true, inbox)
                .await
        };
        let id = link.drive(create).await?.map_err(|of| error_words(&of))?;
        let state = link.session.subscription_state.lock();
        let granted = state.get(id);
        let granted = granted.map(|of| (of.publishing_interval(), of.max_keep_alive_count()));
        drop(state);
        let (publishing, count) = granted.unwrap_or((publishing, alive));
        Ok(Self {
            id,
            publishing,
            alive: publishing.saturating_mul(count),
            sampling,
            came,
            last: 0,
        })
    }

    /// Asks for items, by their numbers: what is granted of each, or why it is not.
    ///
    /// # Errors
    /// When there is no answer.
    pub async fn ask(
        &self,
        link: &mut Link,
        items: Vec<(u32, NodeId)>,
    ) -> Result<Vec<(u32, Result<Granted, StatusCode>)>, String> {
        let mut all = Vec::with_capacity(items.len());
        for piece in items.chunks(AT_ONCE) {
            let filter = self.sampling.deadband.map(|deadband| DataChangeFilter {
                trigger: DataChangeTrigger::StatusValue,
                deadband_type: 1,
                deadband_value: deadband,
            });
            let filter = filter.map_or_else(ExtensionObject::null, ExtensionObject::from_message);
            let request = |(number, node): &(u32, NodeId)| MonitoredItemCreateRequest {
                item_to_monitor: ReadValueId {
                    node_id: node.clone(),
                    attribute_id: AttributeId::Value as u32,
                    ..ReadValueId::default()
                },
                monitoring_mode: MonitoringMode::Reporting,
                requested_parameters: MonitoringParameters {
                    // The crate that speaks the protocol takes another one in place of 0.
                    client_handle: *number + 1,
                    sampling_interval: ms(self.sampling.sampling),
                    filter: filter.clone(),
                    queue_size: self.sampling.queue,
                    discard_oldest: true,
                },
            };
            let requests = piece.iter().map(request).collect();
            let (session, id) = (Arc::clone(&link.session), self.id);
            let create = async move {
                let both = TimestampsToReturn::Both;
                session.create_monitored_items(id, both, requests).await
            };
            let created = link.drive(create).await?;
            let created = created.map_err(|of| error_words(&of))?;
            all.extend(piece.iter().zip(created).map(|((number, _), of)| {
                let granted = Granted {
                    sampling: wait(of.result.revised_sampling_interval),
                    publishing: self.publishing,
                    queue: of.result.revised_queue_size,
                };
                let status = of.result.status_code;
                (
                    *number,
                    if status.is_bad() {
                        Err(status)
                    } else {
                        Ok(granted)
                    },
                )
            }));
        }
        Ok(all)
    }

    /// What has come, as far as it is whole. What is missing of it is asked for again.
    ///
    /// # Errors
    /// When the session has ended for good.
    pub async fn take(
        &mut self,
        link: &mut Link,
        message: NotificationMessage,
        into: &mut Vec<Note>,
    ) -> Result<(), String> {
        let number = message.sequence_number;
        let is_full = message
            .notification_data
            .as_ref()
            .is_some_and(|of| !of.is_empty());
        // One without anything in it has the number of the next one that will have.
        let missing = number.wrapping_sub(1).wrapping_sub(self.last);
        if self.last != 0 && missing > 0 && missing < u32::MAX / 2 {
            self.again(link, Some(missing), into).await?;
        }
        if !is_full {
            into.push(Note::Alive);
        } else if self.last == 0 || number == self.last.wrapping_add(1) {
            self.last = number;
            read(message, into);
        } else {
            // It came again.
            into.push(Note::Alive);
        }
        Ok(())
    }

    /// Asks for the messages behind the last one, so many or until there are no more.
    ///
    /// # Errors
    /// When the session has ended for good.
    pub async fn again(
        &mut self,
        link: &mut Link,
        missing: Option<u32>,
        into: &mut Vec<Note>,
    ) -> Result<(), String> {
        let mut lost = 0;
        for _ in 0..missing.unwrap_or(AGAIN).min(AGAIN) {
            let number = self.last.wrapping_add(1);
            let (session, id) = (Arc::clone(&link.session), self.id);
            // Not by the session: it would acknowledge the number of an empty answer too, under which a message may still come.
            let again = async move {
                let request = Republish::new(id, number, &session);
                request.send(session.channel()).await
            };
            let found = link.drive(again).await?.map(|of| of.notification_message);
            // A server may answer for ever, with nothing.
            let found = found.ok().filter(|of| {
                let data = of.notification_data.as_ref();
                of.sequence_number == number && data.is_some_and(|of| !of.is_empty())
            });
            match (found, missing) {
                (Some(message), _) => read(message, into),
                (None, None) => break,
                (None, Some(_)) => lost += 1,
            }
            self.last = number;
        }
        if let Some(missing) = missing.filter(|of| *of > AGAIN) {
            lost += missing - AGAIN;
            self.last = self.last.wrapping_add(missing - AGAIN);
        }
        if lost > 0 {
            into.push(Note::Missing(lost));
        }
        Ok(())
    }

    /// The next message; it may be given up.
    pub async fn next(&mut self) -> Option<NotificationMessage> {
        self.came.recv().await
    }

    /// How many messages wait.
    pub fn waiting(&self) -> usize {
        self.came.len()
    }
}

fn read(message: NotificationMessage, into: &mut Vec<Note>) {
    for data in message.notification_data.into_iter().flatten() {
        if let Some(changed) = data.inner_as::<DataChangeNotification>() {
            let items = changed.monitored_items.iter().flatten();
            into.extend(
                items.map(|of| Note::Value(of.client_handle.wrapping_sub(1), of.value.clone())),
            );
        } else if let Some(of) = data.inner_as::<StatusChangeNotification>() {
            into.push(Note::Ended(of.status));
        }
    }
}
