//! CAN over a serial adapter: the ASCII protocol of LAWICEL ("slcan").
//!
//! ```text
//! tIIILDD..<CR>  data frame, 11-bit id    TIIIIIIIILDD..<CR>  29-bit id
//! rIIIL<CR>      remote frame             RIIIIIIIIL<CR>
//! C close, Sn bitrate n, O open, F status flags; answers: <CR> done, <BEL> refused
//! ```
//!
//! Lines are at most 31 characters; longer ones, and those that mean nothing,
//! are dropped as noise. The protocol has no checksum and no bus-off message: a
//! refused frame makes the link ask for the status flags, of which bit 7 (bus
//! error) is taken for bus-off.

use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

use super::frame::CanFrame;
use super::line_port::LinePort;
use super::link::{CanEvent, CanFault, CanLink, Sent};

pub const CR: u8 = b'\r';
pub const BEL: u8 = 7;
/// No line is longer: `T`, 8 id, 1 length, 16 data, 4 time stamp.
const LONGEST: usize = 31;

/// The bitrates of `S0` to `S8`.
pub const BITRATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

const BUS_ERROR: u8 = 1 << 7;
const ERROR_PASSIVE: u8 = 1 << 5;
const OVERRUN: u8 = 1 << 3;
const ERROR_WARNING: u8 = 1 << 2;

/// Appends the line of a frame to `out`, its end included.
pub fn encode(frame: &CanFrame, out: &mut Vec<u8>) {
    const HEX: &[u8; 16] = b"0123456789ABCDEF";
    let (letter, digits) = match (frame.is_remote(), frame.is_extended()) {
        (false, false) => (b't', 3),
        (false, true) => (b'T', 8),
        (true, false) => (b'r', 3),
        (true, true) => (b'R', 8),
    };
    out.push(letter);
    let nibbles = (0..digits).rev().map(|at| frame.id() >> (4 * at) & 0xF);
    out.extend(nibbles.map(|nibble| HEX[nibble as usize]));
    out.push(b'0' + frame.length());
    for byte in frame.data() {
        out.push(HEX[usize::from(byte >> 4)]);
        out.push(HEX[usize::from(byte & 0xF)]);
    }
    out.push(CR);
}

/// The frame of a line (without its end); `None` if it is no sound frame line.
/// A time stamp behind the data is allowed.
pub fn decode(line: &[u8]) -> Option<CanFrame> {
    let (&letter, rest) = line.split_first()?;
    let (extended, remote) = match letter {
        b't' => (false, false),
        b'T' => (true, false),
        b'r' => (false, true),
        b'R' => (true, true),
        _ => return None,
    };
    let (id, rest) = rest.split_at_checked(if extended { 8 } else { 3 })?;
    let id = number(id)?;
    let (&length, rest) = rest.split_first()?;
    let length = length.wrapping_sub(b'0');
    if length > 8 {
        return None;
    }
    let digits = if remote { 0 } else { 2 * usize::from(length) };
    let (hex, stamp) = rest.split_at_checked(digits)?;
    if !matches!(stamp.len(), 0 | 4) || number(stamp).is_none() && !stamp.is_empty() {
        return None;
    }
    let mut data = [0; 8];
    for (byte, pair) in data.iter_mut().zip(hex.chunks_exact(2)) {
        *byte = number(pair)? as u8;
    }
    let data = &data[..hex.len() / 2];
    CanFrame::from_parts(id, extended, remote.then_some(length), data)
}

fn number(digits: &[u8]) -> Option<u32> {
    let nibble = |digit: &u8| char::from(*digit).to_digit(16);
    let append = |sum: u32, digit| nibble(digit).map(|nibble| sum << 4 | nibble);
    match digits.len() {
        1..=8 => digits.iter().try_fold(0, append),
        _ => None,
    }
}

/// Lines out of a stream of bytes.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    line: Vec<u8>,
    overlong: bool,
}

impl Lines {
    /// Takes one byte. At a line's end `take` gets the line and what ended it ([`CR`] or [`BEL`]).
    pub fn push<T>(&mut self, byte: u8, take: impl FnOnce(&[u8], u8) -> T) -> Option<T> {
        if byte != CR && byte != BEL {
            self.overlong |= self.line.len() >= LONGEST;
            if !self.overlong {
                self.line.push(byte);
            }
            return None;
        }
        let result = (!self.overlong).then(|| take(&self.line, byte));
        self.line.clear();
        self.overlong = false;
        result
    }
}

fn parse_line(line: &[u8], end: u8) -> Option<CanEvent> {
    if end == BEL {
        return Some(CanEvent::Fault(CanFault::Rejected));
    }
    if let [b'F', flags @ ..] = line
        && flags.len() == 2
    {
        let flags = number(flags)? as u8;
        let faults = [
            (BUS_ERROR, CanFault::BusOff),
            (ERROR_PASSIVE, CanFault::Passive),
            (OVERRUN, CanFault::Overrun),
            (ERROR_WARNING, CanFault::Warning),
        ];
        let raised = faults.iter().find(|(bit, _)| flags & bit != 0);
        return raised.map(|(_, fault)| CanEvent::Fault(*fault));
    }
    decode(line).map(CanEvent::Frame)
}

