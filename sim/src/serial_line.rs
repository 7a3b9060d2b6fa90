//! The far end of a serial line, built from what is told of its servos.

use crate::byte_servo::ByteServo;
use crate::line::{Line, XLine};
use crate::protocol1_line::Protocol1Line;
use crate::servo::SimServo;
use crate::spec::{SimError, SimOptions, SimServoSpec, X_BAUDS};

fn baud_code(baud: u32, bauds: &[u32; 8]) -> Result<u8, SimError> {
    match bauds.iter().position(|known| *known == baud) {
        Some(code) => Ok(code as u8),
        None => Err(bad_baud(baud)),
    }
}

fn bad_baud(baud: u32) -> SimError {
    SimError::Option {
        key: "baud",
        actual: baud.to_string(),
        wanted: "a rate of the servos' baud register",
    }
}

fn checked_supply_ohm(supply_ohm: f64) -> Result<f64, SimError> {
    if (0.0..=10.0).contains(&supply_ohm) {
        return Ok(supply_ohm);
    }
    Err(SimError::Option {
        key: "supply_ohm",
        actual: supply_ohm.to_string(),
        wanted: "0 to 10",
    })
}

/// All servos speak one protocol and have the rate of the options.
pub(crate) fn build_line(
    specs: &[SimServoSpec],
    options: &SimOptions,
    period_s: f64,
) -> Result<Box<dyn Line>, SimError> {
    let mut x_servos = Vec::new();
    let mut byte_servos = Vec::new();
    for spec in specs {
        let model = spec.checked()?;
        let supply_v = options.supply_v.unwrap_or(model.voltage_v);
        if model.is_protocol1() {
            if !model.takes_baud(options.baud) {
                return Err(bad_baud(options.baud));
            }
            let servo = ByteServo::new(spec, model, options.baud, supply_v, period_s);
            byte_servos.push(servo);
        } else {
            let code = baud_code(options.baud, &X_BAUDS)?;
            x_servos.push(SimServo::new(spec, model, code, supply_v, period_s));
        }
    }
    let supply_ohm = checked_supply_ohm(options.supply_ohm)?;
    let baud = options.baud;
    match (x_servos.is_empty(), byte_servos.is_empty()) {
        (_, true) => Ok(Box::new(XLine::new(x_servos, baud, supply_ohm))),
        (true, false) => Ok(Box::new(Protocol1Line::new(byte_servos, baud, supply_ohm))),
        (false, false) => Err(SimError::Option {
            key: "servos",
            actual: "of two protocols".into(),
            wanted: "of one protocol on one line",
        }),
    }
}
