//! Simulated CAN motors, exact to the frame. Each family takes its registers from the
//! folder of that family in `servodance-drivers`.
//!
//! ```text
//! any program <-> slcan or fdcanusb on a pseudo-terminal, multicast, or SocketCAN <-> server thread
//!             <-> CanNet (arbitration) <-> motors (protocol, torque loop, judge)
//! ```

mod adapter;
mod cia402;
mod fdcanusb_adapter;
mod mit;
mod moteus;
mod motor_core;
mod myactuator;
mod net;
mod odrive;
mod robstride;
mod server;

pub use odrive::WATCHDOG_ENDPOINTS;

pub(crate) use adapter::{Adapter, LinkAdapter, SlcanAdapter};
pub(crate) use fdcanusb_adapter::FdcanusbAdapter;
pub(crate) use server::CanServer;

use servodance_drivers::BusKind;

use crate::bus::line::Line;
use crate::bus::options::SimOptions;
use crate::can::cia402::Cia402Drive;
use crate::can::mit::MitMotor;
use crate::can::moteus::MoteusController;
use crate::can::motor_core::MotorCore;
use crate::can::myactuator::RmdMotor;
use crate::can::net::{CanDevice, CanNet};
use crate::can::odrive::OdriveAxis;
use crate::can::robstride::RobstrideMotor;
use crate::error::SimError;
use crate::imu::CanBoard;
use crate::servo::spec::SimServoSpec;
use crate::world::WorldSeat;

type BuildDevice = fn(MotorCore) -> Box<dyn CanDevice>;

/// A bus with these motors, which must be of one family, on each family's nominal supply if
/// the options have none; `period_s` is the control period.
pub fn build_net(
    specs: &[SimServoSpec],
    options: &SimOptions,
    period_s: f64,
) -> Result<Box<dyn Line>, SimError> {
    let kind = specs.first().map_or(BusKind::Mit, |spec| spec.kind);
    let (nominal_v, build): (f64, BuildDevice) = match kind {
        BusKind::Mit => (24.0, |core| Box::new(MitMotor::new(core))),
        BusKind::Robstride => (48.0, |core| Box::new(RobstrideMotor::new(core))),
        BusKind::Odrive => (24.0, |core| Box::new(OdriveAxis::new(core))),
        BusKind::Cia402 => (48.0, |core| Box::new(Cia402Drive::new(core))),
        BusKind::Moteus => (24.0, |core| Box::new(MoteusController::new(core))),
        BusKind::Myactuator => (48.0, |core| Box::new(RmdMotor::new(core))),
        BusKind::Dynamixel2 | BusKind::Dynamixel1 | BusKind::Feetech | BusKind::Custom => {
            return Err(specs[0].refused("is not a CAN motor".into()));
        }
    };
    let mut devices = Vec::with_capacity(specs.len());
    for spec in specs {
        if spec.kind != kind {
            return Err(SimError::Option {
                key: "servos",
                actual: "of two protocols".into(),
                wanted: "of one protocol on one line",
            });
        }
        devices.push(build(MotorCore::new(spec, nominal_v, options.supply_v, period_s)?));
    }
    let world = options.seat.as_ref().map(WorldSeat::world);
    let board = options.imu.as_ref().map(|imu| CanBoard::new(imu, world));
    Ok(Box::new(CanNet::new(devices, board)))
}
