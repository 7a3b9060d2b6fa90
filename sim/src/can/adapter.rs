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

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
#[cfg(target_os = "linux")]
use servodance_drivers::can::Sent;
use servodance_drivers::can::transport::slcan::{self, BEL, CR, Lines};
#[cfg(target_os = "linux")]
use servodance_drivers::can::transport::socket::SocketLink;
use servodance_drivers::can::transport::udp::UdpLink;
use servodance_drivers::can::{CanEvent, CanFrame, CanLink};

use crate::serial::host_port::{HostInput, HostPort};

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
    fn garble(&mut self, bytes: &[u8]);
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
        let line = self
            .lines
            .push(byte, |line, end| (end == CR).then(|| line.to_vec()))??;
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
                let flags: &[u8] = if is_deaf { b"F80" } else { b"F00" };
                self.out.extend(flags);
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

/// Whether there is something to read, after at most `wait`.
pub(crate) fn readable(fd: impl AsFd, wait: Duration) -> io::Result<bool> {
    let mut watched = [PollFd::new(fd.as_fd(), PollFlags::POLLIN)];
    match poll(
        &mut watched,
        PollTimeout::from(wait.as_millis().min(1000) as u16),
    ) {
        Ok(count) => Ok(count > 0),
        Err(Errno::EINTR) => Ok(false),
        Err(errno) => Err(errno.into()),
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

pub(crate) struct MulticastAdapter {
    link: UdpLink,
}

impl MulticastAdapter {
    pub fn open(group: SocketAddrV4) -> io::Result<Self> {
        Ok(Self {
            link: UdpLink::open(group)?,
        })
    }
}

impl Adapter for MulticastAdapter {
    fn watched(&self) -> io::Result<OwnedFd> {
        Ok(self.link.socket().try_clone()?.into())
    }

    fn wait(&self, wait: Duration) -> io::Result<bool> {
        readable(self.link.socket(), wait)
    }

    fn fetch(&mut self, bus_off: bool, frames: &mut Vec<CanFrame>) -> io::Result<()> {
        let now = Instant::now();
        while let CanEvent::Frame(frame) = self.link.receive(now)? {
            if !bus_off {
                frames.push(frame);
            }
        }
        Ok(())
    }

    fn deliver(&mut self, frame: &CanFrame) {
        // Lost, as on a bus without listeners.
        let _ = self.link.send(frame);
    }

    fn garble(&mut self, _bytes: &[u8]) {}
}

#[cfg(target_os = "linux")]
pub(crate) struct InterfaceAdapter {
    link: SocketLink,
}

#[cfg(target_os = "linux")]
impl InterfaceAdapter {
    /// How long a motor waits before it offers a frame again, ...
    const REPEAT: Duration = Duration::from_micros(100);
    /// ... and how often it does: a motor without a bus loses its frame.
    const MOST_REPEATS: u32 = 1000;

    pub fn open(interface: &str) -> io::Result<Self> {
        Ok(Self {
            link: SocketLink::open(interface)?,
        })
    }
}

#[cfg(target_os = "linux")]
impl Adapter for InterfaceAdapter {
    fn watched(&self) -> io::Result<OwnedFd> {
        self.link.as_fd().try_clone_to_owned()
    }

    fn wait(&self, wait: Duration) -> io::Result<bool> {
        readable(&self.link, wait)
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
        for _ in 0..Self::MOST_REPEATS {
            match self.link.send(frame) {
                Ok(Sent::Full) => std::thread::sleep(Self::REPEAT),
                _ => return,
            }
        }
    }

    fn garble(&mut self, _bytes: &[u8]) {}
}
