//! The web server of the page: one thread of low priority for all viewers.
//!
//! A flood of requests does not delay the dance: the control loop is in another thread and
//! never waits (see [`mod@crate::viewer::link`]); at most [`CONNECTIONS`] are open at a time,
//! those beyond are closed at once; a request has to be whole within
//! [`REQUEST_S`]; little is buffered for a slow reader, who then misses frames.

mod guard;
mod page;
mod routes;
mod socket;
mod state;

use self::guard::AccessToken;
use self::routes::routes;
use self::state::ServerState;
use crate::process::console::stderr_line;
use crate::process::failpoint;
use crate::process::realtime;
use crate::viewer::frame::frame;
use crate::viewer::link::ViewerEnd;
use crate::viewer::scene::Scene;
use anyhow::Context;
use axum::Extension;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};
use tokio::time::MissedTickBehavior;

const CONNECTIONS: usize = 32;
/// A request and its answer take no longer, seconds.
const REQUEST_S: u64 = 10;
const FRAMES_HZ: f64 = 30.0;
/// Bytes that the system may keep for a slow reader: a few frames.
const SEND_BUFFER: usize = 64 * 1024;
/// How long viewers have to see the end, seconds.
const FAREWELL_S: f64 = 0.2;

/// The server of the page; it serves until it is dropped.
pub struct Server {
    address: String,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves a scene at `bind`; port 0 is any that is free.
    pub fn start(bind: SocketAddr, scene: Scene, end: ViewerEnd) -> anyhow::Result<Self> {
        let cannot = || format!("--view-bind {bind}: cannot serve the page there");
        let listener = std::net::TcpListener::bind(bind).with_context(cannot)?;
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        let token = AccessToken::random();
        let host = SocketAddr::new(reachable(bind.ip()), port);
        let address = format!("http://{host}/{}/", token.text());
        let state = Arc::new(ServerState::new(token, own_name(), scene, end));
        let (stop, stopped) = oneshot::channel();
        let thread = std::thread::Builder::new().name("viewers".into());
        let thread = thread.spawn(move || {
            realtime::yield_to_others();
            let mut runtime = tokio::runtime::Builder::new_current_thread();
            match runtime.enable_all().build() {
                Ok(runtime) => runtime.block_on(serve(listener, state, stopped)),
                Err(error) => stderr_line!("the page cannot be served: {error}"),
            }
        })?;
        Ok(Self { address, stop: Some(stop), thread: Some(thread) })
    }

    /// Where the page is, with its token.
    pub fn address(&self) -> &str {
        &self.address
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // A panic there has already been printed, and the dance went on.
            let _ = thread.join();
        }
    }
}

/// Where others find this machine, if it listens on all its addresses.
fn reachable(ip: IpAddr) -> IpAddr {
    let outwards = || {
        let socket = UdpSocket::bind((ip, 0)).ok()?;
        // Sends nothing: only asks which way it would go (an address of RFC 5737).
        socket.connect("192.0.2.1:9").ok()?;
        socket.local_addr().ok().map(|address| address.ip())
    };
    match ip.is_unspecified() {
        true => outwards().unwrap_or(ip),
        false => ip,
    }
}

fn own_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname");
    name.unwrap_or_default().trim().to_owned()
}

async fn serve(
    listener: std::net::TcpListener,
    state: Arc<ServerState>,
    stopped: oneshot::Receiver<()>,
) {
    let listener = match TcpListener::from_std(listener) {
        Ok(listener) => listener,
        Err(error) => return stderr_line!("the page cannot be served: {error}"),
    };
    let door = tokio::spawn(welcome(listener, Arc::clone(&state)));
    let frames = tokio::spawn(make_frames(Arc::clone(&state)));
    tokio::select! {
        // Whoever holds the other end never sends, only lets go.
        _ = stopped => tokio::time::sleep(Duration::from_secs_f64(FAREWELL_S)).await,
        // Neither ends but by a panic, which has been told: a page that stands
        // still, or lets nobody in, is none.
        _ = door => {}
        _ = frames => {}
    }
}

async fn welcome(listener: TcpListener, state: Arc<ServerState>) {
    let room = Arc::new(Semaphore::new(CONNECTIONS));
    let routes = routes(state);
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                if let Ok(place) = Arc::clone(&room).try_acquire_owned() {
                    tokio::spawn(answer(stream, routes.clone(), Arc::new(place)));
                }
            }
            // Out of file handles, say: others will be closed.
            Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
        }
    }
}

async fn answer(stream: TcpStream, routes: axum::Router, place: Arc<OwnedSemaphorePermit>) {
    // Without them it works, only less well.
    let _ = stream.set_nodelay(true);
    let _ = socket2::SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
    let service = TowerToHyperService::new(routes.layer(Extension(place)));
    let connection = hyper::server::conn::http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(Duration::from_secs(REQUEST_S / 2))
        .max_headers(64)
        .max_buf_size(16 * 1024)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    // Whatever went wrong concerns this connection alone.
    let _ = tokio::time::timeout(Duration::from_secs(REQUEST_S), connection).await;
}

async fn make_frames(state: Arc<ServerState>) {
    let mut clock = tokio::time::interval(Duration::from_secs_f64(1.0 / FRAMES_HZ));
    clock.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut pressed = false;
    loop {
        clock.tick().await;
        failpoint::pass("viewers");
        if state.frames.receiver_count() == 0 {
            continue;
        }
        let mut end = state.end();
        let estop = end.estop.is_pressed();
        if end.has_news() || estop != pressed {
            pressed = estop;
            let text = frame(&state.scene, end.newest(), estop);
            state.frames.send_replace(text.into());
        }
    }
}
