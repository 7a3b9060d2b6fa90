//! A serial port (or a socket in its place) with deadlines: bytes out, status packets in.
//!
//! Opened for this process alone (a second program on one bus is a hazard).
//! No call blocks past its deadline, or longer than whoever simulates time works.

use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use crate::bus::BusStats;
use crate::error::BusError;
use crate::owed::{Owed, Question};
use crate::packet::{Decoded, Decoder, Packet, Protocol};
use crate::reply_clock::{Patience, ReplyClock};
use crate::stream::Stream;

/// Longest wait for the port to take an instruction's bytes.
const SEND_TIMEOUT: Duration = Duration::from_millis(100);

/// The shortest wait that a port knows.
const SHORTEST: Duration = Duration::from_micros(1);

/// What came back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A sound packet: see [`Wire::packet`].
    Packet,
    /// A damaged one.
    Corrupt,
    /// Nothing within the deadline.
    Nothing,
}

/// The host's end of the wire.
pub struct Wire {
    /// `None` while an adapter that was pulled out is waited for.
    port: Option<Stream>,
    path: String,
    baud: u32,
    clock: ReplyClock,
    protocol: Protocol,
    decoder: Decoder,
    /// Instructions that are to be sent.
    out: Vec<u8>,
    /// How many bytes were sent last.
    sent: usize,
    /// Whether the port was read once more after the deadline.
    looked_late: bool,
    owed: Owed,
    chunk: Vec<u8>,
    /// Counters; `cycles` and `retries` are the caller's to count.
    pub stats: BusStats,
}

impl Wire {
    /// Opens `path` (8 data bits, no parity, 1 stop bit).
    pub fn open(
        path: &str,
        baud: u32,
        protocol: Protocol,
        clock: ReplyClock,
    ) -> Result<Self, BusError> {
        Ok(Self {
            port: Some(open(path, baud)?),
            path: path.into(),
            baud,
            clock,
            protocol,
            decoder: Decoder::new(protocol),
            out: Vec::with_capacity(1024),
            sent: 0,
            looked_late: false,
            owed: Owed::default(),
            chunk: vec![0; 1024],
            stats: BusStats::default(),
        })
    }

    /// Opens the port again, after an adapter was pulled out and put back.
    pub fn reopen(&mut self) -> Result<(), BusError> {
        self.port = None; // it is ours alone: close it first
        self.owed.forget_all();
        self.port = Some(open(&self.path, self.baud)?);
        Ok(())
    }

    /// The framing.
    pub fn protocol(&self) -> Protocol {
        self.protocol
    }

    /// How many bytes were sent last.
    pub fn sent(&self) -> usize {
        self.sent
    }

    /// How long `bytes` take on the wire: ten bits each.
    pub fn time(&self, bytes: usize) -> Duration {
        Duration::from_secs_f64(10.0 * bytes as f64 / f64::from(self.baud))
    }

    /// Keeps an instruction that nobody answers, for the next [`Wire::send`] to
    /// take along: one call to the system, and one transfer over USB, in place of two.
    pub fn hold(&mut self, id: u8, instruction: u8, params: &[u8]) {
        self.protocol.encode(&mut self.out, id, instruction, params);
        self.stats.packets += 1;
    }

    /// Sends what is held and one question. If an answer to another one is still
    /// owed that would pass for its answer, that may come first, for `wait` at most.
    pub fn ask(
        &mut self,
        question: &Question,
        wait: Duration,
        doing: &'static str,
    ) -> Result<(), BusError> {
        let Question {
            id,
            instruction,
            params,
            reply,
        } = *question;
        // Stuffing can lengthen the parameters by a third.
        let longest = self.protocol.status_length() + reply + reply / 3;
        let owed = self.owed.mistakable(question);
        if owed > 0 {
            self.decoder.reset(longest);
            self.await_owed(id, owed, Instant::now() + wait, doing)?;
        }
        self.send(id, instruction, params, longest, doing)
    }

    /// The last question got no answer in time.
    pub fn note_unanswered(&mut self, question: &Question) {
        self.owed.note(question);
    }

    /// Lets so many answers of one servo come and go.
    fn await_owed(
        &mut self,
        id: u8,
        mut owed: usize,
        deadline: Instant,
        doing: &'static str,
    ) -> Result<(), BusError> {
        self.looked_late = false;
        while owed > 0 {
            match self.receive(deadline, doing)? {
                Received::Packet if self.packet().id == id => owed -= 1,
                Received::Packet | Received::Corrupt => {}
                Received::Nothing => break,
            }
        }
        self.owed.forget(id);
        Ok(())
    }

    /// Sends what is held and one instruction, first throwing away what an earlier
    /// exchange left behind. Replies longer than `longest` (length field) will be
    /// taken for damage.
    pub fn send(
        &mut self,
        id: u8,
        instruction: u8,
        params: &[u8],
        longest: usize,
        doing: &'static str,
    ) -> Result<(), BusError> {
        self.hold(id, instruction, params);
        self.decoder.reset(longest);
        self.send_held(doing)
    }

