//! A message by HTTP to an address that is a secret: no error names more of it than the host.

use std::time::Duration as Wait;

use athermal_serve::connector::{ConnectorError, Messages};
use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{CONTENT_TYPE, HOST, USER_AGENT};
use hyper::{Request, StatusCode, Uri};
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;

/// How long a message may take.
const PATIENCE: Wait = Wait::from_secs(3);

/// Where messages are posted.
#[derive(Clone)]
pub(crate) struct Webhook {
    address: Uri,
    is_secure: bool,
}

impl Webhook {
    /// An address; why it is none, without saying it.
    pub(crate) fn new(address: &str) -> Result<Self, String> {
        let wrong =
            || "what stands at `webhook` is no address such as https://HOST/PATH".to_owned();
        let address: Uri = address.trim().parse().map_err(|_| wrong())?;
        let is_secure = match address.scheme_str() {
            Some("https") => true,
            Some("http") => false,
            _ => return Err(wrong()),
        };
        if address.host().is_none_or(str::is_empty) {
            return Err(wrong());
        }
        if is_secure && !cfg!(feature = "tls") {
            return Err("this program has no TLS, so that `webhook` cannot be an https:// address: take one that was built with `--features tls`".to_owned());
        }
        Ok(Self { address, is_secure })
    }

    /// The host alone.
    pub(crate) fn host(&self) -> &str {
        self.address.host().unwrap_or_default()
    }

    async fn post(&self, text: &str) -> Result<StatusCode, String> {
        let host = self.host();
        let port = self
            .address
            .port_u16()
            .unwrap_or(if self.is_secure { 443 } else { 80 });
        let name = host.trim_matches(['[', ']']);
        let stream = TcpStream::connect((name, port)).await;
        let stream = stream.map_err(|error| error.to_string())?;
        #[cfg(feature = "tls")]
        if self.is_secure {
            return self.give(encrypted(stream, name).await?, text).await;
        }
        self.give(stream, text).await
    }

    async fn give<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(
        &self,
        stream: S,
        text: &str,
    ) -> Result<StatusCode, String> {
        let failed = |error: hyper::Error| error.to_string();
        let handshake = hyper::client::conn::http1::handshake(TokioIo::new(stream));
        let (mut sender, connection) = handshake.await.map_err(failed)?;
        tokio::spawn(connection);
        let path = self.address.path_and_query().map_or("/", |of| of.as_str());
        let host = self.address.authority().map_or("", |of| of.as_str());
        let host = host.rsplit_once('@').map_or(host, |(_, host)| host);
        let request = Request::post(path)
            .header(HOST, host)
            .header(CONTENT_TYPE, "application/json")
            .header(USER_AGENT, concat!("athermal/", env!("CARGO_PKG_VERSION")))
            .body(Full::new(Bytes::from(text.to_owned())));
        let request = request.map_err(|_| "the address cannot be asked".to_owned())?;
        let answer = sender.send_request(request).await.map_err(failed)?;
        Ok(answer.status())
    }
}

#[cfg(feature = "tls")]
async fn encrypted(
    stream: TcpStream,
    host: &str,
) -> Result<tokio_rustls::client::TlsStream<TcpStream>, String> {
    use std::sync::Arc;

    use rustls::pki_types::ServerName;
    use rustls::{ClientConfig, RootCertStore};

    let mut roots = RootCertStore::empty();
    roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config =
        ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions();
    let config = config.map_err(|error| error.to_string())?;
    let config = config.with_root_certificates(roots).with_no_client_auth();
    let name = ServerName::try_from(host.to_owned()).map_err(|error| error.to_string())?;
    let connector = tokio_rustls::TlsConnector::from(Arc::new(config));
    connector
        .connect(name, stream)
        .await
        .map_err(|error| error.to_string())
}

impl Messages for Webhook {
    fn send(&mut self, text: &str) -> Result<(), ConnectorError> {
        let failed = |why: &dyn std::fmt::Display| {
            ConnectorError::new(format_args!(
                "the webhook at {} does not take it: {why}",
                self.host()
            ))
        };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(|error| failed(&error))?;
        let posted =
            runtime.block_on(async { tokio::time::timeout(PATIENCE, self.post(text)).await });
        match posted {
            Ok(Ok(status)) if status.is_success() => Ok(()),
            Ok(Ok(status)) => Err(failed(&format_args!("it answers {status}"))),
            Ok(Err(why)) => Err(failed(&why)),
            Err(_) => Err(failed(&"it does not answer")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_refused_without_saying_it() {
        for (address, is_right) in [
            ("http://127.0.0.1:8080/hook?key=secret", true),
            ("http://[::1]:8080/", true),
            ("ftp://host/secret", false),
            ("secret", false),
            ("http:///secret", false),
            ("", false),
        ] {
            match Webhook::new(address) {
                Ok(_) => assert!(is_right, "{address}"),
                Err(words) => assert!(!is_right && !words.contains("secret"), "{words}"),
            }
        }
        assert_eq!(
            Webhook::new("https://host/x").is_ok(),
            cfg!(feature = "tls")
        );
        let mut nobody = Webhook::new("http://user:word@127.0.0.1:1/secret").unwrap();
        let words = nobody.send("{}").unwrap_err().to_string();
        assert!(
            words.contains("127.0.0.1") && !words.contains("secret") && !words.contains("word"),
            "{words}"
        );
    }
}
