//! Every servo of a bus, found with one broadcast.

#[allow(dead_code)] // each example uses a part
mod simulated;

use std::time::Duration;

use servodance_drivers::{Framing, SerialScanner};

fn main() -> Result<(), simulated::Failure> {
    let (sim, _, _) = simulated::bus()?;
    let wait = Duration::from_millis(10);
    let mut scanner =
        SerialScanner::open(sim.port_path(), simulated::BAUD, Framing::Protocol2, wait)?;
    for servo in scanner.everyone()? {
        println!("id {}: {:?}", servo.id, servo.model);
    }
    Ok(())
}
