//! A CAN interface of the system: a raw socket of SocketCAN, with CAN FD where the interface
//! has it.
//!
//! The interface's bitrate, restart time and queue length are the system's
//! (`ip link`); this side opens, sends, receives. A full transmit queue (ENOBUFS)
//! is reported as [`Sent::Full`], never waited for. The controller's error
//! frames are reported as [`CanFault`]; what a program cannot act on (lost
//! arbitration, mere counters) is not.
//!
//! Refused at once: an interface that is not there (those that are there are
//! listed, with the command that brings one up), is not CAN, or is down. Taken
//! down later, it makes every call an error until it is up again.

use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;
use std::time::Instant;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use socketcan::errors::{
    CAN_ERR_ACK, CAN_ERR_BUSERROR, CAN_ERR_BUSOFF, CAN_ERR_CRTL, CAN_ERR_PROT, CAN_ERR_TRX,
    CAN_ERR_TX_TIMEOUT,
};
use socketcan::id::FdFlags;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanErrorFrame, CanFdFrame, CanFdSocket, CanRemoteFrame,
};
use socketcan::{EmbeddedFrame, ExtendedId, Id, Socket, SocketOptions, StandardId};

use super::frame::CanFrame;
use super::link::{CanEvent, CanFault, CanLink, Sent};

const REPORTED: u32 = CAN_ERR_BUSOFF
    | CAN_ERR_CRTL
    | CAN_ERR_PROT
    | CAN_ERR_TRX
    | CAN_ERR_ACK
    | CAN_ERR_BUSERROR
    | CAN_ERR_TX_TIMEOUT;
const CAN_TYPE: &str = "280"; // ARPHRD_CAN
const UP: u32 = 1; // IFF_UP
/// An interface whose packets may be so long carries CAN FD (CANFD_MTU).
const FLEXIBLE_MTU: u32 = 72;

#[derive(Debug)]
pub struct SocketLink {
    socket: CanFdSocket,
    flexible: bool,
}

impl SocketLink {
    /// Opens an interface that is up, e.g. `can0`.
    pub fn open(interface: &str) -> io::Result<Self> {
        let interfaces = Interfaces::of_system();
        interfaces.check(interface)?;
        let socket = CanFdSocket::open(interface).map_err(explained)?;
        socket.set_error_filter(REPORTED)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, flexible: interfaces.is_flexible(interface) })
    }

    /// Waits for something to read until `deadline`; false if nothing came.
    fn wait(&self, deadline: Instant) -> io::Result<bool> {
        let left = deadline.saturating_duration_since(Instant::now());
        let mut watched = [PollFd::new(self.socket.as_fd(), PollFlags::POLLIN)];
        match ppoll(&mut watched, Some(TimeSpec::from_duration(left)), None) {
            Ok(ready) => Ok(ready > 0),
            Err(Errno::EINTR) => Ok(true),
            Err(errno) => Err(errno.into()),
        }
    }
}

impl AsFd for SocketLink {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

impl CanLink for SocketLink {
    fn carries_flexible(&self) -> bool {
        self.flexible
    }

