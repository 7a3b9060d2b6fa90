//! The command line: one file a command, each with its arguments, its
//! examples and what it does. Arguments become one validated configuration
//! there and are not looked at again.
//!
//! A command returns the exit code of the program: 0 done, 1 refused or failed
//! (an error, told by `main` in one line), 130 stopped by Ctrl-C.

#[cfg(feature = "train")]
pub mod ablate;
pub mod beats;
pub mod bench;
pub mod calibrate;
pub mod completions;
pub mod cue;
pub mod dance;
#[cfg(feature = "train")]
pub mod dataset;
pub mod devices;
pub mod doctor;
#[cfg(feature = "train")]
pub mod evaluate;
pub mod export;
mod first_minute;
pub mod follow;
pub mod generate;
pub mod getup;
pub mod guesses;
pub mod jog;
pub mod latency;
pub mod lead;
pub mod man;
pub mod options;
pub mod ping;
pub mod play;
#[cfg(feature = "train")]
pub mod reconstruct;
pub mod retarget;
pub mod robot;
pub mod robots;
pub mod scan;
pub mod schema;
pub mod servos;
pub mod set_baud;
pub mod set_id;
pub mod sim_bus;
pub mod soak;
pub mod song;
#[cfg(feature = "train")]
pub mod train;
#[cfg(feature = "train")]
pub mod weights;

#[cfg(not(feature = "train"))]
mod untrained;
#[cfg(not(feature = "train"))]
use untrained::{ablate, dataset, evaluate, reconstruct, train, weights};

use clap::{Parser, Subcommand};
use signal_hook::consts::{SIGQUIT, SIGTSTP};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What most commands need.
mod prelude {
    pub(super) use super::{INTERRUPTED, motor_stop_signal, stop_signal};
    pub(super) use crate::cli::options::robot::RobotFileArgs;
    pub(super) use crate::cli::options::stage::StageNetworkArgs;
    pub(super) use anyhow::bail;
    pub(super) use servodance_runtime::bus_tools::{Consent, ProtocolChoice};
    pub(super) use servodance_runtime::process::console::{stderr_line, stdout, stdout_line};
    pub(super) use servodance_runtime::process::number_range::within;
    pub(super) use servodance_runtime::process::progress::Progress;
    pub(super) use servodance_runtime::process::wrong_usage::WrongUsage;
    pub(super) use servodance_runtime::robot::Robot;
    pub(super) use servodance_runtime::telemetry::pending_file::write_whole;
    pub(super) use std::path::{Path, PathBuf};
    pub(super) use std::process::ExitCode;
}

/// Exit code after Ctrl-C or SIGTERM.
pub const INTERRUPTED: u8 = 130;

const EXAMPLES: &str = include_str!("examples/servodance.txt").trim_ascii_end();

/// A robot hears music and dances to it.
#[derive(Debug, Parser)]
#[command(
    name = "servodance",
    after_help = EXAMPLES,
    version,
    propagate_version = true,
    max_term_width = 100
)]
pub struct Cli {
    /// Without one the built-in show is danced on a page.
    #[command(subcommand)]
    pub command: Option<Command>,
}

impl Cli {
    /// Does what was asked for.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Some(command) => command.run(),
            None => first_minute::run(),
        }
    }
}

