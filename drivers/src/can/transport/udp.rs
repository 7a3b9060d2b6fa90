//! CAN frames as multicast datagrams, as python-can's `udp_multicast` sends
//! them: one frame a datagram, a msgpack map. For simulation, on one machine.
//!
//! Keys: `arbitration_id`, `is_extended_id`, `is_remote_frame`,
//! `is_error_frame`, `dlc`, `data`, `is_fd` and some that are ignored. The few kinds of
//! value are read here and not by a msgpack crate: datagrams of strangers stay bounded.
//! Whatever is not such a map of at most 16 entries, or is no classic frame,
//! is dropped. A datagram is looked at up to its 512th byte.

use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::time::{Duration, Instant};

use socket2::{Domain, Protocol, Socket, Type};

use super::frame::CanFrame;
use super::link::{CanEvent, CanFault, CanLink, Sent};

const LONGEST: usize = 512;
const MOST_ENTRIES: usize = 16;

/// Replaces `out` with the datagram of a frame.
pub fn encode(frame: &CanFrame, out: &mut Vec<u8>) {
    let flag = |value: bool| [0xC2 | u8::from(value)];
    let [a, b, c, d] = frame.id().to_be_bytes();
    out.clear();
    out.push(0x8B); // a map of 11
    put(out, "timestamp", &[0xCB, 0, 0, 0, 0, 0, 0, 0, 0]);
    put(out, "arbitration_id", &[0xCE, a, b, c, d]);
    put(out, "is_extended_id", &flag(frame.is_extended()));
    put(out, "is_remote_frame", &flag(frame.is_remote()));
    put(out, "is_error_frame", &flag(false));
    put(out, "channel", &[0xC0]);
    put(out, "dlc", &[frame.length()]);
    put(out, "data", &[0xC4, frame.data().len() as u8]);
    out.extend(frame.data());
    put(out, "is_fd", &flag(false));
    put(out, "bitrate_switch", &flag(false));
    put(out, "error_state_indicator", &flag(false));
}

/// Appends a key and the bytes of its value.
fn put(out: &mut Vec<u8>, key: &str, value: &[u8]) {
    out.push(0xA0 | key.len() as u8);
    out.extend(key.as_bytes());
    out.extend(value);
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Msgpack<'a> {
    Flag(bool),
    Number(u64),
    Bytes(&'a [u8]),
    Other,
}

struct MsgpackReader<'a>(&'a [u8]);

impl<'a> MsgpackReader<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    /// A big-endian number of `bytes` bytes, at most eight.
    fn number(&mut self, bytes: usize) -> Option<u64> {
        let append = |sum, byte: &u8| sum << 8 | u64::from(*byte);
        Some(self.take(bytes)?.iter().fold(0, append))
    }

    fn value(&mut self) -> Option<Msgpack<'a>> {
        let tag = *self.take(1)?.first()?;
        let sized = |reader: &mut Self, bytes| {
            let length = usize::try_from(reader.number(bytes)?).ok()?;
            reader.take(length).map(Msgpack::Bytes)
        };
        match tag {
            0x00..=0x7F => Some(Msgpack::Number(u64::from(tag))),
            0xA0..=0xBF => self.take(usize::from(tag & 0x1F)).map(Msgpack::Bytes),
            0xC0 | 0xE0..=0xFF => Some(Msgpack::Other),
            0xC2 | 0xC3 => Some(Msgpack::Flag(tag == 0xC3)),
            0xC4 | 0xD9 => sized(self, 1),
            0xC5 | 0xDA => sized(self, 2),
            0xC6 | 0xDB => sized(self, 4),
            0xCA => self.take(4).map(|_| Msgpack::Other),
            0xCB => self.take(8).map(|_| Msgpack::Other),
            0xCC..=0xCF => self.number(1 << (tag - 0xCC)).map(Msgpack::Number),
            0xD0..=0xD3 => self.take(1 << (tag - 0xD0)).map(|_| Msgpack::Other),
            _ => None,
        }
    }

    fn map_entries(&mut self) -> Option<usize> {
        let tag = *self.take(1)?.first()?;
        match tag {
            0x80..=0x8F => Some(usize::from(tag & 0xF)),
            0xDE => self.number(2).map(|count| count as usize),
            _ => None,
        }
    }
}

pub fn decode(datagram: &[u8]) -> Option<CanEvent> {
    let mut reader = MsgpackReader(datagram);
    let entries = reader.map_entries().filter(|count| *count <= MOST_ENTRIES)?;
    let (mut id, mut dlc, mut data) = (None, 0, None);
    let (mut extended, mut remote, mut error, mut fd) = (false, false, false, false);
    for _ in 0..entries {
        let Msgpack::Bytes(key) = reader.value()? else {
            return None;
        };
        match (key, reader.value()?) {
            (b"arbitration_id", Msgpack::Number(number)) => id = Some(number),
            (b"dlc", Msgpack::Number(number)) => dlc = number,
            (b"data", Msgpack::Bytes(bytes)) => data = Some(bytes),
            (b"is_extended_id", Msgpack::Flag(flag)) => extended = flag,
            (b"is_remote_frame", Msgpack::Flag(flag)) => remote = flag,
            (b"is_error_frame", Msgpack::Flag(flag)) => error = flag,
            (b"is_fd", Msgpack::Flag(flag)) => fd = flag,
            _ => {}
        }
    }
    if error {
        return Some(CanEvent::Fault(CanFault::Error));
    }
    let id = u32::try_from(id?).ok()?;
    let data = data.unwrap_or_default();
    if fd || dlc > 8 || !remote && data.len() as u64 != dlc {
        return None;
    }
    let frame = match remote {
        true => CanFrame::from_parts(id, extended, Some(dlc as u8), &[]),
        false => CanFrame::from_parts(id, extended, None, data),
    };
    frame.map(CanEvent::Frame)
}

