//! `servodance bench sync`.

use crate::cli::prelude::*;
use servodance_audio::playback::SimulatedDevice;
use servodance_audio::song::Song;
use servodance_lab::bench::sync as bench;
use servodance_runtime::pipeline::audio_input::AudioChoice;
use servodance_runtime::pipeline::song_sound::song_sound;
use servodance_runtime::process::speed::Speed;

const EXAMPLES: &str = include_str!("../examples/bench-sync.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in robot, or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// From a sample's callback until it is heard, milliseconds.
    #[arg(long, default_value_t = 120.0, value_name = "MS", value_parser = within(0.0..=2000.0))]
    pub latency_ms: f64,
    /// By how many millionths the loudspeaker's clock is fast.
    #[arg(long, default_value_t = 200.0, value_name = "PPM", allow_negative_numbers = true)]
    #[arg(value_parser = within(-1000.0..=1000.0))]
    pub drift_ppm: f64,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Dances the built-in song in real time, 40 s.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let device = SimulatedDevice {
        latency_s: args.latency_ms * 1e-3,
        drift: args.drift_ppm * 1e-6,
        ..SimulatedDevice::default()
    };
    let config = crate::cli::dance::default_configuration(&args.robot, Speed::Realtime)?;
    let sound = song_sound(&AudioChoice::BuiltIn)?;
    let report = bench::run(config, &sound, &Song::demo().beats_s, device)?;
    if args.json {
        stdout_line!("{}", serde_json::to_string(&report)?);
    } else {
        stdout(format_args!("{report}"));
    }
    Ok(ExitCode::SUCCESS)
}
