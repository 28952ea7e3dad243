//! What is answered, and why something is refused.

use std::convert::Infallible;

use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt as _, Full};
use hyper::body::Bytes;
use hyper::header::{CACHE_CONTROL, CONTENT_TYPE, HeaderValue, X_CONTENT_TYPE_OPTIONS};
use hyper::{Response, StatusCode};
use serde_json::{Value, json};

/// What is answered: whole, or as it comes.
pub type Answer = Response<UnsyncBoxBody<Bytes, Infallible>>;

/// Why something is refused.
#[derive(Debug)]
pub struct Refused {
    /// The status.
    pub status: StatusCode,
    /// Why, as JSON: `error` is a sentence.
    pub body: Value,
}

impl Refused {
    /// With a sentence for whoever asked.
    pub fn new(status: StatusCode, words: &str) -> Self {
        Self {
            status,
            body: json!({ "error": words }),
        }
    }
}

/// An object, or nothing but that it is done.
pub fn json_of(status: StatusCode, body: &Value) -> Answer {
    text(status, "application/json", format!("{body:#}\n"))
}

/// A text of a type.
pub fn text(status: StatusCode, content_type: &'static str, text: String) -> Answer {
    with_body(
        status,
        content_type,
        Full::<Bytes>::from(text).boxed_unsync(),
    )
}

/// A body of a type.
pub fn with_body(
    status: StatusCode,
    content_type: &'static str,
    body: UnsyncBoxBody<Bytes, Infallible>,
) -> Answer {
    let mut answer = Response::new(body);
    *answer.status_mut() = status;
    let headers = answer.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(content_type));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    answer
}

impl From<Refused> for Answer {
    fn from(refused: Refused) -> Self {
        json_of(refused.status, &refused.body)
    }
}