/// What servodance can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Train the model without each of its parts, and compare.
    Ablate(ablate::Args),
    /// Write the beats of a recording, one a line in seconds.
    Beats(beats::Args),
    /// Measure what parts of this program take on this machine.
    Bench(bench::Args),
    /// Put zeros and directions into a robot file, from where its joints rest.
    Calibrate(calibrate::Args),
    /// Write the script that completes commands in a shell.
    Completions(completions::Args),
    /// Tell a follower to dance otherwise: mirror, canon, amplitude, style.
    Cue(cue::Args),
    /// Dance to a recording, to the built-in song, or to raw audio on standard input.
    Dance(dance::Args),
    /// Bring motion in, look it over, build the file to train with.
    Dataset(dataset::Args),
    /// Look for what stands in the way of a dance on this machine, and say what to do.
    Doctor(doctor::Args),
    /// Score the generator: beat, variety, physics, each beside controls and real motion.
    Evaluate(evaluate::Args),
    /// Turn a recording of a dance into a moving picture, BVH or CSV.
    Export(export::Args),
    /// Dance what somebody else leads, with this machine's robot.
    Follow(follow::Args),
    /// Write the human motion that the model dances to a recording, without a robot.
    Generate(generate::Args),
    /// Get up from the floor, by the way that the robot's file has.
    Getup(getup::Args),
    /// Move one joint, by steps from the keyboard or by one.
    Jog(jog::Args),
    /// Ask one servo, or every joint of a robot, how it is.
    Ping(ping::Args),
    /// Play a recording of a dance on a page, with a slider.
    Play(play::Args),
    /// Send a motion through the model's tokens and back.
    Reconstruct(reconstruct::Args),
    /// Turn a motion file into joint positions of a robot, without servos.
    Retarget(retarget::Args),
    /// Write a robot file for a description; look one over; set its servos up.
    Robot(robot::Args),
    /// List the microphones and other inputs that `dance --mic` can listen to.
    Devices(devices::Args),
    /// Measure the delay from sound to servo: a click in, the motion onset out.
    Latency(latency::Args),
    /// Hear music and invent the dance for robots on a network, which follow.
    Lead(lead::Args),
    /// Write the manual pages.
    Man(man::Args),
    /// List the built-in robots and where each file is.
    Robots(robots::Args),
    /// Print the JSON Schema of robot files, for editors.
    Schema(schema::Args),
    /// Look for servos on a serial port, at every usual baud rate.
    Scan(scan::Args),
    /// Look over, read, write, back up, reset and watch the registers of servos.
    Servos(servos::Args),
    /// Give servos another baud rate, and look for each there.
    SetBaud(set_baud::Args),
    /// Give a servo another id.
    SetId(set_id::Args),
    /// Serve a robot's simulated servos to any program, until stopped.
    SimBus(sim_bus::Args),
    /// Dance for hours in simulation while things go wrong, and judge what came of it.
    Soak(soak::Args),
    /// Write the built-in song as a WAV file.
    Song(song::Args),
    /// Learn the model's weights from data: stage 1, then stage 2.
    Train(train::Args),
    /// Look a weights file over, write it in another number format, see what that costs.
    Weights(weights::Args),
}

impl Command {
    /// Does it. What the user gave that cannot be used, or what
    /// failed on the way.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        match self {
            Command::Ablate(args) => ablate::run(args),
            Command::Beats(args) => beats::run(args),
            Command::Bench(args) => bench::run(args),
            Command::Calibrate(args) => calibrate::run(args),
            Command::Completions(args) => completions::run(args),
            Command::Cue(args) => cue::run(args),
            Command::Dance(args) => dance::run(args),
            Command::Dataset(args) => dataset::run(args),
            Command::Doctor(args) => doctor::run(args),
            Command::Evaluate(args) => evaluate::run(args),
            Command::Export(args) => export::run(args),
            Command::Follow(args) => follow::run(args),
            Command::Generate(args) => generate::run(args),
            Command::Getup(args) => getup::run(args),
            Command::Jog(args) => jog::run(args),
            Command::Ping(args) => ping::run(args),
            Command::Play(args) => play::run(args),
            Command::Reconstruct(args) => reconstruct::run(args),
            Command::Retarget(args) => retarget::run(args),
            Command::Robot(args) => robot::run(args),
            Command::Devices(args) => devices::run(args),
            Command::Latency(args) => latency::run(args),
            Command::Lead(args) => lead::run(args),
            Command::Man(args) => man::run(args),
            Command::Robots(args) => robots::run(args),
            Command::Schema(args) => schema::run(args),
            Command::Scan(args) => scan::run(args),
            Command::Servos(args) => servos::run(args),
            Command::SetBaud(args) => set_baud::run(args),
            Command::SetId(args) => set_id::run(args),
            Command::SimBus(args) => sim_bus::run(args),
            Command::Soak(args) => soak::run(args),
            Command::Song(args) => song::run(args),
            Command::Weights(args) => weights::run(args),
            Command::Train(args) => train::run(args),
        }
    }
}

/// Set by Ctrl-C, SIGTERM, SIGHUP, and by Ctrl-\\, which would leave torque on otherwise.
pub(crate) fn stop_signal() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let handler_stop = Arc::clone(&stop);
    ctrlc::set_handler(move || handler_stop.store(true, Ordering::Release))?;
    signal_hook::flag::register(SIGQUIT, Arc::clone(&stop))?;
    Ok(stop)
}

/// The same, and set by Ctrl-Z too: a program that is suspended leaves motors with torque and
/// without commands.
pub(crate) fn motor_stop_signal() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = stop_signal()?;
    signal_hook::flag::register(SIGTSTP, Arc::clone(&stop))?;
    Ok(stop)
}
