//! What all connections of the page's server share.

use super::connections::Connection;
use super::guard::{Role, Tokens, is_own};
use super::invitation::Invitation;
use super::shown::{Answer, RequestRefusal, ServerNow, Shown};
use super::upload;
use crate::process::console::stderr_line;
use crate::viewer::song_wav::song_wav;
use axum::body::{Body, Bytes};
use axum::extract::Request;
use axum::extract::ws::Utf8Bytes;
use axum::http::{StatusCode, header};
use serde_json::Value;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tokio::sync::{OnceCell, OwnedSemaphorePermit, Semaphore, watch};

pub const LONGEST: usize = 4096;
/// WebSockets at a time; the other connections are for pages and commands.
const OPERATOR_SOCKETS: usize = 16;
const AUDIENCE_SOCKETS: usize = 128;

/// What all connections share. Only the viewer thread locks it.
pub struct ServerState {
    pub tokens: Tokens,
    pub invitation: Invitation,
    pub shown: Box<dyn Shown>,
    own_name: String,
    began: Instant,
    /// The newest song that was asked for; decoded when it is asked for first.
    song: Mutex<(u32, Arc<OnceCell<Option<Bytes>>>)>,
    pub frames: watch::Sender<Utf8Bytes>,
    operator_sockets: Arc<Semaphore>,
    audience_sockets: Arc<Semaphore>,
}

impl ServerState {
    pub fn new(tokens: Tokens, invitation: Invitation, shown: Box<dyn Shown>) -> Self {
        Self {
            tokens,
            invitation,
            shown,
            own_name: own_name(),
            began: Instant::now(),
            song: Mutex::default(),
            frames: watch::Sender::new(Utf8Bytes::default()),
            operator_sockets: Arc::new(Semaphore::new(OPERATOR_SOCKETS)),
            audience_sockets: Arc::new(Semaphore::new(AUDIENCE_SOCKETS)),
        }
    }

    /// The newest frame, as JSON.
    pub fn frame(&self) -> String {
        self.shown.frame(ServerNow {
            clock_s: self.began.elapsed().as_secs_f64(),
            viewers: self.frames.receiver_count(),
        })
    }

    /// The music as WAV; `None` if there is none to play.
    pub async fn song(&self) -> Option<Bytes> {
        let (number, choice) = self.shown.songs().now()?;
        let song = {
            let mut kept = self.song.lock().unwrap_or_else(PoisonError::into_inner);
            if kept.0 != number {
                *kept = (number, Arc::default());
            }
            Arc::clone(&kept.1)
        };
        // Not in the thread that hears STOP.
        let decoded = song.get_or_init(|| async move {
            match tokio::task::spawn_blocking(move || song_wav(&choice)).await {
                Ok(Ok(wav)) => return Some(Bytes::from(wav)),
                Ok(Err(error)) => stderr_line!("the page plays no sound: {error:#}"),
                Err(_) => {} // a panic, which has been told
            }
            None
        });
        decoded.await.clone()
    }

    /// Puts a song behind those that wait; the error is one line for the viewer.
    pub async fn add_song(
        &self,
        role: Role,
        name: String,
        body: Body,
        connection: &Connection,
    ) -> Result<Answer, RequestRefusal> {
        let refusal = match role {
            Role::Audience => Some(for_watching()),
            Role::Operator if self.shown.takes_songs() => None,
            Role::Operator => Some((StatusCode::CONFLICT, "no songs can be added here".into())),
        };
        if let Some(refusal) = refusal {
            upload::discard(body).await;
            return Err(refusal);
        }
        let on_piece = || connection.goes_on(Instant::now());
        upload::add_song(self.shown.songs().clone(), name, body, on_piece).await?;
        Ok(Answer::Taken)
    }

    /// The scene, and whether this viewer may command.
    pub fn scene_for(&self, role: Role) -> String {
        let mut scene = self.shown.scene();
        scene["operator"] = Value::Bool(role == Role::Operator);
        scene.to_string()
    }

    /// A place for one more WebSocket.
    pub fn socket_place(&self, role: Role) -> Option<OwnedSemaphorePermit> {
        let places = match role {
            Role::Operator => &self.operator_sockets,
            Role::Audience => &self.audience_sockets,
        };
        Arc::clone(places).try_acquire_owned().ok()
    }

    /// Where a request with the token for once is sent on to.
    pub fn redeem(&self, request: &Request) -> Option<String> {
        let token = request.uri().path().split('/').nth(1).unwrap_or_default();
        self.tokens.redeem(token).then(|| format!("/{}/", self.tokens.operator.text()))
    }

    /// What a request may do, or the status of its refusal: from a foreign page, or without
    /// a token.
    pub fn role_of(&self, request: &Request) -> Result<Role, StatusCode> {
        let text = |name| match request.headers().get(name) {
            Some(value) => Some(value.to_str().unwrap_or("?")),
            None => None,
        };
        let first = request.uri().path().split('/').nth(1);
        if !is_own(text(header::HOST), text(header::ORIGIN), &self.own_name) {
            return Err(StatusCode::FORBIDDEN);
        }
        self.tokens.role(first.unwrap_or_default()).ok_or(StatusCode::NOT_FOUND)
    }

    /// Does what a page asks for.
    pub fn ask(&self, role: Role, json: &str) -> Result<Answer, RequestRefusal> {
        match role {
            Role::Audience => Err(for_watching()),
            Role::Operator => self.shown.ask(json),
        }
    }
}

pub fn for_watching() -> RequestRefusal {
    (StatusCode::FORBIDDEN, "this link is for watching".into())
}

/// What this machine is called.
fn own_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname");
    name.unwrap_or_default().trim().to_owned()
}
