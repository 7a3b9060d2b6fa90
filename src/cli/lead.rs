//! `servodance lead`.

use crate::cli::options::file_ending::file_of;
use crate::cli::prelude::*;
use servodance_runtime::pipeline::model_args::GeneratorArgs;
use std::net::SocketAddr;

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
    /// Show the whole stage on a page in the browser: every follower's robot, a timeline,
    /// buttons for cues.
    #[arg(long)]
    pub view: bool,
    /// The address that the page is served at.
    #[arg(long, default_value = "127.0.0.1:0", value_name = "IP:PORT", requires = "view")]
    pub view_bind: SocketAddr,
    /// Play a show: its song, and its cues at their moments (see docs/stage.md).
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["audio", "mic"])]
    pub show: Option<PathBuf>,
    /// Write figures of the run as JSON.
    #[arg(long, value_name = "FILE.json", value_parser = file_of("json"))]
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
    use servodance_runtime::show::ShowFile;

    let stop = super::stop_signal()?;
    let show = args.show.as_deref().map(ShowFile::read).transpose()?;
    let mut generator = args.generator;
    if let Some(style) = show.as_ref().and_then(ShowFile::style) {
        generator.style.get_or_insert_with(|| style.to_owned());
    }
    let song = show.as_ref().and_then(ShowFile::song).or(args.audio);
    let lead = servodance_runtime::stage::StageLead {
        audio: match (args.mic, song) {
            (Some(device), _) => AudioChoice::Microphone(device),
            (None, Some(path)) => AudioChoice::File(path),
            (None, None) => AudioChoice::BuiltIn,
        },
        generator,
        place: args.place.place(true, args.listen),
        stage: args.place.stage,
        take_over: args.take_over,
        report: args.report,
        quiet: args.quiet,
        view: args.view.then_some(args.view_bind),
        show,
    };
    let is_reachable = !args.view_bind.ip().is_loopback();
    let on_page = |page: &_| super::options::links::say_links(page, is_reachable);
    let led = servodance_runtime::stage::lead(&lead, &stop, on_page)?;
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
