//! `influx` as a sink: rows as lines of InfluxDB, of either generation of its interface.

use std::fmt::Write as _;
use std::io::Write as _;

use athermal_serve::connector::{ConnectorError, Outlet, ParameterRemark, Sink, SinkWiring};
use athermal_serve::deployment::{Login, Secret};
use athermal_serve::register_sink;
use flate2::Compression;
use flate2::write::GzEncoder;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::batches::{Batches, Row, Store, Trouble};
use crate::http::{Address, escaped};

/// A point of InfluxDB for each output of each tick: `value` and `revision`, with the tags `machine` and `output`.
///
/// With `database` as InfluxDB 1 has it, with `org` and `bucket` as later ones do. Points go in batches, packed; one that comes again after
/// a restart is the same point. Where the database is away the journal keeps them; one that is refused is set aside in a file.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct InfluxSink {
    /// The server: "http://HOST", with ":PORT" where it is not 8086.
    url: Address,
    /// The database, of InfluxDB 1.
    #[serde(default)]
    database: Option<String>,
    /// The organisation, of later ones…
    #[serde(default)]
    org: Option<String>,
    /// …and the bucket.
    #[serde(default)]
    bucket: Option<String>,
    /// User and password, of InfluxDB 1.
    #[serde(default)]
    login: Option<Login>,
    /// Where the token stands, of later ones.
    #[serde(default)]
    token: Option<Secret>,
    /// The measurement.
    #[serde(default = "athermal")]
    measurement: String,
}

register_sink!(InfluxSink, "influx");

fn athermal() -> String {
    "athermal".to_owned()
}

impl Sink for InfluxSink {
    fn remarks(&self) -> Vec<ParameterRemark> {
        let (at, words, help) = match (&self.database, &self.org, &self.bucket) {
            (Some(_), None, None) if self.token.is_some() => (
                "token",
                "a token is of `org` and `bucket`",
                "give `login`, or write `org` and `bucket` in place of `database`",
            ),
            (None, Some(_), Some(_)) if self.login.is_some() => (
                "login",
                "user and password are of `database`",
                "give `token`, or write `database` in place of `org` and `bucket`",
            ),
            (Some(_), None, None) | (None, Some(_), Some(_)) => return Vec::new(),
            _ => (
                "url",
                "it does not say where points go",
                "write `database`, or both of `org` and `bucket`",
            ),
        };
        vec![ParameterRemark {
            at: vec![at.to_owned()],
            is_mistake: true,
            words: words.to_owned(),
            help: help.to_owned(),
        }]
    }

    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let secret = |of: Result<String, String>| of.map_err(ConnectorError::new);
        let mut headers =
            "Content-Type: text/plain; charset=utf-8\r\nContent-Encoding: gzip\r\n".to_owned();
        if let Some(token) = &self.token {
            let token = secret(token.read(&wiring.folder))?;
            headers += &format!("Authorization: Token {}\r\n", header(&token)?);
        }
        if let Some(login) = &self.login {
            let (name, password) = login.read(&wiring.folder).map_err(ConnectorError::new)?;
            let both = base64(format!("{name}:{password}").as_bytes());
            headers += &format!("Authorization: Basic {both}\r\n");
        }
        let text = |of: &Option<String>| escaped(of.as_deref().unwrap_or_default());
        let path = match &self.database {
            Some(_) => format!("/write?db={}&precision=ns", text(&self.database)),
            None => format!(
                "/api/v2/write?org={}&bucket={}&precision=ns",
                text(&self.org),
                text(&self.bucket)
            ),
        };
        let machine = wiring.machine.as_deref().unwrap_or("machine");
        let heads = wiring.outputs.iter().map(|of| {
            format!(
                "{},machine={},output={}",
                tag(&self.measurement),
                tag(machine),
                tag(&of.name)
            )
        });
        let store = Influx {
            address: self.url.clone(),
            path,
            headers,
            heads: heads.collect(),
        };
        Ok(Box::new(Batches::new(store, &wiring)))
    }
}

