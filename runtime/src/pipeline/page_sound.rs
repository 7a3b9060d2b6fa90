//! Sound that a page hears by the microphone of its browser, on its way to a dance.
//!
//! The server hands blocks over and waits for nobody; what nobody takes is dropped. A dance
//! reads them like a pipe: see `servodance_audio::source` for what happens when they stay away.

use servodance_audio::source::{PcmEncoding, PcmFormat};
use std::io::{self, Read};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Blocks that may wait: about a second.
const WAITING: usize = 64;
/// How often a reader looks whether another one has taken its place.
const LOOK: Duration = Duration::from_millis(100);

/// The dancer's end; clones are the same sound.
#[derive(Clone, Debug)]
pub struct PageSound {
    rate_hz: u32,
    blocks: Arc<Mutex<Receiver<Vec<u8>>>>,
    /// Which reader is the last that began.
    reader: Arc<AtomicU64>,
}

/// The page's end: dropped, the sound is over.
#[derive(Debug)]
pub struct PageMicrophone(SyncSender<Vec<u8>>);

/// A microphone of so many samples a second.
pub fn page_sound(rate_hz: u32) -> (PageMicrophone, PageSound) {
    let (sender, blocks) = sync_channel(WAITING);
    let blocks = Arc::new(Mutex::new(blocks));
    (PageMicrophone(sender), PageSound { rate_hz, blocks, reader: Arc::default() })
}

impl PageMicrophone {
    /// Hands 16-bit samples over, low byte first; `false` if no dance can hear them any more.
    pub fn hear(&self, block: Vec<u8>) -> bool {
        !matches!(self.0.try_send(block), Err(TrySendError::Disconnected(_)))
    }
}

impl PageSound {
    /// How the samples are encoded.
    pub fn format(&self) -> PcmFormat {
        PcmFormat { encoding: PcmEncoding::S16Le, sample_rate_hz: self.rate_hz, channels: 1 }
    }

    /// A reader from now on; one that began before is at its end.
    pub fn reader(&self) -> impl Read + Send + use<> {
        let number = self.reader.fetch_add(1, Ordering::AcqRel) + 1;
        let blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        while blocks.try_recv().is_ok() {} // what was heard before nobody dances to
        drop(blocks);
        PageReader { sound: self.clone(), number, rest: Vec::new() }
    }

    /// Whether the page has closed its microphone.
    pub fn is_over(&self) -> bool {
        let blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            match blocks.try_recv() {
                Ok(_) => {}
                Err(std::sync::mpsc::TryRecvError::Empty) => return false,
                Err(std::sync::mpsc::TryRecvError::Disconnected) => return true,
            }
        }
    }
}

struct PageReader {
    sound: PageSound,
    number: u64,
    rest: Vec<u8>,
}

impl Read for PageReader {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while self.rest.is_empty() {
            if self.sound.reader.load(Ordering::Acquire) != self.number {
                return Ok(0);
            }
            let blocks = self.sound.blocks.lock().unwrap_or_else(PoisonError::into_inner);
            match blocks.recv_timeout(LOOK) {
                Ok(block) => self.rest = block,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        let count = self.rest.len().min(into.len());
        into[..count].copy_from_slice(&self.rest[..count]);
        self.rest.drain(..count);
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dance_hears_what_comes_after_it_began_and_ends_with_the_microphone() {
        let (microphone, sound) = page_sound(48_000);
        assert!(microphone.hear(vec![9; 4]));
        let mut first = sound.reader();
        assert!(microphone.hear(vec![1, 2, 3, 4]));
        let mut bytes = [0; 3];
        assert_eq!((first.read(&mut bytes).unwrap(), bytes), (3, [1, 2, 3]));
        assert_eq!((first.read(&mut bytes).unwrap(), bytes[0]), (1, 4));
        let mut second = sound.reader();
        assert_eq!(first.read(&mut bytes).unwrap(), 0, "another dance has begun");
        for _ in 0..2 * WAITING {
            assert!(microphone.hear(vec![5]), "a full queue is no end");
        }
        assert_eq!(second.read(&mut bytes).unwrap(), 1);
        assert!(!sound.is_over());
        drop(microphone);
        assert!(sound.is_over());
        assert_eq!(second.read(&mut bytes).unwrap(), 0);
    }
}
