//! `servodance lead`.

use crate::cli::prelude::*;
use servodance_runtime::pipeline::model_args::GeneratorArgs;

const EXAMPLES: &str = include_str!("examples/lead.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The recording (wav, flac, mp3, ogg); the built-in song if left out.
    #[arg(value_name = "AUDIO")]
    pub audio: Option<PathBuf>,
    /// Lead to what a microphone hears now: the default one, or one
    /// that `servodance devices` lists.
    #[arg(long, value_name = "DEVICE", num_args = 0..=1, conflicts_with = "audio")]
    pub mic: Option<Option<String>>,
    #[command(flatten)]
    pub place: StageNetworkArgs,
    /// Where followers connect; tcp/127.0.0.1:7448 if left out. May be given again.
    #[arg(long, value_name = "PROTOCOL/ADDRESS:PORT")]
    pub listen: Vec<String>,
    /// Take the place of a leader that is there; without it that is refused.
    #[arg(long)]
    pub take_over: bool,
    #[command(flatten)]
    pub generator: GeneratorArgs,
    /// Write figures of the run as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    #[arg(help = "Print only errors", long, short)]
    pub quiet: bool,
}

#[cfg(not(feature = "stage"))]
pub fn run(_: Args) -> anyhow::Result<ExitCode> {
    super::options::stage::not_built_in("lead")
}

#[cfg(feature = "stage")]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    use servodance_runtime::pipeline::audio_input::AudioChoice;
    use servodance_runtime::process::console::{stderr_line, stdout_line};

    let stop = super::stop_signal()?;
    let lead = servodance_runtime::stage::StageLead {
        audio: match (args.mic, args.audio) {
            (Some(device), _) => AudioChoice::Microphone(device),
            (None, Some(path)) => AudioChoice::File(path),
            (None, None) => AudioChoice::BuiltIn,
        },
        generator: args.generator,
        place: args.place.place(true, args.listen),
        stage: args.place.stage,
        take_over: args.take_over,
        report: args.report,
        quiet: args.quiet,
    };
    let led = servodance_runtime::stage::lead(&lead, &stop)?;
    if led.interrupted {
        stderr_line!("stopped; followers idle");
        return Ok(ExitCode::from(super::INTERRUPTED));
    }
    if !args.quiet {
        let (frames, followers, late) = (led.frames, led.followers, led.late_frames);
        let ahead_ms = led.lead_ms_max;
        stdout_line!(
            "{frames} frames for {followers} followers, {late} late; sent up to {ahead_ms:.0} ms ahead"
        );
    }
    Ok(ExitCode::SUCCESS)
}