    fn send(&mut self, frame: &CanFrame) -> io::Result<Sent> {
        match self.socket.write_frame(&to_system(frame)?) {
            Ok(()) => Ok(Sent::Taken),
            Err(error) if is_full(&error) => Ok(Sent::Full),
            Err(error) => Err(explained(error)),
        }
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<CanEvent> {
        loop {
            match self.socket.read_frame() {
                Ok(frame) => {
                    if let Some(received) = from_system(frame) {
                        return Ok(received);
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    if !self.wait(deadline)? {
                        return Ok(CanEvent::Nothing);
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(explained(error)),
            }
        }
    }
}

fn is_full(error: &io::Error) -> bool {
    error.raw_os_error() == Some(Errno::ENOBUFS as i32) || error.kind() == ErrorKind::WouldBlock
}

fn explained(error: io::Error) -> io::Error {
    let meaning = match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ENETDOWN) => "the CAN interface is down: `ip link set IFACE up`",
        Some(Errno::ENODEV | Errno::ENXIO) => "the CAN interface is gone: adapter unplugged?",
        Some(Errno::EAFNOSUPPORT) => "this kernel has no CAN (module can, can-raw)",
        _ => return error,
    };
    io::Error::new(error.kind(), meaning)
}

fn to_system(frame: &CanFrame) -> io::Result<CanAnyFrame> {
    let id: Option<Id> = match frame.is_extended() {
        true => ExtendedId::new(frame.id()).map(Id::from),
        false => u16::try_from(frame.id()).ok().and_then(StandardId::new).map(Id::from),
    };
    let built = id.and_then(|id| match (frame.is_flexible(), frame.is_remote()) {
        (true, _) => CanFdFrame::with_flags(id, frame.data(), FdFlags::BRS).map(Into::into),
        (false, true) => CanRemoteFrame::new_remote(id, frame.length().into()).map(Into::into),
        (false, false) => CanDataFrame::new(id, frame.data()).map(Into::into),
    });
    built.ok_or_else(|| ErrorKind::InvalidInput.into())
}

/// `None` for reports that a program cannot act on.
fn from_system(frame: CanAnyFrame) -> Option<CanEvent> {
    let ours = |id: Id, data: &[u8]| match id {
        Id::Standard(id) => CanFrame::standard(id.as_raw().into(), data),
        Id::Extended(id) => CanFrame::extended(id.as_raw(), data),
    };
    let frame = match frame {
        CanAnyFrame::Normal(frame) => ours(frame.id(), frame.data()),
        CanAnyFrame::Remote(frame) => ours(frame.id(), &[]).into_remote(frame.dlc().min(8) as u8),
        CanAnyFrame::Fd(frame) => {
            let id = match frame.id() {
                Id::Standard(id) => id.as_raw().into(),
                Id::Extended(id) => id.as_raw(),
            };
            CanFrame::flexible_from_parts(id, frame.data())?
        }
        CanAnyFrame::Error(frame) => return fault(&frame).map(CanEvent::Fault),
    };
    Some(CanEvent::Frame(frame))
}

fn fault(frame: &CanErrorFrame) -> Option<CanFault> {
    // The second data byte has the controller's flags.
    const OVERFLOW: u8 = 0x03;
    const WARNING: u8 = 0x0C;
    const PASSIVE: u8 = 0x30;
    let reports = |classes: u32| frame.error_bits() & classes != 0;
    let controller = match reports(CAN_ERR_CRTL) {
        true => frame.data().get(1).copied().unwrap_or(0),
        false => 0,
    };
    if reports(CAN_ERR_BUSOFF) {
        Some(CanFault::BusOff)
    } else if reports(CAN_ERR_TX_TIMEOUT) {
        Some(CanFault::Rejected)
    } else if controller & OVERFLOW != 0 {
        Some(CanFault::Overrun)
    } else if controller & PASSIVE != 0 {
        Some(CanFault::Passive)
    } else if reports(CAN_ERR_PROT | CAN_ERR_TRX | CAN_ERR_ACK | CAN_ERR_BUSERROR) {
        Some(CanFault::Error)
    } else {
        (controller & WARNING != 0).then_some(CanFault::Warning)
    }
}

/// The network interfaces in a folder like `/sys/class/net`.
struct Interfaces<'a>(&'a Path);

impl Interfaces<'static> {
    fn of_system() -> Self {
        Self(Path::new("/sys/class/net"))
    }
}

impl Interfaces<'_> {
    fn read(&self, name: &str, file: &str) -> Option<String> {
        let text = std::fs::read_to_string(self.0.join(name).join(file)).ok()?;
        Some(text.trim().to_owned())
    }

    fn is_can(&self, name: &str) -> bool {
        self.read(name, "type").as_deref() == Some(CAN_TYPE)
    }

    fn is_up(&self, name: &str) -> bool {
        let flags = self.read(name, "flags").unwrap_or_default();
        let flags = u32::from_str_radix(flags.trim_start_matches("0x"), 16);
        flags.is_ok_and(|flags| flags & UP != 0)
    }

    fn is_flexible(&self, name: &str) -> bool {
        let mtu = self.read(name, "mtu").and_then(|mtu| mtu.parse().ok());
        mtu.is_some_and(|mtu: u32| mtu >= FLEXIBLE_MTU)
    }

    fn can(&self) -> Vec<(String, bool)> {
        let entries = std::fs::read_dir(self.0).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let mut found: Vec<_> = names
            .filter(|name| self.is_can(name))
            .map(|name| (name.clone(), self.is_up(&name)))
            .collect();
        found.sort();
        found
    }

