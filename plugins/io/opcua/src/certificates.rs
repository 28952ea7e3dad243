//! Our own certificate, which is made once, and those of servers: one that nobody has trusted is put into `rejected/`, from where
//! `athermal trust` takes it.

use std::fs;
use std::path::{Path, PathBuf};

use opcua::crypto::{CertificateStore, SecurityPolicy, X509, X509Data};
use opcua::types::{ByteString, DateTime};

use crate::server::Settings;

/// For how many days our own is valid: who sets a machine up is not there when it ends.
const DAYS: u32 = 20 * 365;
/// How many unknown ones are kept.
const REJECTED: usize = 32;

/// A certificate of a server.
#[derive(Debug)]
pub struct Theirs {
    file: String,
    /// By what people compare it with the one that the server shows.
    pub fingerprint: String,
    /// Whose it is, and until when.
    pub words: String,
}

impl Theirs {
    fn of(certificate: &X509) -> Self {
        let name = certificate.common_name().unwrap_or_default();
        let name = name.strip_prefix("CN=").unwrap_or(&name);
        let name: String = name.chars().filter(|of| !of.is_control()).collect();
        let until = certificate.not_after();
        let until = until.map_or_else(|_| "no day".to_owned(), |of| of.date_naive().to_string());
        Self {
            file: CertificateStore::cert_file_name(certificate),
            fingerprint: certificate.thumbprint().as_hex_string(),
            words: format!("of `{name}`, valid until {until}"),
        }
    }
}

/// The folders with certificates of a source or sink.
#[derive(Debug, Clone)]
pub struct Certificates(PathBuf);

impl Certificates {
    pub fn of(folder: &Path) -> Self {
        Self(folder.to_owned())
    }

    fn folder(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Our own certificate and its key, where they are to be.
    fn own(&self) -> (PathBuf, PathBuf) {
        (
            self.0.join("own/cert.der"),
            self.0.join("private/private.pem"),
        )
    }

    /// Makes our own certificate where there is none yet.
    ///
    /// # Errors
    /// When it cannot be made or kept.
    pub fn make(&self, settings: &Settings) -> Result<(), String> {
        let (certificate, key) = self.own();
        let failed = |why: String| {
            format!(
                "its own certificate cannot be made in {}: {why}",
                self.0.display()
            )
        };
        for name in ["own", "private", "trusted", "rejected"] {
            let made = fs::create_dir_all(self.folder(name));
            made.map_err(|error| failed(error.to_string()))?;
        }
        restrict(&self.folder("private"), 0o700).map_err(|error| failed(error.to_string()))?;
        if certificate.exists() && key.exists() {
            return Ok(());
        }
        let data = X509Data {
            key_size: 2048,
            common_name: settings.name.clone(),
            organization: "athermal".to_owned(),
            organizational_unit: String::new(),
            country: String::new(),
            state: String::new(),
            alt_host_names: X509Data::alt_host_names(&settings.uri, None, false, true, false),
            certificate_duration_days: DAYS,
        };
        CertificateStore::create_certificate_and_key(&data, true, &certificate, &key)
            .map_err(failed)?;
        restrict(&key, 0o600).map_err(|error| failed(error.to_string()))
    }

    /// Whether a certificate that a server shows is trusted, and right.
    ///
    /// # Errors
    /// Why not, and what to do.
    pub fn judge(
        &self,
        shown: &ByteString,
        policy: SecurityPolicy,
        (host, uri): (&str, &str),
    ) -> Result<(), String> {
        let read = X509::from_byte_string(shown);
        let certificate = read.map_err(|_| {
            "it shows no certificate that can be read: it has to have one for this policy"
                .to_owned()
        })?;
        let theirs = Theirs::of(&certificate);
        let Theirs {
            fingerprint, words, ..
        } = &theirs;
        let trusted = fs::read(self.folder("trusted").join(&theirs.file));
        let der = certificate.to_der().unwrap_or_default();
        if trusted.is_ok_and(|of| of != der) || !self.folder("trusted").join(&theirs.file).is_file()
        {
            self.reject(&theirs, &der)?;
            return Err(format!(
                "its certificate {words}, is not trusted; compare its fingerprint with the one that the server shows, then \
                 `athermal trust MACHINE {fingerprint}`"
            ));
        }
        let bits = certificate.key_length().unwrap_or(0);
        if !policy.is_valid_keylength(bits) {
            return Err(format!(
                "its certificate {words}, has a key of {bits} bits, which this policy does not take: have another one made on the server"
            ));
        }
        if certificate
            .is_time_valid(&DateTime::now().as_chrono())
            .is_err()
        {
            return Err(format!(
                "its certificate {words}, is not valid now: renew it on the server, or set the clocks right"
            ));
        }
        if certificate.is_hostname_valid(host).is_err() {
            return Err(format!(
                "its certificate {words}, is not for `{host}`: write the `endpoint` with the name that it is for, or have one made \
                 on the server that names `{host}`"
            ));
        }
        if certificate.is_application_uri_valid(uri).is_err() {
            return Err(format!(
                "its certificate {words}, is not for the application `{uri}` that the server says it is: have one made on the server \
                 that is"
            ));
        }
        Ok(())
    }

    /// Keeps an unknown one for `athermal trust`; not without end, whoever shows them.
    fn reject(&self, theirs: &Theirs, der: &[u8]) -> Result<(), String> {
        let folder = self.folder("rejected");
        let failed = |error: std::io::Error| {
            format!(
                "its certificate is not trusted, and cannot be kept in {}: {error}",
                folder.display()
            )
        };
        fs::create_dir_all(&folder).map_err(failed)?;
        let path = folder.join(&theirs.file);
        if path.exists() {
            return Ok(());
        }
        let mut kept: Vec<_> = fs::read_dir(&folder)
            .map_err(failed)?
            .filter_map(|of| {
                let of = of.ok()?;
                Some((of.metadata().ok()?.modified().ok()?, of.path()))
            })
            .collect();
        kept.sort();
        let over = (kept.len() + 1).saturating_sub(REJECTED);
        for (_, path) in kept.iter().take(over) {
            fs::remove_file(path).map_err(failed)?;
        }
        fs::write(path, der).map_err(failed)
    }

    /// The unknown ones.
    #[cfg(feature = "cli")]
    pub fn rejected(&self) -> Vec<Theirs> {
        let found = fs::read_dir(self.folder("rejected"));
        let found = found.into_iter().flatten().filter_map(|of| {
            let read = CertificateStore::read_cert(&of.ok()?.path()).ok()?;
            Some(Theirs::of(&read))
        });
        let mut all: Vec<_> = found.collect();
        all.sort_by(|a, b| a.fingerprint.cmp(&b.fingerprint));
        all
    }

    /// Trusts one of them.
    ///
    /// # Errors
    /// When it cannot be moved.
    #[cfg(feature = "cli")]
    pub fn trust(&self, theirs: &Theirs) -> Result<(), String> {
        let [from, to] = ["rejected", "trusted"].map(|name| self.folder(name));
        fs::create_dir_all(&to)
            .and_then(|()| fs::rename(from.join(&theirs.file), to.join(&theirs.file)))
            .map_err(|error| format!("cannot move it to {}: {error}", to.display()))
    }
}

#[cfg(unix)]
fn restrict(path: &Path, mode: u32) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(path, fs::Permissions::from_mode(mode))
}

#[cfg(not(unix))]
fn restrict(_: &Path, _: u32) -> std::io::Result<()> {
    Ok(())
}
