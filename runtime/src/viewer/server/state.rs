//! What all connections of the page's server share.

use super::guard::{AccessToken, is_own};
use crate::viewer::frame::frame;
use crate::viewer::link::ViewerEnd;
use crate::viewer::request::{ParsedRequest, parse_request};
use crate::viewer::scene::Scene;
use axum::extract::Request;
use axum::extract::ws::Utf8Bytes;
use axum::http::{StatusCode, header};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Semaphore, watch};

pub const LONGEST: usize = 4096;
/// WebSockets at a time; the other connections are for pages and commands.
const SOCKETS: usize = 16;

/// What all connections share. Only the viewer thread locks it.
pub struct ServerState {
    pub token: AccessToken,
    own_name: String,
    pub scene: Scene,
    pub scene_json: String,
    end: Mutex<ViewerEnd>,
    pub frames: watch::Sender<Utf8Bytes>,
    pub sockets: Arc<Semaphore>,
}

/// A request that was not taken: the status and the reason, one line.
pub type RequestRefusal = (StatusCode, String);

impl ServerState {
    pub fn new(token: AccessToken, own_name: String, scene: Scene, mut end: ViewerEnd) -> Self {
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

    pub fn end(&self) -> MutexGuard<'_, ViewerEnd> {
        self.end.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Why a request gets no answer: from a foreign page, or without the token.
    pub fn refuses(&self, request: &Request) -> Option<StatusCode> {
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

    pub fn ask(&self, json: &str) -> Result<(), RequestRefusal> {
        let requests = match parse_request(json, &self.scene.styles) {
            Ok(ParsedRequest::EStop) => {
                self.end().estop.press("the page");
                return Ok(());
            }
            Ok(ParsedRequest::Requests(requests)) => requests,
            Err(error) => return Err((StatusCode::BAD_REQUEST, error)),
        };
        let mut end = self.end();
        let pressed = end.estop.is_pressed();
        let activity = end.newest().now.activity;
        for request in &requests {
            request.possible(activity, pressed).map_err(|why| (StatusCode::CONFLICT, why))?;
        }
        match end.ask(&requests) {
            true => Ok(()),
            false => Err((StatusCode::SERVICE_UNAVAILABLE, "too many requests".into())),
        }
    }
}
