//! Moves all servos at once: a Sync Write of the goals and a Sync Read of the states
//! each cycle, behind the safety layer.

#[allow(dead_code)] // each example uses a part
mod simulated;

use servodance_drivers::{SafeBus, SafetyConfig, SerialBus};

fn main() -> Result<(), simulated::Failure> {
    let (sim, config, servos) = simulated::bus()?;
    let bus = SerialBus::open(sim.port_path(), &config, servos)?;
    let mut bus = SafeBus::new(bus, SafetyConfig::at_hz(simulated::HZ))?;
    let mut states = bus.arm(0.0)?.states;
    for cycle in 0..400 {
        let now_s = f64::from(cycle) / simulated::HZ;
        bus.command(now_s, &[0.3, -0.3, 0.3 * now_s.sin()]);
        bus.tick(now_s, &mut states)?;
        sim.advance(1.0 / simulated::HZ);
        if cycle % 100 == 99 {
            let positions: Vec<f64> = states.iter().map(|state| state.position_rad).collect();
            println!("{now_s:.2} s: {positions:.2?} rad");
        }
    }
    Ok(bus.disarm(4.0, "end of the example")?)
}
