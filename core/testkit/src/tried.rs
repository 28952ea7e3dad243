//! Decides what becomes of a check that panics.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::diagnostic::panic_message;

/// How a finding says that it is a panic.
pub(super) const PANICS: &str = "it panics: ";

/// What a check finds; a panic in it is a finding too.
pub(super) fn tried<T>(check: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(check))
        .unwrap_or_else(|panic| Err(format!("{PANICS}{}", panic_message(&*panic))))
}
