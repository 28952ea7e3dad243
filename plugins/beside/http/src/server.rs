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
use crate::guard::{Guard, Peer};
use crate::routes::Routes;
use crate::stream::Life;

/// Connections of each door; one more is answered that there are too many.
const CONNECTIONS: usize = 256;
/// Streams of each door, and requests that are under way besides.
const STREAMS: usize = 64;
const REQUESTS: usize = 64;
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
    pub tcp: Vec<TcpDoor>,
    /// The path of the Unix socket, which is removed at the end.
    pub path: PathBuf,
}

/// A door of TCP.
pub struct TcpDoor {
    pub listener: TcpListener,
    pub guard: Arc<Guard>,
    #[cfg(feature = "tls")]
    pub tls: Option<tokio_rustls::TlsAcceptor>,
}

/// How many are at a door.
#[derive(Clone, Default)]
pub struct Crowd {
    connections: Arc<AtomicUsize>,
    streams: Arc<AtomicUsize>,
    requests: Arc<AtomicUsize>,
}

impl Crowd {
    /// A place for a stream, if there is one.
    pub fn stream(&self) -> Option<Place> {
        Place::of(&self.streams, STREAMS)
    }

    /// A place for a request that ends, if there is one.
    pub fn request(&self) -> Option<Place> {
        Place::of(&self.requests, REQUESTS)
    }
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
        for door in &tcp {
            door.listener.set_nonblocking(true)?;
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
    tcp: Vec<TcpDoor>,
    routes: Routes,
    mut ended: watch::Receiver<bool>,
) {
    let Ok(unix) = tokio::net::UnixListener::from_std(unix) else {
        return;
    };
    let routes = Arc::new(routes);
    let crowd = Crowd::default();
    let mut crowds = vec![crowd.clone()];
    for door in tcp {
        let crowd = Crowd::default();
        crowds.push(crowd.clone());
        tokio::spawn(of_tcp(door, crowd, Arc::clone(&routes), ended.clone()));
    }
    loop {
        tokio::select! {
            _ = ended.changed() => break,
            accepted = unix.accept() => match accepted {
                Ok((stream, _)) => {
                    let uid = stream.peer_cred().ok().map(|of| of.uid());
                    open(async { Some(stream) }, Peer::Socket { uid }, &crowd, &routes, &ended);
                }
                Err(_) => pause().await,
            },
        }
    }
    // Who was answered that the service ends is to read it.
    let began = Clock::now();
    let busy = |of: &Crowd| of.connections.load(Ordering::Relaxed) > 0;
    while crowds.iter().any(busy) && began.elapsed() < ENDS {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

/// Accepts what comes to a door of TCP.
async fn of_tcp(
    door: TcpDoor,
    crowd: Crowd,
    routes: Arc<Routes>,
    mut ended: watch::Receiver<bool>,
) {
    let Ok(listener) = tokio::net::TcpListener::from_std(door.listener) else {
        return;
    };
    loop {
        tokio::select! {
            _ = ended.changed() => return,
            accepted = listener.accept() => match accepted {
                Ok((stream, from)) => {
                    let (guard, address) = (Arc::clone(&door.guard), from.ip());
                    let peer = Peer::Tcp { guard, address };
                    #[cfg(feature = "tls")]
                    if let Some(tls) = &door.tls {
                        let greeted = tokio::time::timeout(HEADERS, tls.accept(stream));
                        let greeted = async { greeted.await.ok()?.ok() };
                        open(greeted, peer, &crowd, &routes, &ended);
                        continue;
                    }
                    open(async { Some(stream) }, peer, &crowd, &routes, &ended);
                }
                Err(_) => pause().await,
            },
        }
    }
}

/// Where nothing can be accepted, such as for want of file descriptors, it is tried again soon.
async fn pause() {
    tokio::time::sleep(Duration::from_millis(20)).await;
}

/// Serves a connection beside the others, where there is room for it.
fn open<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(
    stream: impl Future<Output = Option<S>> + Send + 'static,
    peer: Peer,
    crowd: &Crowd,
    routes: &Arc<Routes>,
    ended: &watch::Receiver<bool>,
) {
    let Some(place) = Place::of(&crowd.connections, CONNECTIONS) else {
        routes.hub().turned_away();
        let refusal = async move {
            let text = "HTTP/1.1 503 Service Unavailable\r\ncontent-length: 0\r\nretry-after: 1\r\nconnection: close\r\n\r\n";
            if let Some(mut stream) = stream.await {
                let _ = stream.write_all(text.as_bytes()).await;
            }
        };
        // It fits the buffer of any socket; whoever does not take it is not waited for.
        tokio::spawn(async move {
            let _ = tokio::time::timeout(Duration::from_millis(100), refusal).await;
        });
        return;
    };
    let (routes, mut ended, crowd) = (Arc::clone(routes), ended.clone(), crowd.clone());
    tokio::spawn(async move {
        let _place = place;
        let Some(stream) = stream.await else { return };
        let life = Life::default();
        let connection = connection(stream, (peer, crowd), routes, life.clone());
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
    from: (Peer, Crowd),
    routes: Arc<Routes>,
    life: Life,
) -> impl Future<Output = ()> {
    let service = service_fn(move |request: Request<Incoming>| {
        let ((peer, crowd), routes, life) = (from.clone(), Arc::clone(&routes), life.clone());
        async move {
            let answered = routes.answer(request, (&peer, &crowd), &life).await;
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

/// A place at a door.
#[derive(Debug)]
pub struct Place(Arc<AtomicUsize>);

impl Place {
    fn of(taken: &Arc<AtomicUsize>, most: usize) -> Option<Self> {
        // One thread serves them all.
        let is_free = taken.load(Ordering::Relaxed) < most;
        is_free.then(|| {
            taken.fetch_add(1, Ordering::Relaxed);
            Self(Arc::clone(taken))
        })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
