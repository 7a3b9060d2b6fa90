//! Our end of the host's serial port: a pseudo-terminal, or a Unix socket.
//!
//! A pseudo-terminal is opened by any program, and may be opened by several. A
//! socket has less between both ends (no line discipline, no kernel thread), but
//! only programs that know sockets open it. One host at a time: a second one is
//! hung up on at once.
//!
//! Nothing blocks for longer than it is told to: a host that does not read must
//! not stop the servos.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::Duration;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostInput {
    Bytes(usize),
    Nothing,
    /// There is no host: nobody has the other end open.
    Nobody,
}

#[derive(Debug)]
pub enum HostPort {
    Terminal(OwnedFd),
    Socket {
        listener: UnixListener,
        host: Option<UnixStream>,
        /// A host has come or gone since this was asked last.
        moved: bool,
    },
}

impl HostPort {
    /// A socket with a name and without a file, which is gone with its program.
    #[cfg(target_os = "linux")]
    pub fn listen_by_name(name: &str) -> io::Result<Self> {
        use std::os::linux::net::SocketAddrExt;
        let address = std::os::unix::net::SocketAddr::from_abstract_name(name)?;
        Self::of(UnixListener::bind_addr(&address)?)
    }

    /// A socket at `path`. What a program that died left there is removed; one
    /// that somebody serves is not.
    pub fn listen(path: &Path) -> io::Result<Self> {
        if UnixStream::connect(path).is_err_and(|e| e.kind() == ErrorKind::ConnectionRefused) {
            std::fs::remove_file(path)?;
        }
        Self::of(UnixListener::bind(path)?)
    }

    fn of(listener: UnixListener) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Self::Socket { listener, host: None, moved: false })
    }

    /// Whether a host has come or gone since the last call: then
    /// [`HostPort::watched`] is another handle.
    pub fn moved(&mut self) -> bool {
        match self {
            Self::Terminal(_) => false,
            Self::Socket { moved, .. } => std::mem::take(moved),
        }
    }

    /// A second handle on what will have something to read next: the host's
    /// bytes, or the host itself where it has yet to come in.
    pub fn watched(&self) -> io::Result<OwnedFd> {
        match self {
            Self::Terminal(master) => master.try_clone(),
            Self::Socket { host: Some(host), .. } => host.as_fd().try_clone_to_owned(),
            Self::Socket { listener, .. } => listener.as_fd().try_clone_to_owned(),
        }
    }

    /// Waits until a host says something, comes or goes, for at most `wait`.
    pub fn wait(&self, wait: Duration) -> io::Result<bool> {
        match self {
            Self::Terminal(master) => readable(&[master.as_fd()], wait),
            Self::Socket { listener, host, .. } => match host {
                Some(host) => readable(&[host.as_fd(), listener.as_fd()], wait),
                None => readable(&[listener.as_fd()], wait),
            },
        }
    }

    /// Lets a host in that waits at the socket, or hangs up on a second one.
    fn admit(&mut self) {
        if let Self::Socket { listener, host, moved } = self
            && let Ok((new, _)) = listener.accept()
            && host.is_none()
            && new.set_nonblocking(true).is_ok()
        {
            (*host, *moved) = (Some(new), true);
        }
    }

    /// What the host has said, without waiting. An error ends the port.
    pub fn read(&mut self, chunk: &mut [u8]) -> io::Result<HostInput> {
        if let Self::Socket { host: None, .. } = self {
            self.admit();
        }
        let read = match self {
            // EIO: nobody has the other end open.
            Self::Terminal(master) => match nix::unistd::read(&*master, chunk) {
                Err(Errno::EIO) => Ok(0),
                read => read.map_err(io::Error::from),
            },
            Self::Socket { host: None, .. } => return Ok(HostInput::Nobody),
            Self::Socket { host: Some(host), .. } => host.read(chunk),
        };
        let gone = |kind| matches!(kind, ErrorKind::ConnectionReset | ErrorKind::BrokenPipe);
        match read {
            Ok(0) => Ok(self.nobody()),
            Ok(count) => Ok(HostInput::Bytes(count)),
            Err(error) => match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::Interrupted => {
                    self.admit();
                    Ok(HostInput::Nothing)
                }
                kind if gone(kind) => Ok(self.nobody()),
                _ => Err(error),
            },
        }
    }

    fn nobody(&mut self) -> HostInput {
        if let Self::Socket { host, moved, .. } = self {
            (*host, *moved) = (None, true);
        }
        HostInput::Nobody
    }

    /// Hands bytes to the host; what its buffer does not hold is lost, as on a wire.
    pub fn write(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let written = match self {
                Self::Terminal(master) => {
                    nix::unistd::write(&*master, bytes).map_err(io::Error::from)
                }
                Self::Socket { host: None, .. } => return,
                Self::Socket { host: Some(host), .. } => host.write(bytes),
            };
            match written {
                Ok(count) => bytes = &bytes[count..],
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    }

    /// The rate that the host has set its end to, bits a second; 0 if unknown.
    pub fn baud(&self) -> u32 {
        match self {
            Self::Terminal(master) => {
                rustix::termios::tcgetattr(master).map_or(0, |set| set.output_speed())
            }
            Self::Socket { .. } => 0,
        }
    }
}

