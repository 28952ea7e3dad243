//! What the companion declares is known.

use athermal_command::CommandKind;
use athermal_core::registry::find;
use athermal_serve::companion::CompanionKind;
use athermal_serve::facts::guide;
use my_node as _;

#[test]
fn its_section_its_facts_its_events_its_page_and_its_command_are_known() {
    assert!(find::<CompanionKind>("my_node").is_ok());
    assert!(find::<CommandKind>("my-node").is_ok());
    for name in ["my_node_looks_total", "my_node_degraded"] {
        assert!(guide().contains(name), "{name}");
    }
    assert!(athermal_http::routes().any(|of| of.path == "/my_node"));
}
