//! The thread of a source: runs it, and starts it again after a failure.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::sync::mpsc::Sender;
use std::time::{Duration as Wait, Instant as Clock};

use super::ServiceEvent;
use crate::connector::{ConnectorError, Inlet, Outflow, Stop};
use crate::diagnostic::panic_message;
use crate::time::Duration;

/// How long a source that failed is left alone: at first, and at most.
const BACK_OFF: (Wait, Wait) = (Wait::from_millis(500), Wait::from_secs(30));

/// A source at work.
pub(super) struct SourceThread {
    pub(super) name: String,
    pub(super) inlet: Box<dyn Inlet>,
    pub(super) out: Outflow,
    /// The end of one run, asked for where it is connected and silent.
    pub(super) run: Stop,
    /// How long that may be.
    pub(super) silent: Duration,
}

impl SourceThread {
    /// Runs the source until it ends or is to stop.
    pub(super) fn run(self, stop: &Stop, events: &Sender<ServiceEvent>) {
        let Self {
            name,
            mut inlet,
            mut out,
            run,
            silent,
        } = self;
        let mut pause = BACK_OFF.0;
        let either = stop.or(&run);
        loop {
            let began = Clock::now();
            run.withdraw();
            let ran = catch_unwind(AssertUnwindSafe(|| inlet.run(&mut out, &either)));
            let error = match ran {
                Ok(ended) if run.is_asked() && !stop.is_asked() => {
                    let more = ended.map_or_else(
                        |error| format!("; it ended with: {error}"),
                        |()| String::new(),
                    );
                    ConnectorError::new(format_args!(
                        "connected, and silent for {silent}: the connection is dropped and made anew{more}"
                    ))
                }
                Ok(Ok(())) => {
                    if !stop.is_asked() {
                        let source = name.clone();
                        let _ = events.send(ServiceEvent::SourceEnded { source });
                    }
                    out.end();
                    return;
                }
                Ok(Err(error)) => error,
                Err(panic) => ConnectorError::new(format_args!(
                    "its code panicked: {}; tell its author",
                    panic_message(&*panic)
                )),
            };
            out.away();
            if began.elapsed() >= BACK_OFF.1 {
                pause = BACK_OFF.0;
            }
            out.counts().restarts.fetch_add(1, Ordering::Relaxed);
            let again = pause.mul_f64(jitter(&name, out.counts().restarts.load(Ordering::Relaxed)));
            let _ = events.send(ServiceEvent::SourceFailed {
                source: name.clone(),
                error,
                again_s: again.as_secs_f64(),
            });
            if !stop.wait(again) {
                out.end();
                return;
            }
            pause = (pause * 2).min(BACK_OFF.1);
        }
    }
}

/// Between 0.8 and 1.2, another for each machine and time, so that a fleet does not come back at once.
fn jitter(name: &str, count: u64) -> f64 {
    use std::hash::{BuildHasher, Hasher, RandomState};
    let mut hasher = RandomState::new().build_hasher();
    hasher.write(name.as_bytes());
    hasher.write_u64(count);
    0.8 + 0.4 * (hasher.finish() >> 11) as f64 / (1_u64 << 53) as f64
}
