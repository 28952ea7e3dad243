//! A client of MQTT 3.1.1 by hand: it shares no code with what is tried.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A packet: the first byte, and what follows its length.
pub type Packet = (u8, Vec<u8>);

/// A message as it came.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    pub topic: String,
    pub payload: Vec<u8>,
}

/// Writes a packet.
pub fn write(stream: &mut impl Write, first: u8, body: &[u8]) -> io::Result<()> {
    let mut bytes = vec![first];
    let mut left = body.len();
    loop {
        let more = left >= 128;
        bytes.push((left % 128) as u8 | if more { 128 } else { 0 });
        left /= 128;
        if !more {
            break;
        }
    }
    bytes.extend_from_slice(body);
    stream.write_all(&bytes)
}

/// Cuts a whole packet off the front of what has been read.
pub fn cut(bytes: &mut Vec<u8>) -> Option<Packet> {
    let (mut length, mut at) = (0_usize, 1);
    loop {
        let byte = *bytes.get(at)?;
        length |= usize::from(byte & 127) << (7 * (at - 1));
        at += 1;
        if byte < 128 {
            break;
        }
    }
    if bytes.len() < at + length {
        return None;
    }
    let rest = bytes.split_off(at + length);
    let packet = std::mem::replace(bytes, rest);
    Some((packet[0], packet[at..].to_vec()))
}

pub fn text(text: &str) -> Vec<u8> {
    let mut bytes = (text.len() as u16).to_be_bytes().to_vec();
    bytes.extend_from_slice(text.as_bytes());
    bytes
}

pub struct Peer {
    stream: TcpStream,
    bytes: Vec<u8>,
    next: u16,
    pub session_present: bool,
}

impl Peer {
    pub fn connect(port: u16, id: &str, is_clean: bool) -> io::Result<Self> {
        let address = SocketAddr::from(([127, 0, 0, 1], port));
        let mut stream = TcpStream::connect_timeout(&address, Duration::from_secs(1))?;
        stream.set_nodelay(true)?;
        let flags = if is_clean { 2 } else { 0 };
        let body = [text("MQTT"), vec![4, flags, 0, 60], text(id)].concat();
        write(&mut stream, 0x10, &body)?;
        let mut peer = Self {
            stream,
            bytes: Vec::new(),
            next: 0,
            session_present: false,
        };
        match peer.packet(Duration::from_secs(2))? {
            Some((0x20, body)) if body.get(1) == Some(&0) => {
                peer.session_present = body[0] == 1;
                Ok(peer)
            }
            other => Err(io::Error::other(format!("no CONNACK: {other:?}"))),
        }
    }

