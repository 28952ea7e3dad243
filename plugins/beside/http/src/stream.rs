//! Server-sent events: each tick and what happens, for as long as somebody reads them.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Poll};
use std::time::{Duration, Instant as Clock};

use hyper::body::{Body, Bytes, Frame};
use serde_json::{Map, Value, json};
use tokio::time::{Interval, MissedTickBehavior};

use crate::hub::{Item, Listener, Tick};
use crate::server::Place;

/// How often a stream without news says that it lives.
const ALIVE: Duration = Duration::from_secs(5);
/// How long a reader may read nothing.
const STALLED: Duration = Duration::from_secs(15);

/// How long a connection lasts: a stream lasts as long as it is read.
#[derive(Clone)]
pub struct Life {
    began: Clock,
    /// When the stream was read last, in ms since; 0 where it is none.
    read_ms: Arc<AtomicU64>,
}

impl Default for Life {
    fn default() -> Self {
        Self {
            began: Clock::now(),
            read_ms: Arc::default(),
        }
    }
}

impl Life {
    /// Whether the connection is a stream.
    pub fn is_stream(&self) -> bool {
        self.read_ms.load(Ordering::Relaxed) > 0
    }

    /// Whether nobody reads it any more: its buffers are full, or it would have been asked for more.
    pub fn is_stalled(&self) -> bool {
        let read = Duration::from_millis(self.read_ms.load(Ordering::Relaxed));
        self.began.elapsed().saturating_sub(read) > STALLED
    }

    fn is_read(&self) {
        let ms = self.began.elapsed().as_millis() as u64;
        self.read_ms.store(ms.max(1), Ordering::Relaxed);
    }
}

/// What of a service a listener wants.
#[derive(Debug, Clone, Default)]
pub struct Wanted {
    /// Ticks, beside what happens.
    pub ticks: bool,
    /// Channels whose values come along; `*` is all.
    pub channels: Vec<String>,
}

/// A body that has no end.
pub struct Stream {
    listener: Listener,
    wanted: Wanted,
    life: Life,
    alive: Interval,
    dropped: u64,
    _place: Place,
}

impl Stream {
    /// What a listener is given, of what it wants.
    pub fn new(listener: Listener, wanted: Wanted, life: Life, place: Place) -> Self {
        life.is_read();
        let mut alive = tokio::time::interval(ALIVE);
        alive.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Self {
            listener,
            wanted,
            life,
            alive,
            dropped: 0,
            _place: place,
        }
    }

    /// What was left out because the reader was slow.
    fn gap(&mut self) -> Option<String> {
        let dropped = self.listener.dropped.load(Ordering::Relaxed);
        let more = dropped - std::mem::replace(&mut self.dropped, dropped);
        (more > 0).then(|| message("dropped", &json!({ "items": more })))
    }
}

impl Body for Stream {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        self.life.is_read();
        let frame = |text: String| Poll::Ready(Some(Ok(Frame::data(Bytes::from(text)))));
        loop {
            match self.listener.items.poll_recv(context) {
                Poll::Ready(None) => return Poll::Ready(None),
                Poll::Ready(Some(item)) => {
                    let text = match &*item {
                        Item::Tick(tick) if self.wanted.ticks => {
                            Some(message("tick", &tick_json(tick, &self.wanted.channels)))
                        }
                        Item::Tick(_) => None,
                        Item::Event(event) => Some(message("event", event)),
                    };
                    if let Some(text) = text {
                        let gap = self.gap().unwrap_or_default();
                        return frame(gap + &text);
                    }
                }
                Poll::Pending => break,
            }
        }
        match self.alive.poll_tick(context) {
            Poll::Ready(_) => frame(": alive\n\n".to_owned()),
            Poll::Pending => Poll::Pending,
        }
    }
}

fn message(event: &str, data: &Value) -> String {
    format!("event: {event}\ndata: {data}\n\n")
}

/// A tick, with its outputs and the channels that are asked for. What is absent is null.
fn tick_json(tick: &Tick, channels: &[String]) -> Value {
    let outputs = tick.plan.outputs.iter().zip(&tick.outputs);
    let outputs: Map<_, _> = outputs
        .map(|(of, value)| (of.name.clone(), json!(value)))
        .collect();
    let mut all = json!({
        "time_s": tick.at.as_ns() as f64 / 1e9,
        "time_ns": tick.at.as_ns(),
        "revision": tick.revision,
        "outputs": outputs,
    });
    if !channels.is_empty() {
        let is_wanted = |name: &str| channels.iter().any(|of| of == "*" || of == name);
        let known = tick.plan.channels.iter().zip(&tick.values);
        let wanted = known.filter(|(of, _)| is_wanted(&of.name));
        let wanted: Map<_, _> = wanted
            .map(|(of, value)| (of.name.clone(), json!(value)))
            .collect();
        all["channels"] = Value::Object(wanted);
    }
    all
}
