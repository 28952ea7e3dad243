//! One session with a server. The crate that speaks the protocol makes a lost connection anew and takes the session up again, or makes
//! another one; when a connection is lost is decided here, and it is cut then.

use std::collections::VecDeque;
use std::future::Future;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::time::Duration as Wait;

use futures::{Stream, StreamExt};
use opcua::client::transport::{
    Connector, OutgoingMessage, SecureChannelState, TcpConnector, TcpTransport, Transport,
    TransportConfiguration, TransportPollResult,
};
use opcua::client::{
    Client, ClientBuilder, ConnectionSource, IdentityToken, Session, SessionConnectMode,
    SessionPollResult, SubscriptionActivity,
};
use opcua::types::{
    AttributeId, DataValue, EndpointDescription, Error, NodeId, ReadValueId, StatusCode,
    TimestampsToReturn, VariableId, Variant,
};
use tokio::sync::{mpsc, watch};
use tokio::time::timeout;

use crate::certificates::Certificates;
use crate::server::{Security, Settings};
use crate::value::code;

/// For how long the server keeps a session that has no connection: so long is tried to take it up again.
pub const KEPT: Wait = Wait::from_secs(60);
/// The pauses between tries then.
const AGAIN: (Wait, Wait) = (Wait::from_millis(250), Wait::from_secs(1));
/// How often the crate asks the server how it is, so that the session goes on where nothing is subscribed.
const ASK: Wait = Wait::from_secs(5);
/// How much of a message is taken: all that a server may have queued while nobody was there.
const LARGEST: (usize, usize) = (64 << 20, 1 << 20);

/// A session.
pub struct Link {
    /// It. What is asked of it has an answer only while the link is [driven](Link::drive).
    pub session: Arc<Session>,
    events: Pin<Box<dyn Stream<Item = Result<SessionPollResult, StatusCode>>>>,
    came: VecDeque<Event>,
    cut: watch::Sender<()>,
}

/// What happens to a session.
#[derive(Debug)]
pub enum Event {
    /// It is another one: nothing is subscribed.
    Begun,
    /// It is the one of before: what was subscribed still is.
    TakenUp,
    /// The connection is lost, and made anew.
    Lost(String),
    /// That did not succeed.
    NotYet(StatusCode),
    /// The server does not know what was subscribed.
    Forgotten,
}

/// Makes connections that can be cut, and gives those up that have no answer.
#[derive(Clone)]
struct Lines {
    cut: watch::Receiver<()>,
    patience: Wait,
}

struct Line {
    to: TcpConnector,
    of: Lines,
}

struct Cuttable {
    line: TcpTransport,
    cut: watch::Receiver<()>,
}

impl ConnectionSource for Lines {
    type Builder = Line;

    fn get_connector(&self, endpoint: &EndpointDescription) -> Result<Line, Error> {
        Ok(Line {
            to: TcpConnector::new(endpoint.endpoint_url.as_ref())?,
            of: self.clone(),
        })
    }
}

impl Connector for Line {
    type Transport = Cuttable;

    async fn connect(
        &self,
        channel: Arc<SecureChannelState>,
        outgoing: mpsc::Receiver<OutgoingMessage>,
        config: TransportConfiguration,
    ) -> Result<Cuttable, Error> {
        let connected = timeout(self.of.patience, self.to.connect(channel, outgoing, config));
        let none = |_| Error::new(StatusCode::BadTimeout, "no answer");
        let line = connected.await.map_err(none)??;
        let mut cut = self.of.cut.clone();
        cut.mark_unchanged();
        Ok(Cuttable { line, cut })
    }

    fn default_endpoint(&self) -> EndpointDescription {
        self.to.default_endpoint()
    }
}

impl Transport for Cuttable {
    async fn poll(&mut self) -> TransportPollResult {
        tokio::select! {
            _ = self.cut.changed() => TransportPollResult::Closed(StatusCode::BadConnectionClosed),
            polled = self.line.poll() => polled,
        }
    }

    fn connected_url(&self) -> &str {
        self.line.connected_url()
    }
}

