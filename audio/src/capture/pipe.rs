//! Raw samples that a program writes in its own time, on standard input for
//! instance: a thread reads them into a link, and waits when the link is full.

use super::keeper::Keeper;
use super::link::{LinkFormat, LinkWriter, link};
use super::listener::{Kind, Listener};
use crate::source::SourceError;
use crate::source::pcm::PcmReader;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// How often a full link is looked at again.
const FULL_WAIT: Duration = Duration::from_millis(5);

/// A listener to a reader of raw PCM, and the error that its reading may end with.
pub(crate) fn listen_to_pipe(
    mut reader: PcmReader,
) -> Result<(Listener, Receiver<SourceError>), SourceError> {
    let format = LinkFormat {
        sample_rate_hz: reader.format().sample_rate_hz,
        channels: 1,
    };
    let (mut writer, link) = link(format);
    let (errors, failures) = channel();
    let name = reader.name().to_owned();
    let alarm = Alarm {
        errors: errors.clone(),
        name: name.clone(),
    };
    let pump = move || {
        let _alarm = alarm; // goes before the writer, too
        if let Err(error) = pump(&mut reader, &mut writer) {
            // Before the writer goes, so that the listener finds it at the end.
            let _ = errors.send(error);
        }
    };
    std::thread::Builder::new()
        .name("pipe".into())
        .spawn(pump)
        .map_err(|error| SourceError::Unreadable { name, error })?;
    let keeper = Keeper::of_one_link(link);
    Ok((Listener::new(Kind::Pipe, keeper, Instant::now()), failures))
}

/// Tells of a thread that panics: its pipe has not ended, it is lost.
struct Alarm {
    errors: Sender<SourceError>,
    name: String,
}

impl Drop for Alarm {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let _ = self.errors.send(SourceError::Unreadable {
                name: std::mem::take(&mut self.name),
                error: std::io::Error::other("the thread that reads it broke down"),
            });
        }
    }
}

/// Copies until the end of the pipe or until nobody listens.
fn pump(reader: &mut PcmReader, writer: &mut LinkWriter) -> Result<(), SourceError> {
    let mut block = Vec::new();
    loop {
        block.clear();
        if !reader.next_block(&mut block)? {
            return Ok(());
        }
        let arrived = Instant::now();
        let mut rest = &block[..];
        while !rest.is_empty() {
            let fits = writer.room().min(rest.len());
            if fits == 0 {
                if writer.is_abandoned() {
                    return Ok(());
                }
                std::thread::sleep(FULL_WAIT);
                continue;
            }
            writer.write(rest[..fits].iter().copied(), arrived);
            rest = &rest[fits..];
        }
    }
}
