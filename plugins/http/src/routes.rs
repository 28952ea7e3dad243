//! What is answered.

use std::sync::Arc;
use std::time::Duration as Wait;

use athermal_core::time::Duration;
use athermal_run::live::Staged;
use athermal_run::model::Model;
use athermal_serve::companion::Beside;
use athermal_serve::service::{CommitError, NoAnswer, Service};
use http_body_util::{BodyExt as _, Limited};
use hyper::body::Incoming;
use hyper::header::{ALLOW, HeaderValue};
use hyper::{Method, Request, StatusCode};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tokio::sync::Mutex;

use crate::answer::{Answer, Refused, json_of, text, with_body};
use crate::guard::Peer;
use crate::hub::Hub;
use crate::metrics;
use crate::reload::{revision, running};
use crate::server::not_understood;
use crate::stage::{Given, load, of_file};
use crate::status;
use crate::stream::{Life, Stream, Wanted};

/// The interface, as OpenAPI describes it.
pub const OPENAPI: &str = include_str!("openapi.json");

/// All that is answered: method and path.
pub static ROUTES: [(&str, &str); 16] = [
    ("GET", "/v1/status"),
    ("GET", "/v1/channels"),
    ("GET", "/v1/outputs"),
    ("GET", "/v1/nodes"),
    ("GET", "/v1/events"),
    ("GET", "/v1/openapi.json"),
    ("GET", "/metrics"),
    ("POST", "/v1/stage"),
    ("POST", "/v1/shadow"),
    ("POST", "/v1/commit"),
    ("POST", "/v1/rollback"),
    ("POST", "/v1/discard"),
    ("POST", "/v1/freeze"),
    ("POST", "/v1/thaw"),
    ("POST", "/v1/snapshot"),
    ("POST", "/v1/stop"),
];

/// How large a body may be.
const BODY: usize = 8 << 20;
/// How long a body may take.
const BODY_TIME: Wait = Wait::from_secs(20);
/// How long the service may take to answer.
const PATIENCE: Wait = Wait::from_secs(60);

/// What answers.
pub struct Routes {
    beside: Beside,
    hub: Arc<Hub>,
    /// The revision that ran when its model was read last, and when that was fitted.
    fitted: Mutex<(Option<String>, Option<String>)>,
}

/// `POST /v1/shadow`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShadowOrder {
    duration: Duration,
    /// 0.05 for 5 %.
    #[serde(default)]
    margin: f64,
    #[serde(default)]
    commit: bool,
}

/// An order without parameters.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Nothing {}

impl Routes {
    pub fn new(beside: Beside, hub: Arc<Hub>) -> Self {
        let fitted = Mutex::default();
        Self {
            beside,
            hub,
            fitted,
        }
    }

    pub fn hub(&self) -> &Hub {
        &self.hub
    }

    /// Answers a request.
    pub async fn answer(
        &self,
        request: Request<Incoming>,
        peer: &Peer,
        life: &Life,
    ) -> Result<Answer, Refused> {
        let (parts, body) = request.into_parts();
        peer.check(&parts.method, &parts.headers)?;
        let path = parts.uri.path();
        let known = ROUTES.iter().find(|(_, known)| *known == path);
        let Some((method, _)) = known else {
            return Err(nothing_here());
        };
        if parts.method.as_str() != *method {
            let words = format!("this takes {method}");
            let mut answer = Answer::from(Refused::new(StatusCode::METHOD_NOT_ALLOWED, &words));
            answer
                .headers_mut()
                .insert(ALLOW, HeaderValue::from_static(method));
            return Ok(answer);
        }
        if parts.method == Method::GET {
            return self
                .get(path, parts.uri.query().unwrap_or_default(), life)
                .await;
        }
        let body = tokio::time::timeout(BODY_TIME, Limited::new(body, BODY).collect());
        let body = body
            .await
            .map_err(|_| Refused::new(StatusCode::REQUEST_TIMEOUT, "the body takes too long"))?;
        let body = body.map_err(
            |error| match error.is::<http_body_util::LengthLimitError>() {
                true => Refused::new(StatusCode::PAYLOAD_TOO_LARGE, "a body has at most 8 MB"),
                false => not_understood("the body ends before its end"),
            },
        )?;
        self.post(path, &body.to_bytes(), peer.name()).await
    }

