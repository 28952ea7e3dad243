//! What a reference may not look like is told where it stands, and nothing that hangs on it is left out in silence.

use super::linear;
use super::mistakes::assert_told;
use crate::workbench::{Scratch, athermal};

#[test]
fn a_channel_in_brackets_is_no_reference_and_told_as_such_wherever_it_stands() {
    let inputs = linear().replace(
        "inputs.features = \"temperature\"",
        "inputs.features = \"temperature[room]\"",
    );
    let expected = [(20, "there is no node or signal `temperature[room]`")];
    assert_told("references-input", &inputs, &expected);
    let outputs = linear().replace(
        "predicted = \"thermal\"",
        "predicted = \"thermal[Z]\"\nmore = \"nothing[here]\"\nopen = \"thermal[\"\n",
    );
    let expected = [
        (25, "there is no node or signal `thermal[Z]`"),
        (26, "there is no node or signal `nothing[here]`"),
        (27, "there is no node or signal `thermal[`"),
    ];
    assert_told("references-output", &outputs, &expected);
    let scratch = Scratch::new("references-help");
    let graph = scratch.file("wrong.toml", inputs);
    athermal(&[&"check", &graph])
        .ended(2)
        .tells(&["a channel is written `temperature.room`, a port `temperature:room`"]);
}
