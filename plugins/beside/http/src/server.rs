//! Connections: how many, how long, how large. Whoever is slow, or never reads, loses its connection and nothing else.

use std::convert::Infallible;
use std::future::Future;
use std::io;
use std::net::TcpListener;
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant as Clock};

use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt as _};
use tokio::sync::watch;

use crate::answer::Answer;
use crate::guard::Peer;
use crate::routes::Routes;
use crate::stream::Life;
use crate::token::Token;

/// Connections of each door; one more is answered that there are too many.
const CONNECTIONS: usize = 16;
/// How long headers may take, and how long a connection may wait for its next request.
const HEADERS: Duration = Duration::from_secs(5);
/// How long a connection may last that is no stream.
const LONGEST: Duration = Duration::from_secs(120);
/// How large headers may be.
const BUFFER: usize = 32 << 10;
/// How long answers that are under way may take when the service ends.
const ENDS: Duration = Duration::from_millis(500);

/// Where a server listens.
pub struct Doors {
    pub unix: UnixListener,
    pub tcp: Option<(TcpListener, Token)>,
    /// The path of the Unix socket, which is removed at the end.
    pub path: PathBuf,
}

/// The thread that serves, until this is dropped.
pub struct Server {
    thread: Option<JoinHandle<()>>,
    end: watch::Sender<bool>,
    path: PathBuf,
}

impl Server {
    /// Starts it.
    pub fn start(doors: Doors, routes: Routes) -> io::Result<Self> {
        let Doors { unix, tcp, path } = doors;
        unix.set_nonblocking(true)?;
        if let Some((tcp, _)) = &tcp {
            tcp.set_nonblocking(true)?;
        }
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .max_blocking_threads(8)
            .build()?;
        let (end, ended) = watch::channel(false);
        let thread = std::thread::Builder::new().name("http".to_owned());
        let thread = thread.spawn(move || {
            runtime.block_on(serve(unix, tcp, routes, ended));
            runtime.shutdown_background();
        })?;
        Ok(Self {
            thread: Some(thread),
            end,
            path,
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.end.send(true);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let _ = std::fs::remove_file(&self.path);
    }
}

async fn serve(
    unix: UnixListener,
    tcp: Option<(TcpListener, Token)>,
    routes: Routes,
    mut ended: watch::Receiver<bool>,
) {
    let Ok(unix) = tokio::net::UnixListener::from_std(unix) else {
        return;
    };
    let tcp = tcp.and_then(|(tcp, token)| {
        let tcp = tokio::net::TcpListener::from_std(tcp).ok()?;
        Some((tcp, token))
    });
    let routes = Arc::new(routes);
    let doors = [Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0))];
    loop {
        tokio::select! {
            _ = ended.changed() => break,
            accepted = unix.accept() => match accepted {
                Ok((stream, _)) => {
                    let uid = stream.peer_cred().ok().map(|of| of.uid());
                    open(stream, Peer::Socket { uid }, &doors[0], &routes, &ended);
                }
                Err(_) => pause().await,
            },
            accepted = accept(tcp.as_ref()) => match accepted {
                Ok((stream, token)) => {
                    open(stream, Peer::Loopback { token }, &doors[1], &routes, &ended);
                }
                Err(_) => pause().await,
            },
        }
    }
    // Who was answered that the service ends is to read it.
    let began = Clock::now();
    while doors.iter().any(|door| door.load(Ordering::Relaxed) > 0) && began.elapsed() < ENDS {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

/// Where nothing can be accepted, such as for want of file descriptors, it is tried again soon.
async fn pause() {
    tokio::time::sleep(Duration::from_millis(20)).await;
}

async fn accept(
    tcp: Option<&(tokio::net::TcpListener, Token)>,
) -> io::Result<(tokio::net::TcpStream, Token)> {
    match tcp {
        Some((tcp, token)) => Ok((tcp.accept().await?.0, token.clone())),
        None => std::future::pending().await,
    }
}

/// Serves a connection beside the others, where there is room for it.
fn open<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(
    mut stream: S,
    peer: Peer,
    door: &Arc<AtomicUsize>,
    routes: &Arc<Routes>,
    ended: &watch::Receiver<bool>,
) {
    if door.load(Ordering::Relaxed) >= CONNECTIONS {
        routes.hub().turned_away();
        let refusal = async move {
            let text = "HTTP/1.1 503 Service Unavailable\r\ncontent-length: 0\r\nconnection: close\r\n\r\n";
            let _ = stream.write_all(text.as_bytes()).await;
        };
        // It fits the buffer of any socket; whoever does not take it is not waited for.
        tokio::spawn(async move {
            let _ = tokio::time::timeout(Duration::from_millis(100), refusal).await;
        });
        return;
    }
    door.fetch_add(1, Ordering::Relaxed);
    let place = Place(Arc::clone(door));
    let (routes, mut ended) = (Arc::clone(routes), ended.clone());
    tokio::spawn(async move {
        let _place = place;
        let life = Life::default();
        let connection = connection(stream, peer, routes, life.clone());
        tokio::select! {
            () = connection => {}
            () = outlived(&life) => {}
            () = async {
                let _ = ended.changed().await;
                // A stream has no end of its own.
                while !life.is_stream() {
                    tokio::time::sleep(Duration::from_millis(5)).await;
                }
            } => {}
        }
    });
}

/// Returns once a connection has lasted too long, or its reader has stopped reading.
async fn outlived(life: &Life) {
    let began = Clock::now();
    loop {
        tokio::time::sleep(Duration::from_millis(500)).await;
        let is_over = match life.is_stream() {
            true => life.is_stalled(),
            false => began.elapsed() > LONGEST,
        };
        if is_over {
            return;
        }
    }
}

fn connection<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(
    stream: S,
    peer: Peer,
    routes: Arc<Routes>,
    life: Life,
) -> impl Future<Output = ()> {
    let service = service_fn(move |request: Request<Incoming>| {
        let (peer, routes, life) = (peer.clone(), Arc::clone(&routes), life.clone());
        async move {
            let answered = routes.answer(request, &peer, &life).await;
            Ok::<Answer, Infallible>(answered.unwrap_or_else(Answer::from))
        }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADERS)
        .max_buf_size(BUFFER)
        .max_headers(64)
        .serve_connection(TokioIo::new(stream), service);
    async {
        let _ = connection.await;
    }
}

/// A connection's place at its door.
struct Place(Arc<AtomicUsize>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
