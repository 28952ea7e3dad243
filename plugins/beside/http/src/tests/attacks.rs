//! Attacks on the control interface: refused, with bounded memory, and no tick is late or missing for them.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::prng::Prng;
use serde_json::Value;

use super::metrics::value;
use super::{Bench, GRAPH, exchange, free_port, tcp};
use crate::client::Address;

fn status_of(answer: &str) -> u16 {
    let code = answer.split(' ').nth(1).and_then(|code| code.parse().ok());
    code.unwrap_or_default()
}

/// A request over TCP, with these headers beside `Connection`.
fn ask(port: u16, line: &str, headers: &[(&str, &str)], body: &str) -> u16 {
    let mut text = format!(
        "{line} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n",
        body.len()
    );
    for (name, value) in headers {
        text += &format!("{name}: {value}\r\n");
    }
    status_of(&exchange(tcp(port), (text + "\r\n" + body).as_bytes()))
}

#[test]
fn orders_over_tcp_need_the_token_and_other_hosts_and_origins_are_refused() {
    let port = free_port();
    let bench = Bench::start(GRAPH, &format!("[control]\nhttp = \"127.0.0.1:{port}\"\n"));
    let path = bench.path("state/token");
    let mode =
        std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(&path).unwrap().permissions());
    assert_eq!(mode & 0o777, 0o600);
    let token = std::fs::read_to_string(&path).unwrap();
    let bearer = format!("Bearer {}", token.trim());
    let host = format!("127.0.0.1:{port}");
    let freeze = "POST /v1/freeze";
    let own = ("Host", &*host);
    for (line, headers, status) in [
        (freeze, vec![own], 401),
        (freeze, vec![own, ("Authorization", "Bearer wrong")], 401),
        (freeze, vec![own, ("Authorization", "Basic wrong")], 401),
        (freeze, vec![own, ("Authorization", &*bearer)], 200),
        (
            freeze,
            vec![
                own,
                ("Authorization", &*bearer),
                ("Origin", "http://evil.example"),
            ],
            403,
        ),
        (
            freeze,
            vec![("Host", "evil.example"), ("Authorization", &*bearer)],
            403,
        ),
        (freeze, vec![own, own, ("Authorization", &*bearer)], 400),
        ("GET /v1/status", vec![own], 200),
        (
            "GET /v1/status",
            vec![own, ("Origin", &*format!("http://{host}"))],
            200,
        ),
        ("GET /v1/status", vec![own, ("Origin", "null")], 403),
        ("GET /v1/status", vec![("Host", "evil.example")], 403),
        (
            "GET /v1/status",
            vec![("Host", &*format!("evil.example:{port}"))],
            403,
        ),
        ("GET /v1/status", vec![], 403),
        ("GET /nothing", vec![own], 404),
        ("DELETE /v1/status", vec![own], 405),
        ("GET /v1/stop", vec![own], 405),
    ] {
        assert_eq!(ask(port, line, &headers, ""), status, "{line} {headers:?}");
    }
    // The socket is as good as the rights of its file.
    let Address::Socket(socket) = bench.address() else {
        panic!()
    };
    let mode =
        std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(&socket).unwrap().permissions());
    assert_eq!(mode & 0o777, 0o660);
    let origin = "GET /v1/status HTTP/1.0\r\nOrigin: http://evil.example\r\n\r\n";
    assert_eq!(status_of(&bench.raw(origin.as_bytes())), 403);
}

#[test]
fn bodies_and_headers_that_are_too_large_and_what_is_no_http_are_refused() {
    let bench = Bench::start(GRAPH, "");
    let head = |length: usize| {
        format!(
            "POST /v1/stage HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n"
        )
    };
    let large = [head(9 << 20).into_bytes(), vec![b' '; 9 << 20]].concat();
    assert_eq!(status_of(&bench.raw(&large)), 413);
    let headers = format!(
        "GET /v1/status HTTP/1.1\r\nX: {}\r\n\r\n",
        "y".repeat(200_000)
    );
    assert!(matches!(
        status_of(&bench.raw(headers.as_bytes())),
        0 | 400 | 431
    ));
    let many: String = (0..1_000).map(|nth| format!("X{nth}: 1\r\n")).collect();
    let many = format!("GET /v1/status HTTP/1.1\r\n{many}\r\n");
    assert!(matches!(
        status_of(&bench.raw(many.as_bytes())),
        0 | 400 | 431
    ));
    for bytes in [
        &b"\0\0\0\0\r\n\r\n"[..],
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"\x16\x03\x01\x02\x00",
    ] {
        let answer = bench.raw(bytes);
        assert!(matches!(status_of(&answer), 0 | 400 | 505), "{answer}");
    }
    let nested = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    let nested = head(nested.len()) + &nested;
    assert_eq!(status_of(&bench.raw(nested.as_bytes())), 400);
    assert_eq!(bench.status()["state"], "running");
}

