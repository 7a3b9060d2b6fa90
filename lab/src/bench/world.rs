//! Whether a robot stays on its feet while it dances, in the simulated world: dances
//! to many songs in worlds that differ, and pushes.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use super::world_dump::dump;
use anyhow::Context;
use nix::time::{ClockId, clock_gettime};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use servodance_audio::song::SongSpec;
use servodance_model::motion::Clip;
use servodance_runtime::offline::generate::{GenerateRequest, generate};
use servodance_runtime::offline::song_file::write_song;
use servodance_runtime::physics::{
    ServoVariation, StandingTrial, TrialOptions, TrialReport, survived_push_ns,
    upper_speed2_by_limits,
};
use servodance_runtime::robot::Robot;
use servodance_sim::world::{ImuErrors, World, WorldOptions};

/// A fall is to be announced this long before the body strikes the floor, seconds.
const AHEAD_S: f64 = 0.15;
/// Seconds of standing in which a push comes.
const PUSHED_S: f64 = 6.0;

/// Simulated seconds by which the engine's speed is measured.
const TIMED_S: f64 = 20.0;

/// What `bench world` is to measure.
#[derive(Clone, Debug)]
pub struct WorldBenchRequest {
    /// How many songs, and how many seeds of the dancer for each.
    pub songs: u64,
    /// Seeds of the dancer.
    pub seeds: u64,
    /// Styles to dance; the default one if empty.
    pub styles: Vec<String>,
    /// Seconds of each dance.
    pub seconds: f64,
    /// Names of [`WORLDS`]; all if empty.
    pub worlds: Vec<String>,
    /// Whether the sensor's feedback is on.
    pub feedback: bool,
    /// Whether servos are as strong as the robot's masses ask for.
    pub sized: bool,
    /// Whether pushes are measured too.
    pub pushes: bool,
    /// Where generated motion is kept and found again.
    pub motions: PathBuf,
    /// Where each trial is written for another engine to play.
    pub dump: Option<PathBuf>,
    /// Seed of songs, and of worlds that are drawn.
    pub seed: u64,
}

/// A world's name and what it means.
pub const WORLDS: [(&str, &str); 10] = [
    ("nominal", "servos and robot as described"),
    ("soft", "servos 20 % less stiff"),
    ("firm", "servos 20 % stiffer"),
    ("kp60", "servos of 60 N m/rad"),
    ("play", "0.5 degrees of play in every gear"),
    ("slippery", "friction of 0.4"),
    ("light", "10 % less mass"),
    ("heavy", "10 % more mass"),
    ("tilted", "a floor that leans by 2 degrees"),
    ("late", "a noisy sensor, 20 ms late"),
];

/// All of those at once, drawn for each dance.
pub const DRAWN: &str = "drawn";
/// A push in the middle of the dance, drawn: about half of them topple a robot.
pub const PUSHED: &str = "pushed";
const MOST_DRAWN_NS_PER_KG: f64 = 1.2;

/// The figures of one world.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // units stand in the names
pub struct WorldFigures {
    pub world: String,
    pub dances: usize,
    pub falls: usize,
    pub danced_s: f64,
    pub tilt_rms_deg: f64,
    pub tilt_beyond_plan_rms_deg: f64,
    pub worst_tilt_beyond_plan_rms_deg: f64,
    pub slip_mm_min: f64,
    pub work_w: f64,
    pub upper_speed2: f64,
    /// The same as a share of what the joints' limits alone would allow: on a stand, with
    /// all gains at 1.
    pub arms_kept: f64,
    /// Seconds in which the feet seemed to carry nothing: nobody lifted the robot.
    pub lifted_s: f64,
    /// Steps that were made and that balance refused (stance `stepping`).
    pub steps: u64,
    /// See `steps`.
    pub refused_steps: u64,
    /// Falls that the sensor announced at least 150 ms before the body struck the floor,
    /// and alarms without a fall.
    pub announced: usize,
    pub false_alarms: usize,
    /// Which dances ended in a fall, and when.
    pub fell: Vec<String>,
}

/// The largest push that was survived, in eight directions from the front to the left.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // units stand in the names
pub struct PushFigures {
    pub feedback: bool,
    pub survived_ns: [f64; 8],
}

