//! The thread of a source: runs it, and starts it again after a failure.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::time::{Duration as Wait, Instant as Clock};

use super::ServiceEvent;
use crate::bell::Mailbox;
use crate::connector::{BackOff, ConnectorError, Inlet, Outflow, Stop};
use crate::diagnostic::panic_message;
use crate::time::Duration;

/// A source at work.
pub(super) struct SourceThread {
    pub(super) name: String,
    pub(super) inlet: Box<dyn Inlet>,
    pub(super) out: Outflow,
    /// The end of one run, asked for where it is connected and silent.
    pub(super) run: Stop,
    /// How long that may be.
    pub(super) silent: Duration,
    /// The longest pause after a failure.
    pub(super) retry: Wait,
}

impl SourceThread {
    /// Runs the source until it ends or is to stop.
    pub(super) fn run(self, stop: &Stop, events: &Mailbox<ServiceEvent>) {
        let Self {
            name,
            mut inlet,
            mut out,
            run,
            silent,
            retry,
        } = self;
        let mut back_off = BackOff::up_to(retry);
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
                        out.finish();
                        events.send(ServiceEvent::SourceEnded { source });
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
            out.counts().restarts.fetch_add(1, Ordering::Relaxed);
            let again = back_off.after(began.elapsed());
            events.send(ServiceEvent::SourceFailed {
                source: name.clone(),
                error,
                again_s: again.as_secs_f64(),
            });
            if !stop.wait(again) {
                out.end();
                return;
            }
        }
    }
}
