//! Predicts and corrects the thermal drift of precision machines.
//!
//! A graph file wires measurements through features, estimators and combiners; it is fitted on history, scored, and then
//! run, live or from a loop of one's own:
//!
//! ```no_run
//! use athermal::{Instant, Model};
//!
//! let mut engine = Model::load("model.json")?.engine()?;
//! let samples = [21.5, 21.4]; // one per measured channel, NaN where there is no new value
//! let predicted = engine.step(Instant::from_ns(10_000_000_000), &samples)?;
//! println!("{predicted:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! This package links every built-in plugin: whoever uses it can load any graph that the command line can.
//!
//! The command line stands behind the default feature `cli`; diagnosis, charts and reports behind `analysis`, which `cli` implies.
//! An embedder with `default-features = false` compiles neither: 132 crates instead of 222.

pub use athermal_core as core;
pub use athermal_core::engine::{Engine, EngineError};
pub use athermal_core::time::{Duration, Instant};
pub use athermal_files as files;
pub use athermal_run as run;
pub use athermal_run::model::{Model, ModelError};
pub use athermal_serve as serve;
pub use athermal_trial as trial;

#[cfg(feature = "cli")]
pub use athermal_jobs as jobs;

#[cfg(feature = "analysis")]
pub use athermal_analysis::{chart, diagnosis, drawing, report};

#[cfg(feature = "cli")]
#[macro_use(print, println)]
extern crate athermal_command;

#[cfg(feature = "cli")]
mod checkout;
#[cfg(feature = "cli")]
mod command;
#[cfg(feature = "cli")]
mod invocation;
#[cfg(feature = "cli")]
mod meant;
#[cfg(feature = "cli")]
mod program;
#[cfg(feature = "cli")]
pub mod schema;

#[cfg(feature = "cli")]
pub use program::{command_line, command_line_of};

#[cfg(feature = "cli")]
use athermal_command::{message, output, terminal};

// The commands use what the library offers to everybody by the name that everybody uses.
#[cfg(feature = "cli")]
extern crate self as athermal;

// A plugin that no code names is left out by the linker.
#[cfg(all(unix, feature = "cli"))]
use athermal_alarms as _;
#[cfg(feature = "parquet")]
use athermal_arrow as _;
use athermal_combiners as _;
use athermal_connectors as _;
use athermal_control as _;
#[cfg(any(feature = "influx", feature = "postgres"))]
use athermal_databases as _;
use athermal_estimators as _;
#[cfg(feature = "cli")]
use athermal_export as _;
use athermal_features as _;
#[cfg(feature = "cli")]
use athermal_fleet as _;
#[cfg(all(unix, feature = "cli"))]
use athermal_history as _;
#[cfg(all(unix, feature = "cli"))]
use athermal_http as _;
use athermal_kinematics as _;
#[cfg(all(unix, feature = "cli"))]
use athermal_log as _;
#[cfg(feature = "mqtt")]
use athermal_mqtt as _;
#[cfg(feature = "opcua")]
use athermal_opcua as _;
#[cfg(all(unix, feature = "cli"))]
use athermal_page as _;
#[cfg(all(unix, feature = "cli"))]
use athermal_retrain as _;
use athermal_simulation as _;
#[cfg(feature = "sparkplug")]
use athermal_sparkplug as _;
#[cfg(all(unix, feature = "cli"))]
use athermal_systemd as _;
#[cfg(all(unix, feature = "top"))]
use athermal_top as _;

// What features bring, where they were left out.
#[cfg(not(feature = "mqtt"))]
mod without_mqtt {
    use athermal_serve::connector::{SinkKind, SourceKind};

    athermal_core::lacks!(SourceKind, "mqtt", "mqtt");
    athermal_core::lacks!(SinkKind, "mqtt", "mqtt");
    #[cfg(feature = "cli")]
    athermal_core::lacks!(athermal_command::Scheme, "mqtt", "mqtt", "mqtts");
}
#[cfg(not(feature = "influx"))]
athermal_core::lacks!(athermal_serve::connector::SinkKind, "influx", "influx");
#[cfg(not(feature = "postgres"))]
athermal_core::lacks!(athermal_serve::connector::SinkKind, "postgres", "postgres");
#[cfg(not(feature = "sparkplug"))]
mod without_sparkplug {
    use athermal_serve::connector::{SinkKind, SourceKind};

    athermal_core::lacks!(SourceKind, "sparkplug", "sparkplug");
    athermal_core::lacks!(SinkKind, "sparkplug", "sparkplug");
}
#[cfg(not(feature = "opcua"))]
mod without_opcua {
    use athermal_serve::connector::{SinkKind, SourceKind};

    athermal_core::lacks!(SourceKind, "opcua", "opcua");
    athermal_core::lacks!(SinkKind, "opcua", "opcua");
    #[cfg(feature = "cli")]
    athermal_core::lacks!(athermal_command::Scheme, "opcua", "opc.tcp");
    #[cfg(feature = "cli")]
    athermal_core::lacks!(athermal_command::CommandKind, "opcua", "trust");
}
#[cfg(all(feature = "cli", not(all(unix, feature = "top"))))]
athermal_core::lacks!(athermal_command::CommandKind, "top", "top");
#[cfg(not(feature = "parquet"))]
athermal_core::lacks!(athermal_serve::connector::SinkKind, "parquet", "parquet");
#[cfg(not(all(unix, feature = "cli")))]
athermal_core::lacks!(
    athermal_core::document::Section,
    "cli",
    "alarms",
    "control",
    "history",
    "page",
    "retrain"
);

/// The pages of the guide, so that their code is compiled and run as tests.
#[cfg(doctest)]
mod guide {
    #[doc = include_str!("../docs/src/feature.md")]
    struct Feature;
    #[doc = include_str!("../docs/src/estimator.md")]
    struct Estimator;
    #[doc = include_str!("../docs/src/combiner.md")]
    struct Combiner;
    #[doc = include_str!("../docs/src/source.md")]
    struct Source;
    #[doc = include_str!("../docs/src/machine.md")]
    struct Machine;
}
