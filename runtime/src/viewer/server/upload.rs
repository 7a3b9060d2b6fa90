//! A song that arrives: piece by piece from the connection to the thread that writes it down.
//! Gathered in one buffer, it delayed the control loop by up to 8 ms (docs/measurements/show.md).

use super::shown::RequestRefusal;
use crate::viewer::songs::{MOST_BYTES, Songs};
use axum::body::{Body, Bytes, HttpBody};
use axum::http::StatusCode;
use std::future::poll_fn;
use std::io;
use std::pin::Pin;
use tokio::sync::mpsc;
use tokio::task::{JoinError, spawn_blocking};

/// Pieces that may wait for the disk.
const WAITING: usize = 4;

/// Puts the song in `body` behind those that wait.
pub async fn add_song(songs: Songs, name: String, body: Body) -> Result<(), RequestRefusal> {
    let (pieces, mut arriving) = mpsc::channel(WAITING);
    let arrived = move || std::iter::from_fn(move || arriving.blocking_recv());
    let adding = spawn_blocking(move || songs.add(&name, arrived()));
    let sent = send(body, &pieces).await;
    drop(pieces);
    let broke =
        |_: JoinError| (StatusCode::INTERNAL_SERVER_ERROR, "the song broke the reader".into());
    let added = adding.await.map_err(broke)?;
    sent?;
    added.map_err(|error| (StatusCode::BAD_REQUEST, format!("{error:#}")))
}

/// Reads what comes without keeping it: a browser takes a refusal for a broken connection
/// while it still sends.
pub async fn discard(mut body: Body) {
    let mut left = MOST_BYTES;
    while let Some(Ok(piece)) = next_piece(&mut body).await
        && let Some(less) = left.checked_sub(piece.len())
    {
        left = less;
    }
}

/// Sends the pieces on; one that cannot be read ends them with an error.
async fn send(
    mut body: Body,
    pieces: &mpsc::Sender<io::Result<Bytes>>,
) -> Result<(), RequestRefusal> {
    let mut left = MOST_BYTES;
    while let Some(piece) = next_piece(&mut body).await {
        let refusal = match &piece {
            Ok(piece) if piece.len() <= left => {
                left -= piece.len();
                None
            }
            Ok(_) => {
                let most = MOST_BYTES / 1_000_000;
                Some((StatusCode::PAYLOAD_TOO_LARGE, format!("a song has at most {most} MB")))
            }
            Err(error) => Some((StatusCode::BAD_REQUEST, error.to_string())),
        };
        if let Some(refusal) = refusal {
            let _ = pieces.send(Err(io::Error::other("not all of it came"))).await;
            return Err(refusal);
        }
        if pieces.send(piece).await.is_err() {
            discard(body).await; // it was refused, which the writer says
            break;
        }
    }
    Ok(())
}

/// The next piece of data; `None` at the end.
async fn next_piece(body: &mut Body) -> Option<io::Result<Bytes>> {
    loop {
        let frame = poll_fn(|context| Pin::new(&mut *body).poll_frame(context)).await?;
        match frame.map(|frame| frame.into_data()) {
            Ok(Ok(data)) => return Some(Ok(data)),
            Ok(Err(_)) => {} // trailers
            Err(error) => return Some(Err(io::Error::other(error))),
        }
    }
}
