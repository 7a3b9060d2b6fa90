//! `servodance bench world`.

use crate::cli::prelude::*;
use servodance_lab::bench::world::{self, WorldBenchReport, WorldBenchRequest};

const EXAMPLES: &str = include_str!("../examples/bench-world.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    pub robot: RobotFileArgs,
    /// Songs to dance to, made by this program.
    #[arg(long, default_value_t = 2, value_name = "N", value_parser = within(1..=10_000_u64))]
    pub songs: u64,
    /// Dances to each song and style, with different seeds.
    #[arg(long, default_value_t = 1, value_name = "M", value_parser = within(1..=10_000_u64))]
    pub seeds: u64,
    /// Style to dance; may be given again.
    #[arg(long, value_name = "STYLE")]
    pub style: Vec<String>,
    /// Length of a dance.
    #[arg(long, default_value_t = 60.0, value_name = "S", value_parser = within(1.0..=600.0))]
    pub seconds: f64,
    /// Worlds to dance in: nominal, soft, firm, kp60, play, slippery, light, heavy,
    /// tilted, late, drawn, and pushed. All but the last if left out.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub worlds: Vec<String>,
    /// Do not correct the commands by the sensor on the pelvis.
    #[arg(long)]
    pub no_feedback: bool,
    /// Take servos that are as strong as the robot's masses ask for: for files whose
    /// servos are placeholders.
    #[arg(long)]
    pub sized: bool,
    /// Also find the largest push that is survived, in eight directions.
    #[arg(long)]
    pub pushes: bool,
    /// Folder in which generated motion is kept for the next time.
    #[arg(long, default_value = "servodance-motions", value_name = "DIR")]
    pub motions: PathBuf,
    /// Write every trial as JSON for `sim/reference/mujoco_world.py`.
    #[arg(long, value_name = "DIR")]
    pub dump: Option<PathBuf>,
    /// Seed of songs and worlds.
    #[arg(long, default_value_t = 1000, value_name = "N")]
    pub seed: u64,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// No progress bar.
    #[arg(long, short)]
    pub quiet: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = args.robot.load()?;
    let request = WorldBenchRequest {
        songs: args.songs,
        seeds: args.seeds,
        styles: args.style,
        seconds: args.seconds,
        worlds: args.worlds,
        feedback: !args.no_feedback,
        sized: args.sized,
        pushes: args.pushes,
        motions: args.motions,
        dump: args.dump,
        seed: args.seed,
    };
    let progress = Progress::share("dancing", args.quiet);
    let report = world::run(&robot, &request, |done, all| {
        progress.at(100.0 * done as f64 / all as f64);
    })?;
    progress.done();
    match args.json {
        true => stdout_line!("{}", serde_json::to_string(&report)?),
        false => print(&report),
    }
    Ok(ExitCode::SUCCESS)
}

fn print(report: &WorldBenchReport) {
    stdout_line!(
        "| world | dances | falls | told 150 ms ahead | false alarms | tilt, deg RMS | \
         beyond the plan (worst) | slip, mm/min | arms kept, % |"
    );
    stdout_line!("|---|---|---|---|---|---|---|---|---|");
    for world in &report.worlds {
        stdout_line!(
            "| {} | {} | {} | {} | {} | {:.1} | {:.2} ({:.2}) | {:.0} | {:.0} |",
            world.world,
            world.dances,
            world.falls,
            world.announced,
            world.false_alarms,
            world.tilt_rms_deg,
            world.tilt_beyond_plan_rms_deg,
            world.worst_tilt_beyond_plan_rms_deg,
            world.slip_mm_min,
            100.0 * world.arms_kept
        );
    }
    for world in &report.worlds {
        for fall in &world.fell {
            stdout_line!("{}: fell: {fall}", world.world);
        }
    }
    for world in report.worlds.iter().filter(|world| world.steps + world.refused_steps > 0) {
        let (steps, refused) = (world.steps, world.refused_steps);
        stdout_line!("{}: {steps} steps, {refused} refused", world.world);
    }
    for pushed in &report.pushes {
        let survived: Vec<String> =
            pushed.survived_ns.iter().map(|impulse| format!("{impulse:.2}")).collect();
        let how = if pushed.feedback { "with" } else { "without" };
        stdout_line!("push survived {how} feedback, N s: {}", survived.join(" "));
    }
    stdout_line!(
        "{}: physics {:.0} x real time on one core, with retargeter and balance {:.0} x",
        report.robot,
        report.engine_realtime_factor,
        report.realtime_factor
    );
}
