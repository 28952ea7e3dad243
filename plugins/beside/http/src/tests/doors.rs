//! Who is heard at the doors of TCP, and how many.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration as Wait, Instant as Clock};

use serde_json::json;

use super::{Bench, GRAPH, exchange, free_port, tcp};

/// A request over TCP with these headers: the status and all of the answer.
fn ask(
    stream: impl Read + Write,
    line: &str,
    headers: &[(&str, &str)],
    body: &str,
) -> (u16, String) {
    let mut text = format!(
        "{line} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n",
        body.len()
    );
    for (name, value) in headers {
        text += &format!("{name}: {value}\r\n");
    }
    let answer = exchange(stream, (text + "\r\n" + body).as_bytes());
    let code = answer.split(' ').nth(1).and_then(|code| code.parse().ok());
    (code.unwrap_or_default(), answer)
}

fn bearer(bench: &Bench, file: &str) -> String {
    let token = std::fs::read_to_string(bench.path("state").join(file)).unwrap();
    format!("Bearer {}", token.trim())
}

#[test]
fn an_order_from_a_page_names_the_revision_that_it_shows_and_a_proxy_is_heard_where_its_origin_is_named()
 {
    let port = free_port();
    let control =
        format!("[control]\nhttp = \"127.0.0.1:{port}\"\norigins = [\"https://edge.plant\"]\n");
    let bench = Bench::start(GRAPH, &control);
    let order = bearer(&bench, "token");
    let runs = bench.status()["revision"].as_str().unwrap().to_owned();
    let (host, own) = (
        format!("127.0.0.1:{port}"),
        format!("http://127.0.0.1:{port}"),
    );
    let quoted = format!("\"{runs}\"");
    let token = ("Authorization", &*order);
    for (origin, named, host, status) in [
        (None, None, &*host, 200),
        (None, Some(&*quoted), &host, 200),
        (None, Some("\"0123456789abcdef\""), &host, 409),
        (Some(&*own), None, &host, 409),
        (Some(&own), Some(&quoted), &host, 200),
        (Some("https://edge.plant"), Some(&quoted), &host, 200),
        (Some("https://edge.plant"), Some(&quoted), "edge.plant", 200),
        (Some("http://edge.plant"), Some(&quoted), &host, 403),
        (Some("https://edge.plant.evil"), Some(&quoted), &host, 403),
        (None, Some(&quoted), "edge.plant.evil", 403),
    ] {
        let mut headers = vec![("Host", host), token];
        headers.extend(origin.map(|of| ("Origin", of)));
        headers.extend(named.map(|of| ("If-Match", of)));
        let (found, answer) = ask(tcp(port), "POST /v1/thaw", &headers, "");
        assert_eq!(found, status, "{origin:?} {named:?} {host}: {answer}");
    }
    for path in [
        "/../../etc/passwd",
        "/v1/../v1/status",
        "/v1/status/",
        "//v1/status",
        "/%2e%2e/token",
        "/v1/status%00",
        "/page.js/../../token",
        "http://evil.example/v1/statuses",
    ] {
        let line = format!("GET {path}");
        assert_eq!(
            ask(tcp(port), &line, &[("Host", &host)], "").0,
            404,
            "{path}"
        );
    }
    let (_, answer) = ask(tcp(port), "GET /v1/status", &[("Host", &host)], "");
    assert!(
        answer.contains("content-security-policy: default-src 'none'"),
        "{answer}"
    );
}

#[test]
fn wrong_tokens_wait_a_second_after_five_of_them_and_the_right_one_never_does() {
    let port = free_port();
    let bench = Bench::start(GRAPH, &format!("[control]\nhttp = \"127.0.0.1:{port}\"\n"));
    let order = bearer(&bench, "token");
    let host = format!("127.0.0.1:{port}");
    let with = |token: &str| {
        let began = Clock::now();
        let headers = [("Host", &*host), ("Authorization", token)];
        let (status, _) = ask(tcp(port), "POST /v1/thaw", &headers, "");
        (status, began.elapsed() >= Wait::from_millis(950))
    };
    for _ in 0..5 {
        assert_eq!(with("Bearer wrong"), (401, false));
    }
    let others: Vec<_> = std::thread::scope(|scope| {
        let all: Vec<_> = (0..8)
            .map(|_| scope.spawn(|| with("Bearer wrong")))
            .collect();
        // While they wait.
        assert_eq!(with(&order), (200, false));
        all.into_iter().map(|of| of.join().unwrap()).collect()
    });
    assert!(
        others.iter().filter(|of| **of == (401, true)).count() >= 2,
        "{others:?}"
    );
    assert_eq!(with(&order), (200, false));
    assert_eq!(
        with("Bearer wrong"),
        (401, false),
        "the right one has been given since"
    );
}

