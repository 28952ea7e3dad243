//! A service under systemd.
//!
//! | when | what |
//! |---|---|
//! | it answers, which it does once its state is restored and its socket is up | `READY=1` |
//! | every half of `WatchdogSec=`, if the engine thread has gone round since | `WATCHDOG=1`, and a line for `systemctl status` |
//! | it ends | `STOPPING=1` |
//! | SIGHUP comes | the machine file as it is now is staged and committed; with mistakes what runs goes on |
//!
//! The watchdog asks the thread that owns the service for the beat of the engine thread. So neither of the two hangs unnoticed, and a
//! timer that would go on by itself feeds nothing.

#![cfg_attr(test, allow(clippy::unwrap_used))]

#[cfg(test)]
mod tests;

use std::io;
use std::thread::JoinHandle;
use std::time::Duration as Wait;

use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::{ConnectorError, Stop};
use athermal_serve::register_companion;
use athermal_serve::service::{Service, ServiceEvent};
use schemars::JsonSchema;
use sd_notify::NotifyState;
use serde::Deserialize;
use signal_hook::consts::SIGHUP;
use signal_hook::iterator::{Handle, Signals};

/// How often a line for `systemctl status` is given where there is no watchdog.
const LINES: Wait = Wait::from_secs(5);
/// How often readiness is asked for at the start.
const START: Wait = Wait::from_millis(100);

/// What makes a service one of systemd. It has no section: systemd says by the environment what it wants.
#[derive(Debug, Default, Deserialize, JsonSchema)]
pub struct Systemd {}

register_companion!(Systemd, "");

impl Companion for Systemd {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        let failed = |error: io::Error| ConnectorError::new(format_args!("systemd: {error}"));
        let stop = Stop::default();
        let mut running = Running {
            stop: stop.clone(),
            signals: None,
            threads: Vec::new(),
        };
        let spawn = |name: &str, work: Box<dyn FnOnce() + Send>| {
            std::thread::Builder::new()
                .name(name.to_owned())
                .spawn(work)
        };
        if std::env::var_os("NOTIFY_SOCKET").is_some() {
            let (beside, stop) = (beside.clone(), stop.clone());
            let notify = spawn("systemd", Box::new(move || notify(&beside, &stop)));
            running.threads.push(notify.map_err(failed)?);
        }
        if hears_hangups() {
            let mut signals = Signals::new([SIGHUP]).map_err(failed)?;
            running.signals = Some(signals.handle());
            let beside = beside.clone();
            let reloads = Box::new(move || {
                for _ in signals.forever() {
                    reload(&beside);
                }
            });
            running
                .threads
                .push(spawn("reload", reloads).map_err(failed)?);
        }
        Ok(Box::new(running))
    }
}

/// Until this is dropped.
struct Running {
    stop: Stop,
    signals: Option<Handle>,
    threads: Vec<JoinHandle<()>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = sd_notify::notify(&[NotifyState::Stopping]);
        self.stop.ask();
        if let Some(signals) = &self.signals {
            signals.close();
        }
        // They may ask a service that no longer answers, and are not waited for.
        self.threads.clear();
    }
}

/// Whether SIGHUP is not ignored, as it is under `nohup`.
fn hears_hangups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_none_or(|mask| mask >> (SIGHUP - 1) & 1 == 0)
}

/// Stages the machine file as it is now, and commits it; what comes of it is an event of the service.
fn reload(beside: &Beside) {
    let event = match athermal_http::reload(beside, "SIGHUP") {
        Ok(None) => return,
        Ok(Some((revision, carry))) => ServiceEvent::Staged { revision, carry },
        Err(reason) => ServiceEvent::NotStaged(reason),
    };
    let _ = beside
        .handle
        .ask(LINES, move |service| service.report(event));
}

/// Gives systemd what it wants to know, until the service ends.
fn notify(beside: &Beside, stop: &Stop) {
    let watchdog = sd_notify::watchdog_enabled();
    let every = watchdog.map_or(LINES, |limit| limit / 2);
    let (mut is_ready, mut last) = (false, None);
    loop {
        if let Ok((beat, line)) = beside
            .handle
            .ask(every, |service| (service.beat(), line(service)))
        {
            let mut states = vec![NotifyState::Status(&line)];
            if !is_ready {
                states.push(NotifyState::Ready);
                is_ready = true;
            }
            // Fed by progress alone.
            if last != Some(beat) {
                states.push(NotifyState::Watchdog);
            }
            last = Some(beat);
            let _ = sd_notify::notify(&states);
        }
        if !stop.wait(if is_ready { every } else { START }) {
            return;
        }
    }
}

fn line(service: &Service) -> String {
    let snapshot = service.snapshot();
    let revision = service.running().map_or("none", |of| of.revision);
    let journal = match service.journal().is_degraded {
        true => ", without a journal",
        false => "",
    };
    format!("{} ticks, graph {revision}{journal}", snapshot.ticks)
}