    fn check(&self, name: &str) -> io::Result<()> {
        if self.is_can(name) && self.is_up(name) {
            return Ok(());
        }
        let up = |name: &str| match name.starts_with('v') {
            true => format!("`sudo ip link set {name} up`"),
            false => {
                format!("`sudo ip link set {name} up type can bitrate 1000000 restart-ms 100`")
            }
        };
        if self.is_can(name) {
            let reason = format!("the interface is down; bring it up: {}", up(name));
            return Err(io::Error::new(ErrorKind::NetworkDown, reason));
        }
        let here: Vec<String> = self
            .can()
            .into_iter()
            .map(|(name, is_up)| format!("{name} ({})", if is_up { "up" } else { "down" }))
            .collect();
        let here = match here.is_empty() {
            true => "this machine has no CAN interface".into(),
            false => format!("CAN interfaces here: {}", here.join(", ")),
        };
        let what = match self.0.join(name).exists() && !name.is_empty() {
            true => "it is no CAN interface",
            false => "there is no such interface",
        };
        let reason = format!("{what}; {here}; bring one up: {}", up("can0"));
        Err(io::Error::new(ErrorKind::NotFound, reason))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_go_to_the_system_and_back() {
        for frame in [
            CanFrame::standard(0x7FF, &[1, 2, 3]),
            CanFrame::standard(0, &[]),
            CanFrame::extended(0x1FFF_FFFF, &[9; 8]),
            CanFrame::extended(5, &[9; 8]),
            CanFrame::remote(0x21, 8),
            CanFrame::flexible(0x8001, &[7; 42], 0x50),
            CanFrame::flexible(0x100, &[7; 5], 0),
        ] {
            let system = to_system(&frame).unwrap();
            assert_eq!(from_system(system), Some(CanEvent::Frame(frame)));
        }
    }

    #[test]
    fn error_frames_become_the_worst_they_report() {
        let report = |bits: u32, controller: u8| {
            let data = [0, controller, 0, 0, 0, 0, 0, 0];
            from_system(CanErrorFrame::new_error(bits, &data).unwrap().into())
        };
        let fault = |fault| Some(CanEvent::Fault(fault));
        assert_eq!(report(CAN_ERR_BUSOFF | CAN_ERR_CRTL, 0x30), fault(CanFault::BusOff));
        assert_eq!(report(CAN_ERR_CRTL, 0x01), fault(CanFault::Overrun));
        assert_eq!(report(CAN_ERR_CRTL, 0x0C), fault(CanFault::Warning));
        assert_eq!(report(CAN_ERR_CRTL, 0x2C), fault(CanFault::Passive));
        assert_eq!(report(CAN_ERR_ACK, 0), fault(CanFault::Error));
        assert_eq!(report(CAN_ERR_TX_TIMEOUT, 0), fault(CanFault::Rejected));
        // Back to error-active, and counters alone: nothing to do.
        assert_eq!(report(CAN_ERR_CRTL, 0x40), None);
        assert_eq!(report(0x200, 0), None);
    }

    #[test]
    fn a_wrong_interface_is_refused_with_those_there_are() {
        let folder = std::env::temp_dir().join(format!("net-{}", std::process::id()));
        for (name, kind, flags, mtu) in [
            ("can0", "280", "0x40080", "16"),
            ("vcan3", "280", "0xc1", "72"),
            ("eth0", "1", "0x1003", "1500"),
        ] {
            let interface = folder.join(name);
            std::fs::create_dir_all(&interface).unwrap();
            std::fs::write(interface.join("type"), format!("{kind}\n")).unwrap();
            std::fs::write(interface.join("flags"), format!("{flags}\n")).unwrap();
            std::fs::write(interface.join("mtu"), format!("{mtu}\n")).unwrap();
        }
        let here = Interfaces(&folder);
        let refused = |name: &str| here.check(name).unwrap_err().to_string();
        assert!(here.check("vcan3").is_ok());
        assert!(here.is_flexible("vcan3") && !here.is_flexible("can0"));
        assert_eq!(
            refused("can0"),
            "the interface is down; bring it up: \
             `sudo ip link set can0 up type can bitrate 1000000 restart-ms 100`"
        );
        let missing = refused("can7");
        assert!(missing.contains("no such interface"), "{missing}");
        assert!(missing.contains("can0 (down), vcan3 (up)"), "{missing}");
        assert!(refused("eth0").contains("no CAN interface; CAN interfaces here"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
