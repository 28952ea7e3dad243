//! What a machine file says about a service: its sources and sinks, and how ticks are cut.

mod channels;
mod describe;
mod keys;
mod look;
pub mod problem;
mod runtime;
mod schema;
mod secret;
mod sinks;
mod size;
mod sources;

pub(crate) use keys::read as read_keys;
pub use look::Found;
pub use runtime::{Keep, Runtime};
pub use schema::schemas;
pub use secret::{Login, Secret};
pub use size::Size;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration as Wait;

use athermal_run::recording::{ThinnedChannels, Thinning};

use crate::companion::{Companion, CompanionKind};
use crate::compile::{Plan, SourceChannel};
use crate::connector::{
    Mapped, Sink, SinkKind, SinkWiring, Source, SourceKind, SourceWiring, WiredChannel, WiredOutput,
};
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::GraphFile;
use crate::registry::{self, Registered};
use crate::sequencer::ClockRule;
use crate::service::usual_state;
use crate::time::{Duration, Instant};
use crate::unit::Unit;

/// The sections that a deployment is read from.
pub const SECTIONS: [&str; 3] = ["sources", "sinks", "runtime"];

/// What a machine file says about a service.
#[derive(Debug)]
pub struct Deployment {
    /// `[runtime]`.
    pub runtime: Runtime,
    /// `[sources.NAME]`, in the order of the file.
    pub sources: Vec<DeclaredSource>,
    /// `[sinks.NAME]`, in the order of the file.
    pub sinks: Vec<DeclaredSink>,
    /// What runs beside the service, by its sections.
    pub companions: Vec<Box<dyn Companion>>,
}

/// A source that a machine file declares.
#[derive(Debug)]
pub struct DeclaredSource {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static Registered<SourceKind>,
    /// Its parameters.
    pub parameters: Box<dyn Source>,
    /// The folder of the file in which its `path` stands, if it has one: relative paths start there.
    pub folder: PathBuf,
    /// A source that is away so long is not waited for.
    pub silent: Duration,
    /// The longest pause after a failure.
    pub retry: Duration,
    /// How its clock is judged; not at all without.
    pub clock: Option<ClockRule>,
    /// How it is thinned before the graph; not at all without.
    pub thinning: Option<Thinning>,
    /// The channels that it gives.
    pub channels: Vec<DeclaredChannel>,
}

/// A channel that a source gives.
#[derive(Debug, Clone)]
pub struct DeclaredChannel {
    /// The channel as the graph knows it.
    pub channel: SourceChannel,
    /// Where the source has it: a column, a topic, a node.
    pub address: String,
    /// Which of the source's own mappings names it.
    pub mapped: Option<Mapped>,
    /// The unit of the channel from that of the source: `value * factor + offset`; none where it is the same.
    pub conversion: Option<(f64, f64)>,
    /// A sample no later than this is given to the next tick.
    pub late: Duration,
}

/// A sink that a machine file declares.
#[derive(Debug)]
pub struct DeclaredSink {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static Registered<SinkKind>,
    /// Its parameters.
    pub parameters: Arc<dyn Sink>,
    /// As of a source.
    pub folder: PathBuf,
    /// The columns of the outputs that it is given, as `run` writes them, in order.
    pub outputs: Vec<String>,
    /// The longest pause after a failure.
    pub retry: Duration,
    /// A tick that lies further behind is not put out; for commands 5 s unless the file says otherwise.
    pub behind: Option<Duration>,
    /// By how much a command may change per second, in the unit of each output; without bound where there is none.
    pub rate: Vec<Option<f64>>,
}

fn wait(of: Duration) -> Wait {
    Wait::from_nanos(of.as_ns().max(0) as u64)
}

