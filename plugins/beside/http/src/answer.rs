//! What is answered, and why something is refused.

use std::borrow::Cow;
use std::convert::Infallible;

use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt as _, Full};
use hyper::body::Bytes;
use hyper::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderValue, REFERRER_POLICY,
    RETRY_AFTER, WWW_AUTHENTICATE, X_CONTENT_TYPE_OPTIONS,
};
use hyper::{Response, StatusCode};
use serde_json::{Value, json};

/// What is answered: whole, or as it comes.
pub type Answer = Response<UnsyncBoxBody<Bytes, Infallible>>;

/// What a page may load: its own files, and nothing of others.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

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
pub fn text(
    status: StatusCode,
    content_type: &'static str,
    text: impl Into<Cow<'static, str>>,
) -> Answer {
    let bytes = match text.into() {
        Cow::Borrowed(text) => Bytes::from_static(text.as_bytes()),
        Cow::Owned(text) => Bytes::from(text),
    };
    with_body(status, content_type, Full::new(bytes).boxed_unsync())
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
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    answer
}

impl From<Refused> for Answer {
    fn from(refused: Refused) -> Self {
        let mut answer = json_of(refused.status, &refused.body);
        if refused.status == StatusCode::SERVICE_UNAVAILABLE {
            let soon = HeaderValue::from_static("1");
            answer.headers_mut().insert(RETRY_AFTER, soon);
        }
        if refused.status == StatusCode::UNAUTHORIZED {
            let how = HeaderValue::from_static("Bearer");
            answer.headers_mut().insert(WWW_AUTHENTICATE, how);
        }
        answer
    }
}
