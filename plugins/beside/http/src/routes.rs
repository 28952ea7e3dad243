//! What this crate answers.

use std::sync::Arc;
use std::time::Duration as Wait;

use athermal_core::engine::{Carry, NodeCarry};
use athermal_core::time::Duration;
use athermal_run::live::Staged;
use athermal_serve::companion::Beside;
use athermal_serve::facts::{
    ChannelsFacts, Look, Metrics, NodesFacts, OutputsFacts, StatusFacts, TicksFacts, metrics,
};
use athermal_serve::service::{CommitError, NoAnswer, Service, ServiceEvent};
use http_body_util::{BodyExt as _, Limited};
use hyper::body::Incoming;
use hyper::header::{ALLOW, HeaderValue};
use hyper::{Method, Request, StatusCode};
use schemars::{JsonSchema, json_schema};
use serde::{Deserialize, Serialize};

use crate::answer::{Answer, Refused, text, with_body};
use crate::guard::{Peer, meant_for};
use crate::hub::Hub;
use crate::openapi::openapi;
use crate::reload::running;
use crate::route::{Answerer, Asked, Gives, Reply, Route, routes};
use crate::server::Crowd;
use crate::stage::{Given, load, of_file};
use crate::stream::{Life, Stream, Wanted};

/// How large a body may be.
const BODY: usize = 8 << 20;
/// How long a body may take.
const BODY_TIME: Wait = Wait::from_secs(20);
/// How long the service may take to answer.
const PATIENCE: Wait = Wait::from_secs(60);

/// `POST /v1/shadow`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ShadowOrder {
    /// How long, such as "30min".
    duration: Duration,
    /// By how much its error may be larger: 0.05 for 5 %.
    #[serde(default)]
    margin: f64,
    /// Whether it takes over then, if it passes.
    #[serde(default)]
    commit: bool,
}

/// Nothing but that it is understood, or done.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Nothing {}

/// What takes over.
#[derive(Debug, Serialize, JsonSchema)]
struct Revision {
    revision: Option<String>,
}

/// Whether learning is frozen.
#[derive(Debug, Serialize, JsonSchema)]
struct Frozen {
    frozen: bool,
}

/// After how many ticks, beats, breaks and freezes a checkpoint is.
#[derive(Debug, Serialize, JsonSchema)]
struct Taken {
    happenings: u64,
}

/// What becomes of the nodes of a staged graph.
#[derive(Debug, Serialize, JsonSchema)]
struct StagedGraph {
    revision: String,
    /// How many go on as they were.
    carried: usize,
    nodes: Vec<NodeCarry>,
    /// How long the past is that it was warmed by.
    past_s: f64,
    /// The outputs that had no value over the past.
    silent: Vec<String>,
    /// The nodes that go by all of their past.
    endless: Vec<String>,
    /// What is doubtful in the graph.
    doubts: String,
}

macro_rules! routes {
    (@query) => { &[] };
    (@query $($query:literal $help:literal)+) => { &[$(($query, $help)),+] };
    (@body) => { None };
    (@body $body:ty) => { Some(|of| of.subschema_for::<$body>()) };
    ($($method:literal $path:literal $help:literal $gives:expr, $answer:expr $(, ? $($query:literal)+)? $(, body $body:ty)?;)*) => {
        /// What this crate answers.
        pub static ROUTES: &[Route] = &[$(Route {
            method: $method,
            path: $path,
            help: $help,
            query: routes!(@query $($($query)+)?),
            body: routes!(@body $($body)?),
            gives: $gives,
            answer: $answer,
            is_open: false,
        }),*];
    };
}

macro_rules! facts_of {
    ($facts:ty) => {
        Answerer::Service(|service, _| Ok(Reply::json(&<$facts>::read(&Look::at(service)))))
    };
}

