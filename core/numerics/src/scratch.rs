//! Room for what is worked out on the way. Decides that it does not count: things that differ in nothing else are equal.

/// Numbers that mean nothing between two calls.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scratch(pub(crate) Vec<f64>);

impl PartialEq for Scratch {
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}