/// Whether one of them has something to read, after at most `wait`.
pub(crate) fn readable(fds: &[BorrowedFd<'_>], wait: Duration) -> io::Result<bool> {
    let watched = fds.iter().map(|fd| PollFd::new(*fd, PollFlags::POLLIN));
    let mut watched: Vec<_> = watched.collect();
    let timeout = PollTimeout::from(wait.as_millis().min(1000) as u16);
    match poll(&mut watched, timeout) {
        Ok(ready) => Ok(ready > 0),
        Err(Errno::EINTR) => Ok(false),
        Err(errno) => Err(errno.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(port: &mut HostPort) -> HostInput {
        assert!(port.wait(Duration::from_secs(1)).unwrap());
        port.read(&mut [0; 8]).unwrap()
    }

    #[test]
    fn one_host_at_a_time_and_the_next_when_it_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("port");
        let mut port = HostPort::listen(&at).unwrap();
        assert_eq!(port.read(&mut [0; 8]).unwrap(), HostInput::Nobody);
        port.write(b"to nobody");

        let mut first = UnixStream::connect(&at).unwrap();
        assert_eq!(said(&mut port), HostInput::Nothing);
        assert!(port.moved() && !port.moved());
        let mut second = UnixStream::connect(&at).unwrap();
        assert_eq!(said(&mut port), HostInput::Nothing);
        assert_eq!(second.read(&mut [0; 8]).unwrap(), 0);

        first.write_all(b"one").unwrap();
        assert_eq!(said(&mut port), HostInput::Bytes(3));
        assert!(!port.moved());
        drop(first);
        assert_eq!(said(&mut port), HostInput::Nobody);
        assert!(port.moved());
        let mut third = UnixStream::connect(&at).unwrap();
        third.write_all(b"three").unwrap();
        assert_eq!(said(&mut port), HostInput::Bytes(5));
    }

    #[test]
    fn what_a_dead_program_left_is_replaced_and_a_living_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("port");
        let alive = HostPort::listen(&at).unwrap();
        let refused = HostPort::listen(&at).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::AddrInUse);
        drop(alive);
        assert!(HostPort::listen(&at).is_ok());
    }

    #[test]
    fn a_host_that_does_not_read_stops_nobody() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("port");
        let mut port = HostPort::listen(&at).unwrap();
        let _host = UnixStream::connect(&at).unwrap();
        assert_eq!(said(&mut port), HostInput::Nothing);
        (0..10_000).for_each(|_| port.write(&[0; 1024]));
    }
}