/// What `bench world` prints.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct WorldBenchReport {
    pub robot: String,
    pub worlds: Vec<WorldFigures>,
    pub pushes: Vec<PushFigures>,
    /// Simulated seconds for each second of one core: physics and servos alone, and with
    /// retargeter and balance.
    pub engine_realtime_factor: f64,
    /// See `engine_realtime_factor`.
    pub realtime_factor: f64,
}

fn sensor(seed: u64) -> ImuErrors {
    ImuErrors {
        rate_noise_rad_s: 0.01,
        force_noise_m_s2: 0.1,
        attitude_noise_rad: 0.005,
        rate_bias_rad_s: 0.005,
        delay_s: 0.01,
        seed,
    }
}

/// The options of a world by name for a robot of this mass; `dance` numbers the dance in it.
fn options(name: &str, dance: u64, seed: u64, mass_kg: f64) -> anyhow::Result<TrialOptions> {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ dance.wrapping_mul(0x9E37_79B9));
    let imu = sensor(dance + 1);
    let mut trial = TrialOptions {
        world: WorldOptions { imu, ..WorldOptions::default() },
        ..TrialOptions::default()
    };
    let lean = 2.0_f64.to_radians();
    let turned = std::f64::consts::TAU * random.random::<f64>();
    match name {
        "nominal" => {}
        "soft" => trial.servos.stiffness = 0.8,
        "firm" => trial.servos.stiffness = 1.2,
        "kp60" => trial.servos.kp = Some(60.0),
        "play" => trial.servos.play_rad = 0.5_f64.to_radians(),
        "slippery" => trial.world.friction = 0.4,
        "light" => trial.mass = 0.9,
        "heavy" => trial.mass = 1.1,
        "tilted" => trial.world.tilt_rad = [lean * turned.cos(), lean * turned.sin()],
        "late" => trial.world.imu = late(imu),
        PUSHED => {
            let push_ns = MOST_DRAWN_NS_PER_KG * mass_kg * random.random::<f64>();
            trial.push_ns = [push_ns * turned.cos(), push_ns * turned.sin()];
        }
        DRAWN => {
            let share = lean * random.random::<f64>();
            trial = TrialOptions {
                servos: ServoVariation {
                    stiffness: random.random_range(0.8..1.2),
                    kp: None,
                    play_rad: random.random_range(0.0..0.5_f64.to_radians()),
                },
                world: WorldOptions {
                    friction: random.random_range(0.4..1.0),
                    tilt_rad: [share * turned.cos(), share * turned.sin()],
                    imu: late(imu),
                    ..trial.world
                },
                mass: random.random_range(0.9..1.1),
                ..trial
            };
        }
        _ => {
            let known: Vec<&str> =
                WORLDS.iter().map(|world| world.0).chain([DRAWN, PUSHED]).collect();
            anyhow::bail!("no world \"{name}\"; there are {}", known.join(", "));
        }
    }
    Ok(trial)
}

fn late(imu: ImuErrors) -> ImuErrors {
    ImuErrors { delay_s: 0.02, rate_noise_rad_s: 0.03, attitude_noise_rad: 0.01, ..imu }
}

/// Runs all dances in all worlds; `progress` gets what is done and what there is.
pub fn run(
    robot: &Robot,
    request: &WorldBenchRequest,
    progress: impl Fn(usize, usize) + Sync,
) -> anyhow::Result<WorldBenchReport> {
    if let Some(folder) = &request.dump {
        std::fs::create_dir_all(folder).context("--dump")?;
    }
    let clips = clips(request)?;
    let worlds: Vec<&str> = match request.worlds.is_empty() {
        true => WORLDS.iter().map(|world| world.0).chain([DRAWN]).collect(),
        false => request.worlds.iter().map(String::as_str).collect(),
    };
    let total = worlds.len() * clips.len();
    let results = Mutex::new(vec![TrialReport::default(); total]);
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
    let cpu_s = Mutex::new(0.0);
    let threads = std::thread::available_parallelism().map_or(1, |count| count.get());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= total {
                        break;
                    }
                    let (world, dance) = (index / clips.len(), index % clips.len());
                    match trial(robot, request, worlds[world], dance, &clips[dance]) {
                        Ok(report) => lock(&results)[index] = report,
                        Err(error) => *lock(&failed) = Some(error),
                    }
                    progress(index, total);
                }
                *lock(&cpu_s) += thread_cpu_s();
            });
        }
    });
    if let Some(error) = lock(&failed).take() {
        return Err(error);
    }
    let results = std::mem::take(&mut *lock(&results));
    let danced_s: f64 = results.iter().map(|report| report.danced_s).sum();
    let realtime_factor = danced_s / *lock(&cpu_s);
    let freest = clips.iter().map(|clip| upper_speed2_by_limits(robot, &clip.frames()));
    let freest = freest.collect::<anyhow::Result<Vec<f64>>>()?;
    let freest = freest.iter().sum::<f64>() / freest.len().max(1) as f64;
    let figures = |(world, name): (usize, &&str)| {
        let own = &results[world * clips.len()..(world + 1) * clips.len()];
        let mut figures = world_figures(name, &clips, own);
        figures.arms_kept = figures.upper_speed2 / freest;
        figures
    };
    Ok(WorldBenchReport {
        robot: robot.name.clone(),
        worlds: worlds.iter().enumerate().map(figures).collect(),
        pushes: match request.pushes {
            true => vec![pushes(robot, false)?, pushes(robot, true)?],
            false => Vec::new(),
        },
        engine_realtime_factor: engine_realtime_factor(robot)?,
        realtime_factor,
    })
}

