//! Raw samples that another program writes in real time, on standard input for
//! instance: a thread reads them into a ring, and waits while the ring is full.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use super::error::{SourceError, SourceFault};
use super::pcm::PcmReader;
use crate::capture::{DeviceSupervisor, InputKind, LiveStream, RingFormat, RingWriter, ring};

/// Interval at which a full ring is checked for room.
const FULL_WAIT: Duration = Duration::from_millis(5);

/// Reads raw PCM on a thread: the live stream, and the error that may end it.
pub(super) fn open_live_pcm(
    mut reader: PcmReader,
) -> Result<(LiveStream, Receiver<SourceError>), SourceError> {
    let (mut writer, ring) =
        ring(RingFormat { sample_rate_hz: reader.format().sample_rate_hz, channels: 1 });
    let (errors, failures) = channel();
    let name = reader.name().to_owned();
    let guard = PanicGuard { errors: errors.clone(), name: name.clone() };
    let read = move || {
        let _guard = guard; // dropped before the writer, too
        if let Err(error) = copy(&mut reader, &mut writer) {
            // Sent before the writer is dropped, so that the reader of the ring
            // finds the error at its end.
            let _ = errors.send(error);
        }
    };
    std::thread::Builder::new()
        .name("pipe".into())
        .spawn(read)
        .map_err(|error| SourceFault::Unreadable(error).of(&name))?;
    let supervisor = DeviceSupervisor::of_one_ring(ring);
    let stream = LiveStream::new(InputKind::PcmStream, supervisor, Instant::now());
    Ok((stream, failures))
}

/// Reports a thread that panics: its input has not ended, it is lost.
struct PanicGuard {
    errors: Sender<SourceError>,
    name: String,
}

impl Drop for PanicGuard {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let error = std::io::Error::other("the thread that reads it broke down");
            let _ = self.errors.send(SourceFault::Unreadable(error).of(&self.name));
        }
    }
}

/// Copies until the end of the input or until the ring's reader is gone.
fn copy(reader: &mut PcmReader, writer: &mut RingWriter) -> Result<(), SourceError> {
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
