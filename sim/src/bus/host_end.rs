//! The end that the host plugs into: a pseudo-terminal, a Unix socket, a multicast
//! group, a CAN interface.

use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::unistd::ttyname;
use servodance_drivers::Port;
use servodance_drivers::can::CanPort;

use crate::bus::options::SimLink;
use crate::can::{Adapter, FdcanusbAdapter, LinkAdapter, SlcanAdapter};
use crate::error::SimError;
use crate::serial::host_port::HostPort;

pub(crate) enum HostEnd {
    Serial(HostPort),
    Can(Box<dyn Adapter>),
}

impl HostEnd {
    /// A second handle, to see whether there is something to read.
    pub fn watched(&self) -> Result<OwnedFd, SimError> {
        let watched = match self {
            Self::Can(adapter) => adapter.watched(),
            Self::Serial(port) => port.watched(),
        };
        watched.map_err(SimError::system("watching an adapter"))
    }
}

/// How the far end is opened, the first time and after it was pulled out.
#[derive(Clone, Debug)]
pub(crate) struct HostLink {
    pub is_can: bool,
    /// Whether their frames are of CAN FD.
    pub is_flexible: bool,
    /// Bits a second of their bus.
    pub bitrate: u32,
    pub link: SimLink,
    /// The socket, or a symbolic link that leads to the terminal of the moment.
    pub path: Option<PathBuf>,
}

impl HostLink {
    /// Opens our end; the path and the port that the host is to open.
    pub fn open(&self) -> Result<(HostEnd, String, Port), SimError> {
        match (self.is_can, &self.link) {
            (is_can, SimLink::Terminal | SimLink::Unix) => {
                let (host, path) = match self.link {
                    SimLink::Unix => self.unix_socket()?,
                    _ => self.terminal()?,
                };
                Ok(if self.is_flexible {
                    let port = Port::Can(CanPort::Fdcanusb(path.clone()));
                    (HostEnd::Can(Box::new(FdcanusbAdapter::new(host))), path, port)
                } else if is_can {
                    let adapter = Box::new(SlcanAdapter::new(host, self.bitrate));
                    let port = Port::Can(CanPort::Slcan(path.clone()));
                    (HostEnd::Can(adapter), path, port)
                } else {
                    (HostEnd::Serial(host), path.clone(), Port::Serial(path))
                })
            }
            (true, SimLink::Multicast(group)) if self.is_flexible => Err(SimError::Option {
                key: "link",
                actual: group.to_string(),
                wanted: "a terminal, a Unix socket or an interface: these motors speak CAN FD",
            }),
            (true, SimLink::Multicast(group)) => {
                let failed = SimError::system("joining a multicast group");
                let adapter = LinkAdapter::open_group(*group).map_err(failed)?;
                let port = Port::Can(CanPort::Udp(*group));
                Ok((HostEnd::Can(Box::new(adapter)), group.to_string(), port))
            }
            #[cfg(target_os = "linux")]
            (true, SimLink::Interface(name)) => {
                let failed = SimError::system("opening a CAN interface");
                let adapter = LinkAdapter::open_interface(name).map_err(failed)?;
                let port = Port::Can(CanPort::Socket(name.clone()));
                Ok((HostEnd::Can(Box::new(adapter)), name.clone(), port))
            }
            #[cfg(not(target_os = "linux"))]
            (true, SimLink::Interface(name)) => Err(SimError::Option {
                key: "link",
                actual: name.clone(),
                wanted: "a terminal or a multicast group: CAN interfaces need Linux",
            }),
            (false, link) => Err(SimError::Option {
                key: "link",
                actual: format!("{link:?}"),
                wanted: "a terminal or a Unix socket: these servos are on a serial bus",
            }),
        }
    }

    /// Removes the path of a port that is no longer open.
    pub fn close(&self, port_path: &str) {
        let in_a_file = self.link == SimLink::Unix && !port_path.starts_with('@');
        let own = in_a_file.then(|| PathBuf::from(port_path));
        if let Some(path) = self.path.clone().or(own) {
            // It may be gone already.
            let _ = std::fs::remove_file(path);
        }
    }

    /// A pseudo-terminal: our end, and the path to open, its own or the link's.
    fn terminal(&self) -> Result<(HostPort, String), SimError> {
        let (master, terminal) = open_terminal()?;
        let Some(path) = &self.path else {
            return Ok((HostPort::Terminal(master), terminal));
        };
        self.close(&terminal);
        let failed = SimError::system("linking the port");
        std::os::unix::fs::symlink(&terminal, path).map_err(failed)?;
        let path = path.to_string_lossy().into_owned();
        Ok((HostPort::Terminal(master), path))
    }

    /// A Unix socket: our end, and the path to open. Without a path it has a name and no
    /// file, or where the system knows none, a temporary file.
    fn unix_socket(&self) -> Result<(HostPort, String), SimError> {
        let failed = SimError::system("opening a Unix socket");
        let path = match &self.path {
            Some(path) => path.clone(),
            None => {
                static COUNT: AtomicU32 = AtomicU32::new(0);
                let count = COUNT.fetch_add(1, Ordering::Relaxed);
                let name = format!("servodance-{}-{count}", std::process::id());
                #[cfg(target_os = "linux")]
                return HostPort::listen_by_name(&name)
                    .map(|port| (port, format!("@{name}")))
                    .map_err(failed);
                #[cfg(not(target_os = "linux"))]
                std::env::temp_dir().join(name)
            }
        };
        let port = HostPort::listen(&path).map_err(failed)?;
        Ok((port, path.to_string_lossy().into_owned()))
    }
}

/// A pseudo-terminal: our end, and the path of the other.
fn open_terminal() -> Result<(OwnedFd, String), SimError> {
    let pty = openpty(None, None).map_err(SimError::system("opening a pseudo-terminal"))?;
    let path = ttyname(&pty.slave).map_err(SimError::system("naming a pseudo-terminal"))?;
    // A host that does not read must not stop the servos.
    fcntl(&pty.master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))
        .map_err(SimError::system("setting up a pseudo-terminal"))?;
    // The other end is not held open here: whoever opens it may take it for
    // itself, and it is free again when that program dies.
    Ok((pty.master, path.to_string_lossy().into_owned()))
}
