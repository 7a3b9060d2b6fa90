//! `servodance dance`.

use super::options::dance::RobotArgs;
use crate::cli::options::file_ending::file_of;
use crate::cli::options::links::say_links;
use crate::cli::prelude::*;
use servodance_audio::TempoRange;
use servodance_audio::source::PcmEncoding;
use servodance_audio::source::PcmFormat;
use servodance_runtime::control::bus_choice::BusChoice;
use servodance_runtime::control::bus_choice::choose as choose_buses;
use servodance_runtime::pipeline::audio_input::AudioChoice;
use servodance_runtime::pipeline::model_args::GeneratorArgs;
use servodance_runtime::pipeline::speaker::{SpeakerConfig, SpeakerDevice};
use servodance_runtime::process::speed::Speed;
use servodance_runtime::session::config::DanceConfig;
use servodance_runtime::session::dance::Outcome;
use servodance_runtime::session::dance::dance;
use servodance_runtime::session::dance_session::Session;
use servodance_runtime::session::summary::summary;
use servodance_runtime::viewer::{Server, TerminalView};
use servodance_runtime::world::WorldChoice;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const EXAMPLES: &str = include_str!("examples/dance.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    group = clap::ArgGroup::new("watched").args(["view", "tui"]).multiple(true)
)]
pub struct Args {
    /// The recording (wav, flac, mp3, ogg), or `-` for raw PCM on standard
    /// input; the built-in song if left out.
    #[arg(value_name = "AUDIO")]
    pub audio: Option<PathBuf>,
    /// Dance to what a microphone hears now: the default one, or one
    /// that `servodance devices` lists.
    #[arg(long, value_name = "DEVICE", num_args = 0..=1, conflicts_with = "audio")]
    pub mic: Option<Option<String>>,
    #[command(flatten)]
    pub rig: RobotArgs,
    /// What is around a simulated robot: a floor, a stand that holds it, or none, where
    /// its servos carry no weight; a floor for a robot that stands if left out.
    #[arg(long, value_enum)]
    pub world: Option<WorldChoice>,
    /// How fast time passes; `max` on the simulated bus, `realtime` on a real one.
    #[arg(long, value_enum)]
    pub speed: Option<Speed>,
    /// Dance to the recording as if it came in live: nothing is known ahead.
    #[arg(long)]
    pub as_live: bool,
    /// Leave the timing of the motion as it is: do not steer it so that the
    /// servos meet the beat.
    #[arg(long)]
    pub no_compensation: bool,
    /// Follow no tempo but these, beats a minute, slowest and fastest: 80-140, say.
    #[arg(long, value_name = "LO-HI")]
    pub tempo: Option<TempoRange>,
    /// Share of the movement that is danced, 0 to 1: small for a first try on real servos; the
    /// robot file's `[retarget] amplitude` if left out.
    #[arg(long, value_name = "SHARE", value_parser = within(0.0..=1.0_f64))]
    pub amplitude: Option<f64>,
    #[command(flatten)]
    pub generator: GeneratorArgs,
    /// Write figures of the run as JSON (see docs/report.md).
    #[arg(long, value_name = "FILE.json", value_parser = file_of("json"))]
    pub report: Option<PathBuf>,
    /// Record everything as MCAP, for robotics viewers.
    #[arg(long, value_name = "FILE.mcap", value_parser = file_of("mcap"))]
    pub record: Option<PathBuf>,
    /// Where the picture of the dance goes.
    #[arg(long, default_value = "dance.png", value_name = "FILE.png", value_parser = file_of("png"))]
    pub picture: PathBuf,
    #[arg(help = "Draw no picture", long, conflicts_with = "picture")]
    pub no_picture: bool,
    /// Draw a moving picture too: ten seconds from the middle of the dance, the
    /// human beside the robot. For another part: --record, then `servodance
    /// export FILE.mcap --gif FILE.gif --from 20 --seconds 8`.
    #[arg(long, value_name = "FILE.gif", value_parser = file_of("gif"))]
    pub gif: Option<PathBuf>,
    /// Sample rate of raw PCM on standard input, hertz.
    #[arg(long, default_value_t = 48_000, value_name = "HZ")]
    #[arg(value_parser = within(8_000..=384_000_u32))]
    pub pcm_rate: u32,
    /// Sample format of raw PCM on standard input.
    #[arg(long, default_value = "s16le", value_name = "u8|s16le|s24le|s32le|f32le")]
    pub pcm_format: PcmEncoding,
    /// Channels of raw PCM on standard input, interleaved.
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = within(1..=16_u16))]
    pub pcm_channels: u16,
    /// Play the song in step with the robot: through the default loudspeaker, or one named
    /// here. In real time.
    #[arg(long, value_name = "DEVICE", num_args = 0..=1, conflicts_with = "mic")]
    pub speaker: Option<Option<String>>,
    /// Play so many milliseconds later, for a robot that is seen later than it moves;
    /// negative, for a loudspeaker that is later than it says.
    #[arg(long, default_value_t = 0.0, value_name = "MS", allow_negative_numbers = true)]
    #[arg(requires = "speaker", value_parser = audio_delay_ms)]
    pub delay_audio: f64,
    /// Serve a page to watch and to steer the dance with; its address is the
    /// first line on standard output (see docs/show.md).
    #[arg(long)]
    pub view: bool,
    /// Where the page is served; anything but this machine's own address makes
    /// it reachable for whoever has the address with its token.
    #[arg(long, default_value = "127.0.0.1:0", value_name = "IP:PORT", requires = "view")]
    pub view_bind: SocketAddr,
    /// Dead-man mode: without an operator's page open in front of somebody for so many
    /// seconds the robot holds, and after as many again goes to rest, torque off.
    #[arg(long, value_name = "SECONDS", requires = "view", value_parser = dead_man_seconds)]
    pub view_dead_man: Option<f64>,
    /// Show the dance in this terminal and steer it by keys: start, hold, resume,
    /// end, amplitude, style, seed, mirror, idle; Enter, Esc or Space is the
    /// emergency stop (see docs/show.md).
    #[arg(long, visible_alias = "terminal")]
    pub tui: bool,
    /// Wait, torque off, until the page or a key says start, before each
    /// dance; end by Ctrl-C.
    #[arg(long, requires = "watched")]
    pub wait_for_start: bool,
    #[arg(help = "Print only errors", long, short)]
    pub quiet: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let config = configuration(args)?;
    let stop = motor_stop_signal()?;
    if config.view.is_some() || config.tui {
        return watched(config, &stop);
    }
    let outcome = dance(&config, &stop)?;
    report(&config, &outcome);
    if outcome.interrupted {
        stderr_line!("stopped; torque is off");
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

fn report(config: &DanceConfig, outcome: &Outcome) {
    if !config.quiet {
        stdout(format_args!("{}", summary(config, &outcome.report)));
    }
}

/// Dances for whoever opens the page or sits at the terminal.
fn watched(config: DanceConfig, stop: &Arc<AtomicBool>) -> anyhow::Result<ExitCode> {
    let (waits, bind, tui, quiet) = (config.wait_for_start, config.view, config.tui, config.quiet);
    if tui {
        TerminalView::check()?;
    }
    let mut session = Session::new(config)?;
    let scene = session.scene()?;
    for mesh in &scene.meshes.left_out {
        stderr_line!("the page draws a stick: {mesh}");
    }
    let server = match bind {
        Some(bind) => {
            let viewer = session.add_viewer();
            Some(Server::start(bind, scene.clone(), viewer, session.songs())?)
        }
        None => None,
    };
    let address = server.as_ref().map(Server::address);
    if let Some(server) = &server {
        say_links(server, !quiet && !tui && bind.is_some_and(|bind| !bind.ip().is_loopback()));
    }
    let terminal = match tui {
        true => Some(TerminalView::start(scene, session.add_viewer(), stop, address)?),
        false => None,
    };
    let danced = session.run(stop, |config, outcome| match outcome {
        Ok(outcome) => report(config, outcome),
        Err(error) if waits => stderr_line!("error: {error:#}"),
        Err(_) => {} // told by `main`
    });
    drop(terminal); // what comes now is for the usual terminal
    danced?;
    if stop.load(Ordering::Acquire) {
        stderr_line!("stopped; torque is off");
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Checks the arguments and loads the robot.
pub fn configuration(args: Args) -> anyhow::Result<DanceConfig> {
    each_file_once(&args)?;
    let mut robot = args.rig.robot.load()?;
    robot.retarget.amplitude = args.amplitude.unwrap_or(robot.retarget.amplitude);
    let buses = choose_buses(&robot, &args.rig.bus)?;
    let all_simulated = buses.iter().all(|bus| *bus == BusChoice::Sim);
    let world = args.world.unwrap_or_else(|| match all_simulated {
        true => WorldChoice::of_robot(&robot),
        false => WorldChoice::None,
    });
    let hears = args.mic.is_some();
    let speed = match (args.speed, all_simulated) {
        (Some(Speed::Max), _) if hears => {
            bail!("--speed max needs a recording: a microphone lives in real time")
        }
        (Some(Speed::Max), false) => {
            bail!("--speed max needs the simulated bus: real servos live in real time")
        }
        (Some(Speed::Max), _) if args.view || args.tui => {
            bail!("--speed max cannot be watched: --view and --tui live in real time")
        }
        (Some(Speed::Max), _) if args.speaker.is_some() => {
            bail!("--speed max cannot be played: --speaker lives in real time")
        }
        (Some(speed), _) => speed,
        (None, true) if !hears && !args.view && !args.tui && args.speaker.is_none() => Speed::Max,
        (None, _) => Speed::Realtime,
    };
    let audio = audio_choice(&args)?;
    if args.speaker.is_some() && matches!(audio, AudioChoice::Stdin(_)) {
        bail!("--speaker needs a recording: what comes in live is heard already")
    }
    let speaker = args.speaker.map(|name| SpeakerConfig {
        device: SpeakerDevice::System(name),
        delay_s: args.delay_audio * 1e-3,
    });
    Ok(DanceConfig {
        audio,
        idle: args.rig.idle.unwrap_or(robot.idle),
        robot,
        buses,
        world,
        speed,
        as_live: args.as_live,
        compensation: !args.no_compensation,
        tempo: args.tempo,
        generator: args.generator,
        report: args.report,
        record: args.record,
        picture: (!args.no_picture).then_some(args.picture),
        gif: args.gif,
        view: args.view.then_some(args.view_bind),
        dead_man_s: args.view_dead_man,
        tui: args.tui,
        wait_for_start: args.wait_for_start,
        estop_file: args.rig.estop_file,
        speaker,
        motion_log: None,
        quiet: args.quiet,
    })
}

/// No output takes the place of another one, or of the song.
fn each_file_once(args: &Args) -> anyhow::Result<()> {
    let picture = Some(&args.picture).filter(|_| !args.no_picture);
    let files = [
        ("AUDIO", args.audio.as_ref()),
        ("--report", args.report.as_ref()),
        ("--record", args.record.as_ref()),
        ("--picture", picture),
        ("--gif", args.gif.as_ref()),
    ];
    let files = files.map(|(option, path)| (option, path.map(std::path::absolute)));
    for (at, (option, path)) in files.iter().enumerate() {
        let Some(Ok(path)) = path else { continue };
        let same = |(_, other): &&(&str, _)| matches!(other, Some(Ok(other)) if other == path);
        if let Some((other, _)) = files[..at].iter().find(same) {
            bail!("{other} and {option} are one file: {}", path.display());
        }
    }
    Ok(())
}

/// A dance of the built-in song without any files, as if it had been asked for.
pub fn default_configuration(robot: &str, speed: Speed) -> anyhow::Result<DanceConfig> {
    #[derive(clap::Parser)]
    struct Asked {
        #[command(flatten)]
        dance: Args,
    }
    let words = ["servodance", "--no-picture", "--quiet", "--bus", "sim", "--robot", robot];
    let asked = <Asked as clap::Parser>::parse_from(words);
    Ok(DanceConfig { speed, ..configuration(asked.dance)? })
}

fn audio_delay_ms(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(ms) if (-2000.0..=2000.0).contains(&ms) => Ok(ms),
        _ => Err("expected -2000 to 2000 milliseconds".into()),
    }
}

fn dead_man_seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (1.0..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("expected 1 to 3600 seconds".into()),
    }
}

fn audio_choice(args: &Args) -> anyhow::Result<AudioChoice> {
    if let Some(device) = &args.mic {
        return Ok(AudioChoice::Microphone(device.clone()));
    }
    match &args.audio {
        None => Ok(AudioChoice::BuiltIn),
        Some(path) if path.as_os_str() == "-" => Ok(AudioChoice::Stdin(PcmFormat {
            encoding: args.pcm_format,
            sample_rate_hz: args.pcm_rate,
            channels: args.pcm_channels,
        })),
        Some(path) => Ok(AudioChoice::File(path.clone())),
    }
}
