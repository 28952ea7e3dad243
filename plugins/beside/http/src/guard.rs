//! Who is heard. A browser on the same machine is led here by any web page, so that a name that resolves to loopback is not enough.

use hyper::header::{AUTHORIZATION, HOST, HeaderMap, HeaderName, ORIGIN};
use hyper::{Method, StatusCode};

use crate::answer::Refused;
use crate::token::Token;

/// Where a connection comes from.
#[derive(Clone)]
pub enum Peer {
    /// The Unix socket, from a process of this user.
    Socket { uid: Option<u32> },
    /// Loopback.
    Loopback { token: Token },
}

impl Peer {
    /// How it stands in the journal.
    pub fn name(&self) -> String {
        match self {
            Self::Socket { uid: Some(uid) } => format!("uid {uid}"),
            Self::Socket { uid: None } => "socket".to_owned(),
            Self::Loopback { .. } => "token".to_owned(),
        }
    }

    /// Refuses what is not to be heard.
    pub fn check(&self, method: &Method, headers: &HeaderMap) -> Result<(), Refused> {
        let refused = |words: &str| Err(Refused::new(StatusCode::FORBIDDEN, words));
        let host = only(headers, HOST);
        if let Some(origin) = only(headers, ORIGIN)? {
            let own = host.as_ref().ok().and_then(|host| *host);
            let same = own.is_some_and(|host| origin.strip_prefix("http://") == Some(host));
            if !same {
                return refused("requests of other sites are refused");
            }
        }
        let Self::Loopback { token } = self else {
            return Ok(());
        };
        match host? {
            Some(host) if is_loopback(host) => {}
            _ => return refused("`Host` is to be 127.0.0.1, [::1] or localhost"),
        }
        if method != Method::POST {
            return Ok(());
        }
        let given = only(headers, AUTHORIZATION)?;
        let given = given.and_then(|text| text.split_once(' '));
        let given = given.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"));
        match given {
            Some((_, text)) if token.is(text.trim()) => Ok(()),
            _ => Err(Refused::new(
                StatusCode::UNAUTHORIZED,
                "orders over TCP need `Authorization: Bearer` with the token of the state folder",
            )),
        }
    }
}

/// A header that may stand once.
fn only(headers: &HeaderMap, name: HeaderName) -> Result<Option<&str>, Refused> {
    let wrong = || Refused::new(StatusCode::BAD_REQUEST, &format!("`{name}` is not right"));
    let mut all = headers.get_all(&name).iter();
    let (first, second) = (all.next(), all.next());
    if second.is_some() {
        return Err(wrong());
    }
    first
        .map(|value| value.to_str().map_err(|_| wrong()))
        .transpose()
}

/// Whether a `Host` is a literal name of the machine itself, with or without a port.
fn is_loopback(host: &str) -> bool {
    let names = ["127.0.0.1", "[::1]", "localhost"];
    names.iter().any(|name| {
        let rest = host.strip_prefix(name);
        rest.is_some_and(|rest| {
            let port = rest.strip_prefix(':');
            rest.is_empty() || port.is_some_and(|port| port.parse::<u16>().is_ok())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_literal_names_of_the_machine_itself_are_hosts() {
        for host in [
            "127.0.0.1",
            "127.0.0.1:9464",
            "[::1]:1",
            "localhost",
            "localhost:80",
        ] {
            assert!(is_loopback(host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "127.0.0.1.evil.example",
            "localhost.evil.example:80",
            "127.0.0.1:",
            "127.0.0.1:99999",
            "127.0.0.1@evil.example",
            "[::1",
        ] {
            assert!(!is_loopback(host), "{host}");
        }
    }
}
