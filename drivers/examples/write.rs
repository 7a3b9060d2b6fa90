//! Writes a register of one servo and reads it back: the LED goes on.

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
    scanner.set(3, registers::LED, 1)?;
    println!("LED: {:?}", scanner.read(3, registers::LED)?);
    Ok(())
}
