//! Standard input for one dance after another: the last reader that began gets the bytes.
//!
//! A reader that began before is at its end. What it had asked for when the other one began
//! is not lost, and the next reader begins with a whole frame.

use std::io::{self, Read};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Bytes that are read at once: few, so that live sound arrives soon.
const READ_BYTES: usize = 4096;

/// A pipe that several readers share; clones are the same pipe.
#[derive(Clone)]
pub struct SharedPipe(Arc<Shared>);

struct Shared {
    /// Which reader is the last that began.
    newest: AtomicU64,
    pipe: Mutex<Pipe>,
}

struct Pipe {
    input: Box<dyn Read + Send>,
    /// Bytes that came and that no reader has taken.
    waiting: Vec<u8>,
    /// How many bytes readers have taken.
    taken: u64,
}

/// The standard input of this program.
pub fn standard_input() -> &'static SharedPipe {
    static PIPE: OnceLock<SharedPipe> = OnceLock::new();
    PIPE.get_or_init(|| SharedPipe::new(io::stdin()))
}

impl SharedPipe {
    fn new(input: impl Read + Send + 'static) -> Self {
        let pipe = Pipe { input: Box::new(input), waiting: Vec::new(), taken: 0 };
        Self(Arc::new(Shared { newest: AtomicU64::new(0), pipe: Mutex::new(pipe) }))
    }

    /// A reader of frames of so many bytes from now on; one that began before is at its end.
    pub fn reader(&self, frame_bytes: usize) -> impl Read + Send + use<> {
        let number = self.0.newest.fetch_add(1, Ordering::AcqRel) + 1;
        PipeReader { shared: Arc::clone(&self.0), number, frame_bytes, is_aligned: false }
    }
}

impl Pipe {
    /// Waits for bytes; `false` at the end.
    fn fill(&mut self) -> io::Result<bool> {
        if self.waiting.is_empty() {
            self.waiting.resize(READ_BYTES, 0);
            let read = self.input.read(&mut self.waiting);
            self.waiting.truncate(*read.as_ref().unwrap_or(&0));
            read?;
        }
        Ok(!self.waiting.is_empty())
    }

    fn take(&mut self, most: usize) -> Vec<u8> {
        let count = self.waiting.len().min(most);
        self.taken += count as u64;
        self.waiting.drain(..count).collect()
    }
}

struct PipeReader {
    shared: Arc<Shared>,
    number: u64,
    frame_bytes: usize,
    /// The rest of a frame whose beginning another reader took has been passed over.
    is_aligned: bool,
}

impl PipeReader {
    fn is_over(&self) -> bool {
        self.shared.newest.load(Ordering::Acquire) != self.number
    }
}

impl Read for PipeReader {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let shared = Arc::clone(&self.shared);
        // An older reader may wait for bytes here: it leaves them for this one.
        let mut pipe = shared.pipe.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if self.is_over() || !pipe.fill()? || self.is_over() {
                return Ok(0);
            }
            let begun = (pipe.taken % self.frame_bytes as u64) as usize;
            if self.is_aligned || begun == 0 {
                self.is_aligned = true;
                let bytes = pipe.take(into.len());
                into[..bytes.len()].copy_from_slice(&bytes);
                return Ok(bytes.len());
            }
            pipe.take(self.frame_bytes - begun);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, channel};

    /// Pieces as another program writes them.
    struct Pieces(Receiver<Vec<u8>>);

    impl Read for Pieces {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let piece = self.0.recv().unwrap_or_default();
            into[..piece.len()].copy_from_slice(&piece);
            Ok(piece.len())
        }
    }

    fn read(reader: &mut impl Read) -> Vec<u8> {
        let mut bytes = [0; 64];
        let count = reader.read(&mut bytes).expect("bytes");
        bytes[..count].to_vec()
    }

    #[test]
    fn each_reader_begins_with_a_whole_frame_and_no_byte_is_lost_on_the_way() {
        let (writer, pieces) = channel();
        let pipe = SharedPipe::new(Pieces(pieces));
        let mut first = pipe.reader(3);
        writer.send(vec![10, 11, 12, 20]).expect("room");
        assert_eq!(read(&mut first), [10, 11, 12, 20]);
        // It waits for bytes while the next dance begins.
        let waits = std::thread::spawn(move || read(&mut first));
        while pipe.0.pipe.try_lock().is_ok() {
            std::thread::yield_now();
        }
        let mut second = pipe.reader(3);
        writer.send(vec![21, 22, 30, 31, 32]).expect("room");
        assert_eq!(waits.join().expect("no panic"), [0; 0], "it is over");
        assert_eq!(read(&mut second), [30, 31, 32]);
        drop(writer);
        assert_eq!(read(&mut second), [0; 0]);
    }
}
