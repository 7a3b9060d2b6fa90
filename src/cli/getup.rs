//! `servodance getup`.

use crate::cli::prelude::*;
use servodance_runtime::control::bus_choice::{self, BusChoice};
use servodance_runtime::control::getup::GetUp;
use servodance_runtime::process::speed::Speed;
use servodance_runtime::robot::Lying;

const EXAMPLES: &str = include_str!("examples/getup.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    pub robot: RobotFileArgs,
    /// Where commands go, as for `dance`.
    #[arg(long, default_value = "sim", value_name = "[NAME=]BUS")]
    pub bus: Vec<String>,
    /// How a simulated robot lies, or a real one that has no motion sensor.
    #[arg(long, value_name = "front|back")]
    pub lying: Option<Lying>,
    /// How long it stands before torque goes off: then hold it.
    #[arg(long, default_value_t = 5.0, value_name = "S", value_parser = within(0.0..=3600.0))]
    pub stand: f64,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = args.robot.load()?;
    let buses = bus_choice::choose(&robot, &args.bus)?;
    let speed = match buses.iter().all(|choice| *choice == BusChoice::Sim) {
        true => Speed::Max,
        false => Speed::Realtime,
    };
    let getup = GetUp { robot: &robot, buses: &buses, lying: args.lying, stands_s: args.stand };
    let told = getup.run(speed, &*motor_stop_signal()?)?;
    stdout_line!("{told}");
    Ok(ExitCode::SUCCESS)
}
