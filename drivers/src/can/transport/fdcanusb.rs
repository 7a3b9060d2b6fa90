//! CAN FD over mjbots' fdcanusb: a serial adapter with lines of text.
//!
//! ```text
//! can send 8001 0100... BF   a frame; B: data at the higher rate, F: CAN FD, b and f: not
//! OK                         taken        ERR ...   refused
//! rcv 100 2100... E B F      a frame from the bus; E: its id has 29 bits
//! ```
//!
//! Its bitrates are its own settings: 1 and 5 Mbit/s as it is delivered. A line may end with a
//! checksum (` *5C`), which controllers on a UART ask for; this link sends none.

use std::io;
use std::time::Instant;

use super::frame::CanFrame;
use super::line_port::LinePort;
use super::link::{CanEvent, CanFault, CanLink, Sent};

/// No line is longer: 64 bytes as digits, the words around them.
const LONGEST: usize = 200;

/// Appends the line of a frame to `out`, after `verb` (`can send` or `rcv`), its end included.
pub fn encode(verb: &str, frame: &CanFrame, out: &mut Vec<u8>) {
    use std::io::Write;
    // Writing to a vector does not fail.
    let _ = write!(out, "{verb} {:x} ", frame.id());
    frame.data().iter().for_each(|byte| drop(write!(out, "{byte:02X}")));
    let flags: &[u8] = match (frame.is_flexible(), frame.is_remote()) {
        (true, _) => b" BF",
        (false, true) => b" bfR",
        (false, false) => b" bf",
    };
    out.extend(flags);
    if verb == "rcv" && frame.is_extended() {
        out.extend(b" E");
    }
    out.push(b'\n');
}

/// The frame of a line (without its end) that begins with `verb`; `None` if there is none.
pub fn decode(verb: &str, line: &str) -> Option<CanFrame> {
    let mut words = line.strip_prefix(verb)?.split_ascii_whitespace();
    let id = u32::from_str_radix(words.next()?, 16).ok()?;
    let digits = words.next().unwrap_or_default();
    let flags = words.take_while(|word| !word.starts_with('*'));
    let flags: String = flags.filter(|word| !word.starts_with(['t', 'f'])).collect();
    let digits = if digits.is_ascii() && digits.len() % 2 == 0 { digits } else { return None };
    let pairs = (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16));
    let data: Vec<u8> = pairs.collect::<Result<_, _>>().ok()?;
    match flags.contains('F') {
        true => CanFrame::flexible_from_parts(id, &data),
        false => {
            let remote = flags.contains('R').then_some(data.len() as u8);
            CanFrame::from_parts(id, id > CanFrame::STANDARD_MAX, remote, &data)
        }
    }
}

/// Lines of text out of a stream of bytes.
#[derive(Clone, Debug, Default)]
pub struct TextLines {
    line: Vec<u8>,
}

impl TextLines {
    /// Takes one byte; the line that it ended, if it is text and not too long.
    pub fn push(&mut self, byte: u8) -> Option<String> {
        if byte != b'\n' && byte != b'\r' {
            self.line.push(byte);
            self.line.truncate(LONGEST + 1);
            return None;
        }
        let line = std::mem::take(&mut self.line);
        let fits = (1..=LONGEST).contains(&line.len());
        String::from_utf8(line).ok().filter(|_| fits)
    }
}

fn parse_line(line: &str) -> Option<CanEvent> {
    if line.starts_with("ERR") {
        return Some(CanEvent::Fault(CanFault::Error));
    }
    decode("rcv", line).map(CanEvent::Frame)
}

pub struct FdcanusbLink {
    port: LinePort,
    lines: TextLines,
}

impl FdcanusbLink {
    /// Opens the adapter at `path` for this program alone.
    pub fn open(path: &str) -> io::Result<Self> {
        let mut link = Self { port: LinePort::open(path)?, lines: TextLines::default() };
        // It ends whatever an earlier program left.
        link.port.write(b"\n")?;
        Ok(link)
    }
}

impl CanLink for FdcanusbLink {
    fn carries_flexible(&self) -> bool {
        true
    }

    fn send(&mut self, frame: &CanFrame) -> io::Result<Sent> {
        if self.port.make_room()? == Sent::Full {
            return Ok(Sent::Full);
        }
        encode("can send", frame, &mut self.port.out);
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
            while let Some(byte) = self.port.byte() {
                let line = self.lines.push(byte);
                if let Some(event) = line.and_then(|line| parse_line(&line)) {
                    return Ok(event);
                }
            }
            if !self.port.read_until(deadline)? {
                return Ok(CanEvent::Nothing);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_their_published_lines() {
        let line = |verb, frame: CanFrame| {
            let mut out = Vec::new();
            encode(verb, &frame, &mut out);
            String::from_utf8(out).unwrap()
        };
        let frame = CanFrame::flexible(0x8001, &[1, 0, 10], 0x50);
        assert_eq!(line("can send", frame), "can send 8001 01000A BF\n");
        assert_eq!(line("rcv", frame), "rcv 8001 01000A BF E\n");
        assert_eq!(line("can send", CanFrame::standard(0x141, &[0x80])), "can send 141 80 bf\n");
        for sound in ["rcv 8001 01000A E B F t1234 *5C", "rcv 8001 01000A BF"] {
            assert_eq!(decode("rcv", sound), Some(frame), "{sound}");
        }
        let nine = "rcv 100 000102030405060708 F"; // no length of CAN FD
        for noise in ["rcv", "rcv xyz 00", "rcv 100 0", "rcv 100 0g", "OK", nine, "rcv 1\u{e9} 00"]
        {
            assert_eq!(decode("rcv", noise), None, "{noise}");
        }
        assert_eq!(parse_line("ERR unknown"), Some(CanEvent::Fault(CanFault::Error)));
    }
}
