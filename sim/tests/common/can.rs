//! Robots of CAN motors.

use servodance_drivers::can::CanBus;
use servodance_drivers::{BusConfig, BusKind, Servo, ServoConfig, servos};
use servodance_sim::can::WATCHDOG_ENDPOINTS;
use servodance_sim::{SimBus, SimOptions};

use super::*;

pub const BITRATE: u32 = 1_000_000;

/// The motors that are simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotorKind {
    CubeMars,
    Damiao,
    /// In position-velocity mode.
    DamiaoOwnLoops,
    Robstride,
    Odrive,
    Cia402,
    Myactuator,
    /// Switched to MIT mode.
    RobstrideMit,
    Moteus,
}

pub const KINDS: [MotorKind; 9] = [
    MotorKind::CubeMars,
    MotorKind::Damiao,
    MotorKind::DamiaoOwnLoops,
    MotorKind::Robstride,
    MotorKind::Odrive,
    MotorKind::Cia402,
    MotorKind::Myactuator,
    MotorKind::RobstrideMit,
    MotorKind::Moteus,
];

impl MotorKind {
    pub fn model(self) -> &'static str {
        match self {
            Self::CubeMars => "AK80-9",
            Self::Damiao => "DM-J4310",
            Self::DamiaoOwnLoops => "DM-J4310(PV)",
            Self::Robstride => "RS02",
            Self::Odrive => "ODrive",
            Self::Cia402 => "CiA402",
            Self::Myactuator => "RMD-V3",
            Self::RobstrideMit => "RS02(MIT)",
            Self::Moteus => "moteus",
        }
    }

    pub fn bus(self) -> BusKind {
        match self {
            Self::CubeMars | Self::Damiao | Self::DamiaoOwnLoops | Self::RobstrideMit => {
                BusKind::Mit
            }
            Self::Robstride => BusKind::Robstride,
            Self::Odrive => BusKind::Odrive,
            Self::Cia402 => BusKind::Cia402,
            Self::Myactuator => BusKind::Myactuator,
            Self::Moteus => BusKind::Moteus,
        }
    }

    pub fn has_watchdog(self) -> bool {
        !matches!(self, Self::CubeMars | Self::RobstrideMit)
    }
}

/// `count` joints, every other one mounted in reverse.
pub fn can_robot(kind: MotorKind, count: u8) -> Vec<Servo> {
    let geared = matches!(kind, MotorKind::Odrive | MotorKind::Cia402);
    let joint = |k: u8| ServoConfig {
        name: format!("joint_{k}"),
        id: k,
        model: kind.model().into(),
        direction: if k.is_multiple_of(2) { 1 } else { -1 },
        zero_deg: 10.0,
        lower_deg: -60.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        gear_ratio: geared.then_some(9.0),
        // Those from 0x100 on are commands to a motor in another mode.
        reply_id: match kind {
            MotorKind::Damiao => Some(0x100 + u16::from(k)),
            MotorKind::DamiaoOwnLoops => Some(0x80 + u16::from(k)),
            _ => None,
        },
        ..Default::default()
    };
    servos(&(1..=count).map(joint).collect::<Vec<_>>()).unwrap()
}

/// A reply may be late by a stall of the machine, never by the simulation.
pub fn can_patient(kind: MotorKind) -> BusConfig {
    BusConfig {
        reply_timeout_ms: 2000.0,
        watchdog_ms: 100,
        accept_no_watchdog: !kind.has_watchdog(),
        watchdog_endpoints: (kind == MotorKind::Odrive).then_some(WATCHDOG_ENDPOINTS),
        ..BusConfig::of_kind(kind.bus(), BITRATE)
    }
}

pub fn open(kind: MotorKind, sim: &SimBus, servos: &[Servo]) -> CanBus {
    CanBus::open(&sim.port().to_string(), &can_patient(kind), servos.to_vec()).unwrap()
}

pub fn start(kind: MotorKind, count: u8) -> (Vec<Servo>, SimBus, CanBus) {
    let servos = can_robot(kind, count);
    let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(BITRATE, HZ)).unwrap();
    let bus = open(kind, &sim, &servos);
    (servos, sim, bus)
}
