//! The serial port of an adapter that speaks in lines: what goes out is gathered, what comes
//! in is read in chunks.

use std::io::{self, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use super::link::Sent;
use crate::serial::wire::stream::PortStream;

/// Rate of the serial port, bits a second; USB adapters ignore it.
const SERIAL_BAUD: u32 = 1_000_000;
const SEND_TIMEOUT: Duration = Duration::from_millis(100);
/// No more bytes wait for the moment when answers are awaited.
const LONGEST_BURST: usize = 1024;

pub(super) struct LinePort {
    port: PortStream,
    /// What is to go out.
    pub out: Vec<u8>,
    chunk: Vec<u8>,
    /// How much of `chunk` is filled and how much of that is taken.
    filled: usize,
    taken: usize,
}

impl LinePort {
    /// Opens the adapter at `path` for this program alone.
    pub fn open(path: &str) -> io::Result<Self> {
        Ok(Self {
            port: PortStream::open(path, SERIAL_BAUD, SEND_TIMEOUT)?,
            out: Vec::with_capacity(2 * LONGEST_BURST),
            chunk: vec![0; 1024],
            filled: 0,
            taken: 0,
        })
    }

    /// Writes at once, before what waits.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.set_timeout(SEND_TIMEOUT)?;
        self.port.write_all(bytes)
    }

    /// Makes room for another line.
    pub fn make_room(&mut self) -> io::Result<Sent> {
        if self.out.len() > LONGEST_BURST { self.hand_over() } else { Ok(Sent::Taken) }
    }

    /// Hands what waits over to the adapter; what its buffer does not take goes on waiting.
    pub fn hand_over(&mut self) -> io::Result<Sent> {
        self.port.set_timeout(SEND_TIMEOUT)?;
        while !self.out.is_empty() {
            match self.port.write(&self.out) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => drop(self.out.drain(..count)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::TimedOut => return Ok(Sent::Full),
                Err(error) => return Err(error),
            }
        }
        Ok(Sent::Taken)
    }

    /// The next byte that is there already.
    pub fn byte(&mut self) -> Option<u8> {
        let byte = *self.chunk[..self.filled].get(self.taken)?;
        self.taken += 1;
        Some(byte)
    }

    /// Reads until something is there; false if nothing has come by `deadline`. For when
    /// [`LinePort::byte`] has no more.
    pub fn read_until(&mut self, deadline: Instant) -> io::Result<bool> {
        loop {
            // A pseudo-terminal may not count yet what it would give to a reader:
            // only to read tells what is there.
            let left = deadline.saturating_duration_since(Instant::now());
            self.port.set_timeout(left.max(Duration::from_micros(1)))?;
            match self.port.read(&mut self.chunk) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    (self.taken, self.filled) = (0, count);
                    return Ok(true);
                }
                Err(error) if error.kind() == ErrorKind::TimedOut && left.is_zero() => {
                    return Ok(false);
                }
                Err(error)
                    if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) => return Err(error),
            }
        }
    }
}
