//! The sources of a service at its start: opened, and linked to the engine thread.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread::Thread;

use athermal_run::live::Feed;
use athermal_run::model::Model;

use super::source_thread::SourceThread;
use super::watch::Watch;
use super::{ServiceError, wait};
use crate::bell::{Bell, Mailbox};
use crate::connector::{Remarks, SourceCounts, SourceLink, Stop, link};
use crate::deployment::DeclaredSource;
use crate::journal::Progress;
use crate::time::{Duration, Instant};

/// How many arrivals of a source may wait for the engine thread.
const ARRIVALS: usize = 1 << 14;

/// Sources that have been opened.
pub(super) struct OpenSources {
    pub(super) inlets: Vec<SourceThread>,
    pub(super) links: Vec<SourceLink>,
    pub(super) counts: Vec<(String, Arc<SourceCounts>)>,
    pub(super) watches: Vec<Watch>,
    /// What they leave out, by their names.
    pub(super) heard: Receiver<(String, String)>,
}

/// Opens sources, which go on behind the newest stamps of the feed. `bounds` are `wait` and `future`.
pub(super) fn open(
    sources: Vec<DeclaredSource>,
    model: &Model,
    state: &Path,
    (feed, stamps): (&[Feed], &[Instant]),
    (engine, progress): (&Thread, &Arc<Progress>),
    bounds: (Duration, Duration),
) -> Result<OpenSources, ServiceError> {
    let (tell, heard) = channel();
    let tell = Mailbox::new(tell, &Bell::here());
    let mut open = OpenSources {
        inlets: Vec::new(),
        links: Vec::new(),
        counts: Vec::new(),
        watches: Vec::new(),
        heard,
    };
    let place = |name: &str| feed.iter().position(|of| of.name == name);
    let plan = &model.plan;
    for source in sources {
        let mut wiring = source.wiring(plan, state);
        // Each channel of a source is one of the feed.
        wiring
            .channels
            .retain(|of| place(&of.channel.name).is_some());
        let places = wiring
            .channels
            .iter()
            .filter_map(|of| place(&of.channel.name));
        let places: Vec<_> = places.map(|place| place as u32).collect();
        for (of, place) in wiring.channels.iter_mut().zip(&places) {
            of.after = stamps[*place as usize];
        }
        let (mut outflow, link) = link(
            ARRIVALS,
            &wiring.channels,
            &places,
            source.parameters.stamps(),
            (
                engine.clone(),
                Arc::clone(progress),
                Remarks::new(&source.name, &tell),
            ),
        );
        if let Some(thinning) = source.thinning {
            outflow.thin(thinning, bounds);
        }
        let inlet = source.parameters.open(wiring);
        let inlet = inlet.map_err(|error| ServiceError::Source {
            source: source.name.clone(),
            error,
        })?;
        let counts = Arc::clone(outflow.counts());
        let run = Stop::default();
        if source.parameters.is_watched() {
            let silent = wait(source.silent);
            open.watches.push(Watch::new(silent, &counts, &run));
        }
        open.counts.push((source.name.clone(), counts));
        open.links.push(link);
        open.inlets.push(SourceThread {
            name: source.name,
            inlet,
            out: outflow,
            run,
            silent: source.silent,
            retry: wait(source.retry),
        });
    }
    Ok(open)
}
