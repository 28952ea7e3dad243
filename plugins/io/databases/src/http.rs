//! One request by HTTP, on a connection of its own.

use std::io::{Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::Duration as Wait;

use schemars::JsonSchema;
use serde::Deserialize;

/// How long an answer may take.
const PATIENCE: Wait = Wait::from_secs(10);
/// How much of an answer is read.
const ANSWER: u64 = 16 << 10;

/// Where something is asked.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
#[schemars(with = "String")]
pub struct Address {
    host: String,
    port: u16,
    /// What stands before the path of a request.
    before: String,
}

impl TryFrom<String> for Address {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let wrong =
            |why: &str| format!("\"{text}\" is no address: {why}; write \"http://HOST:PORT\"");
        let rest = text.strip_prefix("http://");
        let rest = rest.ok_or(match text.starts_with("https://") {
            true => wrong("this sink does not speak TLS; let a proxy on this computer do it"),
            false => wrong("it has no `http://`"),
        })?;
        let (place, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
        if place.contains('@') {
            let why = "a user or password has no place in it: they are given by `login` or `token`";
            return Err(wrong(why));
        }
        let (host, port) = match place.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                let port: Result<u16, _> = port.parse();
                (host, port.map_err(|_| wrong("its port is no number"))?)
            }
            _ => (place, 8086),
        };
        let is_plain = |of: char| !of.is_control() && !of.is_whitespace();
        if host.is_empty() || !text.chars().all(is_plain) {
            return Err(wrong("it has no host"));
        }
        Ok(Self {
            host: host.to_owned(),
            port,
            before: path.trim_end_matches('/').to_owned(),
        })
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "http://{}:{}{}", self.host, self.port, self.before)
    }
}

/// An answer: its status, and what it says.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub body: String,
}

impl Address {
    /// Posts something; `headers` are whole lines.
    ///
    /// # Errors
    /// When there is no answer.
    pub fn post(&self, path: &str, headers: &str, body: &[u8]) -> Result<Answer, String> {
        let failed = |error: std::io::Error| error.to_string();
        let name = self.host.trim_matches(['[', ']']);
        let found = (name, self.port).to_socket_addrs().map_err(failed)?;
        let mut stream = Err("its name is of no address".to_owned());
        for address in found {
            stream = TcpStream::connect_timeout(&address, PATIENCE).map_err(failed);
            if stream.is_ok() {
                break;
            }
        }
        let mut stream = stream?;
        stream.set_read_timeout(Some(PATIENCE)).map_err(failed)?;
        stream.set_write_timeout(Some(PATIENCE)).map_err(failed)?;
        let head = format!(
            "POST {}{path} HTTP/1.1\r\nHost: {}:{}\r\nUser-Agent: athermal/{}\r\nContent-Length: {}\r\nConnection: close\r\n{headers}\r\n",
            self.before,
            self.host,
            self.port,
            env!("CARGO_PKG_VERSION"),
            body.len()
        );
        let sent = stream
            .write_all(head.as_bytes())
            .and_then(|()| stream.write_all(body));
        let mut answer = Vec::new();
        // One that does not want the whole of it has answered already.
        let read = (&stream).take(ANSWER).read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer
            .strip_prefix("HTTP/1.")
            .and_then(|of| of.get(2..5)?.parse().ok());
        let Some(status) = status else {
            sent.map_err(failed)?;
            read.map_err(failed)?;
            return Err("it does not answer by HTTP".to_owned());
        };
        let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        Ok(Answer {
            status,
            body: body.trim().to_owned(),
        })
    }
}

/// A text as a value in an address.
pub fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for byte in text.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' => {
                escaped.push(char::from(byte));
            }
            _ => escaped += &format!("%{byte:02X}"),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_host_and_the_usual_port_and_no_password() {
        let of = |text: &str| Address::try_from(text.to_owned()).map(|of| of.to_string());
        assert_eq!(of("http://db"), Ok("http://db:8086".to_owned()));
        assert_eq!(of("http://[::1]:7/x/"), Ok("http://[::1]:7/x".to_owned()));
        for (text, why) in [
            ("db", "no `http://`"),
            ("https://db", "does not speak TLS"),
            ("http://", "no host"),
            ("http://a\r\nb", "no host"),
            ("http://a:b", "no number"),
            ("http://me:w0rd@db", "`login`"),
        ] {
            assert!(of(text).expect_err(text).contains(why), "{text}");
        }
        assert_eq!(escaped("a b&ü"), "a%20b%26%C3%BC");
    }
}
