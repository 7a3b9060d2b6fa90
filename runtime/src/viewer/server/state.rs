//! What all connections of the page's server share.

use super::guard::{Role, Tokens, is_own};
use super::invitation::Invitation;
use super::stop_presses::StopPresses;
use crate::process::console::stderr_line;
use crate::viewer::frame::{FrameSurroundings, frame};
use crate::viewer::link::ViewerEnd;
use crate::viewer::request::{ParsedRequest, ViewerRequest, parse_request};
use crate::viewer::scene::Scene;
use crate::viewer::snapshot::Snapshot;
use crate::viewer::song_wav::song_wav;
use crate::viewer::songs::Songs;
use axum::body::Bytes;
use axum::extract::Request;
use axum::extract::ws::Utf8Bytes;
use axum::http::{StatusCode, header};
use serde_json::Value;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
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
    own_name: String,
    pub scene: Scene,
    scene_json: Value,
    robot: Mutex<RobotView>,
    began: Instant,
    songs: Songs,
    /// The newest song that was asked for; decoded when it is asked for first.
    song: Mutex<(u32, Arc<OnceCell<Option<Bytes>>>)>,
    pub frames: watch::Sender<Utf8Bytes>,
    operator_sockets: Arc<Semaphore>,
    audience_sockets: Arc<Semaphore>,
}

/// What the server knows of the robot.
struct RobotView {
    end: ViewerEnd,
    /// Whether a frame has shown the newest snapshot.
    shown: bool,
    presses: StopPresses,
}

impl RobotView {
    fn newest(&mut self) -> &Snapshot {
        if self.end.has_news() {
            self.shown = false;
        }
        self.end.newest()
    }
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    Taken,
    /// It said that the page is there, no more.
    Alive,
    /// A stop, and the control loop says that torque is off since.
    Stopped,
}

/// A request that was not taken: the status and the reason, one line.
pub type RequestRefusal = (StatusCode, String);

impl ServerState {
    pub fn new(
        tokens: Tokens,
        invitation: Invitation,
        scene: Scene,
        end: ViewerEnd,
        songs: Songs,
    ) -> Self {
        Self {
            tokens,
            invitation,
            own_name: own_name(),
            scene_json: scene.json(),
            scene,
            began: Instant::now(),
            songs,
            song: Mutex::default(),
            robot: Mutex::new(RobotView { end, shown: false, presses: StopPresses::default() }),
            frames: watch::Sender::new(Utf8Bytes::default()),
            operator_sockets: Arc::new(Semaphore::new(OPERATOR_SOCKETS)),
            audience_sockets: Arc::new(Semaphore::new(AUDIENCE_SOCKETS)),
        }
    }

    fn robot(&self) -> MutexGuard<'_, RobotView> {
        self.robot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a snapshot has come that no frame has shown.
    pub fn has_news(&self) -> bool {
        let mut robot = self.robot();
        robot.newest();
        !robot.shown
    }

    /// The newest frame, as JSON.
    pub fn frame(&self) -> String {
        let mut robot = self.robot();
        robot.newest();
        robot.shown = true;
        let RobotView { end, presses, .. } = &mut *robot;
        let estop = end.estop.is_pressed();
        let snapshot = end.newest();
        let surroundings = FrameSurroundings {
            estop,
            clock_s: self.began.elapsed().as_secs_f64(),
            age_s: snapshot.now.published.elapsed().as_secs_f64(),
            confirmed: presses.confirmed(snapshot.now.stopped).collect(),
            viewers: self.frames.receiver_count(),
            song: self.songs.now().map(|(number, _)| number),
            queue: self.songs.waiting(),
        };
        frame(&self.scene, snapshot, &surroundings)
    }

    /// The music as WAV; `None` if there is none to play.
    pub async fn song(&self) -> Option<Bytes> {
        let (number, choice) = self.songs.now()?;
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
        bytes: Bytes,
    ) -> Result<Answer, RequestRefusal> {
        if role == Role::Audience {
            return Err(for_watching());
        }
        let songs = self.songs.clone();
        let added = tokio::task::spawn_blocking(move || songs.add(&name, &bytes)).await;
        match added {
            Ok(Ok(())) => Ok(Answer::Taken),
            Ok(Err(error)) => Err((StatusCode::BAD_REQUEST, format!("{error:#}"))),
            Err(_) => Err((StatusCode::INTERNAL_SERVER_ERROR, "the song broke the reader".into())),
        }
    }

    /// Whether a page waits to see its stop confirmed.
    pub fn is_stop_awaited(&self) -> bool {
        self.robot().presses.is_awaited()
    }

    /// Whether this press has stopped the robot, as the control loop says.
    fn is_confirmed(&self, press: &str) -> bool {
        let mut robot = self.robot();
        let stopped = robot.newest().now.stopped;
        robot.presses.confirmed(stopped).any(|name| name == press)
    }

    /// Tells the program that the page of an operator has fallen silent.
    pub fn operator_lost(&self) {
        // A full queue has more urgent things in it.
        let _ = self.robot().end.ask(&[ViewerRequest::OperatorLost]);
    }

    /// The scene, and whether this viewer may command.
    pub fn scene_for(&self, role: Role) -> String {
        let mut scene = self.scene_json.clone();
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
        if role == Role::Audience {
            return Err(for_watching());
        }
        match parse_request(json, &self.scene.styles) {
            Ok(ParsedRequest::EStop(press)) => Ok(self.press_stop(press)),
            Ok(ParsedRequest::Seen(press)) => {
                self.robot().presses.see(&press);
                Ok(Answer::Taken)
            }
            Ok(ParsedRequest::Alive) => {
                self.robot().end.operators.hear();
                Ok(Answer::Alive)
            }
            Ok(ParsedRequest::Requests(requests)) => self.pass_on(&requests),
            Err(error) => Err((StatusCode::BAD_REQUEST, error)),
        }
    }

    fn press_stop(&self, press: Option<String>) -> Answer {
        let mut robot = self.robot();
        robot.end.estop.press("the page");
        let Some(press) = press else {
            return Answer::Taken;
        };
        let releases = robot.end.estop.releases();
        robot.presses.push(press.clone(), releases);
        drop(robot);
        match self.is_confirmed(&press) {
            true => Answer::Stopped,
            false => Answer::Taken,
        }
    }

    fn pass_on(&self, requests: &[ViewerRequest]) -> Result<Answer, RequestRefusal> {
        let mut robot = self.robot();
        let pressed = robot.end.estop.is_pressed();
        let activity = robot.newest().now.activity;
        for request in requests {
            request.possible(activity, pressed).map_err(|why| (StatusCode::CONFLICT, why))?;
        }
        match robot.end.ask(requests) {
            true => Ok(Answer::Taken),
            false => Err((StatusCode::SERVICE_UNAVAILABLE, "too many requests".into())),
        }
    }
}

fn for_watching() -> RequestRefusal {
    (StatusCode::FORBIDDEN, "this link is for watching".into())
}

/// What this machine is called.
fn own_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname");
    name.unwrap_or_default().trim().to_owned()
}
