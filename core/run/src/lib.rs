//! Data through the engine of athermal: fitting, scoring and live running step the same plan.
//!
//! Where rows come from and go to is the business of plugins; what a graph means is decided in `athermal-core`.
//!
//! | layer | decides |
//! |---|---|
//! | [`recording`] | what a data set offers to the layers below |
//! | [`model`] | a fitted graph, in one file |
//! | [`fit`], [`score`] | training the nodes of a graph, and judging what they predict |
//! | [`live`] | sources, sinks, running from one to the other; replacing a graph while it runs |

mod failure;
pub mod fit;
pub mod live;
pub mod model;
pub mod recording;
pub mod score;

// The layers below, by the names that they have for everybody.
use athermal_core::{
    channel, compile, diagnostic, document, engine, event, figures, message, node, quantity, time,
    unit,
};