impl Link {
    /// Finds the server, judges its certificate, and begins a session.
    ///
    /// # Errors
    /// Why there is none, and what to do.
    pub async fn open(settings: &Settings) -> Result<Self, String> {
        let certificates = Certificates::of(&settings.folder);
        if settings.security != Security::None {
            certificates.make(settings)?;
        }
        let client = client(settings, -1)?;
        let (cut, lines) = watch::channel(());
        let lines = Lines {
            cut: lines,
            patience: settings.patience,
        };
        let url = &settings.server.url;
        let failed = |error: Error| error_words(&error);
        let line = lines.get_connector(&EndpointDescription::from(url.as_str()));
        // Whether somebody is there is asked once: how often is decided elsewhere.
        let once = self::client(settings, 0)?;
        let asked = once.get_server_endpoints_from_url(line.map_err(failed)?);
        let found = timeout(settings.patience * 2, asked).await;
        let found = found.map_err(|_| "no answer".to_owned())?.map_err(failed)?;
        let mut endpoint = chosen(settings, found)?;
        if settings.security != Security::None {
            let shown = &endpoint.server_certificate;
            let uri = endpoint.server.application_uri.as_ref();
            let of = (settings.server.host.as_str(), uri);
            certificates.judge(shown, settings.security.policy(), of)?;
        }
        // What it says of its own address is that of its network, and not always of ours.
        endpoint.endpoint_url = url.as_str().into();
        let token = match &settings.login {
            Some((name, password)) => IdentityToken::new_user_name(name, password.as_str()),
            None => IdentityToken::new_anonymous(),
        };
        let builder = client.session_builder().user_identity_token(token);
        let builder = builder.with_connector(lines);
        let builder = builder.connect_to_endpoint_directly(endpoint);
        let built = builder.map_err(failed)?;
        let (session, events) = built
            .build(Arc::clone(client.certificate_store()))
            .map_err(failed)?;
        let mut link = Self {
            session,
            events: Box::pin(events.enter()),
            came: VecDeque::new(),
            cut,
        };
        let begun = async {
            loop {
                match link.next().await? {
                    Event::NotYet(why) => return Err(status_words(why)),
                    Event::Begun | Event::TakenUp => return Ok(()),
                    _ => {}
                }
            }
        };
        let begun = timeout(settings.patience * 3, begun).await;
        begun.map_err(|_| "no answer".to_owned())??;
        Ok(link)
    }

    /// What happens next. It may be given up.
    ///
    /// # Errors
    /// When the session has ended for good.
    pub async fn next(&mut self) -> Result<Event, String> {
        loop {
            if let Some(event) = self.came.pop_front() {
                return Ok(event);
            }
            self.pass().await?;
        }
    }

    /// Works on an answer until it is there; what happens meanwhile comes [next](Self::next).
    ///
    /// # Errors
    /// When the session has ended for good.
    pub async fn drive<T>(&mut self, work: impl Future<Output = T>) -> Result<T, String> {
        let mut work = pin!(work);
        loop {
            tokio::select! {
                done = &mut work => return Ok(done),
                passed = self.pass() => passed?,
            }
        }
    }

    async fn pass(&mut self) -> Result<(), String> {
        use SessionPollResult as Polled;
        let event = match self.events.next().await {
            None => return Err("the session has ended".to_owned()),
            Some(Err(status)) => return Err(status_words(status)),
            Some(Ok(Polled::Reconnected(SessionConnectMode::NewSession(_)))) => Event::Begun,
            Some(Ok(Polled::Reconnected(SessionConnectMode::ReactivatedSession(_)))) => {
                Event::TakenUp
            }
            Some(Ok(Polled::ConnectionLost(why))) => Event::Lost(status_words(why)),
            Some(Ok(Polled::ReconnectFailed(why))) => Event::NotYet(why),
            Some(Ok(Polled::Subscription(SubscriptionActivity::PublishFailed(
                StatusCode::BadNoSubscription | StatusCode::BadSubscriptionIdInvalid,
            )))) => Event::Forgotten,
            Some(Ok(_)) => return Ok(()),
        };
        self.came.push_back(event);
        Ok(())
    }

    /// Cuts the connection: it is made anew, and the session taken up.
    pub fn cut(&self) {
        let _ = self.cut.send(());
    }

    /// Takes leave of the server, for so long at most.
    pub async fn leave(mut self, patience: Wait) {
        let session = Arc::clone(&self.session);
        let leave = async move {
            let _ = session.disconnect().await;
        };
        let _ = timeout(patience, self.drive(leave)).await;
    }

