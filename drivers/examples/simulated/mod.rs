//! Three simulated XL430 servos on one bus, for the examples.

use servodance_drivers::{BusConfig, Servo, ServoConfig, servos};
use servodance_sim::{SimBus, SimOptions, SimServoSpec};

pub type Failure = Box<dyn std::error::Error>;

pub const BAUD: u32 = 1_000_000;
pub const HZ: f64 = 100.0;

/// A real bus differs in the path: `/dev/ttyUSB0` in place of `sim.port_path()`.
pub fn bus() -> Result<(SimBus, BusConfig, Vec<Servo>), Failure> {
    let joint = |id: u8| ServoConfig {
        name: format!("joint_{id}"),
        id,
        model: "XL430-W250".into(),
        direction: 1,
        zero_deg: 180.0,
        lower_deg: -60.0,
        upper_deg: 60.0,
        velocity_deg_s: 200.0,
        acceleration_deg_s2: 2000.0,
        ..Default::default()
    };
    let servos = servos(&[joint(1), joint(2), joint(3)])?;
    let specs: Vec<SimServoSpec> = servos.iter().map(Into::into).collect();
    let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ))?;
    let config = BusConfig { reply_clock: sim.reply_clock(), ..BusConfig::dynamixel2(BAUD) };
    Ok((sim, config, servos))
}