/// A text that stands in a line of a request.
fn header(text: &str) -> Result<&str, ConnectorError> {
    let is_plain = text.chars().all(|of| of.is_ascii_graphic() || of == ' ');
    is_plain
        .then_some(text)
        .ok_or_else(|| ConnectorError::new("`token` is none: it has signs that none has"))
}

/// A name in a line.
fn tag(text: &str) -> String {
    let mut tag = String::new();
    for of in text.chars().filter(|of| !of.is_control()) {
        if matches!(of, ',' | ' ' | '=' | '\\') {
            tag.push('\\');
        }
        tag.push(of);
    }
    tag
}

fn base64(bytes: &[u8]) -> String {
    const SIGNS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for piece in bytes.chunks(3) {
        let whole = piece
            .iter()
            .fold(0_u32, |all, of| all << 8 | u32::from(*of));
        let whole = whole << (8 * (3 - piece.len()));
        for nth in 0..4 {
            let sign = SIGNS[(whole >> (18 - 6 * nth) & 63) as usize];
            text.push(if nth <= piece.len() {
                char::from(sign)
            } else {
                '='
            });
        }
    }
    text
}

/// A database.
#[derive(Debug)]
struct Influx {
    address: Address,
    path: String,
    headers: String,
    /// What a line of each output begins with.
    heads: Vec<String>,
}

impl Influx {
    fn lines(&self, rows: &[Row]) -> String {
        let mut text = String::new();
        for row in rows {
            let (at, revision) = (row.at.as_ns(), row.revision);
            for (nth, value) in &row.values {
                // With a point always: a whole number would be of another type.
                let head = &self.heads[*nth];
                let _ = writeln!(
                    text,
                    "{head} value={value:?},revision=\"{revision:016x}\" {at}"
                );
            }
        }
        text
    }

    fn failed(&self, why: impl std::fmt::Display) -> String {
        format!("{}: {why}", self.address)
    }
}

impl Store for Influx {
    fn write(&mut self, rows: &[Row]) -> Result<(), Trouble> {
        let away = |why: String| Trouble::Away(self.failed(why));
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        let packed = packed
            .write_all(self.lines(rows).as_bytes())
            .and_then(|()| packed.finish());
        let packed = packed.map_err(|error| away(error.to_string()))?;
        let answer = self
            .address
            .post(&self.path, &self.headers, &packed)
            .map_err(away)?;
        let said: String = answer.body.chars().take(300).collect();
        let said = format!("it answers {}: {said}", answer.status);
        match answer.status {
            200..=299 => Ok(()),
            // Too much at once, or a line that does not fit what is there.
            400 | 413 | 422 => Err(Trouble::Refused(self.failed(said))),
            401 | 403 => Err(away(format!("{said}; see `login` or `token`"))),
            404 => Err(away(format!(
                "{said}; make the database or the bucket, or see `url`"
            ))),
            _ => Err(away(said)),
        }
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::time::Instant;

    use super::*;

    #[test]
    fn a_row_is_a_line_for_each_output_that_is_there() {
        let influx = Influx {
            address: Address::try_from("http://db".to_owned()).unwrap(),
            path: String::new(),
            headers: String::new(),
            heads: vec![
                "m,output=a".to_owned(),
                format!("m,output={}", tag("b, c=d\n\\")),
            ],
        };
        let row = |values: &[(usize, f64)]| Row {
            at: Instant::from_ns(7),
            revision: 0xab,
            values: values.to_vec(),
        };
        let text = influx.lines(&[row(&[(0, 1.0), (1, -2.5e-9)]), row(&[(1, 1e300)])]);
        assert_eq!(
            text,
            "m,output=a value=1.0,revision=\"00000000000000ab\" 7\n\
             m,output=b\\,\\ c\\=d\\\\ value=-2.5e-9,revision=\"00000000000000ab\" 7\n\
             m,output=b\\,\\ c\\=d\\\\ value=1e300,revision=\"00000000000000ab\" 7\n"
        );
    }

    #[test]
    fn a_login_is_written_as_the_standard_says() {
        for (text, expected) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
        ] {
            assert_eq!(base64(text.as_bytes()), expected);
        }
        assert!(header("abc-_=").is_ok() && header("a\r\nb").is_err());
    }
}
