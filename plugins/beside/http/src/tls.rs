//! TLS: certificates, which are read again when they change, and one of our own where none is given.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use rustls::ServerConfig;
use rustls::crypto::ring::{default_provider, sign::any_supported_type};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use tokio_rustls::TlsAcceptor;

use crate::settings::Https;
use crate::token::write_private;

/// When a file was written, and how long it was.
type Written = Option<(SystemTime, u64)>;

/// A certificate and its key, as they are in their files now.
struct Certificates {
    paths: [PathBuf; 2],
    known: Mutex<([Written; 2], Arc<CertifiedKey>)>,
}

impl std::fmt::Debug for Certificates {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(&self.paths).finish()
    }
}

/// What accepts connections, and the SHA-256 of the certificate where it is our own.
///
/// # Errors
/// When the certificate or its key cannot be read or made, or they do not belong together.
pub fn acceptor(
    settings: &Https,
    machine: &Path,
    state: &Path,
) -> io::Result<(TlsAcceptor, Option<String>)> {
    let beside = |path: &PathBuf| machine.parent().unwrap_or(Path::new(".")).join(path);
    let (paths, is_own) = match (&settings.certificate, &settings.key) {
        (Some(certificate), Some(key)) => ([beside(certificate), beside(key)], false),
        _ => ([state.join("https.crt"), state.join("https.key")], true),
    };
    if is_own && !paths[0].exists() {
        make(&paths, settings)?;
    }
    let key = read(&paths)?;
    let fingerprint = is_own.then(|| fingerprint(&key));
    let known = Mutex::new((written(&paths), Arc::new(key)));
    let certificates = Arc::new(Certificates { paths, known });
    let config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(io::Error::other)?
        .with_no_client_auth()
        .with_cert_resolver(certificates);
    Ok((TlsAcceptor::from(Arc::new(config)), fingerprint))
}

impl ResolvesServerCert for Certificates {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let now = written(&self.paths);
        // While only one of both has been written, those before go on.
        if now != known.0
            && let Ok(key) = read(&self.paths)
        {
            *known = (now, Arc::new(key));
        }
        Some(Arc::clone(&known.1))
    }
}

fn written(paths: &[PathBuf; 2]) -> [Written; 2] {
    paths.each_ref().map(|path| {
        let facts = std::fs::metadata(path).ok()?;
        Some((facts.modified().ok()?, facts.len()))
    })
}

fn read([certificate, key]: &[PathBuf; 2]) -> io::Result<CertifiedKey> {
    let failed = |path: &Path, error: &dyn std::fmt::Display| {
        io::Error::other(format!("{}: {error}", path.display()))
    };
    let chain = CertificateDer::pem_file_iter(certificate)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(|error| failed(certificate, &error))?;
    let private = PrivateKeyDer::from_pem_file(key).map_err(|error| failed(key, &error))?;
    let private = any_supported_type(&private).map_err(|error| failed(key, &error))?;
    let certified = CertifiedKey::new(chain, private);
    let belongs = certified.keys_match();
    belongs.map_err(|error| {
        failed(
            key,
            &format_args!("it is not the key of the certificate: {error}"),
        )
    })?;
    Ok(certified)
}

/// Makes a certificate that nobody has signed but itself.
fn make([certificate, key]: &[PathBuf; 2], settings: &Https) -> io::Result<()> {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let ip = settings.at.ip();
    let mut names = vec!["localhost".to_owned(), "127.0.0.1".to_owned()];
    names.extend((!host.trim().is_empty()).then(|| host.trim().to_owned()));
    names.extend((!ip.is_unspecified()).then(|| ip.to_string()));
    let made = rcgen::generate_simple_self_signed(names).map_err(io::Error::other)?;
    write_private(key, &made.signing_key.serialize_pem())?;
    std::fs::write(certificate, made.cert.pem())
}

/// SHA-256 of a certificate, as browsers show it.
fn fingerprint(key: &CertifiedKey) -> String {
    let der = key.cert.first().map_or(&[][..], |of| of.as_ref());
    let digest = ring::digest::digest(&ring::digest::SHA256, der);
    let pairs = digest.as_ref().iter().map(|byte| format!("{byte:02X}"));
    pairs.collect::<Vec<_>>().join(":")
}
