//! Decides what becomes of a check that panics.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// How a finding says that it is a panic.
pub(super) const PANICS: &str = "it panics: ";

/// What a check finds; a panic in it is a finding too.
pub(super) fn tried<T>(check: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(check)).unwrap_or_else(|panic| {
        let said = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied());
        Err(format!("{PANICS}{}", said.unwrap_or("without a message")))
    })
}
