//! `[page]`: what the page says of each axis, where that does not follow from the graph.

use std::sync::{Arc, Mutex};

use athermal_core::compile::Plan;
use athermal_core::diagnostic::Diagnostics;
use athermal_core::document::Value;
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::ConnectorError;
use athermal_serve::deployment::DeclaredSink;
use athermal_serve::shown::{Shown, place_of};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::now::{Looker, Now};

/// What the page says of each axis: each key names an output or a channel, or the beginning of their names before the axis, such as
/// `now` for `now.X` and `now.Z`. Without a key it is what nodes of the kinds `stability`, `optical_loss` and `compensate` say, and
/// without those it is left out.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Page {
    /// How the axis drifts.
    pub drift: Option<String>,
    /// What is left of that after the correction.
    pub left: Option<String>,
    /// Other than 0 while the axis is stable.
    pub stable: Option<String>,
    /// Other than 0 while the axis may be measured.
    pub may_measure: Option<String>,
}

impl Page {
    /// The keys with what they name.
    pub(crate) fn named(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let keys = [
            ("drift", &self.drift),
            ("left", &self.left),
            ("stable", &self.stable),
            ("may_measure", &self.may_measure),
        ];
        keys.into_iter()
            .filter_map(|(key, of)| Some((key, of.as_deref()?)))
    }
}

impl Companion for Page {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        let now = Arc::new(Mutex::new(Now::new(self.clone())));
        beside.observe(Box::new(Looker::new(Arc::clone(&now))));
        beside.shared.give(now);
        Ok(Box::new(()))
    }

    fn check(
        &self,
        section: &Value,
        plan: &Plan,
        _: &[DeclaredSink],
        diagnostics: &mut Diagnostics,
    ) {
        for (key, name) in self.named() {
            let place = place_of(section, key);
            let _ = Shown::declared(plan, (name, place), "[page]", diagnostics);
        }
    }
}