routes! {
    "GET" "/v1/status" "How the service is, and what happened last." Gives::json::<StatusFacts>(), facts_of!(StatusFacts);
    "GET" "/v1/channels" "What became of the samples of each channel, and how old the newest one is."
        Gives::json::<ChannelsFacts>(), facts_of!(ChannelsFacts);
    "GET" "/v1/outputs" "The outputs of what runs, with their last values; null is absent." Gives::json::<OutputsFacts>(), facts_of!(OutputsFacts);
    "GET" "/v1/ticks" "The last ticks of each output, the oldest first; null is absent." Gives::json::<TicksFacts>(), facts_of!(TicksFacts);
    "GET" "/v1/nodes" "The nodes of what runs, the novelty of their regressors and the errors of their predictions."
        Gives::json::<NodesFacts>(), facts_of!(NodesFacts);
    "GET" "/v1/events" "Server-sent events: what happens, and each tick where `ticks=1`. Whoever reads slowly is given `dropped` events in between."
        Gives::Text("text/event-stream"), Answerer::Events,
        ? "ticks" "Ticks come too where it is 1." "channel" "Values of this channel come along with ticks; `*` is all. May stand several times.";
    "GET" "/v1/openapi.json" "This description." Gives::Json(|_| json_schema!({ "type": "object" })),
        Answerer::Service(|_, _| Ok(Reply::text("application/json", openapi().to_owned())));
    "GET" "/metrics" "Metrics in the text format of Prometheus." Gives::Text(Metrics::CONTENT_TYPE),
        Answerer::Service(|service, _| Ok(Reply::text(Metrics::CONTENT_TYPE, metrics(service).text())));
    "POST" "/v1/stage" "Makes a graph ready to take over. Without a body it is that of the machine file as it is now."
        Gives::json::<StagedGraph>(), Answerer::Stage, body Given;
    "POST" "/v1/shadow" "Compares the staged graph with what runs, on the same ticks."
        Gives::json::<ShadowOrder>(), Answerer::Service(shadow), body ShadowOrder;
    "POST" "/v1/commit" "Lets the staged graph take over before the next tick." Gives::json::<Revision>(), Answerer::Service(commit);
    "POST" "/v1/rollback" "Lets the graph before the last swap take over again." Gives::json::<Revision>(), Answerer::Service(rollback);
    "POST" "/v1/discard" "Lets go of what is staged." Gives::json::<Nothing>(), Answerer::Service(discard);
    "POST" "/v1/freeze" "Freezes learning." Gives::json::<Frozen>(), Answerer::Service(|service, asked| freeze(service, asked, true));
    "POST" "/v1/thaw" "Lets learning go on." Gives::json::<Frozen>(), Answerer::Service(|service, asked| freeze(service, asked, false));
    "POST" "/v1/snapshot" "Takes a checkpoint." Gives::json::<Taken>(), Answerer::Service(snapshot);
    "POST" "/v1/stop" "Ends the service." Gives::json::<Nothing>(), Answerer::Service(stop);
}

fn commit(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    asked.read::<Nothing>()?;
    let revision = service.staged().map(|of| of.revision().to_owned());
    service.commit(&asked.by).map_err(not_now)?;
    Ok(Reply::json(&Revision { revision }))
}

fn rollback(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    asked.read::<Nothing>()?;
    let revision = service.previous().map(|of| of.revision().to_owned());
    service.rollback(&asked.by).map_err(not_now)?;
    Ok(Reply::json(&Revision { revision }))
}

fn discard(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    asked.read::<Nothing>()?;
    service.discard(&asked.by).map_err(not_now)?;
    Ok(Reply::json(&Nothing {}))
}

fn snapshot(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    asked.read::<Nothing>()?;
    let words = "no checkpoint can be taken: nothing has been stepped since the last one, a graph is on its way, or ticks were missed";
    let happenings = service
        .checkpoint(&asked.by)
        .ok_or_else(|| Refused::not_now(words))?;
    Ok(Reply::json(&Taken { happenings }))
}

fn stop(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    asked.read::<Nothing>()?;
    service.ask_to_end(&asked.by);
    Ok(Reply::json(&Nothing {}))
}

