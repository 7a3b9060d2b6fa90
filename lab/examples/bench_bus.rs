//! Measures a driver against simulated servos:
//! `bench_bus [SERVOS] [BAUD] [ADAPTER_MS] [HZ|max] [MODEL] [pty|unix]`.

use servodance_drivers::{BusConfig, ServoConfig, ServoModel, servos};
use servodance_lab::bench::bus_cycles::bench_bus;
use servodance_sim::SimLink;
use servodance_sim::can::WATCHDOG_ENDPOINTS;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let count: u8 = args.next().unwrap_or("20".into()).parse()?;
    let baud: u32 = args.next().unwrap_or("4000000".into()).parse()?;
    let adapter_ms: f64 = args.next().unwrap_or("0".into()).parse()?;
    let control_hz: Option<f64> = match args.next().as_deref() {
        None | Some("max") => None,
        Some(hz) => Some(hz.parse()?),
    };
    let model = args.next().unwrap_or("XM430-W350".into());
    let link = match args.next().as_deref() {
        Some("unix") => SimLink::Unix,
        _ => SimLink::Terminal,
    };
    let known = ServoModel::from_name(&model).ok_or("unknown model")?;
    let is_damiao = known.motor.is_some_and(|motor| motor.has_registers);
    let joint = |id: u8| ServoConfig {
        name: format!("joint_{id}"),
        id,
        model: model.clone(),
        direction: 1,
        zero_deg: 180.0,
        lower_deg: -90.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        reply_id: is_damiao.then_some(0x100 + u16::from(id)),
        ..Default::default()
    };
    let servos = servos(&(1..=count).map(joint).collect::<Vec<_>>())?;
    let config = BusConfig {
        reply_timeout_ms: 500.0,
        watchdog_ms: 2000,
        accept_no_watchdog: true,
        watchdog_endpoints: Some(WATCHDOG_ENDPOINTS),
        ..BusConfig::of_kind(known.kind, baud)
    };
    let bench = bench_bus(&servos, &config, control_hz, 2000, adapter_ms * 1e-3, link)?;
    println!("{bench:?} {:.1} % of the wire", 100.0 * bench.hz / bench.wire_limit_hz);
    Ok(())
}
