//! What other programs open to reach simulated servos: the choice of `--link`.

use anyhow::bail;
use serde::Serialize;
use servodance_drivers::BusConfig;
use servodance_sim::SimLink;
use std::net::{Ipv4Addr, SocketAddrV4};

/// python-can's own multicast group and port; further buses get the ports behind it.
const GROUP: SocketAddrV4 = SocketAddrV4::new(Ipv4Addr::new(239, 74, 163, 2), 43113);

/// A way to a simulated bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LinkChoice {
    /// A serial port: servos on a serial bus.
    Pty,
    /// A serial CAN adapter (slcan): motors on CAN.
    Slcan,
    /// A Unix socket in place of either, for programs that know sockets.
    Unix,
    /// Multicast datagrams as python-can's udp_multicast: motors on CAN.
    Udp,
}

/// The link of the bus at `place`; each kind of bus has its default.
pub fn sim_link(
    bus: &BusConfig,
    choice: Option<LinkChoice>,
    place: usize,
) -> anyhow::Result<SimLink> {
    match (choice, bus.kind.is_can()) {
        (None, _) | (Some(LinkChoice::Pty), false) | (Some(LinkChoice::Slcan), true) => {
            Ok(SimLink::Terminal)
        }
        (Some(LinkChoice::Unix), _) => Ok(SimLink::Unix),
        (Some(LinkChoice::Udp), true) => {
            let port = GROUP.port().saturating_add(place as u16);
            Ok(SimLink::Multicast(SocketAddrV4::new(*GROUP.ip(), port)))
        }
        (Some(_), true) => {
            bail!("--link pty: the robot's motors are on CAN; choose slcan, unix or udp")
        }
        (Some(_), false) => {
            bail!("--link: the robot's servos are on a serial bus; choose pty or unix")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_drivers::BusKind;

    #[test]
    fn links_fit_the_bus() {
        let can = BusConfig::of_kind(BusKind::Mit, 1_000_000);
        let serial = BusConfig::dynamixel2(1_000_000);
        assert_eq!(sim_link(&can, None, 0).unwrap(), SimLink::Terminal);
        let second = sim_link(&can, Some(LinkChoice::Udp), 1).unwrap();
        assert_eq!(second, SimLink::Multicast("239.74.163.2:43114".parse().unwrap()));
        for bus in [&can, &serial] {
            let unix = sim_link(bus, Some(LinkChoice::Unix), 0).unwrap();
            assert_eq!(unix, SimLink::Unix);
        }
        assert!(sim_link(&can, Some(LinkChoice::Pty), 0).is_err());
        assert!(sim_link(&serial, Some(LinkChoice::Udp), 0).is_err());
    }
}