#[derive(Debug)]
pub struct UdpLink {
    group: SocketAddrV4,
    receiver: UdpSocket,
    /// Has a port of its own, by which our frames are known when they come back.
    sender: UdpSocket,
    out: Vec<u8>,
    datagram: Vec<u8>,
}

impl UdpLink {
    pub fn open(group: SocketAddrV4) -> io::Result<Self> {
        let receiver = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
        receiver.set_reuse_address(true)?;
        #[cfg(unix)]
        receiver.set_reuse_port(true)?;
        receiver.bind(&SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, group.port()).into())?;
        receiver.join_multicast_v4(group.ip(), &Ipv4Addr::UNSPECIFIED)?;
        let sender = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        // This machine only.
        sender.set_multicast_ttl_v4(0)?;
        Ok(Self {
            group,
            receiver: receiver.into(),
            sender,
            out: Vec::with_capacity(256),
            datagram: vec![0; LONGEST],
        })
    }

    pub fn socket(&self) -> &UdpSocket {
        &self.receiver
    }

    /// One datagram, if one comes in time: its length if it is not our own.
    fn datagram(&mut self) -> io::Result<Option<usize>> {
        let (length, from) = self.receiver.recv_from(&mut self.datagram)?;
        let ours = self.sender.local_addr()?.port();
        Ok((from.port() != ours).then_some(length))
    }
}

impl CanLink for UdpLink {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sent> {
        encode(frame, &mut self.out);
        match self.sender.send_to(&self.out, self.group) {
            Ok(_) => Ok(Sent::Taken),
            // ENOBUFS has no kind of its own.
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(Sent::Full),
            Err(error) if error.raw_os_error() == Some(105) => Ok(Sent::Full),
            Err(error) => Err(error),
        }
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<CanEvent> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            self.receiver.set_nonblocking(left.is_zero())?;
            if !left.is_zero() {
                self.receiver.set_read_timeout(Some(left.max(Duration::from_micros(1))))?;
            }
            match self.datagram() {
                Ok(None) => {}
                Ok(Some(length)) => {
                    if let Some(received) = decode(&self.datagram[..length]) {
                        return Ok(received);
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    if left.is_zero() {
                        return Ok(CanEvent::Nothing);
                    }
                }
                Err(error) => return Err(error),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_comes_back() {
        for frame in [
            CanFrame::standard(0x7FF, &[]),
            CanFrame::extended(0x1FFF_FFFF, &[1, 2, 3, 4, 5, 6, 7, 8]),
            CanFrame::remote(0x21, 8),
        ] {
            let mut datagram = Vec::new();
            encode(&frame, &mut datagram);
            assert_eq!(decode(&datagram), Some(CanEvent::Frame(frame)));
            for cut in 0..datagram.len() {
                let kept = decode(&datagram[..cut]);
                assert_eq!(kept, None, "cut at {cut}");
            }
        }
    }

    /// `msgpack.packb` of python-can 4.6 for id 0x123, data 01 02.
    #[test]
    fn a_datagram_of_python_can_is_read() {
        let mut datagram = vec![0x8B];
        let out = &mut datagram;
        put(out, "timestamp", &[0xCB, 0x41, 0xD9, 0x5F, 0x3E, 0x12, 0x34, 0x56, 0x78]);
        put(out, "arbitration_id", &[0xCD, 0x01, 0x23]);
        put(out, "is_extended_id", &[0xC2]);
        put(out, "is_remote_frame", &[0xC2]);
        put(out, "is_error_frame", &[0xC2]);
        put(out, "channel", &[0xC0]);
        put(out, "dlc", &[2]);
        put(out, "data", &[0xC4, 2, 1, 2]);
        put(out, "is_fd", &[0xC2]);
        put(out, "bitrate_switch", &[0xC2]);
        put(out, "error_state_indicator", &[0xC2]);
        let frame = CanFrame::standard(0x123, &[1, 2]);
        assert_eq!(decode(&datagram), Some(CanEvent::Frame(frame)));
    }

    #[test]
    fn lengths_that_lie_are_no_frames() {
        assert_eq!(decode(&[0xDE, 0xFF, 0xFF]), None);
        assert_eq!(decode(&[0x81, 0xC6, 0xFF, 0xFF, 0xFF, 0xFF]), None);
        assert_eq!(decode(&[]), None);
    }
}
