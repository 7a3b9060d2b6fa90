//! How a bus of simulated servos behaves.

use std::net::SocketAddrV4;
use std::path::PathBuf;

use servodance_drivers::ImuConfig;

use crate::world::WorldSeat;

/// Who moves time on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimClock {
    /// The machine's clock; replies are held back until their wire time has passed.
    Realtime,
    /// [`crate::SimBus::advance`] only; wire time is counted, not waited for.
    Lockstep,
}

/// What the host opens to reach the servos.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum SimLink {
    /// A serial adapter on a pseudo-terminal, an slcan adapter for CAN motors.
    #[default]
    Terminal,
    /// The same on a Unix socket: quicker, for programs that know sockets.
    Unix,
    /// A multicast group of this machine, as python-can's `udp_multicast`: CAN only.
    Multicast(SocketAddrV4),
    /// A CAN interface of this machine (a virtual one, for instance): CAN only.
    Interface(String),
}

/// How a bus of simulated servos behaves.
#[derive(Clone, Debug, PartialEq)]
pub struct SimOptions {
    /// What the host opens.
    pub link: SimLink,
    /// Who moves time on.
    pub clock: SimClock,
    /// Bits a second of the wire and of every servo.
    pub baud: u32,
    /// Control periods a second: the time over which rates are judged.
    pub control_hz: f64,
    /// Supply voltage; `None` is each model's nominal voltage.
    pub supply_v: Option<f64>,
    /// What a USB adapter adds before the host sees a reply, seconds. Real time only.
    pub adapter_s: f64,
    /// Resistance of the supply and its cable, ohms: what the servos draw makes it sag.
    pub supply_ohm: f64,
    /// Seed of everything random: faults.
    pub seed: u64,
    /// Where the port is found (a link to the terminal, or the socket), also after the
    /// adapter was pulled out and put back; without one it has a new path then.
    pub path: Option<PathBuf>,
    /// The place of the servos in a world that moves their shafts; without one each
    /// servo turns by itself, with the load of its spec.
    pub seat: Option<WorldSeat>,
    /// The motion sensor on the bus, read by the driver beside the servos; without a
    /// world it lies level and still.
    pub imu: Option<ImuConfig>,
}

impl SimOptions {
    /// Simulated time: the same commands give the same bytes and states.
    pub fn lockstep(baud: u32, control_hz: f64) -> Self {
        Self {
            link: SimLink::Terminal,
            clock: SimClock::Lockstep,
            baud,
            control_hz,
            supply_v: None,
            adapter_s: 0.0,
            supply_ohm: 0.0,
            seed: 0,
            path: None,
            seat: None,
            imu: None,
        }
    }

    /// The machine's time: servos move by the wall's clock.
    pub fn realtime(baud: u32, control_hz: f64) -> Self {
        Self { clock: SimClock::Realtime, ..Self::lockstep(baud, control_hz) }
    }
}
