//! Measures the driver against simulated servos: `bench [SERVOS] [BAUD] [ADAPTER_MS] [HZ]`.

use servodance_drivers::{BusConfig, ServoConfig, servos};
use servodance_sim::bench_bus;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let count: u8 = args.next().unwrap_or("20".into()).parse()?;
    let baud: u32 = args.next().unwrap_or("4000000".into()).parse()?;
    let adapter_ms: f64 = args.next().unwrap_or("0".into()).parse()?;
    let control_hz: Option<f64> = args.next().map(|hz| hz.parse()).transpose()?;
    let joint = |id: u8| ServoConfig {
        name: format!("joint_{id}"),
        id,
        model: "XM430-W350".into(),
        direction: 1,
        zero_deg: 180.0,
        lower_deg: -90.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        ..Default::default()
    };
    let servos = servos(&(1..=count).map(joint).collect::<Vec<_>>())?;
    let bench = bench_bus(
        &servos,
        &BusConfig::dynamixel2(baud),
        control_hz,
        2000,
        adapter_ms * 1e-3,
    )?;
    println!(
        "{bench:?} {:.1} % of the wire",
        100.0 * bench.hz / bench.wire_limit_hz
    );
    Ok(())
}