pub struct SlcanLink {
    port: LinePort,
    lines: Lines,
    asked: Option<Instant>,
}

const ASK_AGAIN: Duration = Duration::from_millis(20);

impl SlcanLink {
    /// Opens the adapter at `path` for this program alone, and its CAN side at `bitrate`.
    pub fn open(path: &str, bitrate: u32) -> io::Result<Self> {
        let code = BITRATES.iter().position(|known| *known == bitrate);
        let code = code.ok_or_else(|| {
            let reason = format!("slcan knows no bitrate of {bitrate}, only {BITRATES:?}");
            io::Error::new(ErrorKind::InvalidInput, reason)
        })?;
        let mut link = Self { port: LinePort::open(path)?, lines: Lines::default(), asked: None };
        // An end of line first: it ends whatever an earlier program left.
        link.port.write(format!("\rC\rS{code}\rO\r").as_bytes())?;
        Ok(link)
    }

    /// The next frame or fault among the bytes at hand.
    fn next(&mut self) -> Option<CanEvent> {
        while let Some(byte) = self.port.byte() {
            if let Some(Some(received)) = self.lines.push(byte, parse_line) {
                return Some(received);
            }
        }
        None
    }

    fn ask_flags(&mut self) -> io::Result<()> {
        if self.asked.is_some_and(|at| at.elapsed() < ASK_AGAIN) {
            return Ok(());
        }
        self.asked = Some(Instant::now());
        self.port.write(b"F\r")
    }
}

impl CanLink for SlcanLink {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sent> {
        // The frames of a cycle go out together, when their answers are awaited.
        if self.port.make_room()? == Sent::Full {
            return Ok(Sent::Full);
        }
        encode(frame, &mut self.port.out);
        Ok(Sent::Taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.port.hand_over().map(drop)
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<CanEvent> {
        if self.port.hand_over()? == Sent::Full && Instant::now() >= deadline {
            return Ok(CanEvent::Nothing);
        }
        loop {
            if let Some(received) = self.next() {
                if received == CanEvent::Fault(CanFault::Rejected) {
                    self.ask_flags()?;
                }
                return Ok(received);
            }
            if !self.port.read_until(deadline)? {
                return Ok(CanEvent::Nothing);
            }
        }
    }
}

impl Drop for SlcanLink {
    fn drop(&mut self) {
        // The adapter may be gone already.
        let _ = self.port.hand_over();
        let _ = self.port.write(b"C\r");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(frame: CanFrame) -> String {
        let mut out = Vec::new();
        encode(&frame, &mut out);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn frames_have_their_published_lines() {
        assert_eq!(line(CanFrame::standard(0x123, &[0x11, 0xAB])), "t123211AB\r");
        assert_eq!(line(CanFrame::extended(0x0300_FD01, &[0; 8])), "T0300FD0180000000000000000\r");
        assert_eq!(line(CanFrame::remote(0x29, 8)), "r0298\r");
    }

    #[test]
    fn every_frame_comes_back() {
        for frame in [
            CanFrame::standard(0x7FF, &[]),
            CanFrame::standard(1, &[1, 2, 3, 4, 5, 6, 7, 8]),
            CanFrame::extended(0x1FFF_FFFF, &[0xFF; 8]),
            CanFrame::remote(0x21, 8),
        ] {
            let line = line(frame);
            assert_eq!(decode(&line.as_bytes()[..line.len() - 1]), Some(frame));
        }
        assert!(decode(b"t12320102ABCD").is_some(), "with a time stamp");
    }

    #[test]
    fn damaged_lines_mean_nothing() {
        for line in [
            &b"t12"[..],
            b"t8001",
            b"t1239",
            b"t12320",
            b"t1232011",
            b"t123201GG",
            b"T200000000",
            b"x1230",
            b"",
            b"\xff\xff",
        ] {
            assert_eq!(decode(line), None, "{line:?}");
        }
    }

    #[test]
    fn an_endless_line_is_dropped_and_the_next_one_read() {
        let mut lines = Lines::default();
        for _ in 0..1_000_000 {
            assert_eq!(lines.push(b'7', |_, _| ()), None);
        }
        assert_eq!(lines.push(CR, |_, _| ()), None);
        let heard: Vec<usize> =
            b"t1230\r".iter().filter_map(|byte| lines.push(*byte, |line, _| line.len())).collect();
        assert_eq!(heard, [5]);
    }

    #[test]
    fn flags_become_faults() {
        let fault = |line: &[u8]| parse_line(line, CR);
        assert_eq!(fault(b"F80"), Some(CanEvent::Fault(CanFault::BusOff)));
        assert_eq!(fault(b"F24"), Some(CanEvent::Fault(CanFault::Passive)));
        assert_eq!(fault(b"F00"), None);
        assert_eq!(parse_line(b"", BEL), Some(CanEvent::Fault(CanFault::Rejected)));
    }
}