    /// Sends what is held, if anything is.
    pub fn send_held(&mut self, doing: &'static str) -> Result<(), BusError> {
        if self.out.is_empty() {
            return Ok(());
        }
        self.decoder.expect_echo(&self.out);
        let sent = match &mut self.port {
            None => Err(ErrorKind::NotConnected.into()),
            Some(port) => port
                .clear_input()
                .and_then(|()| port.set_timeout(SEND_TIMEOUT))
                .and_then(|()| port.write_all(&self.out)),
        };
        self.stats.bytes += self.out.len() as u64;
        self.sent = self.out.len();
        self.looked_late = false;
        self.out.clear();
        sent.map_err(|reason| self.failed(doing, reason))
    }

    /// Waits for the next packet until `deadline`. What came in time counts even if
    /// this thread got no processor until later: after the deadline there is one
    /// look more, and only one for all that was sent, so that noise without end
    /// ends as well.
    pub fn receive(
        &mut self,
        deadline: Instant,
        doing: &'static str,
    ) -> Result<Received, BusError> {
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
                Some(port) => port
                    .set_timeout(left.max(SHORTEST))
                    .and_then(|()| port.read(&mut self.chunk)),
            };
            match read {
                Ok(0) => return Err(self.failed(doing, ErrorKind::UnexpectedEof.into())),
                Ok(count) => {
                    self.stats.bytes += count as u64;
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

    /// What keeps a USB adapter slow, if anything does: its latency timer.
    pub fn latency_note(&self) -> Option<String> {
        latency_timer(&self.path)?.note(&self.path)
    }

    fn timed_out(&mut self) -> Received {
        self.stats.timeouts += 1;
        Received::Nothing
    }

    fn failed(&self, doing: &'static str, reason: std::io::Error) -> BusError {
        BusError::Port {
            port: self.path.clone(),
            doing,
            reason,
        }
    }
}

fn open(path: &str, baud: u32) -> Result<Stream, BusError> {
    Stream::open(path, baud, SEND_TIMEOUT).map_err(|error| BusError::Open {
        port: path.into(),
        reason: error.to_string(),
        choices: choices(),
    })
}

/// How long a USB adapter (FTDI) collects bytes before it passes them on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LatencyTimer {
    /// Milliseconds; 1 is the best, 16 the default.
    pub latency_ms: u32,
    /// The file that sets it.
    pub file: String,
}

impl LatencyTimer {
    /// What to do about it; nothing where it is as short as can be.
    pub fn note(&self, port: &str) -> Option<String> {
        let Self { latency_ms, file } = self;
        (*latency_ms > 1).then(|| {
            format!(
                "USB latency timer of {port} is {latency_ms} ms and delays every reply: \
                 set it with `echo 1 | sudo tee {file}`"
            )
        })
    }
}

/// The latency timer of a serial port, if it has one.
pub fn latency_timer(port: &str) -> Option<LatencyTimer> {
    latency_timer_in(Path::new("/sys/bus/usb-serial/devices"), port)
}

fn latency_timer_in(devices: &Path, port: &str) -> Option<LatencyTimer> {
    let device = Path::new(port).canonicalize().ok()?;
    let file = devices.join(device.file_name()?).join("latency_timer");
    let latency_ms = std::fs::read_to_string(&file).ok()?.trim().parse().ok()?;
    Some(LatencyTimer {
        latency_ms,
        file: file.to_string_lossy().into_owned(),
    })
}

/// The serial ports of this machine.
pub fn available_ports() -> Vec<String> {
    // Without this folder the enumeration of `serialport` panics.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let ports = serialport::available_ports().unwrap_or_default();
    ports.into_iter().map(|port| port.port_name).collect()
}

fn choices() -> String {
    let ports = available_ports();
    if ports.is_empty() {
        "; this machine has no serial ports".into()
    } else {
        format!("; serial ports here: {}", ports.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wire to a socket, and its other end.
    #[cfg(unix)]
    fn wire_to_here(name: &str) -> (Wire, std::os::unix::net::UnixStream) {
        let path = std::env::temp_dir().join(format!("wire-{name}-{}", std::process::id()));
        let listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let at = path.to_str().unwrap();
        let wire = Wire::open(at, 1_000_000, Protocol::Dynamixel2, ReplyClock::Wall).unwrap();
        std::fs::remove_file(&path).unwrap();
        (wire, listener.accept().unwrap().0)
    }

    #[cfg(unix)]
    #[test]
    fn what_came_in_time_counts_although_it_is_looked_at_too_late() {
        let (mut wire, mut servo) = wire_to_here("late");
        wire.send(7, 1, &[], 7, "test").unwrap();
        let mut status = Vec::new();
        Protocol::Dynamixel2.encode(&mut status, 7, 0x55, &[0]);
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

    #[test]
    fn a_slow_adapter_is_told_with_what_to_do() {
        let folder = std::env::temp_dir().join(format!("latency-{}", std::process::id()));
        let device = folder.join("devices/ttyUSB0");
        std::fs::create_dir_all(&device).unwrap();
        std::fs::write(folder.join("ttyUSB0"), "").unwrap();
        std::fs::write(device.join("latency_timer"), "16\n").unwrap();
        let port = folder.join("ttyUSB0");
        let port = port.to_str().unwrap();
        let timer = latency_timer_in(&folder.join("devices"), port).unwrap();
        let note = timer.note(port).unwrap();
        assert!(
            note.contains("is 16 ms") && note.contains("latency_timer`"),
            "{note}"
        );
        let best = LatencyTimer {
            latency_ms: 1,
            ..timer
        };
        assert_eq!(best.note(port), None);
        assert_eq!(latency_timer_in(&folder.join("devices"), "/dev/null"), None);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
