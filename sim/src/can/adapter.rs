//! The adapter between host and simulated bus: an slcan adapter on a pseudo-terminal or
//! a Unix socket, a multicast group, or a CAN interface.
//!
//! The slcan adapter knows `S`, `s`, `O`, `L`, `C`, `F`, `V`, `N`, `t`, `T`,
//! `r`, `R`; it refuses frames while closed or bus-off, and everything else. Set
//! to another bitrate than the bus has, it receives nothing, and no node acknowledges
//! what it sends: its queue fills up, then frames are refused.

use std::io;
use std::net::SocketAddrV4;
use std::os::fd::{AsFd, OwnedFd};
use std::time::{Duration, Instant};

use servodance_drivers::can::transport::slcan::{self, BEL, CR, Lines};
#[cfg(target_os = "linux")]
use servodance_drivers::can::transport::socket::SocketLink;
use servodance_drivers::can::transport::udp::UdpLink;
use servodance_drivers::can::{CanEvent, CanFrame, CanLink, Sent};

use crate::serial::host_port::{HostInput, HostPort, readable};

pub(crate) trait Adapter: Send {
    /// A second handle on the file that brings the host's bytes.
    fn watched(&self) -> io::Result<OwnedFd>;

    /// Whether `watched` is another file since the last call.
    fn moved(&mut self) -> bool {
        false
    }

    /// Waits until the host has sent something, for at most `wait`.
    fn wait(&self, wait: Duration) -> io::Result<bool>;

    /// Adds the frames that the host has sent. An error ends the adapter.
    fn fetch(&mut self, bus_off: bool, frames: &mut Vec<CanFrame>) -> io::Result<()>;

    /// Hands a frame to the host; what its buffer does not hold is lost.
    fn deliver(&mut self, frame: &CanFrame);

    /// Hands noise to the host, on an adapter of bytes.
    fn garble(&mut self, _bytes: &[u8]) {}
}

pub(crate) struct SlcanAdapter {
    port: HostPort,
    lines: Lines,
    open: bool,
    out: Vec<u8>,
    /// Bits a second of the bus, and of the adapter.
    bus_bitrate: u32,
    bitrate: u32,
    /// Frames that wait because no node acknowledges them.
    waiting: usize,
}

const QUEUE: usize = 16;

impl SlcanAdapter {
    pub fn new(port: HostPort, bus_bitrate: u32) -> Self {
        Self {
            port,
            lines: Lines::default(),
            open: false,
            out: Vec::new(),
            bus_bitrate,
            bitrate: bus_bitrate,
            waiting: 0,
        }
    }

    fn on_the_bus(&self) -> bool {
        self.open && self.bitrate == self.bus_bitrate
    }

    /// Takes one byte from the host.
    fn take(&mut self, byte: u8, bus_off: bool) -> Option<CanFrame> {
        let line = self.lines.push(byte, |line, end| (end == CR).then(|| line.to_vec()))??;
        let letter = *line.first()?;
        match (letter, &line[1..]) {
            (b't' | b'T' | b'r' | b'R', _) => {
                let has_room = self.on_the_bus() || self.waiting < QUEUE;
                let taken = self.open && !bus_off && has_room;
                let frame = slcan::decode(&line).filter(|_| taken);
                match frame {
                    None => self.out.push(BEL),
                    Some(_) if letter.is_ascii_uppercase() => self.out.extend(b"Z\r"),
                    Some(_) => self.out.extend(b"z\r"),
                }
                self.waiting += usize::from(frame.is_some() && !self.on_the_bus());
                return frame.filter(|_| self.on_the_bus());
            }
            (b'O' | b'L', []) if !self.open => self.open = true,
            (b'C', []) => (self.open, self.waiting) = (false, 0),
            (b'S', &[code @ b'0'..=b'8']) if !self.open => {
                self.bitrate = slcan::BITRATES[usize::from(code - b'0')];
            }
            (b's', _) if !self.open => {}
            (b'F', []) => {
                let is_deaf = bus_off || self.waiting == QUEUE;
                self.out.extend(if is_deaf { b"F80" } else { b"F00" });
            }
            (b'V', []) => self.out.extend(b"V1013"),
            (b'N', []) => self.out.extend(b"NSIM1"),
            _ => {
                self.out.push(BEL);
                return None;
            }
        }
        self.out.push(CR);
        None
    }

    fn flush(&mut self) {
        self.port.write(&self.out);
        self.out.clear();
    }
}

impl Adapter for SlcanAdapter {
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
                let taken = chunk[..count].iter();
                frames.extend(taken.filter_map(|byte| self.take(*byte, bus_off)));
                self.flush();
            }
            // The next host finds the adapter closed.
            HostInput::Nobody => {
                self.open = false;
                self.lines = Lines::default();
                std::thread::sleep(Duration::from_millis(1));
            }
            HostInput::Nothing => {}
        }
        Ok(())
    }

    fn deliver(&mut self, frame: &CanFrame) {
        if self.on_the_bus() {
            slcan::encode(frame, &mut self.out);
            self.flush();
        }
    }

    fn garble(&mut self, bytes: &[u8]) {
        self.out.extend(bytes);
        self.flush();
    }
}

/// A link of the drivers from its other end: a multicast group, or a CAN interface.
pub(crate) struct LinkAdapter<L> {
    link: L,
    watched: OwnedFd,
    /// How often a motor offers a frame again: without a bus it loses its frame.
    most_repeats: u32,
}

/// How long a motor waits before it offers a frame again.
const REPEAT: Duration = Duration::from_micros(100);

impl LinkAdapter<UdpLink> {
    pub fn open_group(group: SocketAddrV4) -> io::Result<Self> {
        let link = UdpLink::open(group)?;
        Ok(Self { watched: link.socket().try_clone()?.into(), link, most_repeats: 0 })
    }
}

#[cfg(target_os = "linux")]
impl LinkAdapter<SocketLink> {
    pub fn open_interface(interface: &str) -> io::Result<Self> {
        let link = SocketLink::open(interface)?;
        Ok(Self { watched: link.as_fd().try_clone_to_owned()?, link, most_repeats: 1000 })
    }
}

impl<L: CanLink> Adapter for LinkAdapter<L> {
    fn watched(&self) -> io::Result<OwnedFd> {
        self.watched.try_clone()
    }

    fn wait(&self, wait: Duration) -> io::Result<bool> {
        readable(&[self.watched.as_fd()], wait)
    }

    fn fetch(&mut self, bus_off: bool, frames: &mut Vec<CanFrame>) -> io::Result<()> {
        let now = Instant::now();
        loop {
            match self.link.receive(now) {
                Ok(CanEvent::Frame(frame)) if !bus_off => frames.push(frame),
                Ok(CanEvent::Nothing) => return Ok(()),
                // Motors live on when the interface is taken down.
                Err(error) if error.kind() == io::ErrorKind::NetworkDown => return Ok(()),
                Err(error) => return Err(error),
                Ok(_) => {}
            }
        }
    }

    fn deliver(&mut self, frame: &CanFrame) {
        for _ in 0..=self.most_repeats {
            match self.link.send(frame) {
                Ok(Sent::Full) if self.most_repeats > 0 => std::thread::sleep(REPEAT),
                _ => return,
            }
        }
    }
}
