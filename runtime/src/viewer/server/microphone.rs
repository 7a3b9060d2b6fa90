//! The microphone of an operator's browser on a WebSocket: its rate as text, then blocks of
//! 16-bit samples. It waits among the songs, and is danced to until the page closes it.

use super::guard::Role;
use super::state::{ServerState, for_watching};
use crate::pipeline::page_sound::page_sound;
use axum::Extension;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use std::time::Duration;

/// Bytes of a block at most.
const LONGEST: usize = 16 * 1024;
/// Rates of sound that a browser hears, hertz.
const RATES_HZ: std::ops::RangeInclusive<u32> = 8_000..=192_000;
/// A page from which nothing comes for so long is gone.
const GONE: Duration = Duration::from_secs(5);

pub async fn microphone(
    State(state): State<Arc<ServerState>>,
    Extension(role): Extension<Role>,
    upgrade: WebSocketUpgrade,
) -> Response {
    if role == Role::Audience {
        return for_watching().into_response();
    }
    if !state.shown.takes_songs() {
        return StatusCode::CONFLICT.into_response();
    }
    let Some(place) = state.socket_place(role) else {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    };
    let upgrade = upgrade.max_message_size(LONGEST).max_frame_size(LONGEST);
    upgrade.on_upgrade(async move |mut socket| {
        let _kept = place;
        // However it ends, the sound is over then.
        let _ = listen(&mut socket, &state).await;
    })
}

/// Until the page closes its microphone, or says what is none.
async fn listen(socket: &mut WebSocket, state: &ServerState) -> Option<()> {
    let Message::Text(rate) = next(socket).await? else { return None };
    let rate_hz = rate.parse().ok().filter(|rate| RATES_HZ.contains(rate))?;
    let (microphone, sound) = page_sound(rate_hz);
    state.shown.songs().add_microphone(sound).ok()?;
    loop {
        match next(socket).await? {
            Message::Binary(block) if microphone.hear(block.to_vec()) => {}
            Message::Ping(_) | Message::Pong(_) => {}
            _ => return None,
        }
    }
}

async fn next(socket: &mut WebSocket) -> Option<Message> {
    tokio::time::timeout(GONE, socket.recv()).await.ok()??.ok()
}