    async fn get(&self, path: &str, query: &str, life: &Life) -> Result<Answer, Refused> {
        let body = match path {
            "/v1/events" => {
                let wanted = wanted(query)?;
                let stream = Stream::new(self.hub.listen(), wanted, life.clone());
                let body = stream.boxed_unsync();
                return Ok(with_body(StatusCode::OK, "text/event-stream", body));
            }
            "/v1/openapi.json" => {
                return Ok(text(StatusCode::OK, "application/json", OPENAPI.to_owned()));
            }
            "/metrics" => {
                let (name, known) = (self.beside.name.clone(), self.hub.known());
                let turned_away = self.hub.count_turned_away();
                let created = self.created().await;
                let text_of = self.ask(move |service| {
                    metrics::text(&name, service, &known, turned_away, created.as_deref())
                });
                return Ok(text(StatusCode::OK, metrics::CONTENT_TYPE, text_of.await?));
            }
            "/v1/status" => {
                let (name, known) = (self.beside.name.clone(), self.hub.known());
                self.ask(move |service| status::status(&name, service, &known))
                    .await?
            }
            "/v1/channels" => self.ask(status::channels).await?,
            "/v1/outputs" => self.ask(status::outputs).await?,
            "/v1/nodes" => {
                let known = self.hub.known();
                self.ask(move |service| status::nodes(service, &known))
                    .await?
            }
            _ => return Err(nothing_here()),
        };
        Ok(json_of(StatusCode::OK, &body))
    }

    async fn post(&self, path: &str, body: &[u8], by: String) -> Result<Answer, Refused> {
        let body = match path {
            "/v1/stage" => {
                let given = match body.is_empty() {
                    // What the machine file has now.
                    true => of_file(&self.beside.machine),
                    false => read::<Given>(body)?,
                };
                self.stage(given, by).await?
            }
            "/v1/shadow" => {
                let ShadowOrder {
                    duration,
                    margin,
                    commit,
                } = read(body)?;
                if duration <= Duration::ZERO || !(0.0..1e3).contains(&margin) {
                    let words = "`duration` is to be longer than 0 s, and `margin` 0 or more";
                    return Err(not_understood(words));
                }
                self.swapped(move |service| service.shadow(duration, margin, commit, &by))
                    .await?;
                json!({ "duration": duration, "margin": margin, "commit": commit })
            }
            other => {
                if !body.is_empty() {
                    read::<Nothing>(body)?;
                }
                self.order(other, by).await?
            }
        };
        Ok(json_of(StatusCode::OK, &body))
    }

    async fn order(&self, path: &str, by: String) -> Result<Value, Refused> {
        Ok(match path {
            "/v1/commit" => {
                let commit = move |service: &mut Service| {
                    let staged = service.staged().map(|of| of.revision().to_owned());
                    service.commit(&by).map(|()| json!({ "revision": staged }))
                };
                self.swapped(commit).await?
            }
            "/v1/rollback" => {
                let rollback = move |service: &mut Service| {
                    let previous = service.previous().map(|of| of.revision().to_owned());
                    service
                        .rollback(&by)
                        .map(|()| json!({ "revision": previous }))
                };
                self.swapped(rollback).await?
            }
            "/v1/discard" => {
                self.swapped(move |service| service.discard(&by)).await?;
                json!({})
            }
            "/v1/freeze" | "/v1/thaw" => {
                let frozen = path == "/v1/freeze";
                let freeze = move |service: &mut Service| {
                    let what = if frozen { "frozen" } else { "thawed" };
                    service.note(&format!("{by}: learning {what}"));
                    service.freeze(frozen);
                };
                self.ask(freeze).await?;
                json!({ "frozen": frozen })
            }
            "/v1/snapshot" => {
                let taken = self.ask(move |service| service.checkpoint(&by)).await?;
                let words = "no checkpoint can be taken: nothing has been stepped since the last one, a graph is on its way, or ticks were missed";
                let taken = taken.ok_or_else(|| Refused::new(StatusCode::CONFLICT, words))?;
                json!({ "happenings": taken })
            }
            "/v1/stop" => {
                self.ask(move |service| service.ask_to_end(&by)).await?;
                json!({})
            }
            _ => return Err(nothing_here()),
        })
    }

    /// Stages what is given: it is read beside the service, so that nothing waits for a file.
    async fn stage(&self, given: Given, by: String) -> Result<Value, Refused> {
        let (_, running) = self.running().await;
        let loaded = blocking(move || load(given, running.as_ref())).await??;
        let doubts = loaded.doubts;
        let staged = self.swapped(move |service| {
            let staged = service.stage(&loaded.model, &by)?;
            Ok(report(staged))
        });
        let mut staged = staged.await?;
        staged["doubts"] = json!(doubts);
        Ok(staged)
    }

