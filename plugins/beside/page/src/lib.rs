//! The page of a running service, and what it says in sentences.
//!
//! | part | decides |
//! |---|---|
//! | [`settings`] | what `[page]` says |
//! | `axes` | what an axis of a graph is made of: its drift, what is left of it, whether it is stable, its correction |
//! | `now` | what is said of it now, and when nothing may be said any more |
//! | `contributions` | what a prediction is made of, by voter and sensor |
//! | `drawing` | the boxes of the graph and their places |
//!
//! The page itself is made in `web/` and stands in `dist/` as it is served, so that nothing but this crate is needed to build it.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod axes;
mod contributions;
mod drawing;
mod now;
pub mod settings;

use athermal_http::{Answerer, Gives, Reply, Route};

pub use now::{AxesNow, AxisNow};

athermal_serve::register_companion!(settings::Page, "page");

macro_rules! files {
    ($($path:literal $file:literal $of:literal $help:literal;)*) => {
        $(athermal_http::mount!(Route::get(
            $path,
            $help,
            Gives::Text($of),
            Answerer::Service(|_, _| Ok(Reply::text($of, include_str!(concat!("../dist/", $file))))),
        )
        .open());)*
    };
}

files! {
    "/" "index.html" "text/html; charset=utf-8" "The page of the service.";
    "/page.js" "page.js" "text/javascript; charset=utf-8" "What the page does.";
    "/page.css" "page.css" "text/css; charset=utf-8" "How the page looks.";
}

athermal_http::mount!(Route::get(
    "/v1/axes",
    "Each axis in a sentence: how it drifts, what is left of that, whether it is stable, whether it may be measured.",
    Gives::json::<AxesNow>(),
    Answerer::Service(now::answer),
));

athermal_http::mount!(Route::get(
    "/v1/graph",
    "The graph that runs, as boxes and arrows with their places.",
    Gives::json::<drawing::Drawn>(),
    Answerer::Service(drawing::answer),
));

athermal_http::mount!(
    Route::get(
        "/v1/contributions",
        "What a prediction is made of at the last tick, by voter and by sensor, while a stream of events is open.",
        Gives::json::<contributions::MadeOf>(),
        Answerer::Service(contributions::answer),
    )
    .asked_with(&[("output", "An output or a channel that is predicted.")])
);
