//! The HTTP side of a show; docs/show.md is for those who use it.
//!
//! | under the token | what |
//! |---|---|
//! | `GET ` (the page), `GET NAME` | the page and its parts |
//! | `GET api/scene` | what does not change |
//! | `GET api/mesh/N` | the corners of a mesh |
//! | `GET api/state` | the newest frame |
//! | `POST api/command` | a request: [`super::request`] |
//! | `GET api/live` | WebSocket: frames out, requests in |

use super::frame::frame;
use super::guard::{Token, is_own};
use super::link::ViewerEnd;
use super::page;
use super::request::{Understood, understand};
use super::scene::Scene;
use super::socket;
use axum::Router;
use axum::body::Bytes;
use axum::extract::rejection::StringRejection;
use axum::extract::ws::Utf8Bytes;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde_json::json;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Semaphore, watch};

/// Longest request, bytes.
pub const LONGEST: usize = 4096;
/// WebSockets at a time; the other connections are for pages and commands.
const SOCKETS: usize = 16;

/// What all connections share. Only the viewer thread locks it.
pub struct Shared {
    token: Token,
    own_name: String,
    /// What does not change.
    pub scene: Scene,
    scene_json: String,
    end: Mutex<ViewerEnd>,
    /// The newest frame.
    pub frames: watch::Sender<Utf8Bytes>,
    /// Places for WebSockets.
    pub sockets: Arc<Semaphore>,
}

/// A request that was not taken: the status and the reason, one line.
pub type Refusal = (StatusCode, String);

impl Shared {
    /// A show that nobody watches yet.
    pub fn new(token: Token, own_name: String, scene: Scene, mut end: ViewerEnd) -> Self {
        let first = frame(&scene, end.newest(), false);
        Self {
            token,
            own_name,
            scene_json: scene.json().to_string(),
            scene,
            end: Mutex::new(end),
            frames: watch::Sender::new(first.into()),
            sockets: Arc::new(Semaphore::new(SOCKETS)),
        }
    }

    /// The line to the control loop.
    pub fn end(&self) -> MutexGuard<'_, ViewerEnd> {
        self.end.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Why a request gets no answer: from a foreign page, or without the token.
    fn refuses(&self, request: &Request) -> Option<StatusCode> {
        let text = |name| match request.headers().get(name) {
            Some(value) => Some(value.to_str().unwrap_or("?")),
            None => None,
        };
        let first = request.uri().path().split('/').nth(1);
        if !is_own(text(header::HOST), text(header::ORIGIN), &self.own_name) {
            return Some(StatusCode::FORBIDDEN);
        }
        (!self.token.is(first.unwrap_or_default())).then_some(StatusCode::NOT_FOUND)
    }

    /// Passes a request on.
    ///
    /// # Errors
    /// Why it was refused.
    pub fn ask(&self, json: &str) -> Result<(), Refusal> {
        let wishes = match understand(json, &self.scene.styles) {
            Ok(Understood::EStop) => {
                self.end().estop.press("the page");
                return Ok(());
            }
            Ok(Understood::Requests(wishes)) => wishes,
            Err(error) => return Err((StatusCode::BAD_REQUEST, error)),
        };
        let mut end = self.end();
        let pressed = end.estop.is_pressed();
        let activity = end.newest().now.activity;
        for wish in &wishes {
            wish.possible(activity, pressed)
                .map_err(|why| (StatusCode::CONFLICT, why))?;
        }
        match end.ask(&wishes) {
            true => Ok(()),
            false => Err((StatusCode::SERVICE_UNAVAILABLE, "too many requests".into())),
        }
    }
}

/// Everything that is answered.
pub fn routes(shared: Arc<Shared>) -> Router {
    let inner = Router::new()
        .route("/api/scene", get(scene))
        .route("/api/mesh/{part}", get(mesh))
        .route("/api/state", get(state))
        .route("/api/command", post(command))
        .route("/api/live", get(socket::live))
        .route("/{name}", get(part));
    let top = format!("/{}", shared.token.text());
    Router::new()
        .route(&format!("{top}/"), get(index))
        .nest(&top, inner)
        .layer(DefaultBodyLimit::max(LONGEST))
        .layer(from_fn_with_state(Arc::clone(&shared), guard))
        .with_state(shared)
}

/// Answers nobody without the token, and no foreign page.
async fn guard(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let mut response = match shared.refuses(&request) {
        Some(status) => status.into_response(),
        None => next.run(request).await,
    };
    // One request a connection, unless it becomes a WebSocket.
    let upgraded = response.status() == StatusCode::SWITCHING_PROTOCOLS;
    let headers = response.headers_mut();
    if !upgraded {
        headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, page::POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn index() -> Response {
    part(Path("index.html".into())).await
}

async fn part(Path(name): Path<String>) -> Response {
    match page::part(&name) {
        Some((kind, text)) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn scene(State(shared): State<Arc<Shared>>) -> Response {
    as_json(shared.scene_json.clone())
}

async fn mesh(State(shared): State<Arc<Shared>>, Path(part): Path<usize>) -> Response {
    const BYTES: &str = "application/octet-stream";
    match shared.scene.meshes.parts.get(part) {
        // Kept once, however many fetch it.
        Some(corners) => {
            let corners = Bytes::from_owner(Arc::clone(corners));
            ([(header::CONTENT_TYPE, BYTES)], corners).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn state(State(shared): State<Arc<Shared>>) -> Response {
    let mut end = shared.end();
    let estop = end.estop.is_pressed();
    as_json(frame(&shared.scene, end.newest(), estop))
}

async fn command(
    State(shared): State<Arc<Shared>>,
    headers: HeaderMap,
    body: Result<String, StringRejection>,
) -> Response {
    let kind = headers.get(header::CONTENT_TYPE);
    let kind = kind.and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    // Forms of foreign pages cannot have this type without being asked first.
    if !kind.starts_with("application/json") {
        let expected = "expected Content-Type: application/json";
        return refused((StatusCode::UNSUPPORTED_MEDIA_TYPE, expected.into()));
    }
    let body = body.map_err(|unread| (unread.status(), unread.body_text()));
    match body.and_then(|body| shared.ask(&body)) {
        Ok(()) => (StatusCode::ACCEPTED, as_json("{}".into())).into_response(),
        Err(refusal) => refused(refusal),
    }
}

fn refused((status, why): Refusal) -> Response {
    (status, as_json(json!({ "error": why }).to_string())).into_response()
}

fn as_json(text: String) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], text).into_response()
}
