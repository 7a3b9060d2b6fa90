//! One viewer on a WebSocket: the newest frame out, as fast as they can take
//! it; requests in. What they miss is gone: only the newest counts.

use super::connections::Connection;
use super::guard::Role;
use super::shown::Answer;
use super::state::{LONGEST, ServerState};
use axum::Extension;
use axum::extract::State;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, WebSocketUpgrade, close_code};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde_json::json;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A viewer that takes nothing for so long is gone, seconds.
const GONE_S: u64 = 5;
/// The page of an operator that says nothing for so long is silent, seconds.
const SILENT_S: f64 = 2.0;
/// More messages a second are no person.
const MESSAGES_PER_S: u32 = 100;

pub async fn live(
    State(state): State<Arc<ServerState>>,
    Extension(connection): Extension<Arc<Connection>>,
    Extension(role): Extension<Role>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let Some(place) = state.socket_place(role) else {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    };
    upgrade
        .max_message_size(LONGEST)
        .max_frame_size(LONGEST)
        .read_buffer_size(LONGEST)
        .write_buffer_size(0)
        .max_write_buffer_size(1 << 20)
        .on_upgrade(async move |mut socket| {
            let _kept = (connection, place);
            let farewell = watch(&mut socket, &state, role).await;
            if let Some((code, reason)) = farewell {
                let reason = Utf8Bytes::from(reason);
                let close = Message::Close(Some(CloseFrame { code, reason }));
                let _ = send(&mut socket, close).await; // they may be gone already
            }
        })
}

/// Until the viewer goes, or must: then the close code and the reason.
async fn watch(socket: &mut WebSocket, state: &ServerState, role: Role) -> Option<(u16, String)> {
    let mut frames = state.frames.subscribe();
    send(socket, Message::Text(state.frame().into())).await?;
    let mut second = (Instant::now(), 0);
    let mut pulse = Pulse { state, heard: None };
    let mut clock = tokio::time::interval(Duration::from_secs_f64(SILENT_S / 4.0));
    loop {
        tokio::select! {
            _ = clock.tick() => pulse.check(),
            message = socket.recv() => match message?.ok()? {
                Message::Text(text) => {
                    if second.0.elapsed() > Duration::from_secs(1) {
                        second = (Instant::now(), 0);
                    }
                    second.1 += 1;
                    if second.1 > MESSAGES_PER_S {
                        return Some((close_code::POLICY, "too many messages".into()));
                    }
                    match state.ask(role, &text) {
                        Ok(Answer::Alive) => pulse.heard = Some(Instant::now()),
                        Ok(Answer::Taken | Answer::Stopped) => {}
                        Err((StatusCode::BAD_REQUEST, why)) => {
                            return Some((close_code::POLICY, short(why)));
                        }
                        Err((_, why)) => {
                            let text = json!({ "refused": why }).to_string();
                            send(socket, Message::Text(text.into())).await?;
                        }
                    }
                }
                Message::Binary(_) => {
                    return Some((close_code::UNSUPPORTED, "expected text".into()));
                }
                Message::Close(_) => {
                    pulse.heard = None; // said goodbye
                    return None;
                }
                Message::Ping(_) | Message::Pong(_) => {}
            },
            changed = frames.changed() => {
                changed.ok()?;
                let frame = frames.borrow_and_update().clone();
                send(socket, Message::Text(frame)).await?;
            }
        }
    }
}

/// Tells the program when the page of an operator falls silent, or goes without a goodbye.
struct Pulse<'a> {
    state: &'a ServerState,
    heard: Option<Instant>,
}

impl Pulse<'_> {
    fn check(&mut self) {
        if self.heard.is_some_and(|heard| heard.elapsed().as_secs_f64() > SILENT_S) {
            self.heard = None;
            self.state.shown.operator_lost();
        }
    }
}

impl Drop for Pulse<'_> {
    fn drop(&mut self) {
        if self.heard.is_some() {
            self.state.shown.operator_lost();
        }
    }
}

async fn send(socket: &mut WebSocket, message: Message) -> Option<()> {
    let sent = tokio::time::timeout(Duration::from_secs(GONE_S), socket.send(message)).await;
    sent.ok()?.ok()
}

/// A close reason holds 123 bytes.
fn short(mut reason: String) -> String {
    let end = (0..=120).rev().find(|end| reason.is_char_boundary(*end));
    reason.truncate(end.unwrap_or_default().min(reason.len()));
    reason
}