    /// What runs: its revision, and its model.
    async fn running(&self) -> (Option<String>, Option<Model>) {
        let beside = self.beside.clone();
        let running = blocking(move || running(&beside)).await;
        running.ok().and_then(Result::ok).unwrap_or_default()
    }

    /// When the model that runs was fitted. Its file is read once.
    async fn created(&self) -> Option<String> {
        let runs = self.ask(revision).await.ok()?;
        let mut fitted = self.fitted.lock().await;
        if fitted.0 != runs
            && let (revision, Some(model)) = self.running().await
        {
            *fitted = (revision, model.card.and_then(|of| of.created));
        }
        fitted.1.clone().filter(|_| fitted.0 == runs)
    }

    /// Has something done that may be refused.
    async fn swapped<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Service) -> Result<T, CommitError> + Send + 'static,
    ) -> Result<T, Refused> {
        let done = self.ask(move |service| work(service).map_err(|error| error.to_string()));
        let refused = |words: String| Refused::new(StatusCode::CONFLICT, &words);
        done.await?.map_err(refused)
    }

    async fn ask<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Service) -> T + Send + 'static,
    ) -> Result<T, Refused> {
        let handle = self.beside.handle.clone();
        let asked = blocking(move || handle.ask(PATIENCE, work)).await?;
        asked.map_err(|error| {
            let status = match error {
                NoAnswer::Busy | NoAnswer::Ended => StatusCode::SERVICE_UNAVAILABLE,
                NoAnswer::TooLate => StatusCode::GATEWAY_TIMEOUT,
            };
            Refused::new(status, &error.to_string())
        })
    }
}

fn nothing_here() -> Refused {
    let words = "nothing is here; /v1/openapi.json describes what there is";
    Refused::new(StatusCode::NOT_FOUND, words)
}

/// Does what waits on a thread for that.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Refused> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|_| Refused::new(StatusCode::INTERNAL_SERVER_ERROR, "it panicked"))
}

fn read<T: DeserializeOwned>(body: &[u8]) -> Result<T, Refused> {
    serde_json::from_slice(body).map_err(|error| not_understood(&format!("the body: {error}")))
}

/// `ticks=1`, `channel=NAME` as often as there are channels.
fn wanted(query: &str) -> Result<Wanted, Refused> {
    let mut wanted = Wanted::default();
    for part in query.split('&').filter(|part| !part.is_empty()) {
        match part.split_once('=') {
            Some(("ticks", "1")) => wanted.ticks = true,
            Some(("channel", name)) if wanted.channels.len() < 256 => {
                wanted.ticks = true;
                wanted.channels.push(decoded(name)?);
            }
            _ => {
                return Err(not_understood(
                    "`ticks=1` and `channel=NAME` are what there is",
                ));
            }
        }
    }
    Ok(wanted)
}

/// A part of a query without its escapes.
fn decoded(text: &str) -> Result<String, Refused> {
    let (mut bytes, mut rest) = (Vec::new(), text.as_bytes());
    while let Some((byte, after)) = rest.split_first() {
        rest = after;
        if *byte != b'%' {
            bytes.push(*byte);
            continue;
        }
        let code = rest.split_at_checked(2).and_then(|(code, after)| {
            rest = after;
            u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok()
        });
        bytes.push(code.ok_or_else(|| not_understood("an escape in the query is not right"))?);
    }
    String::from_utf8(bytes).map_err(|_| not_understood("the query is not UTF-8"))
}

/// What becomes of the nodes of a staged graph.
fn report(staged: &Staged) -> Value {
    use athermal_core::engine::Carry::Carried;
    let all = staged.carry();
    let carried = all.iter().filter(|node| node.outcome == Carried).count();
    let (past, silent) = staged.silent();
    json!({
        "revision": staged.revision(),
        "carried": carried,
        "nodes": all,
        "past_s": past.as_ns() as f64 / 1e9,
        "silent": silent,
        "endless": staged.endless().1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Bench, GRAPH};

    #[test]
    fn an_order_that_is_listed_and_not_known_is_refused_and_the_service_goes_on() {
        let bench = Bench::start(GRAPH, "");
        let beside = Beside {
            name: "line".to_owned(),
            machine: bench.path("machine.toml"),
            state: bench.path("state"),
            handle: bench.handle.clone(),
        };
        let routes = Routes::new(beside, Arc::default());
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        let answered =
            runtime
                .unwrap()
                .block_on(routes.post("/v1/restart", b"", "test".to_owned()));
        assert_eq!(answered.unwrap_err().status, StatusCode::NOT_FOUND);
        assert_eq!(bench.status()["state"], "running");
    }
}
