//! A follower has two connections: what holds one of them up holds nothing up.

use super::strangers::net;
use super::together::{Running, endpoint};
use crate::program::Program;
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Where a connection comes to nothing unless another is open beside it.
fn relay(target: &str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    let target = target.trim_start_matches("tcp/").to_owned();
    let open = Arc::new(AtomicUsize::new(0));
    std::thread::spawn(move || {
        for near in listener.incoming().flatten() {
            let far = match open.fetch_add(1, Ordering::SeqCst) {
                0 => None,
                _ => TcpStream::connect(&target).ok(),
            };
            let open = Arc::clone(&open);
            std::thread::spawn(move || {
                serve(near, far);
                open.fetch_sub(1, Ordering::SeqCst);
            });
        }
    });
    format!("tcp/{address}")
}

/// Passes on both ways, or swallows, until `near` is closed.
fn serve(mut near: TcpStream, far: Option<TcpStream>) {
    let Some(mut far) = far else {
        let _ = std::io::copy(&mut near, &mut std::io::sink());
        return;
    };
    let (mut back, mut home) =
        (far.try_clone().expect("a handle"), near.try_clone().expect("a handle"));
    std::thread::spawn(move || std::io::copy(&mut back, &mut home));
    let _ = std::io::copy(&mut near, &mut far);
}

#[test]
fn a_connection_that_stalls_keeps_nobody_from_following() {
    let program = Program::new();
    let (at, elsewhere) = (endpoint(), endpoint());
    let _router = net(&elsewhere);
    let leader = Running::start(&program, &["lead", "--listen", &at]);
    leader.says("leading the stage");
    let follower = Running::follow(&program, &relay(&at), &["--connect", &elsewhere]);
    follower.says("following");
    follower.stop();
    leader.stop();
}
