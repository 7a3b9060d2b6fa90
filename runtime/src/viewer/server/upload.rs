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

/// What comes of a song: a piece, `None` at its end, an error where it breaks off.
type Arrival = io::Result<Option<Bytes>>;

/// Puts the song in `body` behind those that wait; `on_piece` is called with each piece of it.
pub async fn add_song(
    songs: Songs,
    name: String,
    body: Body,
    on_piece: impl Fn(),
) -> Result<(), RequestRefusal> {
    let (pieces, mut arriving) = mpsc::channel::<Arrival>(WAITING);
    // A connection that ends takes this function along, and the end is never said.
    let mut next = move || arriving.blocking_recv().unwrap_or_else(|| Err(broken_off()));
    let arrived = move || std::iter::from_fn(move || next().transpose());
    let adding = spawn_blocking(move || songs.add(&name, arrived()));
    let sent = send(body, &pieces, on_piece).await;
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

fn broken_off() -> io::Error {
    io::Error::other("not all of it came")
}

/// Sends the pieces on; one that cannot be read ends them with an error.
async fn send(
    mut body: Body,
    pieces: &mpsc::Sender<Arrival>,
    on_piece: impl Fn(),
) -> Result<(), RequestRefusal> {
    let mut left = MOST_BYTES;
    while let Some(piece) = next_piece(&mut body).await {
        on_piece();
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
            let _ = pieces.send(Err(broken_off())).await;
            return Err(refusal);
        }
        if pieces.send(piece.map(Some)).await.is_err() {
            discard(body).await; // it was refused, which the writer says
            return Ok(());
        }
    }
    let _ = pieces.send(Ok(None)).await;
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

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::body::Frame;
    use std::convert::Infallible;
    use std::task::{Context, Poll};
    use std::time::Duration;

    /// A song of which half comes, and then nothing more.
    struct Half(Option<Bytes>);

    impl HttpBody for Half {
        type Data = Bytes;
        type Error = Infallible;

        fn poll_frame(
            mut self: Pin<&mut Self>,
            _: &mut Context<'_>,
        ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
            match self.0.take() {
                Some(bytes) => Poll::Ready(Some(Ok(Frame::data(bytes)))),
                None => Poll::Pending,
            }
        }
    }

    #[test]
    fn a_song_whose_connection_ends_is_no_song() {
        use crate::pipeline::audio_input::AudioChoice;
        let wav = crate::viewer::song_wav::song_wav(&AudioChoice::BuiltIn).expect("a song");
        let half = Bytes::copy_from_slice(&wav[..wav.len() / 2]);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build();
        let runtime = runtime.expect("a runtime");
        let songs = Songs::default();
        runtime.block_on(async {
            let body = Body::new(Half(Some(half)));
            let adding = add_song(songs.clone(), "half.wav".into(), body, || ());
            let cut = tokio::time::timeout(Duration::from_millis(200), adding).await;
            assert!(cut.is_err(), "it waits for the rest");
        });
        drop(runtime); // it waits for the thread that writes
        assert_eq!(songs.waiting(), [""; 0]);
    }
}
