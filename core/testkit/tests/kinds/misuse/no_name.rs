use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Registered without a name.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Difference {}

athermal_core::register!(Difference, Feature);

fn main() {}