#[test]
fn sixty_four_streams_are_open_and_orders_and_status_are_answered_meanwhile() {
    let port = free_port();
    let bench = Bench::start(GRAPH, &format!("[control]\nhttp = \"127.0.0.1:{port}\"\n"));
    let order = bearer(&bench, "token");
    let host = format!("127.0.0.1:{port}");
    let stream = || {
        let mut stream = tcp(port);
        let text = format!("GET /v1/events?ticks=1 HTTP/1.1\r\nHost: {host}\r\n\r\n");
        stream.write_all(text.as_bytes()).unwrap();
        let mut begin = [0; 512];
        let count = stream.read(&mut begin).unwrap();
        (
            stream,
            String::from_utf8_lossy(&begin[..count]).into_owned(),
        )
    };
    let open: Vec<_> = (0..64).map(|_| stream()).collect();
    assert!(
        open.iter()
            .all(|(_, begin)| begin.starts_with("HTTP/1.1 200"))
    );
    let (_, more) = stream();
    assert!(
        more.starts_with("HTTP/1.1 503") && more.contains("retry-after: 1"),
        "{more}"
    );
    let own = ("Host", &*host);
    let (status, _) = ask(tcp(port), "GET /v1/status", &[own], "");
    assert_eq!(status, 200);
    let (status, _) = ask(
        tcp(port),
        "POST /v1/freeze",
        &[own, ("Authorization", &order)],
        "",
    );
    assert_eq!(status, 200);
    drop(open);
    let began = Clock::now();
    while !stream().1.starts_with("HTTP/1.1 200") {
        assert!(began.elapsed() < Wait::from_secs(10), "none is free");
    }
}

#[test]
fn the_text_of_a_graph_is_staged_as_if_it_stood_beside_the_machine_file() {
    let bench = Bench::start(GRAPH, "");
    std::fs::write(bench.path("base.toml"), GRAPH).unwrap();
    let stage = |graph: &str| bench.post("/v1/stage", &json!({ "graph": graph }));
    // What means the same takes the fit that runs.
    let staged =
        stage("schema = 1\nextends = \"base.toml\"\nname = \"line\"\noutputs.also = \"steady\"\n");
    assert_eq!(
        staged.status,
        200,
        "{}",
        String::from_utf8_lossy(&staged.body)
    );
    // What has none is named.
    let unfitted = stage("schema = 1\nextends = \"base.toml\"\nnodes.steady.ahead = \"2s\"\n");
    let text = unfitted.json()["error"].as_str().unwrap().to_owned();
    assert_eq!(
        (unfitted.status, text.contains("steady")),
        (422, true),
        "{text}"
    );
    let wrong = stage("schema = 1\nextends = \"base.toml\"\noutputs.also = \"stedy\"\n");
    let text = wrong.json()["text"].as_str().unwrap().to_owned();
    assert_eq!(wrong.status, 422);
    assert!(
        text.contains("graph.toml:3") && text.contains("^^^^^"),
        "{text}"
    );
    assert_eq!(stage(&"x".repeat(100)).status, 422);
}

#[cfg(feature = "tls")]
mod over_tls {
    use std::sync::Arc;

    use rustls::pki_types::pem::PemObject;
    use rustls::pki_types::{CertificateDer, ServerName};
    use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

    use super::*;

    fn connect(
        port: u16,
        certificate: &std::path::Path,
    ) -> StreamOwned<ClientConnection, TcpStream> {
        let mut roots = RootCertStore::empty();
        roots
            .add(CertificateDer::from_pem_file(certificate).unwrap())
            .unwrap();
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider);
        let config = config.with_safe_default_protocol_versions().unwrap();
        let config = config.with_root_certificates(roots).with_no_client_auth();
        let name = ServerName::try_from("localhost").unwrap();
        let client = ClientConnection::new(Arc::new(config), name).unwrap();
        StreamOwned::new(client, tcp(port))
    }

    #[test]
    fn other_machines_look_with_one_token_and_order_with_another_and_a_new_certificate_is_read() {
        let port = free_port();
        let bench = Bench::start(
            GRAPH,
            &format!("[control]\nhttps.at = \"127.0.0.1:{port}\"\n"),
        );
        let [order, read] = ["token", "token-read"].map(|of| bearer(&bench, of));
        let certificate = bench.path("state/https.crt");
        let host = format!("localhost:{port}");
        let origin = format!("https://{host}");
        for (line, token, status) in [
            ("GET /v1/status", None, 401),
            ("GET /metrics", None, 401),
            ("GET /v1/events", None, 401),
            ("GET /v1/status", Some("Bearer wrong"), 401),
            ("GET /v1/status", Some(&*read), 200),
            ("GET /v1/status", Some(&order), 200),
            ("POST /v1/freeze", Some(&read), 403),
            ("POST /v1/freeze", Some(&order), 200),
            ("GET /nothing", None, 401),
        ] {
            let mut headers = vec![("Host", &*host)];
            headers.extend(token.map(|of| ("Authorization", of)));
            let (found, answer) = ask(connect(port, &certificate), line, &headers, "");
            assert_eq!(found, status, "{line} {token:?}: {answer}");
        }
        let page = [
            ("Host", &*host),
            ("Origin", &*origin),
            ("Authorization", &*read),
        ];
        assert_eq!(
            ask(connect(port, &certificate), "GET /v1/status", &page, "").0,
            200
        );
        let plain = exchange(
            tcp(port),
            b"GET /v1/status HTTP/1.1\r\nHost: localhost\r\n\r\n",
        );
        assert!(!plain.contains("200 OK"), "{plain}");
        // Its fingerprint is reported.
        bench.until("the fingerprint", |of| {
            of["events"]
                .as_array()
                .unwrap()
                .iter()
                .any(|of| of["event"] == "own_certificate")
        });
        let made = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
        let other = bench.path("other.crt");
        std::fs::write(&other, made.cert.pem()).unwrap();
        std::fs::write(
            bench.path("state/https.key"),
            made.signing_key.serialize_pem(),
        )
        .unwrap();
        // Until both are there the one before goes on.
        assert_eq!(
            ask(connect(port, &certificate), "GET /v1/status", &page, "").0,
            200
        );
        std::fs::copy(&other, bench.path("state/https.crt")).unwrap();
        assert_eq!(
            ask(connect(port, &other), "GET /v1/status", &page, "").0,
            200
        );
    }
}