    pub fn packet(&mut self, within: Duration) -> io::Result<Option<Packet>> {
        let until = Instant::now() + within;
        loop {
            if let Some(packet) = cut(&mut self.bytes) {
                return Ok(Some(packet));
            }
            let left = until.saturating_duration_since(Instant::now());
            self.stream
                .set_read_timeout(Some(left.max(Duration::from_millis(1))))?;
            let mut piece = [0; 65_536];
            match self.stream.read(&mut piece) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => self.bytes.extend_from_slice(&piece[..count]),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    if left.is_zero() {
                        return Ok(None);
                    }
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn number(&mut self) -> u16 {
        self.next = self.next % 60_000 + 1;
        self.next
    }

    /// Publishes with QoS 1, and gives the number that the broker answers with.
    pub fn publish(&mut self, topic: &str, payload: &[u8], flags: u8) -> io::Result<u16> {
        let number = self.number();
        let body = [&text(topic)[..], &number.to_be_bytes(), payload].concat();
        write(&mut self.stream, 0x32 | flags, &body)?;
        Ok(number)
    }

    /// Publishes, and waits for the answer.
    pub fn publish_safely(&mut self, topic: &str, payload: &[u8], is_retained: bool) {
        let number = self.publish(topic, payload, u8::from(is_retained)).unwrap();
        loop {
            let (first, body) = self
                .packet(Duration::from_secs(5))
                .unwrap()
                .expect("an answer");
            if first == 0x40 && body[..2] == number.to_be_bytes() {
                return;
            }
        }
    }

    pub fn subscribe(&mut self, filter: &str) {
        let number = self.number().to_be_bytes();
        let body = [&number[..], &text(filter), &[1]].concat();
        write(&mut self.stream, 0x82, &body).unwrap();
        let (first, _) = self
            .packet(Duration::from_secs(5))
            .unwrap()
            .expect("an answer");
        assert_eq!(first, 0x90);
    }

    /// The next message, acknowledged.
    pub fn receive(&mut self, within: Duration) -> io::Result<Option<Received>> {
        let until = Instant::now() + within;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let Some((first, body)) = self.packet(left)? else {
                return Ok(None);
            };
            if first >> 4 != 3 {
                continue;
            }
            let length = usize::from(u16::from_be_bytes([body[0], body[1]]));
            let topic = String::from_utf8(body[2..2 + length].to_vec()).unwrap();
            let mut at = 2 + length;
            if first & 6 != 0 {
                write(&mut self.stream, 0x40, &body[at..at + 2])?;
                at += 2;
            }
            let payload = body[at..].to_vec();
            return Ok(Some(Received { topic, payload }));
        }
    }
}

impl Peer {
    /// Takes leave, and waits until the broker has read all that was acknowledged.
    pub fn leave(mut self) {
        write(&mut self.stream, 0xe0, &[]).unwrap();
        while self
            .packet(Duration::from_secs(5))
            .is_ok_and(|of| of.is_some())
        {}
    }
}

/// What a publisher sends again on a new connection although the broker had answered: a broker that saves after each message answers
/// a moment before it has saved.
const AGAIN: usize = 50;

/// Publishes with QoS 1 from a queue of its own, in order, one each `pace`, through all outages: what has no answer is sent again, and
/// the last ones that had.
pub fn publish_all(
    port: u16,
    messages: &[(String, String)],
    pace: Duration,
    published: &AtomicU64,
    stop: &AtomicBool,
) {
    let message = |nth: usize| messages[nth].clone();
    publish_each(
        port,
        messages.len(),
        message,
        pace,
        AGAIN,
        stop,
        |_, is_answered| {
            published.fetch_add(u64::from(is_answered), Ordering::Relaxed);
        },
    );
}

/// The same with messages that are made when they are sent, so many of which are sent again; what becomes of each is noted: it is sent
/// for the first time, or answered.
pub fn publish_each(
    port: u16,
    count: usize,
    message: impl Fn(usize) -> (String, String),
    pace: Duration,
    again: usize,
    stop: &AtomicBool,
    mut note: impl FnMut(usize, bool),
) {
    let began = Instant::now();
    let (mut next, mut open) = (0, VecDeque::<usize>::new());
    while (next < count || !open.is_empty()) && !stop.load(Ordering::Relaxed) {
        let Ok(mut peer) = Peer::connect(port, "publisher", true) else {
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        let mut waiting = VecDeque::new();
        let mut work = || -> io::Result<()> {
            let first = open.front().copied().unwrap_or(next);
            for nth in (first.saturating_sub(again)..first).rev() {
                open.push_front(nth);
            }
            for &nth in &open {
                let (topic, payload) = message(nth);
                waiting.push_back(peer.publish(&topic, payload.as_bytes(), 8)?);
            }
            while next < count || !open.is_empty() {
                if stop.load(Ordering::Relaxed) {
                    return Ok(());
                }
                let due = began + pace * next as u32;
                let now = Instant::now();
                if next < count && open.len() < 20 + again && due <= now {
                    let (topic, payload) = message(next);
                    note(next, false);
                    // Before it is sent: where that fails it is sent again.
                    open.push_back(next);
                    next += 1;
                    waiting.push_back(peer.publish(&topic, payload.as_bytes(), 0)?);
                    continue;
                }
                let left = due
                    .saturating_duration_since(now)
                    .min(Duration::from_millis(20));
                while let Some((first, body)) = peer.packet(left)? {
                    if first == 0x40
                        && waiting
                            .front()
                            .is_some_and(|of| of.to_be_bytes() == body[..2])
                    {
                        waiting.pop_front();
                        if let Some(nth) = open.pop_front() {
                            note(nth, true);
                        }
                    }
                    if due <= Instant::now() {
                        break;
                    }
                }
            }
            Ok(())
        };
        if work().is_err() {
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}
