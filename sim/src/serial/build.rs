//! The far end of a serial line, built from the models of its servos.

use servodance_drivers::serial::{Firmware, family_of};

use crate::bus::line::Line;
use crate::bus::options::SimOptions;
use crate::error::SimError;
use crate::serial::imu_board::ImuBoard;
use crate::serial::protocol1_line::Protocol1Line;
use crate::serial::protocol2_line::Protocol2Line;
use crate::servo::byte_servo::ByteServo;
use crate::servo::dynamixel2::XServo;
use crate::servo::spec::SimServoSpec;
use crate::world::WorldSeat;

/// The usual supply of a board, volts.
const BOARD_V: f64 = 12.0;

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
        let supply_v = options.supply_v.unwrap_or(model.sheet.voltage_v);
        let family =
            family_of(model.kind).ok_or_else(|| spec.refused("is on no serial bus".into()))?;
        let mut bauds = family.bauds(model).iter();
        let code = bauds.position(|baud| *baud == options.baud);
        let code = code.ok_or_else(|| SimError::Option {
            key: "baud",
            actual: options.baud.to_string(),
            wanted: "a rate of the servos' baud register",
        })?;
        match family.firmware(model) {
            Firmware::Bytes(memory) => {
                let servo = ByteServo::new(spec, model, memory, options.baud, supply_v, period_s);
                byte_servos.push(servo);
            }
            Firmware::DynamixelX => {
                x_servos.push(XServo::new(spec, model, code as u8, supply_v, period_s));
            }
        }
    }
    let supply_ohm = SimError::checked("supply_ohm", options.supply_ohm, 0.0..=10.0, "0 to 10")?;
    let baud = options.baud;
    match (x_servos.is_empty(), byte_servos.is_empty()) {
        (_, true) => {
            let world = options.seat.as_ref().map(WorldSeat::world);
            let supply_v = options.supply_v.unwrap_or(BOARD_V);
            let board = options.imu.as_ref();
            let board = board.map(|imu| ImuBoard::new(imu, world, supply_v));
            Ok(Box::new(Protocol2Line::new(x_servos, baud, supply_ohm).with_board(board)))
        }
        (true, false) => Ok(Box::new(Protocol1Line::new(byte_servos, baud, supply_ohm))),
        (false, false) => Err(SimError::Option {
            key: "servos",
            actual: "of two protocols".into(),
            wanted: "of one protocol on one line",
        }),
    }
}