    /// What some attributes of nodes are.
    ///
    /// # Errors
    /// When there is no answer.
    pub async fn read(&mut self, of: &[(NodeId, AttributeId)]) -> Result<Vec<DataValue>, String> {
        let mut all = Vec::with_capacity(of.len());
        for piece in of.chunks(500) {
            let of: Vec<_> = piece
                .iter()
                .map(|(node_id, attribute)| ReadValueId {
                    node_id: node_id.clone(),
                    attribute_id: *attribute as u32,
                    ..ReadValueId::default()
                })
                .collect();
            let session = Arc::clone(&self.session);
            let read = async move { session.read(&of, TimestampsToReturn::Both, 0.0).await };
            let read = self.drive(read).await?.map_err(|of| error_words(&of))?;
            if read.len() != piece.len() {
                return Err("it answers to another question".to_owned());
            }
            all.extend(read);
        }
        Ok(all)
    }

    /// The URIs of the namespaces of this session, by their numbers.
    ///
    /// # Errors
    /// When there is no answer.
    pub async fn namespaces(&mut self) -> Result<Vec<String>, String> {
        let node = NodeId::from(VariableId::Server_NamespaceArray);
        let read = self.read(&[(node, AttributeId::Value)]).await?;
        let value = read.into_iter().next().and_then(|of| of.value);
        Ok(match value {
            Some(Variant::Array(of)) => of.values.iter().map(ToString::to_string).collect(),
            _ => Vec::new(),
        })
    }
}

/// The crate that speaks the protocol, with our settings.
fn client(settings: &Settings, again: i32) -> Result<Client, String> {
    let (message, piece) = LARGEST;
    let seconds = |of: Wait| u32::try_from(of.as_millis()).unwrap_or(u32::MAX);
    let builder = ClientBuilder::new()
        .application_name(&settings.name)
        .application_uri(&settings.uri)
        .product_uri("urn:athermal")
        .session_name(&settings.name)
        .pki_dir(&settings.folder)
        .create_sample_keypair(false)
        .trust_server_certs(false)
        .verify_server_certs(true)
        .session_retry_limit(again)
        .session_retry_initial(AGAIN.0.min(settings.retry))
        .session_retry_max(AGAIN.1.min(settings.retry))
        .session_timeout(seconds(KEPT))
        .keep_alive_interval(ASK)
        .request_timeout(settings.patience)
        .recreate_subscriptions(false)
        .max_array_length(piece)
        .max_string_length(piece)
        .max_byte_string_length(piece)
        .max_chunk_count(4096)
        .max_message_size(message);
    builder.client().map_err(|why| why.join("; "))
}

/// The endpoint that has the policy that was asked for.
fn chosen(
    settings: &Settings,
    found: Vec<EndpointDescription>,
) -> Result<EndpointDescription, String> {
    let policy = settings.security.policy();
    let mode = settings.message_mode();
    let policy_of = |of: &EndpointDescription| of.security_policy_uri.to_string();
    let fits =
        |of: &EndpointDescription| policy_of(of) == policy.to_uri() && of.security_mode == mode;
    let offered = found.iter().map(|of| {
        let uri = policy_of(of);
        let name = uri.rsplit('#').next().unwrap_or_default();
        format!("{} ({:?})", name, of.security_mode)
    });
    let offered = offered.collect::<Vec<_>>().join(", ");
    found.into_iter().find(fits).ok_or_else(|| {
        format!(
            "it does not offer security = \"{}\" ({mode:?}); it offers {offered}: write one of these, or have the policy allowed on the server",
            settings.security.name()
        )
    })
}

/// Why a request failed.
pub fn error_words(error: &Error) -> String {
    status_words(error.status())
}

/// What a code means for whoever can do something about it.
pub fn status_words(status: StatusCode) -> String {
    let advice = match status {
        StatusCode::BadUserAccessDenied
        | StatusCode::BadIdentityTokenRejected
        | StatusCode::BadIdentityTokenInvalid => {
            ": the server does not take this user and password; see `login`"
        }
        StatusCode::BadSecurityChecksFailed
        | StatusCode::BadCertificateUntrusted
        | StatusCode::BadCertificateUseNotAllowed => {
            ": the server does not trust our certificate; trust that on the server"
        }
        StatusCode::BadCommunicationError => ": nobody answers there",
        StatusCode::BadConnectionClosed => ": the connection was closed",
        StatusCode::BadTimeout => ": no answer in time",
        StatusCode::BadTooManySessions => ": the server takes no more sessions",
        _ => "",
    };
    format!("{}{advice}", code(status))
}
