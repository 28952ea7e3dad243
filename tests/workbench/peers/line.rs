//! What stands between a server and its client, for the tests of crates that speak to one.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A line that can be cut, so that nothing comes through, and neither end notices.
pub struct Line {
    pub port: u16,
    is_cut: Arc<AtomicBool>,
}

impl Line {
    pub fn to(port: u16) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let is_cut = Arc::new(AtomicBool::new(false));
        let own = listener.local_addr().unwrap().port();
        let cut = Arc::clone(&is_cut);
        std::thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let Ok(server) = TcpStream::connect(("127.0.0.1", port)) else {
                    let _ = client.shutdown(Shutdown::Both);
                    continue;
                };
                pass(
                    client.try_clone().unwrap(),
                    server.try_clone().unwrap(),
                    &cut,
                );
                pass(server, client, &cut);
            }
        });
        Self { port: own, is_cut }
    }

    pub fn cut(&self, is: bool) {
        self.is_cut.store(is, Ordering::Relaxed);
    }
}

/// What was on its way when the line was cut comes once it is whole again, perhaps to a connection that has been given up.
fn pass(mut from: TcpStream, mut to: TcpStream, cut: &Arc<AtomicBool>) {
    let cut = Arc::clone(cut);
    std::thread::spawn(move || {
        let mut piece = [0; 4096];
        loop {
            let count = from.read(&mut piece).unwrap_or(0);
            while cut.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(10));
            }
            if count == 0 || to.write_all(&piece[..count]).is_err() {
                let _ = to.shutdown(Shutdown::Both);
                return;
            }
        }
    });
}
