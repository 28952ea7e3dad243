//! `mqtts://`: TLS by rustls, with the cryptography of ring.

use std::sync::Arc;

use rumqttc::{TlsConfiguration, Transport};
use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ClientConfig, Error, RootCertStore};

use crate::broker::{Broker, Identity};

/// How a broker is spoken to.
///
/// # Errors
/// When the certificates that its own is judged by, or that of the client and its key, cannot be read.
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
        .with_root_certificates(authorities);
    let config = match &broker.identity {
        Some(identity) => {
            let (chain, key) = read(identity)?;
            let config = config.with_client_auth_cert(chain, key);
            config.map_err(|error| {
                let certificate = identity.certificate.display();
                match error {
                    Error::InconsistentKeys(_) => {
                        let key = identity.key.display();
                        format!("the certificate {certificate} does not go with the key {key}: {error}")
                    }
                    // As `openssl x509 -req` makes it where nothing is said of extensions.
                    _ => format!("the certificate {certificate} cannot be used: {error}; it has to be of version 3 of X.509"),
                }
            })?
        }
        None => config.with_no_client_auth(),
    };
    let config = TlsConfiguration::Rustls(Arc::new(config));
    Ok(Transport::tls_with_config(config))
}

/// The certificate of a client and its key.
fn read(
    identity: &Identity,
) -> Result<(Vec<CertificateDer<'static>>, PrivateKeyDer<'static>), String> {
    let Identity { certificate, key } = identity;
    let failed = |what: &str, path: &std::path::Path, why: &dyn std::fmt::Display| {
        format!(
            "cannot read the {what} of the client in {}: {why}",
            path.display()
        )
    };
    let of_certificate = |why: &dyn std::fmt::Display| failed("certificate", certificate, why);
    let all = CertificateDer::pem_file_iter(certificate).map_err(|of| of_certificate(&of))?;
    let chain: Vec<_> = all
        .collect::<Result<_, _>>()
        .map_err(|of| of_certificate(&of))?;
    if chain.is_empty() {
        return Err(of_certificate(&"there is none in it; it is a file of PEM"));
    }
    let key = PrivateKeyDer::from_pem_file(key).map_err(|of| failed("key", key, &of))?;
    Ok((chain, key))
}
