//! What a route is, and how a crate mounts one.

use std::borrow::Cow;

use athermal_serve::companion::Beside;
use athermal_serve::service::Service;
use hyper::StatusCode;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use crate::answer::Refused;

/// A route of the control interface.
#[derive(Debug)]
pub struct Route {
    /// `GET` for what is shown, `POST` for an order, which needs the token over TCP.
    pub method: &'static str,
    /// Its path, such as `/v1/status`.
    pub path: &'static str,
    /// What it is for.
    pub help: &'static str,
    /// What a query may have, and what that means.
    pub query: &'static [(&'static str, &'static str)],
    /// The schema of the body; none where there is none.
    pub body: Option<SchemaOf>,
    /// What it answers with.
    pub gives: Gives,
    /// How it is answered.
    pub answer: Answerer,
    /// Whether anybody may see it, since it says nothing of the machine.
    pub is_open: bool,
}

impl Route {
    /// What is shown at a path.
    #[must_use]
    pub const fn get(
        path: &'static str,
        help: &'static str,
        gives: Gives,
        answer: Answerer,
    ) -> Self {
        Self {
            method: "GET",
            path,
            help,
            query: &[],
            body: None,
            gives,
            answer,
            is_open: false,
        }
    }

    /// An order at a path, with the schema of its body.
    #[must_use]
    pub const fn post(
        path: &'static str,
        help: &'static str,
        body: SchemaOf,
        gives: Gives,
        answer: Answerer,
    ) -> Self {
        Self {
            method: "POST",
            body: Some(body),
            ..Self::get(path, help, gives, answer)
        }
    }

    /// The same with what a query may have, and what that means.
    #[must_use]
    pub const fn asked_with(self, query: &'static [(&'static str, &'static str)]) -> Self {
        Self { query, ..self }
    }

    /// The same for anybody to see.
    #[must_use]
    pub const fn open(self) -> Self {
        Self {
            is_open: true,
            ..self
        }
    }
}

/// A schema, among those of a description.
pub type SchemaOf = fn(&mut SchemaGenerator) -> Schema;

/// What a route answers with.
#[derive(Debug)]
pub enum Gives {
    /// JSON of a schema.
    Json(SchemaOf),
    /// A text of this type.
    Text(&'static str),
}

impl Gives {
    /// JSON of a type.
    #[must_use]
    pub const fn json<T: JsonSchema>() -> Self {
        Self::Json(|of| of.subschema_for::<T>())
    }
}

/// How a route is answered.
#[derive(Debug, Clone, Copy)]
pub enum Answerer {
    /// On the thread that owns the service, which must not wait.
    Service(fn(&mut Service, &Asked) -> Result<Reply, Refused>),
    /// On a thread that may wait, by what companions [share](Beside#structfield.shared).
    Beside(fn(&Beside, &Asked) -> Result<Reply, Refused>),
    /// By this crate: with a stream of what happens.
    #[doc(hidden)]
    Events,
    /// By this crate: a graph is read from files first.
    #[doc(hidden)]
    Stage,
}

/// What is asked.
#[derive(Debug)]
pub struct Asked {
    /// What stands behind `?`, as it is.
    pub query: String,
    /// The body.
    pub body: Vec<u8>,
    /// Who asks, as it stands in the journal.
    pub by: String,
}

impl Asked {
    /// The body as a type reads it; an empty one is `{}`.
    ///
    /// # Errors
    /// When it cannot.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, Refused> {
        let body = if self.body.is_empty() {
            b"{}"
        } else {
            &*self.body
        };
        serde_json::from_slice(body)
            .map_err(|error| Refused::not_understood(&format!("the body: {error}")))
    }

    /// The parts of the query, without their escapes.
    ///
    /// # Errors
    /// When one is no `KEY=VALUE`, or its escapes are not right.
    pub fn parts(&self) -> Result<Vec<(&str, String)>, Refused> {
        let parts = self.query.split('&').filter(|part| !part.is_empty());
        parts
            .map(|part| {
                let (key, value) = part
                    .split_once('=')
                    .ok_or_else(|| Refused::not_understood("a query is made of KEY=VALUE"))?;
                Ok((key, crate::routes::decoded(value)?))
            })
            .collect()
    }
}

/// What is answered.
#[derive(Debug)]
pub struct Reply {
    /// Its type.
    pub content_type: &'static str,
    /// It.
    pub text: Cow<'static, str>,
}

impl Reply {
    /// A text of a type, such as `text/html; charset=utf-8`.
    #[must_use]
    pub fn text(content_type: &'static str, text: impl Into<Cow<'static, str>>) -> Self {
        Self {
            content_type,
            text: text.into(),
        }
    }

    /// JSON.
    #[must_use]
    pub fn json(of: &impl Serialize) -> Self {
        Self::text("application/json", format!("{:#}\n", json!(of)))
    }
}

impl Refused {
    /// What is asked for is not understood.
    #[must_use]
    pub fn not_understood(words: &str) -> Self {
        Self::new(StatusCode::BAD_REQUEST, words)
    }

    /// There is nothing of the kind here.
    #[must_use]
    pub fn nothing_here(words: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, words)
    }

    /// It cannot be done now; what runs is untouched.
    #[must_use]
    pub fn not_now(words: &str) -> Self {
        Self::new(StatusCode::CONFLICT, words)
    }
}

/// A route of another crate.
#[derive(Debug)]
pub struct Mounted(pub Route);

inventory::collect!(Mounted);

/// All that is answered: what this crate answers first, then what others mount.
pub fn routes() -> impl Iterator<Item = &'static Route> {
    let mounted = inventory::iter::<Mounted>.into_iter();
    crate::routes::ROUTES.iter().chain(mounted.map(|of| &of.0))
}

/// Mounts what is shown at a path of the control interface: the path, what it is for, what it gives, and how it is answered.
///
/// ```
/// use athermal_http::{Asked, Gives, Refused, Reply};
/// use athermal_serve::service::Service;
///
/// fn page(service: &mut Service, _: &Asked) -> Result<Reply, Refused> {
///     Ok(Reply::text("text/plain", format!("{} ticks\n", service.snapshot().ticks)))
/// }
///
/// athermal_http::mount!("/ticks", "How many ticks there were.", Gives::Text("text/plain"), page);
/// # assert!(athermal_http::routes().any(|of| of.path == "/ticks"));
/// ```
#[macro_export]
macro_rules! mount {
    ($route:expr) => {
        $crate::__private::inventory::submit! { $crate::Mounted($route) }
    };
    ($path:literal, $help:literal, $gives:expr, $answer:path) => {
        $crate::__private::inventory::submit! {
            $crate::Mounted($crate::Route::get(
                $path,
                $help,
                $gives,
                $crate::Answerer::Service($answer),
            ))
        }
    };
}
