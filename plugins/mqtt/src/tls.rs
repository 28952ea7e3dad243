//! `mqtts://`: TLS by rustls, with the cryptography of ring.

use std::sync::Arc;

use rumqttc::{TlsConfiguration, Transport};
use rustls::crypto::ring;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use rustls::{ClientConfig, RootCertStore};

use crate::broker::Broker;

/// How a broker is spoken to.
///
/// # Errors
/// When the certificates that its own is judged by cannot be read.
pub fn transport(broker: &Broker) -> Result<Transport, String> {
    let mut authorities = RootCertStore::empty();
    match &broker.authorities {
        Some(path) => {
            let failed = |why: &dyn std::fmt::Display| {
                format!("cannot read certificates of {}: {why}", path.display())
            };
            let all = CertificateDer::pem_file_iter(path).map_err(|error| failed(&error))?;
            for of in all {
                let of = of.map_err(|error| failed(&error))?;
                authorities.add(of).map_err(|error| failed(&error))?;
            }
            if authorities.is_empty() {
                return Err(failed(&"there is none in it; it is a file of PEM"));
            }
        }
        None => {
            let known = rustls_native_certs::load_native_certs().certs;
            authorities.add_parsable_certificates(known);
            if authorities.is_empty() {
                let why = "this system has no certificates of authorities: name a file of them as `authorities`";
                return Err(why.to_owned());
            }
        }
    }
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(|error| error.to_string())?
        .with_root_certificates(authorities)
        .with_no_client_auth();
    let config = TlsConfiguration::Rustls(Arc::new(config));
    Ok(Transport::tls_with_config(config))
}
