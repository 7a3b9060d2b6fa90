//! `servodance bench`: what the parts of this program take on this machine.

pub mod accents;
pub mod beats;
pub mod bus;
pub mod model;
pub mod retarget;
pub mod stage;
pub mod start_frame;
pub mod sync;
pub mod world;

use clap::Subcommand;
use std::process::ExitCode;

const EXAMPLES: &str = include_str!("../examples/bench.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    pub what: What,
}

/// What can be measured.
#[derive(Debug, Subcommand)]
pub enum What {
    /// How much of a dancer's movement, and of its accents, reaches the servos.
    Accents(accents::Args),
    /// How well the live beat tracker follows songs with known beats.
    Beats(beats::Args),
    /// Control cycles a second over simulated servos, wire time imposed.
    Bus(bus::Args),
    /// Time of a frame of the model, beside what memory allows.
    Model(model::Args),
    /// Time and allocations of a retargeting cycle.
    Retarget(retarget::Args),
    /// Whether a robot stays on its feet while it dances, in the simulated world.
    World(world::Args),
    /// How far apart dances of one motion are that begin at different frames.
    StartFrame(start_frame::Args),
    /// How far apart robots on a network are, and what becomes of them when it breaks.
    Stage(stage::Args),
    /// How far apart the music and the robot are, by one clock.
    Sync(sync::Args),
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.what {
        What::Accents(args) => accents::run(args),
        What::Beats(args) => beats::run(args),
        What::Bus(args) => bus::run(args),
        What::Model(args) => model::run(args),
        What::Retarget(args) => retarget::run(args),
        What::Stage(args) => stage::run(args),
        What::StartFrame(args) => start_frame::run(args),
        What::Sync(args) => sync::run(args),
        What::World(args) => world::run(args),
    }
}
