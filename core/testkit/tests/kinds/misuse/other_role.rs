use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Registered in a role that there is not.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Difference {}

athermal_core::register!(Difference, Featuer, "difference");

fn main() {}