#[test]
fn whoever_sends_slowly_or_never_reads_loses_its_connection_and_others_are_answered() {
    let bench = Bench::start(GRAPH, "");
    let Address::Socket(path) = bench.address() else {
        panic!()
    };
    let connect = || UnixStream::connect(&path).unwrap();
    // Eight that send a byte now and then, and four that never read what they asked for.
    let mut slow: Vec<_> = (0..8).map(|_| connect()).collect();
    let mut deaf: Vec<_> = (0..4).map(|_| connect()).collect();
    for stream in &mut deaf {
        stream
            .write_all(b"GET /v1/events?channel=* HTTP/1.1\r\nHost: x\r\n\r\n")
            .unwrap();
    }
    let listeners = || value(&bench, "athermal_control_listeners{").unwrap();
    let mut most = 0.0_f64;
    let began = Clock::now();
    while began.elapsed() < Wait::from_secs(7) {
        most = most.max(listeners());
        for stream in &mut slow {
            let _ = stream.write_all(b"G");
        }
        assert_eq!(bench.status()["name"], "line");
        std::thread::sleep(Wait::from_millis(250));
    }
    for stream in &mut slow {
        stream.set_read_timeout(Some(Wait::from_secs(5))).unwrap();
        let mut text = Vec::new();
        assert!(stream.read_to_end(&mut text).is_ok(), "it is still open");
    }
    assert_eq!(most, 4.0);
    while listeners() > 0.0 {
        assert!(
            began.elapsed() < Wait::from_secs(60),
            "they are still heard"
        );
        std::thread::sleep(Wait::from_millis(250));
    }
}

#[test]
fn of_ten_thousand_connections_most_are_turned_away_and_the_ticks_go_on() {
    let count = if std::env::var_os("ATHERMAL_LONG").is_some() {
        10_000
    } else {
        2_000
    };
    let bench = Bench::start(GRAPH, "");
    let Address::Socket(path) = bench.address() else {
        panic!()
    };
    let before = bench.status();
    let memory = resident();
    let mut open = Vec::new();
    for nth in 0..count {
        if let Ok(stream) = UnixStream::connect(&path) {
            open.push(stream);
        }
        if nth % 500 == 499 {
            open.clear();
        }
    }
    drop(open);
    let grown = resident().saturating_sub(memory);
    assert!(grown < 32 << 20, "{grown} bytes");
    let after = settled(&bench);
    let ticks = |of: &Value| of["ticks"].as_u64().unwrap();
    let before = ticks(&before).max(ticks(&after));
    bench.until("more ticks", |of| ticks(of) > before);
    let turned_away = String::from_utf8(bench.get("/metrics").body).unwrap();
    let line = turned_away
        .lines()
        .find(|of| of.starts_with("athermal_control_refused_connections_total"));
    let refused: f64 = line.unwrap().rsplit(' ').next().unwrap().parse().unwrap();
    assert!(refused > 100.0, "{refused}");
}

/// The status, once there is room again.
fn settled(bench: &Bench) -> Value {
    let began = Clock::now();
    loop {
        if let Ok(reply) = bench.address().get("/v1/status")
            && reply.status == 200
        {
            return reply.json();
        }
        assert!(began.elapsed() < Wait::from_secs(20));
        std::thread::sleep(Wait::from_millis(50));
    }
}

/// Bytes of memory that this process has.
fn resident() -> usize {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    text.split(' ').nth(1).unwrap().parse::<usize>().unwrap() * 4096
}

#[test]
fn whatever_is_sent_the_service_goes_on() {
    let count = if std::env::var_os("ATHERMAL_LONG").is_some() {
        100_000
    } else {
        2_000
    };
    let bench = Bench::start(GRAPH, "");
    let Address::Socket(path) = bench.address() else {
        panic!()
    };
    let whole = [
        "GET /v1/status HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "POST /v1/shadow HTTP/1.1\r\nHost: localhost\r\nContent-Length: 33\r\n\r\n{\"duration\": \"1s\", \"margin\": 0.0}",
        "POST /v1/stage HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n{\"a\":\r\n0\r\n\r\n",
        "GET /v1/events?channel=%74emperature.room&ticks=1 HTTP/1.1\r\n\r\n",
        "POST /v1/stage HTTP/1.1\r\nContent-Length: 20\r\n\r\n{\"path\": \"/dev/null\"}",
    ];
    let mut prng = Prng::stream(47, "requests");
    let mut below = |n: usize| (prng.uniform() * n as f64) as usize;
    let memory = resident();
    for nth in 0..count {
        let mut bytes = whole[nth % whole.len()].as_bytes().to_vec();
        for _ in 0..=below(6) {
            let at = below(bytes.len());
            match below(4) {
                0 => bytes[at] = below(256) as u8,
                1 => bytes.truncate(at.max(1)),
                2 => bytes.insert(at, below(256) as u8),
                _ => {
                    let part = bytes[at..].to_vec();
                    bytes.extend_from_slice(&part[..part.len().min(64)]);
                }
            }
        }
        let Ok(mut stream) = UnixStream::connect(&path) else {
            continue;
        };
        let _ = stream.write_all(&bytes);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        stream.set_read_timeout(Some(Wait::from_millis(2))).unwrap();
        let _ = stream.read(&mut [0; 256]);
    }
    let grown = resident().saturating_sub(memory);
    assert!(grown < 64 << 20, "{grown} bytes");
    assert!(settled(&bench)["ticks"].as_u64() > Some(10));
}
