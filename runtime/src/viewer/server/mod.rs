//! The web server of the page: one thread of low priority for all viewers.
//!
//! A flood of requests does not delay the dance: the control loop is in another thread and
//! never waits (see [`mod@crate::viewer::link`]); `connections.rs` says how many may be open;
//! a request has to be whole within a minute, a song may not stop coming for as long; little is
//! buffered for a slow reader, who then misses frames.

mod connections;
mod guard;
mod invitation;
mod microphone;
mod page;
mod robot_page;
mod routes;
mod shown;
mod socket;
#[cfg(feature = "stage")]
mod stage_page;
mod state;
mod stop_presses;
mod upload;

use self::connections::{Connection, Connections, STRANGER_S};
use self::guard::Tokens;
use self::invitation::Invitation;
use self::robot_page::RobotPage;
use self::routes::routes;
use self::shown::Shown;
use self::state::ServerState;
use crate::process::console::stderr_line;
use crate::process::failpoint;
use crate::process::realtime;
use crate::viewer::link::ViewerEnd;
use crate::viewer::scene::Scene;
use crate::viewer::songs::Songs;
#[cfg(feature = "stage")]
use crate::viewer::stage_link::StageEnd;
use anyhow::Context;
use axum::Extension;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::time::MissedTickBehavior;

const FRAMES_HZ: f64 = 30.0;
/// Bytes that the system may keep for a slow reader: a few frames.
const SEND_BUFFER: usize = 64 * 1024;
/// Bytes of a song that may wait in the system: whoever sends more waits for the disk.
const RECEIVE_BUFFER: usize = 64 * 1024;
/// So often a frame is sent if there is no newer one, so that pages know that the program is
/// there, seconds.
const HEARTBEAT_S: f64 = 0.2;
/// How long viewers have to see the end, seconds; and the page of whoever pressed STOP.
const FAREWELL_S: f64 = 0.2;
const STOP_FAREWELL_S: f64 = 15.0;

/// The server of the page; it serves until it is dropped.
pub struct Server {
    invitation: Invitation,
    state: Arc<ServerState>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves the page of a robot at `bind`; port 0 is any that is free.
    /// The page plays and adds `songs`.
    pub fn start(
        bind: SocketAddr,
        scene: Scene,
        end: ViewerEnd,
        songs: Songs,
    ) -> anyhow::Result<Self> {
        Self::serve(bind, Box::new(RobotPage::new(scene, end, songs)))
    }

    /// Serves the page of a whole stage.
    #[cfg(feature = "stage")]
    pub fn start_stage(bind: SocketAddr, end: StageEnd) -> anyhow::Result<Self> {
        Self::serve(bind, Box::new(stage_page::StagePage::new(end)))
    }

    fn serve(bind: SocketAddr, shown: Box<dyn Shown>) -> anyhow::Result<Self> {
        let cannot = || format!("--view-bind {bind}: cannot serve the page there");
        let listener = std::net::TcpListener::bind(bind).with_context(cannot)?;
        // Connections inherit the size; without it songs come too.
        let _ = socket2::SockRef::from(&listener).set_recv_buffer_size(RECEIVE_BUFFER);
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        let tokens = Tokens::random();
        let host = SocketAddr::new(reachable(bind.ip()), port);
        let invitation = Invitation {
            operator: format!("http://{host}/{}/", tokens.operator.text()),
            audience: format!("http://{host}/{}/", tokens.audience.text()),
        };
        let state = Arc::new(ServerState::new(tokens, invitation.clone(), shown));
        let (stop, stopped) = oneshot::channel();
        let kept = Arc::clone(&state);
        let thread = std::thread::Builder::new().name("viewers".into());
        let thread = thread.spawn(move || {
            realtime::yield_to_others();
            let mut runtime = tokio::runtime::Builder::new_current_thread();
            match runtime.enable_all().build() {
                Ok(runtime) => {
                    runtime.block_on(serve(listener, state, stopped));
                    runtime.shutdown_background(); // nobody waits for a song half decoded
                }
                Err(error) => stderr_line!("the page cannot be served: {error}"),
            }
        })?;
        Ok(Self { invitation, state: kept, stop: Some(stop), thread: Some(thread) })
    }

    /// Where the page is for operators, with their token.
    pub fn address(&self) -> &str {
        &self.invitation.operator
    }

    /// Where the page is for the audience, which cannot command.
    pub fn audience_address(&self) -> &str {
        &self.invitation.audience
    }

    /// A link that leads to the operator's once, in the next half minute: for a command line.
    pub fn address_for_once(&self) -> String {
        let tokens = &self.state.tokens;
        self.invitation.operator.replace(tokens.operator.text(), &tokens.for_once())
    }

    /// Both links as QR codes, for a terminal.
    pub fn codes(&self) -> String {
        self.invitation.terminal()
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
        _ = stopped => farewell(&state).await,
        // Neither ends but by a panic, which has been told: a page that stands
        // still, or lets nobody in, is none.
        _ = door => {}
        _ = frames => {}
    }
}

/// Until viewers had time to see the end, and whoever pressed STOP what came of it.
async fn farewell(state: &ServerState) {
    let began = Instant::now();
    tokio::time::sleep(Duration::from_secs_f64(FAREWELL_S)).await;
    while state.shown.is_stop_awaited() && began.elapsed().as_secs_f64() < STOP_FAREWELL_S {
        tokio::time::sleep(Duration::from_secs_f64(FAREWELL_S)).await;
    }
}

async fn welcome(listener: TcpListener, state: Arc<ServerState>) {
    let connections = Arc::new(Connections::default());
    let routes = routes(state);
    loop {
        match listener.accept().await {
            Ok((stream, from)) => {
                let (connection, turned_away) = connections.enter(from.ip());
                let connection = Arc::new(connection);
                let routes = routes.clone().layer(Extension(Arc::clone(&connection)));
                tokio::spawn(async move {
                    tokio::select! {
                        () = answer(stream, routes, &connection) => {}
                        Ok(()) = turned_away => {}
                    }
                });
                // A request that is there already is read before the next one is let in.
                tokio::task::yield_now().await;
            }
            // Out of file handles, say: others will be closed.
            Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
        }
    }
}

async fn answer(stream: TcpStream, routes: axum::Router, place: &Connection) {
    // Without them it works, only less well.
    let _ = stream.set_nodelay(true);
    let _ = socket2::SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
    let service = TowerToHyperService::new(routes);
    let connection = hyper::server::conn::http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(Duration::from_secs(STRANGER_S))
        .max_headers(64)
        .max_buf_size(16 * 1024)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    let mut connection = std::pin::pin!(connection);
    loop {
        let left = place.left(Instant::now());
        // Whatever went wrong concerns this connection alone.
        if left.is_zero() || tokio::time::timeout(left, connection.as_mut()).await.is_ok() {
            return;
        }
    }
}

async fn make_frames(state: Arc<ServerState>) {
    let mut clock = tokio::time::interval(Duration::from_secs_f64(1.0 / FRAMES_HZ));
    clock.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut sent = Instant::now();
    loop {
        clock.tick().await;
        failpoint::pass("viewers");
        let due = sent.elapsed().as_secs_f64() >= HEARTBEAT_S;
        if (state.shown.has_news() || due) && state.frames.receiver_count() > 0 {
            sent = Instant::now();
            state.frames.send_replace(state.frame().into());
        }
    }
}
