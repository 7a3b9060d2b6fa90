//! `servodance play`.

use crate::cli::options::links::say_links;
use crate::cli::prelude::*;
use servodance_retarget::RobotModel;
use servodance_runtime::pipeline::audio_input::AudioChoice;
use servodance_runtime::robot::Meshes;
use servodance_runtime::telemetry::recorder::Recording;
use servodance_runtime::viewer::{Player, Scene, Server, Songs, ViewerSettings, link};
use std::net::SocketAddr;

const EXAMPLES: &str = include_str!("examples/play.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A recording made by `dance --record`.
    #[arg(value_name = "FILE.mcap")]
    pub recording: PathBuf,
    /// Play it on a page, whose address is the first line on standard output;
    /// so far there is no other way.
    #[arg(long)]
    pub view: bool,
    /// Where the page is served; anything but this machine's own address makes
    /// it reachable for whoever has the address with its token.
    #[arg(long, default_value = "127.0.0.1:0", value_name = "IP:PORT")]
    pub view_bind: SocketAddr,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let recording = Recording::read(&args.recording)?;
    let scene = scene(&recording)?;
    let settings = ViewerSettings {
        amplitude: 1.0,
        mirror: false,
        idle: Default::default(),
        style: 0,
        seed: 0,
    };
    let stop = stop_signal()?;
    let (end, viewers) = link(recording.joints.len(), settings);
    let song = recording.audio.as_ref().map(|audio| AudioChoice::Recorded(audio.sound()));
    let songs = song.map_or_else(Songs::default, |song| Songs::new(&song));
    let server = Server::start(args.view_bind, scene, viewers, songs)?;
    say_links(&server, !args.view_bind.ip().is_loopback());
    Player::new(&recording, end).run(&stop);
    Ok(ExitCode::from(INTERRUPTED)) // nothing else ends it
}

fn scene(recording: &Recording) -> anyhow::Result<Scene> {
    let names: Vec<&str> = recording.joints.iter().map(|j| j.0.as_str()).collect();
    Ok(Scene {
        robot: recording.robot.clone(),
        model: RobotModel::new(&recording.urdf_xml, &names)?,
        meshes: Meshes::default(), // their files are not in a recording
        joints: recording.joints.clone(),
        styles: Vec::new(),
        control_hz: recording.control_hz,
        waits: false,
        takes_songs: false,
        speaker: false,
        recording_s: Some(recording.span_s()),
    })
}
