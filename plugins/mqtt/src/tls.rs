//! `mqtts://`: TLS by rustls, with the cryptography of ring.

use std::sync::Arc;

use rumqttc::tokio_rustls::rustls::{ClientConfig, RootCertStore, crypto::ring};
use rumqttc::{TlsConfiguration, Transport};

use crate::broker::Broker;

/// How a broker is spoken to.
///
/// # Errors
/// When the certificates that its own is judged by cannot be read.
pub fn transport(broker: &Broker) -> Result<Transport, String> {
    let provider = Arc::new(ring::default_provider());
    // What this crate builds goes by it; what the other one builds goes by the default.
    let _ = ring::default_provider().install_default();
    if let Some(path) = &broker.authorities {
        let read = std::fs::read(path);
        let ca = read.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        return Ok(Transport::tls(ca, None, None));
    }
    let mut authorities = RootCertStore::empty();
    let known = rustls_native_certs::load_native_certs().certs;
    authorities.add_parsable_certificates(known);
    if authorities.is_empty() {
        return Err(
            "this system has no certificates of authorities: name a file of them as `authorities`"
                .to_owned(),
        );
    }
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|error| error.to_string())?
        .with_root_certificates(authorities)
        .with_no_client_auth();
    Ok(Transport::tls_with_config(TlsConfiguration::Rustls(
        Arc::new(config),
    )))
}
