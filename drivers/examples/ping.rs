//! Asks one servo whether it is there, and how it is.

#[allow(dead_code)] // each example uses a part
mod simulated;

use std::time::Duration;

use servodance_drivers::{Framing, SerialScanner};

fn main() -> Result<(), simulated::Failure> {
    let (sim, _, _) = simulated::bus()?;
    let wait = Duration::from_millis(100);
    let mut scanner =
        SerialScanner::open(sim.port_path(), simulated::BAUD, Framing::Protocol2, wait)?;
    let servo = scanner.ping(2)?.ok_or("id 2 does not answer")?;
    println!("{} with firmware {}", servo.model.unwrap_or("unknown model"), servo.firmware);
    println!("{:?}", scanner.vitals(&servo)?);
    Ok(())
}
