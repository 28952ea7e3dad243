//! Who is heard. A browser on the same machine is led here by any web page, so that a name that resolves to loopback is not enough.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration as Wait, Instant as Clock};

use hyper::header::{AUTHORIZATION, HOST, HeaderMap, HeaderName, IF_MATCH, ORIGIN};
use hyper::{Method, StatusCode};

use crate::answer::Refused;
use crate::settings::Origin;
use crate::token::Token;

/// So many wrong tokens of a peer are answered at once; those after wait.
const WRONG: u32 = 5;
/// How long they wait.
const WAITS: Wait = Wait::from_secs(1);
/// How long a wrong token is remembered, and of how many peers.
const REMEMBERED: (Wait, usize) = (Wait::from_secs(60), 4096);

/// Where a connection comes from.
#[derive(Clone)]
pub enum Peer {
    /// The Unix socket, from a process of this user.
    Socket { uid: Option<u32> },
    /// A door of TCP.
    Tcp { guard: Arc<Guard>, address: IpAddr },
}

/// Who passes a door of TCP.
pub struct Guard {
    /// What orders need.
    pub order: Token,
    /// What it takes to look, over TLS.
    pub read: Token,
    /// Whether it is TLS, which other machines may use.
    pub is_tls: bool,
    /// Whose pages may ask besides.
    pub origins: Vec<Origin>,
    /// Wrong tokens, by where they come from.
    pub wrong: Mutex<HashMap<IpAddr, (u32, Clock)>>,
}

impl Peer {
    /// How it stands in the journal.
    pub fn name(&self) -> String {
        match self {
            Self::Socket { uid: Some(uid) } => format!("uid {uid}"),
            Self::Socket { uid: None } => "socket".to_owned(),
            Self::Tcp { guard, address } if guard.is_tls => format!("token from {address}"),
            Self::Tcp { .. } => "token".to_owned(),
        }
    }

    /// Refuses what is not to be heard. `is_open`: it says nothing of the machine.
    pub async fn check(
        &self,
        method: &Method,
        headers: &HeaderMap,
        is_open: bool,
    ) -> Result<(), Refused> {
        let refused = |words: &str| Err(Refused::new(StatusCode::FORBIDDEN, words));
        let host = only(headers, HOST);
        let (scheme, origins) = match self {
            Self::Tcp { guard, .. } if guard.is_tls => ("https://", &guard.origins[..]),
            Self::Tcp { guard, .. } => ("http://", &guard.origins[..]),
            Self::Socket { .. } => ("http://", &[][..]),
        };
        let own = host.as_ref().ok().and_then(|host| *host);
        if let Some(origin) = only(headers, ORIGIN)? {
            let same = own.is_some_and(|host| origin.strip_prefix(scheme) == Some(host));
            if !same && !origins.iter().any(|of| of.0 == origin) {
                return refused(
                    "requests of other sites are refused; a proxy is named by `origins` of `[control]`",
                );
            }
        }
        let Self::Tcp { guard, address } = self else {
            return Ok(());
        };
        match host? {
            _ if guard.is_tls => {}
            Some(host) if is_loopback(host) || origins.iter().any(|of| of.host() == host) => {}
            _ => {
                return refused(
                    "`Host` is to be 127.0.0.1, [::1], localhost, or that of one of the `origins`",
                );
            }
        }
        let is_order = method == Method::POST;
        if !is_order && (is_open || !guard.is_tls) {
            return Ok(());
        }
        let given = only(headers, AUTHORIZATION)?;
        let given = given.and_then(|text| text.split_once(' '));
        let given = given.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"));
        let unauthorized = || {
            let words = match is_order {
                true => {
                    "orders need `Authorization: Bearer` with what stands in `token` of the state folder"
                }
                false => {
                    "over TLS `Authorization: Bearer` is needed with what stands in `token-read`, or in `token`, of the state folder"
                }
            };
            Err(Refused::new(StatusCode::UNAUTHORIZED, words))
        };
        let Some((_, given)) = given else {
            return unauthorized();
        };
        // Both are looked at, whichever it is.
        let (orders, reads) = (guard.order.is(given.trim()), guard.read.is(given.trim()));
        if orders || reads && !is_order {
            guard.right(*address);
            return Ok(());
        }
        if reads {
            return refused("this token is for looking; orders need the other one");
        }
        if guard.wrong(*address) > WRONG {
            tokio::time::sleep(WAITS).await;
        }
        unauthorized()
    }
}

impl Guard {
    fn right(&self, address: IpAddr) {
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        wrong.remove(&address);
    }

    /// How many wrong tokens came from there of late.
    fn wrong(&self, address: IpAddr) -> u32 {
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        if wrong.len() >= REMEMBERED.1 {
            wrong.retain(|_, (_, last)| last.elapsed() < REMEMBERED.0);
        }
        if wrong.len() >= REMEMBERED.1 {
            // Of so many none is known from the others.
            return WRONG + 1;
        }
        let now = Clock::now();
        let (count, last) = wrong.entry(address).or_insert((0, now));
        if last.elapsed() > REMEMBERED.0 {
            *count = 0;
        }
        (*count, *last) = (count.saturating_add(1), now);
        *count
    }
}

/// The revision that an order is meant for, as `If-Match` names it. One from a page has to.
pub fn meant_for(headers: &HeaderMap) -> Result<Option<String>, Refused> {
    let named = only(headers, IF_MATCH)?;
    if named.is_none() && headers.contains_key(ORIGIN) {
        let words =
            "an order from a page names the revision that it shows: `If-Match: \"REVISION\"`";
        return Err(Refused::not_now(words));
    }
    Ok(named.map(|of| of.trim().trim_matches('"').to_owned()))
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
