//! The HTTP routes of the page and its API; docs/show.md describes their use.
//!
//! | under a token | what |
//! |---|---|
//! | `GET ` (the page), `GET NAME` | the page and its parts |
//! | `GET api/scene` | what does not change |
//! | `GET api/mesh/N` | the corners of a mesh |
//! | `GET api/part/NAME` | what changes seldom: a robot of a stage, its timeline |
//! | `GET api/show` | the show of a stage as a file: for operators |
//! | `GET api/state` | the newest frame |
//! | `POST api/command` | a request: [`crate::viewer::request`] |
//! | `POST api/tap` | `{"do": "tap"}` without a body |
//! | `GET api/song` | the music as WAV, where it is a recording |
//! | `POST api/song/NAME` | a file of music, to be danced next: for operators |
//! | `GET api/microphone` | WebSocket: what a browser hears, to be danced next: for operators |
//! | `GET api/links` | both links with their QR codes: for operators |
//! | `GET api/live` | WebSocket: frames out, requests in |

use super::connections::Connection;
use super::guard::Role;
use super::microphone;
use super::page;
use super::shown::{Answer, RequestRefusal};
use super::socket;
use super::state::{LONGEST, ServerState, for_watching};
use axum::body::Body;
use axum::extract::rejection::StringRejection;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use serde_json::json;
use std::sync::Arc;

pub fn routes(state: Arc<ServerState>) -> Router {
    let inner = Router::new()
        .route("/api/scene", get(scene))
        .route("/api/mesh/{part}", get(mesh))
        .route("/api/part/{name}", get(scene_part))
        .route("/api/show", get(show_file))
        .route("/api/state", get(newest_frame))
        .route("/api/command", post(command))
        .route("/api/tap", post(tap))
        .route("/api/song", get(song))
        .route("/api/song/{name}", post(add_song))
        .route("/api/microphone", get(microphone::microphone))
        .route("/api/links", get(links))
        .route("/api/live", get(socket::live))
        .route("/{name}", get(part));
    let tokens = &state.tokens;
    let both = [(&tokens.operator, Role::Operator), (&tokens.audience, Role::Audience)];
    let router = both.into_iter().fold(Router::new(), |router, (token, role)| {
        let top = format!("/{}", token.text());
        let under = inner.clone().layer(Extension(role));
        router.route(&format!("{top}/"), get(index)).nest(&top, under)
    });
    router
        .layer(DefaultBodyLimit::max(LONGEST))
        .layer(from_fn_with_state(Arc::clone(&state), guard))
        .with_state(state)
}

/// Refuses requests without a token, those of foreign pages, and whom there is no place for.
async fn guard(
    State(state): State<Arc<ServerState>>,
    Extension(connection): Extension<Arc<Connection>>,
    request: Request,
    next: Next,
) -> Response {
    let mut response = match state.role_of(&request) {
        Err(StatusCode::NOT_FOUND) => match state.redeem(&request) {
            Some(to) => (StatusCode::SEE_OTHER, [(header::LOCATION, to)]).into_response(),
            None => StatusCode::NOT_FOUND.into_response(),
        },
        Err(status) => status.into_response(),
        Ok(role) if !connection.admit(role) => StatusCode::SERVICE_UNAVAILABLE.into_response(),
        Ok(_) => next.run(request).await,
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

async fn index(State(state): State<Arc<ServerState>>) -> Response {
    part(Path(state.shown.index().into())).await
}

async fn part(Path(name): Path<String>) -> Response {
    match page::part(&name) {
        Some((kind, text)) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn scene(
    State(state): State<Arc<ServerState>>,
    Extension(role): Extension<Role>,
) -> Response {
    as_json(state.scene_for(role))
}

async fn links(
    State(state): State<Arc<ServerState>>,
    Extension(role): Extension<Role>,
) -> Response {
    match role {
        Role::Operator => as_json(state.invitation.json().to_string()),
        Role::Audience => StatusCode::FORBIDDEN.into_response(),
    }
}

async fn mesh(State(state): State<Arc<ServerState>>, Path(part): Path<usize>) -> Response {
    const BYTES: &str = "application/octet-stream";
    match state.shown.mesh(part) {
        Some(corners) => ([(header::CONTENT_TYPE, BYTES)], corners).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn scene_part(State(state): State<Arc<ServerState>>, Path(name): Path<String>) -> Response {
    match state.shown.part(&name) {
        Some(part) => as_json(part),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn show_file(
    State(state): State<Arc<ServerState>>,
    Extension(role): Extension<Role>,
) -> Response {
    const KIND: &str = "application/toml";
    match (role, state.shown.document()) {
        (Role::Audience, _) => refused(for_watching()),
        (Role::Operator, Some((name, text))) => {
            let name = format!("attachment; filename=\"{name}\"");
            ([(header::CONTENT_TYPE, KIND), (header::CONTENT_DISPOSITION, &name)], text)
                .into_response()
        }
        (Role::Operator, None) => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn song(State(state): State<Arc<ServerState>>) -> Response {
    match state.song().await {
        Some(wav) => ([(header::CONTENT_TYPE, "audio/wav")], wav).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn add_song(
    State(state): State<Arc<ServerState>>,
    Extension(role): Extension<Role>,
    Extension(connection): Extension<Arc<Connection>>,
    Path(name): Path<String>,
    body: Body,
) -> Response {
    answer(state.add_song(role, name, body, &connection).await)
}

async fn newest_frame(State(state): State<Arc<ServerState>>) -> Response {
    as_json(state.frame())
}

async fn command(
    State(state): State<Arc<ServerState>>,
    Extension(role): Extension<Role>,
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
    answer(body.and_then(|body| state.ask(role, &body)))
}

async fn tap(State(state): State<Arc<ServerState>>, Extension(role): Extension<Role>) -> Response {
    answer(state.ask(role, r#"{"do": "tap"}"#))
}

fn answer(asked: Result<Answer, RequestRefusal>) -> Response {
    let said = match asked {
        Ok(Answer::Stopped) => json!({ "stopped": true }),
        Ok(_) => json!({}),
        Err(refusal) => return refused(refusal),
    };
    (StatusCode::ACCEPTED, as_json(said.to_string())).into_response()
}

fn refused((status, why): RequestRefusal) -> Response {
    (status, as_json(json!({ "error": why }).to_string())).into_response()
}

fn as_json(text: String) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], text).into_response()
}
