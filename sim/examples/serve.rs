//! Serves simulated servos until its standard input ends.
//!
//! `serve COUNT BAUD [MODEL] [GROUP:PORT]`: on a pseudo-terminal (an slcan or fdcanusb
//! adapter for CAN motors), or CAN motors in a multicast group. The first line on standard
//! output is what to open. A line on standard input is something that happens, such as
//! `unplug joint_2` (`sim/src/fault/script.rs`).
//! The reference clients of `sim/reference` start it.

use std::io::Write;

use servodance_drivers::{ServoConfig, ServoModel, servos};
use servodance_sim::{SimBus, SimLink, SimOptions, SimServoSpec, happen, parse_happening};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let count: u8 = args.next().unwrap_or("3".into()).parse()?;
    let baud: u32 = args.next().unwrap_or("1000000".into()).parse()?;
    let model = args.next().unwrap_or("XM430-W350".into());
    let link = match args.next() {
        Some(group) => SimLink::Multicast(group.parse()?),
        None => SimLink::Terminal,
    };
    let known = ServoModel::from_name(&model);
    let is_can = known.is_some_and(|model| model.motor.is_some());
    // Half of a turn, or of the 300 degrees that an AX has.
    let middle_deg = known.map_or(180.0, |model| {
        (f64::from(model.last_tick) + 1.0) * 0.5 * model.rad_per_tick.to_degrees()
    });
    let joint = |id: u8| ServoConfig {
        name: format!("joint_{id}"),
        id,
        model: model.clone(),
        direction: 1,
        zero_deg: if is_can { 0.0 } else { middle_deg.round() },
        // Only Damiao motors heed it.
        reply_id: model.starts_with("DM-").then_some(0x10 + u16::from(id)),
        lower_deg: -90.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        ..Default::default()
    };
    let configs: Vec<ServoConfig> = (1..=count).map(joint).collect();
    let specs: Vec<SimServoSpec> = servos(&configs)?.iter().map(Into::into).collect();
    let mut sim = SimBus::start(&specs, SimOptions { link, ..SimOptions::realtime(baud, 100.0) })?;
    println!("{}", sim.port_path());
    std::io::stdout().flush()?;
    let names: Vec<&str> = configs.iter().map(|config| config.name.as_str()).collect();
    let places = vec![(0..configs.len()).collect()];
    for line in std::io::stdin().lines() {
        happen(&parse_happening(&line?, &names)?, std::slice::from_mut(&mut sim), &places)?;
    }
    println!("{:?}", sim.wire_stats());
    Ok(())
}
