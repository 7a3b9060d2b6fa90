//! Reads registers of one servo.

#[allow(dead_code)] // each example uses a part
mod simulated;

use std::time::Duration;

use servodance_drivers::serial::dynamixel2::registers;
use servodance_drivers::{Framing, SerialScanner};

fn main() -> Result<(), simulated::Failure> {
    let (sim, _, _) = simulated::bus()?;
    let wait = Duration::from_millis(100);
    let mut scanner =
        SerialScanner::open(sim.port_path(), simulated::BAUD, Framing::Protocol2, wait)?;
    for register in
        [registers::PRESENT_POSITION, registers::PRESENT_VOLTAGE, registers::PRESENT_TEMPERATURE]
    {
        println!("{}: {:?}", register.name, scanner.read(1, register)?);
    }
    Ok(())
}
