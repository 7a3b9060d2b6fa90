//! A serial port (or a socket in its place) with deadlines: instructions out,
//! status packets in.
//!
//! Opened for this process alone (a second program on one bus is a hazard).
//! No call blocks past its deadline; in simulated time, past the simulation's work.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use crate::bus::BusStats;
use crate::bus::reply_clock::{Patience, ReplyClock};
use crate::error::{BusError, BusResult};
use crate::serial::wire::decoder::{Decoded, Decoder, Packet};
use crate::serial::wire::framing::Framing;
use crate::serial::wire::open_error::remedy;
use crate::serial::wire::protocol1::ErrorFlags;
use crate::serial::wire::stale_replies::{ServoRequest, StaleReplies};
use crate::serial::wire::stream::PortStream;
use crate::serial::wire::system_ports::latency_timer;

/// Longest wait for the port to take an instruction's bytes.
const SEND_TIMEOUT: Duration = Duration::from_millis(100);

/// How long bytes that end a damaged packet may take, seconds, and how many are enough: one
/// damaged bit makes a packet 2048 bytes longer at most that a servo takes for one.
const SHORT_FILLER_S: f64 = 1.5e-3;
const LONG_FILLER_S: f64 = 12e-3;
const LONGEST_FILLER: usize = 2048;

const SHORTEST: Duration = Duration::from_micros(1);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A sound packet: see [`PacketPort::packet`].
    Packet,
    Corrupt,
    Nothing,
}

pub struct PacketPort {
    /// `None` while an adapter that was pulled out is waited for.
    port: Option<PortStream>,
    path: String,
    baud: u32,
    clock: ReplyClock,
    framing: Framing,
    decoder: Decoder,
    out: Vec<u8>,
    /// When all that was sent has passed over the wire.
    passed: Instant,
    /// Whether nobody answers what was sent last.
    sent_goals: bool,
    /// How many bytes came since the port was opened.
    received: usize,
    looked_late: bool,
    stale: StaleReplies,
    chunk: Vec<u8>,
    /// Counters; `cycles` and `retries` are the caller's to count.
    pub stats: BusStats,
}

impl PacketPort {
    /// Opens `path` (8 data bits, no parity, 1 stop bit).
    pub fn open(path: &str, baud: u32, framing: Framing, clock: ReplyClock) -> BusResult<Self> {
        Ok(Self {
            port: Some(open(path, baud)?),
            path: path.into(),
            baud,
            clock,
            framing,
            decoder: Decoder::new(framing),
            out: Vec::with_capacity(1024),
            passed: Instant::now(),
            sent_goals: false,
            received: 0,
            looked_late: false,
            stale: StaleReplies::default(),
            chunk: vec![0; 1024],
            stats: BusStats::default(),
        })
    }

    pub fn reopen(&mut self) -> BusResult<()> {
        self.port = None; // it is ours alone: close it first
        self.stale.forget_all();
        self.port = Some(open(&self.path, self.baud)?);
        Ok(())
    }

    pub fn framing(&self) -> Framing {
        self.framing
    }

    /// How the error flags of Protocol 1 are read from now on.
    pub fn read_flags_as(&mut self, error_flags: ErrorFlags) {
        self.decoder.read_flags_as(error_flags);
    }

    /// When all that was sent has passed over the wire.
    pub fn passed(&self) -> Instant {
        self.passed
    }

    /// How long what was sent still takes to pass over the wire.
    pub fn passing(&self) -> Duration {
        self.passed.saturating_duration_since(Instant::now())
    }

    /// How many bytes came since the port was opened.
    pub fn received(&self) -> usize {
        self.received
    }

    /// How long `bytes` take on the wire: ten bits each.
    pub fn time(&self, bytes: usize) -> Duration {
        Duration::from_secs_f64(10.0 * bytes as f64 / f64::from(self.baud))
    }

    /// Keeps an instruction that nobody answers, for the next [`PacketPort::send`] to
    /// take along: one call to the system, and one transfer over USB, in place of two.
    pub fn hold(&mut self, id: u8, instruction: u8, params: &[u8]) {
        self.framing.encode(&mut self.out, id, instruction, params);
        self.stats.packets += 1;
    }