fn shadow(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    let order: ShadowOrder = asked.read()?;
    if order.duration <= Duration::ZERO || !(0.0..1e3).contains(&order.margin) {
        let words = "`duration` is to be longer than 0 s, and `margin` 0 or more";
        return Err(Refused::not_understood(words));
    }
    let done = service.shadow(order.duration, order.margin, order.commit, &asked.by);
    done.map_err(not_now)?;
    Ok(Reply::json(&order))
}

fn freeze(service: &mut Service, asked: &Asked, frozen: bool) -> Result<Reply, Refused> {
    asked.read::<Nothing>()?;
    let what = if frozen { "frozen" } else { "thawed" };
    service.note(&format!("{}: learning {what}", asked.by));
    service.freeze(frozen);
    Ok(Reply::json(&Frozen { frozen }))
}

fn not_now(error: CommitError) -> Refused {
    Refused::not_now(&error.to_string())
}

/// What answers.
pub struct Routes {
    beside: Beside,
    hub: Arc<Hub>,
}

impl Routes {
    pub fn new(beside: Beside, hub: Arc<Hub>) -> Self {
        Self { beside, hub }
    }

    pub fn hub(&self) -> &Hub {
        &self.hub
    }

    /// Answers a request.
    pub async fn answer(
        &self,
        request: Request<Incoming>,
        (peer, crowd): (&Peer, &Crowd),
        life: &Life,
    ) -> Result<Answer, Refused> {
        let (parts, body) = request.into_parts();
        let path = parts.uri.path();
        let route = routes().find(|of| of.path == path);
        let is_open = route.is_some_and(|of| of.is_open);
        peer.check(&parts.method, &parts.headers, is_open).await?;
        let route = route.ok_or_else(nothing_here)?;
        if parts.method.as_str() != route.method {
            let words = format!("this takes {}", route.method);
            let mut answer = Answer::from(Refused::new(StatusCode::METHOD_NOT_ALLOWED, &words));
            answer
                .headers_mut()
                .insert(ALLOW, HeaderValue::from_static(route.method));
            return Ok(answer);
        }
        let mut asked = Asked {
            query: parts.uri.query().unwrap_or_default().to_owned(),
            body: Vec::new(),
            by: peer.name(),
        };
        let meant_for = match parts.method == Method::GET {
            true => None,
            false => meant_for(&parts.headers)?,
        };
        let crowded = |what: &str| {
            self.hub.turned_away();
            let words = format!("there are too many {what}; try again soon");
            Refused::new(StatusCode::SERVICE_UNAVAILABLE, &words)
        };
        if matches!(route.answer, Answerer::Events) {
            let place = crowd.stream().ok_or_else(|| crowded("streams"))?;
            let wanted = wanted(&asked)?;
            let stream = Stream::new(self.hub.listen(), wanted, life.clone(), place);
            let body = stream.boxed_unsync();
            return Ok(with_body(StatusCode::OK, "text/event-stream", body));
        }
        let _place = crowd.request().ok_or_else(|| crowded("requests"))?;
        if parts.method != Method::GET {
            asked.body = whole(body).await?;
        }
        let reply = match route.answer {
            Answerer::Events | Answerer::Stage => self.stage(asked, meant_for).await?,
            Answerer::Beside(answer) => {
                let beside = self.beside.clone();
                blocking(move || answer(&beside, &asked)).await??
            }
            Answerer::Service(answer) => {
                let work = move |service: &mut Service| {
                    is_meant(service, meant_for.as_deref())?;
                    let reply = answer(service, &asked)?;
                    if route.method == "POST" {
                        ordered(service, &asked.by, route.path);
                    }
                    Ok::<_, Refused>(reply)
                };
                self.ask(work).await??
            }
        };
        Ok(text(StatusCode::OK, reply.content_type, reply.text))
    }

