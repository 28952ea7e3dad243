//! Decides what is told of a panic that was caught.

use std::any::Any;

/// What a panic says of itself.
#[must_use]
pub fn said(panic: &(dyn Any + Send)) -> &str {
    let owned = panic.downcast_ref::<String>().map(String::as_str);
    let said = owned.or_else(|| panic.downcast_ref::<&str>().copied());
    said.unwrap_or("it does not say why")
}
