//! Serves simulated servos until its standard input ends.
//!
//! `serve COUNT BAUD [MODEL] [GROUP:PORT]`: on a pseudo-terminal (an slcan adapter
//! for CAN motors), or CAN motors in a multicast group. The first line on standard
//! output is what to open.
//! The reference clients of `sim/reference` start it.

use std::io::{Read, Write};

use servodance_drivers::{ServoConfig, ServoModel, servos};
use servodance_sim::{SimBus, SimLink, SimOptions, SimServoSpec};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let count: u8 = args.next().unwrap_or("3".into()).parse()?;
    let baud: u32 = args.next().unwrap_or("1000000".into()).parse()?;
    let model = args.next().unwrap_or("XM430-W350".into());
    let link = match args.next() {
        Some(group) => SimLink::Multicast(group.parse()?),
        None => SimLink::Terminal,
    };
    let is_can = ServoModel::from_name(&model).is_some_and(|model| model.motor.is_some());
    let joint = |id: u8| ServoConfig {
        name: format!("joint_{id}"),
        id,
        model: model.clone(),
        direction: 1,
        zero_deg: if is_can { 0.0 } else { 180.0 },
        lower_deg: -90.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        ..Default::default()
    };
    let configs: Vec<ServoConfig> = (1..=count).map(joint).collect();
    let specs: Vec<SimServoSpec> = servos(&configs)?.iter().map(Into::into).collect();
    let sim = SimBus::start(&specs, SimOptions { link, ..SimOptions::realtime(baud, 100.0) })?;
    println!("{}", sim.port_path());
    std::io::stdout().flush()?;
    std::io::stdin().read_to_end(&mut Vec::new())?;
    println!("{:?}", sim.wire_stats());
    Ok(())
}