    /// Puts bytes that mean nothing before what is sent next: servos that took damage for the
    /// length of a packet are deaf until so many bytes have come. Few after one question that
    /// nobody answered, as many as the longest packet has after `several`.
    pub fn hold_filler(&mut self, several: bool) {
        let longest_s = if several { LONG_FILLER_S } else { SHORT_FILLER_S };
        let bytes = (longest_s * f64::from(self.baud) / 10.0) as usize;
        self.out.resize(self.out.len() + bytes.min(LONGEST_FILLER), 0);
    }

    /// Sends what is held and one request. A stale reply that would pass for its
    /// answer may come first, for `wait` at most.
    pub fn ask(
        &mut self,
        request: &ServoRequest,
        wait: Duration,
        doing: &'static str,
    ) -> BusResult<()> {
        let ServoRequest { id, instruction, params, reply } = *request;
        // Stuffing can lengthen the parameters by a third.
        let longest = self.framing.status_length() + reply + reply / 3;
        let stale = self.stale.mistakable(request);
        if stale > 0 {
            self.send_held(doing)?; // it does not wait for them
            self.decoder.reset(longest);
            self.drain_stale(id, stale, Instant::now() + wait, doing)?;
        }
        self.send(id, instruction, params, longest, doing)
    }

    pub fn note_unanswered(&mut self, request: &ServoRequest) {
        self.stale.note(request);
    }

    fn drain_stale(
        &mut self,
        id: u8,
        mut count: usize,
        deadline: Instant,
        doing: &'static str,
    ) -> BusResult<()> {
        self.looked_late = false;
        while count > 0 {
            match self.receive(deadline, doing)? {
                Received::Packet if self.packet().id == id => count -= 1,
                Received::Packet | Received::Corrupt => {}
                Received::Nothing => break,
            }
        }
        self.stale.forget(id);
        Ok(())
    }

    /// Sends what is held and one instruction, first throwing away what an earlier exchange left
    /// behind. Replies longer than `longest` (length field) will be taken for damage.
    pub fn send(
        &mut self,
        id: u8,
        instruction: u8,
        params: &[u8],
        longest: usize,
        doing: &'static str,
    ) -> BusResult<()> {
        self.hold(id, instruction, params);
        self.decoder.reset(longest);
        self.send_held(doing)?;
        self.sent_goals = false;
        Ok(())
    }

    /// Before a row of [`PacketPort::send_along`]: what an earlier exchange left is thrown away.
    pub fn begin_sweep(&mut self, longest: usize) -> BusResult<()> {
        self.decoder.reset(longest);
        self.stale.forget_all();
        match &mut self.port {
            None => Ok(()),
            Some(port) => port.clear_input().map_err(|reason| self.failed("sweep", reason)),
        }
    }

    /// Sends one instruction without parameters, and throws nothing away: answers to
    /// earlier ones may still be under way.
    pub fn send_along(&mut self, id: u8, instruction: u8, doing: &'static str) -> BusResult<()> {
        self.hold(id, instruction, &[]);
        let sent = match &mut self.port {
            None => Err(ErrorKind::NotConnected.into()),
            Some(port) => port.set_timeout(SEND_TIMEOUT).and_then(|()| port.write_all(&self.out)),
        };
        self.stats.bytes += self.out.len() as u64;
        self.looked_late = false;
        self.out.clear();
        sent.map_err(|reason| self.failed(doing, reason))
    }

    pub fn send_held(&mut self, doing: &'static str) -> BusResult<()> {
        if self.out.is_empty() {
            return Ok(());
        }
        let after_goals = std::mem::replace(&mut self.sent_goals, true);
        self.decoder.expect_echo(&self.out, after_goals);
        let sent = match &mut self.port {
            None => Err(ErrorKind::NotConnected.into()),
            Some(port) => port
                .clear_input()
                .and_then(|()| port.set_timeout(SEND_TIMEOUT))
                .and_then(|()| port.write_all(&self.out)),
        };
        self.stats.bytes += self.out.len() as u64;
        self.passed = self.passed.max(Instant::now()) + self.time(self.out.len());
        self.looked_late = false;
        self.out.clear();
        sent.map_err(|reason| self.failed(doing, reason))
    }