fn thread_cpu_s() -> f64 {
    let time = clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID);
    time.map_or(f64::NAN, |time| Duration::from(time).as_secs_f64())
}

/// How fast a standing robot of these links and servos is simulated.
fn engine_realtime_factor(robot: &Robot) -> anyhow::Result<f64> {
    let retargeter = robot.retargeter()?;
    let trial = StandingTrial::new(robot, TrialOptions::default())?;
    let mechanics: Vec<_> = trial.servos().iter().map(|servo| servo.mechanics).collect();
    let mut world = World::new(trial.links(), &mechanics, WorldOptions::default())?;
    world.place(Some(&retargeter.root_placement(retargeter.rest())), retargeter.rest());
    let mut drives = vec![Default::default(); mechanics.len()];
    let began_s = thread_cpu_s();
    while world.time_s() < TIMED_S {
        for (joint, (drive, servo)) in drives.iter_mut().zip(trial.servos()).enumerate() {
            *drive = servo.drive(retargeter.rest()[joint], world.joint(joint).0);
        }
        world.step(&drives);
    }
    Ok(world.time_s() / (thread_cpu_s() - began_s))
}

fn lock<T>(shared: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn trial(
    robot: &Robot,
    request: &WorldBenchRequest,
    world: &str,
    dance: usize,
    clip: &Clip,
) -> anyhow::Result<TrialReport> {
    let options = options(world, dance as u64, request.seed, mass_kg(robot)?)?;
    let options = TrialOptions { feedback: request.feedback, sized: request.sized, ..options };
    match &request.dump {
        Some(folder) => {
            let path = folder.join(format!("{world}-{}.json", clip.name));
            dump(robot, options, &clip.frames(), &path)
        }
        None => StandingTrial::new(robot, options)?.run(&clip.frames(), |_, _, _| ()),
    }
}

fn mass_kg(robot: &Robot) -> anyhow::Result<f64> {
    Ok(robot.retargeter()?.rigid_links().iter().map(|link| link.mass_kg).sum())
}

fn world_figures(name: &str, clips: &[Clip], results: &[TrialReport]) -> WorldFigures {
    let count = results.len().max(1) as f64;
    let mean = |of: fn(&TrialReport) -> f64| results.iter().map(of).sum::<f64>() / count;
    let rms = |of: fn(&TrialReport) -> f64| {
        (results.iter().map(|report| of(report).powi(2)).sum::<f64>() / count).sqrt()
    };
    let fell: Vec<String> = results
        .iter()
        .zip(clips)
        .filter_map(|(report, clip)| Some(format!("{} at {:.1} s", clip.name, report.fell_s?)))
        .collect();
    let beyond = |report: &TrialReport| report.tilt_beyond_plan_rms_deg;
    let count_of = |is: fn(&TrialReport) -> bool| results.iter().filter(|r| is(r)).count();
    WorldFigures {
        announced: count_of(was_announced),
        false_alarms: count_of(|report| report.fell_s.is_none() && report.announced_s.is_some()),
        world: name.into(),
        dances: results.len(),
        falls: fell.len(),
        danced_s: results.iter().map(|report| report.danced_s).sum(),
        tilt_rms_deg: rms(|report| report.tilt_rms_deg),
        tilt_beyond_plan_rms_deg: rms(beyond),
        worst_tilt_beyond_plan_rms_deg: results.iter().map(beyond).fold(0.0, f64::max),
        slip_mm_min: mean(|report| report.slip_mm_min),
        work_w: mean(|report| report.work_w),
        upper_speed2: mean(|report| report.upper_speed2),
        arms_kept: f64::NAN,
        lifted_s: results.iter().map(|report| report.lifted_s).sum(),
        steps: results.iter().map(|report| report.steps).sum(),
        refused_steps: results.iter().map(|report| report.refused_steps).sum(),
        fell,
    }
}

fn was_announced(report: &TrialReport) -> bool {
    let (Some(told_s), Some(struck_s)) = (report.announced_s, report.struck_s) else {
        return false;
    };
    report.fell_s.is_some() && struck_s - told_s >= AHEAD_S - 1e-9
}

/// Largest push that the standing robot survives in each direction.
fn pushes(robot: &Robot, feedback: bool) -> anyhow::Result<PushFigures> {
    let still = Clip { name: "standing".into(), ..standing() };
    let frames = still.frames();
    let options = TrialOptions { feedback, ..options("nominal", 0, 0, 0.0)? };
    let mut survived_ns = [0.0; 8];
    for (direction, survived) in survived_ns.iter_mut().enumerate() {
        let angle = std::f64::consts::TAU * direction as f64 / 8.0;
        // A push from the front goes back.
        let towards = [-angle.cos(), -angle.sin()];
        *survived = survived_push_ns(robot, &frames, options, towards)?;
    }
    Ok(PushFigures { feedback, survived_ns })
}

/// A dancer who stands still.
fn standing() -> Clip {
    let pose = servodance_training::choreography::choreograph(
        &[],
        1.0,
        servodance_training::choreography::DanceStyle::Groove,
        1,
    )
    .poses[0];
    let frames = (PUSHED_S * servodance_types::FRAME_RATE_HZ) as usize;
    Clip { name: String::new(), fps: servodance_types::FRAME_RATE_HZ, poses: vec![pose; frames] }
}

/// The dances, generated or found in the folder.
fn clips(request: &WorldBenchRequest) -> anyhow::Result<Vec<Clip>> {
    std::fs::create_dir_all(&request.motions).context("--motions")?;
    let styles: Vec<Option<&str>> = match request.styles.is_empty() {
        true => vec![None],
        false => request.styles.iter().map(|style| Some(style.as_str())).collect(),
    };
    let mut clips = Vec::new();
    for song in 0..request.songs {
        let mut file = None;
        for style in &styles {
            for seed in 0..request.seeds {
                let song_seed = request.seed + song;
                let label = style.unwrap_or("default");
                let name = format!("song{song_seed}-{label}-{seed}-{:.0}s", request.seconds);
                let path = request.motions.join(format!("{name}.npz"));
                if !path.exists() {
                    let wav = match &file {
                        Some(wav) => wav,
                        None => {
                            file.insert(song_file(&request.motions, song_seed, request.seconds)?)
                        }
                    };
                    dance(wav, *style, seed, request.seconds)?.write_npz(&path)?;
                }
                clips.push(Clip { name, ..Clip::read_npz(&path)? });
            }
        }
    }
    Ok(clips)
}

fn song_file(folder: &Path, seed: u64, seconds: f64) -> anyhow::Result<PathBuf> {
    let song = SongSpec::random(seconds, seed)?.render()?;
    let path = folder.join(format!("song{seed}.wav"));
    write_song(&path, &song, 0.0)?;
    Ok(path)
}

fn dance(wav: &Path, style: Option<&str>, seed: u64, seconds: f64) -> anyhow::Result<Clip> {
    let request =
        GenerateRequest::plain(Some(wav.to_owned()), seconds, seed, style.map(Into::into));
    generate(&GenerateRequest { lookahead: 0.3, ..request })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two worlds in which the sensor comes 20 ms late, the floor slopes and gears have play.
    #[test]
    fn a_late_sensor_does_not_shake_a_robot_of_stiff_servos_over() {
        let robot = Robot::load("lite22").unwrap();
        let mass_kg = mass_kg(&robot).unwrap();
        for dance in [9, 13] {
            let options = options(DRAWN, dance, 6160, mass_kg).unwrap();
            let trial = StandingTrial::new(&robot, options).unwrap();
            let report = trial.run(&standing().frames(), |_, _, _| ()).unwrap();
            assert_eq!(report.fell_s, None, "dance {dance}: {report:?}");
        }
    }
}