    /// Stages what is given: it is read beside the service, so that nothing waits for a file.
    async fn stage(&self, asked: Asked, meant_for: Option<String>) -> Result<Reply, Refused> {
        let given = match asked.body.is_empty() {
            // What the machine file has now.
            true => of_file(&self.beside.machine),
            false => asked.read::<Given>()?,
        };
        let beside = self.beside.clone();
        let runs = blocking(move || running(&beside)).await;
        let (_, running) = runs.ok().and_then(Result::ok).unwrap_or_default();
        let machine = self.beside.machine.clone();
        let loaded = blocking(move || load(given, &machine, running.as_ref())).await??;
        let staged = self.ask(move |service| {
            is_meant(service, meant_for.as_deref())?;
            let staged = service.stage(&loaded.model, &asked.by).map_err(not_now)?;
            let reply = Reply::json(&report(staged, loaded.doubts));
            ordered(service, &asked.by, "/v1/stage");
            Ok(reply)
        });
        staged.await?
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

athermal_core::events! {
    /// What somebody ordered.
    #[derive(Debug)]
    enum Order {
        /// Somebody gave an order, which was taken.
        Taken {
            /// Who.
            by: String,
            /// Which.
            order: String,
        } => "ordered", note, { by: String = by, order: String = order }, format!("{by}: {order}");
    }
}

athermal_serve::register_events!(Order);

/// Reports an order, for whoever asks who did what.
fn ordered(service: &mut Service, by: &str, path: &str) {
    let order = path.rsplit('/').next().unwrap_or(path).to_owned();
    let by = by.to_owned();
    service.report(ServiceEvent::Of(Box::new(Order::Taken { by, order })));
}

/// Refuses an order that is meant for another graph than the one that runs.
fn is_meant(service: &Service, revision: Option<&str>) -> Result<(), Refused> {
    let Some(meant) = revision else {
        return Ok(());
    };
    let runs = service.running().map(|of| of.revision);
    match runs == Some(meant) {
        true => Ok(()),
        false => Err(Refused::not_now(&format!(
            "the order is meant for revision {meant}, and {} runs; look again",
            runs.unwrap_or("one that is not known")
        ))),
    }
}

/// A body, which may be neither large nor slow.
async fn whole(body: Incoming) -> Result<Vec<u8>, Refused> {
    let body = tokio::time::timeout(BODY_TIME, Limited::new(body, BODY).collect());
    let body = body
        .await
        .map_err(|_| Refused::new(StatusCode::REQUEST_TIMEOUT, "the body takes too long"))?;
    let body = body.map_err(
        |error| match error.is::<http_body_util::LengthLimitError>() {
            true => Refused::new(StatusCode::PAYLOAD_TOO_LARGE, "a body has at most 8 MB"),
            false => Refused::not_understood("the body ends before its end"),
        },
    )?;
    Ok(body.to_bytes().to_vec())
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

/// `ticks=1`, `channel=NAME` as often as there are channels.
fn wanted(asked: &Asked) -> Result<Wanted, Refused> {
    let mut wanted = Wanted::default();
    for part in asked.parts()? {
        match part {
            ("ticks", one) if one == "1" => wanted.ticks = true,
            ("channel", name) if wanted.channels.len() < 256 => {
                wanted.ticks = true;
                wanted.channels.push(name);
            }
            _ => {
                return Err(Refused::not_understood(
                    "`ticks=1` and `channel=NAME` are what there is",
                ));
            }
        }
    }
    Ok(wanted)
}

/// A part of a query without its escapes.
pub fn decoded(text: &str) -> Result<String, Refused> {
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
        bytes.push(
            code.ok_or_else(|| Refused::not_understood("an escape in the query is not right"))?,
        );
    }
    String::from_utf8(bytes).map_err(|_| Refused::not_understood("the query is not UTF-8"))
}

/// What becomes of the nodes of a staged graph.
fn report(staged: &Staged, doubts: String) -> StagedGraph {
    let nodes = staged.carry().to_vec();
    let carried = nodes.iter().filter(|node| node.outcome == Carry::Carried);
    let (past, silent) = staged.silent();
    StagedGraph {
        revision: staged.revision().to_owned(),
        carried: carried.count(),
        past_s: past.as_ns() as f64 / 1e9,
        silent: silent.iter().map(|of| (*of).to_owned()).collect(),
        endless: staged
            .endless()
            .1
            .iter()
            .map(|of| (*of).to_owned())
            .collect(),
        doubts,
        nodes,
    }
}