    /// Waits for the next packet until `deadline`. What came in time counts even if this thread
    /// got no processor until later: after the deadline there is one look more, and only one for
    /// all that was sent, so that noise without end ends as well.
    pub fn receive(&mut self, deadline: Instant, doing: &'static str) -> BusResult<Received> {
        loop {
            match self.decoder.advance() {
                Decoded::Packet => {
                    self.stats.packets += 1;
                    return Ok(Received::Packet);
                }
                Decoded::Corrupt => {
                    self.stats.crc_errors += 1;
                    return Ok(Received::Corrupt);
                }
                Decoded::Incomplete => {}
            }
            let Patience { until, last } = self.clock.patience(deadline);
            let left = until.saturating_duration_since(Instant::now());
            let late = left.is_zero();
            if late && self.looked_late && self.clock == ReplyClock::Wall {
                return Ok(self.timed_out());
            }
            self.looked_late |= late;
            let read = match &mut self.port {
                None => Err(ErrorKind::NotConnected.into()),
                Some(port) => {
                    port.set_timeout(left.max(SHORTEST)).and_then(|()| port.read(&mut self.chunk))
                }
            };
            match read {
                Ok(0) => return Err(self.failed(doing, ErrorKind::UnexpectedEof.into())),
                Ok(count) => {
                    self.stats.bytes += count as u64;
                    self.received += count;
                    self.decoder.push(&self.chunk[..count]);
                }
                Err(error) if error.kind() == ErrorKind::TimedOut && late && last => {
                    return Ok(self.timed_out());
                }
                Err(error)
                    if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) => return Err(self.failed(doing, error)),
            }
        }
    }

    /// The packet of the last [`Received::Packet`].
    pub fn packet(&self) -> Packet<'_> {
        self.decoder.packet()
    }

    pub fn latency_note(&self) -> Option<String> {
        latency_timer(&self.path)?.note(&self.path)
    }

    fn timed_out(&mut self) -> Received {
        self.stats.timeouts += 1;
        Received::Nothing
    }

    fn failed(&self, doing: &'static str, reason: std::io::Error) -> BusError {
        BusError::Port { port: self.path.clone(), doing, reason }
    }
}

/// How often so many bytes pass on a serial wire in a second: ten bits each.
pub fn bytes_hz(baud: u32, bytes: usize) -> f64 {
    f64::from(baud) / (10.0 * bytes as f64)
}

fn open(path: &str, baud: u32) -> BusResult<PortStream> {
    PortStream::open(path, baud, SEND_TIMEOUT).map_err(|error| BusError::Open {
        port: path.into(),
        choices: remedy(path, &error),
        reason: error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    fn wire_to_here(name: &str) -> (PacketPort, std::os::unix::net::UnixStream) {
        let path = std::env::temp_dir().join(format!("wire-{name}-{}", std::process::id()));
        let listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let at = path.to_str().unwrap();
        let wire = PacketPort::open(at, 1_000_000, Framing::Protocol2, ReplyClock::Wall).unwrap();
        std::fs::remove_file(&path).unwrap();
        (wire, listener.accept().unwrap().0)
    }

    #[cfg(unix)]
    #[test]
    fn what_came_in_time_counts_although_it_is_looked_at_too_late() {
        let (mut wire, mut servo) = wire_to_here("late");
        wire.send(7, 1, &[], 7, "test").unwrap();
        let mut status = Vec::new();
        Framing::Protocol2.encode(&mut status, 7, 0x55, &[0]);
        servo.write_all(&status).unwrap();
        let over = Instant::now();
        assert_eq!(wire.receive(over, "test").unwrap(), Received::Packet);
        assert_eq!(wire.receive(over, "test").unwrap(), Received::Nothing);
    }

    #[cfg(unix)]
    #[test]
    fn noise_without_end_is_looked_at_once_after_the_deadline() {
        let (mut wire, mut servo) = wire_to_here("noise");
        wire.send(7, 1, &[], 7, "test").unwrap();
        let noise = [0xFF, 0xFF, 0xFD, 0, 7, 4, 0, 0x55, 0, 1, 2].repeat(1000);
        servo.write_all(&noise).unwrap();
        let over = Instant::now();
        let mut heard = 0;
        while wire.receive(over, "test").unwrap() != Received::Nothing {
            heard += 1;
        }
        assert!((1..=100).contains(&heard), "{heard} of 1000");
    }
}
