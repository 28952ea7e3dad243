//! Logs, scores and messages that users brought: what was wrong, or led nowhere, and others of its kind.

mod ages;
mod cases;
mod dates;
mod homings;
mod layouts;
mod random_forms;
mod scored_outputs;
