use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Registered in a role that it does not have.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Difference {}

athermal_core::register!(Difference, Feature, "difference");

fn main() {}
