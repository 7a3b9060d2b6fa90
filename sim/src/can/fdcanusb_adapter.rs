//! mjbots' fdcanusb on a pseudo-terminal or a Unix socket: `can send`, and what it answers.
//!
//! A host that ends its lines with a checksum, as the vendor's client does where it takes the
//! port for a UART, is answered with checksums.

use std::io;
use std::os::fd::OwnedFd;
use std::time::Duration;

use servodance_drivers::can::CanFrame;
use servodance_drivers::can::transport::fdcanusb::{TextLines, decode, encode};

use crate::can::Adapter;
use crate::serial::host_port::{HostInput, HostPort};

pub(crate) struct FdcanusbAdapter {
    port: HostPort,
    lines: TextLines,
    out: Vec<u8>,
    with_checksums: bool,
}

/// CRC-8 with the polynomial 0x97.
fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| {
        let step = |sum: u8, _| if sum & 0x80 != 0 { sum << 1 ^ 0x97 } else { sum << 1 };
        (0..8).fold(sum ^ byte, step)
    })
}

impl FdcanusbAdapter {
    pub fn new(port: HostPort) -> Self {
        Self { port, lines: TextLines::default(), out: Vec::new(), with_checksums: false }
    }

    fn say(&mut self, line: &str) {
        let mut line = line.to_owned();
        if self.with_checksums {
            line.push(' ');
            line.push_str(&format!("*{:02X}", checksum(line.as_bytes())));
        }
        self.out.extend(line.as_bytes());
        self.out.extend(b"\r\n");
    }

    fn take(&mut self, line: &str, bus_off: bool) -> Option<CanFrame> {
        let mut said = line;
        if let Some((before, sum)) = line.rsplit_once('*').filter(|(_, sum)| sum.len() == 2) {
            if u8::from_str_radix(sum, 16) != Ok(checksum(before.as_bytes())) {
                self.say("ERR checksum");
                return None;
            }
            self.with_checksums = true;
            said = before.trim_end();
        }
        let frame = decode("can send", said).filter(|_| !bus_off);
        self.say(if frame.is_some() { "OK" } else { "ERR unknown command" });
        frame
    }
}

impl Adapter for FdcanusbAdapter {
    fn watched(&self) -> io::Result<OwnedFd> {
        self.port.watched()
    }

    fn moved(&mut self) -> bool {
        self.port.moved()
    }

    fn wait(&self, wait: Duration) -> io::Result<bool> {
        self.port.wait(wait)
    }

    fn fetch(&mut self, bus_off: bool, frames: &mut Vec<CanFrame>) -> io::Result<()> {
        let mut chunk = [0; 4096];
        match self.port.read(&mut chunk)? {
            HostInput::Bytes(count) => {
                for byte in &chunk[..count] {
                    let line = self.lines.push(*byte);
                    frames.extend(line.and_then(|line| self.take(&line, bus_off)));
                }
                self.port.write(&self.out);
                self.out.clear();
            }
            HostInput::Nobody => {
                self.lines = TextLines::default();
                self.with_checksums = false;
                std::thread::sleep(Duration::from_millis(1));
            }
            HostInput::Nothing => {}
        }
        Ok(())
    }

    fn deliver(&mut self, frame: &CanFrame) {
        let mut line = Vec::new();
        encode("rcv", frame, &mut line);
        self.say(String::from_utf8_lossy(&line).trim_end());
        self.port.write(&self.out);
        self.out.clear();
    }

    fn garble(&mut self, bytes: &[u8]) {
        self.port.write(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the vendor's client.
    #[test]
    fn checksums_are_those_of_the_vendor() {
        assert_eq!(checksum(b""), 0);
        assert_eq!(checksum(b"\x01"), 0x97);
        assert_eq!(checksum(b"OK "), vendor(b"OK "));
    }

    /// The same by a table for half a byte.
    fn vendor(bytes: &[u8]) -> u8 {
        let half: Vec<u8> = (0..16).map(|nibble| checksum(&[nibble])).collect();
        let step = |sum: u8, nibble: u8| half[usize::from(sum >> 4 ^ nibble)] ^ sum << 4;
        bytes.iter().fold(0, |sum, byte| step(step(sum, byte >> 4), byte & 0xF))
    }
}
