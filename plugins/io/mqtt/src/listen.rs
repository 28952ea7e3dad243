//! To listen for a while, beside whatever runs: under an id of its own, without a session, and without acknowledging for others.

use std::time::{Duration as Wait, Instant as Clock};

use tokio::runtime::Builder;
use tokio::time::timeout;

use crate::broker::Version;
use crate::client::{Connection, Ended, Event, Message, Settings};

/// What was heard.
pub enum Heard {
    /// A message.
    Message(Message),
    /// What the broker says to a topic: the QoS that it grants, or why none.
    Answer(String, Result<u8, String>),
}

/// Hands all that comes on, until that is enough, or for so long. The other version of the protocol is tried where this one is
/// not spoken.
///
/// # Errors
/// Why there is no connection.
pub fn listen(
    mut settings: Settings,
    filters: &[String],
    patience: Wait,
    mut take: impl FnMut(Heard) -> bool,
) -> Result<(), String> {
    settings.keeps_session = false;
    settings.last_will = None;
    settings.client_id = format!("{}-{}", settings.client_id, std::process::id());
    let runtime = Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| error.to_string())?;
    runtime.block_on(async {
        let until = Clock::now() + patience;
        let ended = once(&settings, filters, until, &mut take).await;
        let Err((words, is_other)) = ended else {
            return Ok(());
        };
        if !is_other {
            return Err(words);
        }
        settings.version = match settings.version {
            Version::Five => Version::Three,
            Version::Three => Version::Five,
        };
        let ended = once(&settings, filters, until, &mut take).await;
        ended.map_err(|(words, _)| words)
    })
}

/// One connection. Where it cannot be made, whether the other version may be spoken.
async fn once(
    settings: &Settings,
    filters: &[String],
    until: Clock,
    take: &mut impl FnMut(Heard) -> bool,
) -> Result<(), (String, bool)> {
    let mut connection = Connection::new(settings).map_err(|words| (words, false))?;
    let sender = connection.sender();
    let mut is_connected = false;
    loop {
        let left = until.saturating_duration_since(Clock::now());
        let Ok(next) = timeout(left, connection.next()).await else {
            let words = "nothing answers".to_owned();
            return is_connected.then_some(()).ok_or((words, false));
        };
        let event = next.map_err(|ended| match ended {
            Ended::TakenOver => ("another client has its id".to_owned(), false),
            Ended::Version(words) | Ended::Closed(words) => (words, !is_connected),
            Ended::Other(words) => (words, false),
        })?;
        let is_enough = match event {
            Event::Connected { .. } => {
                is_connected = true;
                sender.subscribe(filters);
                false
            }
            Event::Subscribed(_, codes) => {
                let mut answers = filters.iter().zip(codes);
                answers.any(|(topic, code)| take(Heard::Answer(topic.clone(), code)))
            }
            Event::Message(message) => {
                if let Some(packet) = message.packet {
                    sender.acknowledge(packet);
                }
                take(Heard::Message(message))
            }
            _ => false,
        };
        if is_enough {
            sender.disconnect();
            let leave = async { while connection.next().await.is_ok() {} };
            let _ = timeout(Wait::from_millis(100), leave).await;
            return Ok(());
        }
    }
}
