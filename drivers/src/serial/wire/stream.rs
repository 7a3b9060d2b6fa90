//! The bytes of an adapter: a serial port, or a Unix socket at its place.
//!
//! A path that leads to a socket is connected to, and on Linux `@NAME` to one
//! that has a name and no file. Simulators serve their ports so (`servodance
//! sim-bus --link unix`, QEMU, Renode), and so does `socat`, which brings one
//! from another machine. A socket has no rate: both ends are taken to agree.
//!
//! Nothing here waits for longer than its timeout.

use std::io::{self, ErrorKind, Read, Write};
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort};

pub enum PortStream {
    Serial(Box<dyn SerialPort>),
    #[cfg(unix)]
    Socket(socket::Socket),
}

impl PortStream {
    /// Opens `path`: 8 data bits, no parity, 1 stop bit.
    pub fn open(path: &str, baud: u32, timeout: Duration) -> io::Result<Self> {
        #[cfg(unix)]
        if socket::is_at(path) {
            return Ok(Self::Socket(socket::Socket::open(path, timeout)?));
        }
        let port = serialport::new(path, baud).timeout(timeout).open()?;
        Ok(Self::Serial(port))
    }

    pub fn set_timeout(&mut self, timeout: Duration) -> io::Result<()> {
        match self {
            Self::Serial(port) => Ok(port.set_timeout(timeout)?),
            #[cfg(unix)]
            Self::Socket(socket) => {
                socket.timeout = timeout;
                Ok(())
            }
        }
    }

    pub fn clear_input(&mut self) -> io::Result<()> {
        match self {
            Self::Serial(port) => Ok(port.clear(ClearBuffer::Input)?),
            #[cfg(unix)]
            Self::Socket(socket) => socket.drain(),
        }
    }
}

impl Read for PortStream {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Serial(port) => port.read(into),
            #[cfg(unix)]
            Self::Socket(socket) => socket.read(into),
        }
    }
}

impl Write for PortStream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Serial(port) => port.write(bytes),
            #[cfg(unix)]
            Self::Socket(socket) => socket.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.flush(),
            #[cfg(unix)]
            Self::Socket(_) => Ok(()),
        }
    }
}

#[cfg(unix)]
mod socket {
    use super::*;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use std::os::unix::fs::FileTypeExt;
    use std::os::unix::net::UnixStream;

    /// A connection that waits to the microsecond (the system's own timeouts of
    /// sockets count in milliseconds).
    pub struct Socket {
        stream: UnixStream,
        pub timeout: Duration,
    }

    pub fn is_at(path: &str) -> bool {
        let is_name = cfg!(target_os = "linux") && path.starts_with('@');
        is_name || std::fs::metadata(path).is_ok_and(|at| at.file_type().is_socket())
    }

    fn connect(path: &str) -> io::Result<UnixStream> {
        #[cfg(target_os = "linux")]
        if let Some(name) = path.strip_prefix('@') {
            use std::os::linux::net::SocketAddrExt;
            let address = std::os::unix::net::SocketAddr::from_abstract_name(name)?;
            return UnixStream::connect_addr(&address);
        }
        UnixStream::connect(path)
    }

    impl Socket {
        pub fn open(path: &str, timeout: Duration) -> io::Result<Self> {
            let stream = connect(path)?;
            stream.set_nonblocking(true)?;
            Ok(Self { stream, timeout })
        }

        /// Waits until the socket can be read from or written to.
        fn wait(&self, what: PollFlags) -> io::Result<()> {
            let timeout = Timespec::try_from(self.timeout).map_err(io::Error::other)?;
            let mut watched = [PollFd::new(&self.stream, what)];
            match poll(&mut watched, Some(&timeout))? {
                0 => Err(ErrorKind::TimedOut.into()),
                _ => Ok(()),
            }
        }

        pub fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            self.wait(PollFlags::IN)?;
            late(self.stream.read(into))
        }

        pub fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match self.stream.write(bytes) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    self.wait(PollFlags::OUT)?;
                    late(self.stream.write(bytes))
                }
                written => written,
            }
        }

        /// Reads what is there. That the other end is gone is for the next call to say.
        pub fn drain(&mut self) -> io::Result<()> {
            let mut chunk = [0; 1024];
            loop {
                match self.stream.read(&mut chunk) {
                    Ok(0) => return Ok(()),
                    Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                    Ok(_) => {}
                }
            }
        }
    }

    fn late(result: io::Result<usize>) -> io::Result<usize> {
        result.map_err(|error| match error.kind() {
            ErrorKind::WouldBlock => ErrorKind::TimedOut.into(),
            _ => error,
        })
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;
    use std::path::PathBuf;

    const SOON: Duration = Duration::from_millis(1);

    fn path(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("stream-{name}-{}", std::process::id()))
    }

    #[test]
    fn a_socket_is_read_written_and_emptied_like_a_port() {
        let at = path("pair");
        let listener = UnixListener::bind(&at).unwrap();
        let mut stream = PortStream::open(at.to_str().unwrap(), 1_000_000, SOON).unwrap();
        let (mut other, _) = listener.accept().unwrap();
        std::fs::remove_file(&at).unwrap();
        let mut chunk = [0; 8];

        assert_eq!(stream.read(&mut chunk).unwrap_err().kind(), ErrorKind::TimedOut);
        stream.write_all(b"ask").unwrap();
        assert_eq!(other.read(&mut chunk).unwrap(), 3);
        other.write_all(b"stale").unwrap();
        stream.clear_input().unwrap();
        other.write_all(b"new").unwrap();
        assert_eq!(stream.read(&mut chunk).unwrap(), 3);
        assert_eq!(&chunk[..3], b"new");
        drop(other);
        stream.clear_input().unwrap();
        assert_eq!(stream.read(&mut chunk).unwrap(), 0);
    }

    #[test]
    fn a_socket_that_nobody_reads_takes_no_more_after_a_while() {
        let at = path("full");
        let _listener = UnixListener::bind(&at).unwrap();
        let mut stream = PortStream::open(at.to_str().unwrap(), 1_000_000, SOON).unwrap();
        std::fs::remove_file(&at).unwrap();
        let refused = (0..100_000).find_map(|_| stream.write(&[0; 1024]).err());
        assert_eq!(refused.unwrap().kind(), ErrorKind::TimedOut);
    }

    #[test]
    fn a_path_without_anything_is_refused() {
        for path in ["/nonexistent/port", "@nonexistent port"] {
            assert!(PortStream::open(path, 1_000_000, SOON).is_err());
        }
    }
}
