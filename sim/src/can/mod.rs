//! Simulated CAN motors, exact to the frame.
//!
//! ```text
//! any program <-> slcan on a pseudo-terminal, multicast, or SocketCAN <-> server thread
//!             <-> CanNet (arbitration) <-> motors (protocol, torque loop, judge)
//! ```

mod adapter;
mod cia402;
mod core;
mod mit;
mod net;
mod odrive;
mod robstride;
mod server;

pub use cia402::Cia402Drive;
pub use core::{Command, Core, Trouble};
pub use mit::MitMotor;
pub use net::{CanNet, Device};
pub use odrive::{OdriveAxis, WATCHDOG_ENDPOINTS};
pub use robstride::RobstrideMotor;

#[cfg(target_os = "linux")]
pub(crate) use adapter::InterfaceAdapter;
pub(crate) use adapter::{Adapter, MulticastAdapter, SlcanAdapter};
pub(crate) use server::CanServer;

use servodance_drivers::BusKind;

use crate::error::SimError;
use crate::servo::spec::SimServoSpec;

/// What the motors of a kind are made for, volts.
fn nominal_v(kind: BusKind) -> f64 {
    match kind {
        BusKind::Robstride | BusKind::Cia402 => 48.0,
        _ => 24.0,
    }
}

/// A bus with these motors; all must speak the same protocol.
pub fn build_net(
    specs: &[SimServoSpec],
    supply_v: Option<f64>,
    period_s: f64,
) -> Result<CanNet, SimError> {
    let kind = specs.first().map_or(BusKind::Mit, |spec| spec.kind);
    let mut devices: Vec<Box<dyn Device>> = Vec::with_capacity(specs.len());
    for spec in specs {
        if spec.kind != kind {
            return Err(SimError::Option {
                key: "servos",
                actual: "of two protocols".into(),
                wanted: "of one protocol on one line",
            });
        }
        let core = Core::new(spec, nominal_v(kind), supply_v, period_s)?;
        devices.push(match kind {
            BusKind::Robstride => Box::new(RobstrideMotor::new(core)),
            BusKind::Odrive => Box::new(OdriveAxis::new(core)),
            BusKind::Cia402 => Box::new(Cia402Drive::new(core)),
            _ => Box::new(MitMotor::new(core)),
        });
    }
    Ok(CanNet::new(devices))
}
