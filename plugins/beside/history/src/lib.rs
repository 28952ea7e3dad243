//! What a service gave: ten minutes whole and a day in stretches of ten seconds, in memory that is bounded, kept over restarts.
//!
//! | part | decides |
//! |---|---|
//! | [`settings`] | what `[history]` says, and the threads |
//! | `columns` | which channels are kept: outputs and what is measured first |
//! | `store` | what is kept of them, and for how long |
//! | `asked` | how that is cut into stretches for a picture, without losing an extreme |
//! | `files` | how it stands beside the journal |
//!
//! The journal has samples and hashes and no outputs. What came after the last write is stepped again, beside the service.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod asked;
mod columns;
mod files;
pub mod settings;
mod store;

use athermal_http::{Answerer, Gives, Route};

pub use asked::{Channel, Stretches};

athermal_serve::register_companion!(settings::History, "history");

athermal_http::mount!(
    Route::get(
        "/v1/history",
        "What was measured and put out: lowest, highest and last of each stretch. Without a channel, what is kept.",
        Gives::json::<Stretches>(),
        Answerer::Beside(asked::answer),
    )
    .asked_with(&[
        ("channel", "An output or a channel. May stand several times."),
        ("from", "From this instant on, in s since 1970; ten minutes before the end without."),
        ("to", "Up to this instant; the newest without."),
        ("points", "How many stretches at most, up to 2,000; 600 without."),
    ])
);