impl DeclaredSource {
    /// What it is asked for, with nothing known before. `state` is the folder of the service.
    #[must_use]
    pub fn wiring(&self, plan: &Plan, state: &Path) -> SourceWiring {
        let unit = |name: &str| {
            let mut channels = plan.sources.iter().zip(&plan.channels);
            let found = channels.find(|(of, _)| of.name == name);
            found.map_or_else(Unit::one, |(_, of)| of.channel.unit.clone())
        };
        let channel = |of: &DeclaredChannel| WiredChannel {
            unit: unit(&of.channel.name),
            channel: of.channel.clone(),
            address: of.address.clone(),
            mapped: of.mapped.clone(),
            conversion: of.conversion,
            after: Instant::MIN,
        };
        SourceWiring {
            name: self.name.clone(),
            machine: plan.name.clone(),
            state: state.join("sources").join(&self.name),
            folder: self.folder.clone(),
            channels: self.channels.iter().map(channel).collect(),
            silent: wait(self.silent),
            retry: wait(self.retry),
            time: plan.time.clone(),
            table: plan.table.clone(),
        }
    }
}

impl DeclaredSink {
    /// What it is given, by the columns that it has. `state` is the folder of the service.
    #[must_use]
    pub fn wiring(&self, plan: &Plan, state: &Path) -> SinkWiring {
        let unit = |name: &String| {
            let output = plan.outputs.iter().find(|of| of.name == *name)?;
            Some(plan.channels[output.slot].channel.unit.text().to_owned())
        };
        let output = |name: &String| WiredOutput {
            name: name.clone(),
            unit: unit(name),
        };
        SinkWiring {
            name: self.name.clone(),
            machine: plan.name.clone(),
            state: state.join("sinks").join(&self.name),
            folder: self.folder.clone(),
            outputs: self.outputs.iter().map(output).collect(),
            time: plan.time.clone(),
            retry: wait(self.retry),
        }
    }
}

impl Deployment {
    /// The folder that a service of this machine file keeps its state in.
    #[must_use]
    pub fn state(&self, machine: &Path) -> PathBuf {
        let named = self.runtime.state.clone();
        named.unwrap_or_else(|| usual_state(machine))
    }

    /// The channels that are thinned before the graph, for whoever reads them elsewhere.
    #[must_use]
    pub fn thinned(&self) -> Vec<ThinnedChannels> {
        let of = |source: &DeclaredSource| {
            let channels = source.channels.iter().map(|of| of.channel.name.clone());
            Some(ThinnedChannels {
                thinning: source.thinning?,
                channels: channels.collect(),
            })
        };
        self.sources.iter().filter_map(of).collect()
    }

    /// What a graph that has been compiled to a plan says of its deployment. `files` are those that it was read from: relative paths
    /// start at the file in which they stand. All mistakes are reported; without one there is a deployment.
    pub fn read(
        graph: &GraphFile,
        plan: &Plan,
        files: &Sources,
        diagnostics: &mut Diagnostics,
    ) -> Option<Self> {
        let deployment = Self::check(graph, plan, files, diagnostics);
        if graph.deployment.contains_key("sources") {
            return deployment;
        }
        diagnostics.report(graph.tree.place, problem::NoSources {});
        None
    }

    /// As [`read`](Self::read), of a graph that need not have sources: it may be one that others extend.
    pub fn check(
        graph: &GraphFile,
        plan: &Plan,
        files: &Sources,
        diagnostics: &mut Diagnostics,
    ) -> Option<Self> {
        let before = diagnostics.error_count();
        let section = |name: &str| graph.deployment.get(name);
        let runtime = runtime::read(section("runtime"), files, diagnostics);
        let sources = section("sources")
            .map(|section| sources::read(section, graph, plan, files, diagnostics))
            .unwrap_or_default();
        let sinks = section("sinks")
            .map(|section| sinks::read(section, graph, plan, files, diagnostics))
            .unwrap_or_default();
        let mut companions = Vec::new();
        for kind in registry::all::<CompanionKind>() {
            let found = section(kind.name);
            if let (Some(value), Err(why)) = (found, registry::find::<CompanionKind>(kind.name)) {
                diagnostics.report(value.place, problem::KindTwice { why });
                break;
            }
            let what = format!("`[{}]`", kind.name);
            let companion = (kind.read)(found, &what, diagnostics);
            if let (Some(section), Some(companion)) = (found, &companion) {
                companion.check(section, plan, &sinks, diagnostics);
            }
            companions.extend(companion);
        }
        let deployment = Self {
            runtime: runtime?,
            sources,
            sinks,
            companions,
        };
        (diagnostics.error_count() == before).then_some(deployment)
    }
}

#[cfg(test)]
mod tests;
