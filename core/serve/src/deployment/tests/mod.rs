//! What a machine file says is read, or what is wrong with it is reported at its place.

mod kinds;
mod mistakes;
mod readings;

use athermal_features as _;

use super::Deployment;
use crate::compile::{Wanted, compile};
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::{Memory, declare, load};

/// A machine with two sensors of temperature, one of them optional, and two axes.
const MACHINE: &str = r#"schema = 1
[sets]
axis = ["X", "Y"]
[signals.temperature]
unit = "Cel"
channels = ["plate", "room"]
optional = ["room"]
column = "T_{channel}"
max_age = "3min"
[signals.position]
unit = "nm"
channels = "axis"
max_age = "3min"
[nodes.trend]
type = "slope"
inputs.signal = "temperature"
windows = ["5min"]
unit = "K/min"
[nodes.before]
type = "lag"
inputs.signal = "position"
lags = ["1min"]
[outputs]
trend = "trend"
correction = "before"
"#;

/// What a machine file with these lines behind [`MACHINE`] says, or all that is wrong with it, each with the text at its place.
fn read(lines: &str) -> Result<Deployment, Vec<String>> {
    let text = format!("{MACHINE}{lines}");
    read_from(&Memory::new().with("site/machine.toml", text))
}

/// What `site/machine.toml` of these files says, or all that is wrong with it.
fn read_from(files: &Memory) -> Result<Deployment, Vec<String>> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let path = std::path::Path::new("site/machine.toml");
    let graph = load(path, files, &mut sources, &mut diagnostics)
        .and_then(|document| declare(document, &mut diagnostics))
        .expect("its declarations have no mistake");
    let plan = compile(&graph, Wanted::default(), &mut diagnostics);
    let plan = plan.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 100)));
    let mut found = Diagnostics::new();
    let deployment = Deployment::read(&graph, &plan, &sources, &mut found);
    assert_eq!(deployment.is_none(), found.has_errors());
    deployment.ok_or_else(|| {
        let shown = found.iter().map(|of| {
            let at = of.place.map_or("", |place| sources.slice(place));
            let help = of.help.as_deref().unwrap_or_default();
            format!("{} at `{at}`: {}; {help}", of.code, of.message)
        });
        shown.collect()
    })
}
