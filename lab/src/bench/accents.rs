//! How much of a dancer's movement reaches the servos, and how much of its accents:
//! `servodance bench accents`.
//!
//! Four stages: the dancer; a perfect robot of the same shape, whose joints are three times
//! as fast (three times the velocity, nine times the acceleration, 27 times the jerk) and are
//! where they are told to be; the commands inside the limits; the simulated servos. Movement
//! of arms is compared as directions of upper arms and forearms in the heading of the chest
//! (the dancer's arms have other joints), movement of joints as their angles. Energy is the
//! mean square of the velocity; accents are its part from 3 to 8 Hz. The first two seconds are
//! left out.

use serde::Serialize;
use servodance_drivers::EStop;
use servodance_model::motion::Clip;
use servodance_retarget::LimbDirectionError;
use servodance_runtime::control::bus_choice;
use servodance_runtime::control::robot_buses::RobotBuses;
use servodance_runtime::process::speed::Speed;
use servodance_runtime::robot::Robot;
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

/// How many times as fast a perfect robot is. Without any limit the search for better arms
/// would jump from one answer to another in a cycle, which no dancer does.
const FASTER: f64 = 3.0;
/// The fastest rise of acceleration that a robot file can give, seconds.
const LEAST_RISE_S: f64 = 0.002;
const SKIPPED_S: f64 = 2.0;
const ACCENTS_HZ: (f64, f64) = (3.0, 8.0);
/// Frames of a window of the spectrum; windows overlap by half.
const WINDOW: usize = 64;

/// Mean square of a velocity and its part from 3 to 8 Hz.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct MovementPower {
    pub energy: f64,
    pub accents: f64,
}

impl MovementPower {
    /// The shares of another movement's power.
    fn over(self, other: Self) -> Option<Self> {
        let known = other.energy > 1e-9 && other.accents > 1e-9;
        known.then(|| Self {
            energy: self.energy / other.energy,
            accents: self.accents / other.accents,
        })
    }
}

/// What of a movement is there at each stage; all but the dancer as shares of the perfect
/// robot's.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StageShares {
    /// The dancer's; for arms alone.
    pub dancer: Option<MovementPower>,
    /// The perfect robot: (rad/s)^2.
    pub perfect: MovementPower,
    /// What the servos were told.
    pub commands: MovementPower,
    /// Where the servos were.
    pub servos: MovementPower,
}

/// The figures of one robot.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct AccentReport {
    pub robot: String,
    /// Directions of upper arms and forearms; `None` for a robot without arms.
    pub arms: Option<StageShares>,
    /// Angles of the joints that are not of legs.
    pub upper_joints: Option<StageShares>,
    /// Angles of all joints.
    pub all_joints: Option<StageShares>,
    /// Limits broken at the simulated servos.
    pub violations: u64,
}

/// Positions of all channels at every frame of the dance.
type Channels = Vec<Vec<f64>>;

/// One robot at one stage.
#[derive(Default)]
struct Stage {
    joints: Channels,
    arms: Channels,
}

/// Measures one robot over all clips.
/// Fails for: clips of less than five seconds, or a robot that cannot be simulated.
pub fn run(robot: &Robot, clips: &[Clip]) -> anyhow::Result<AccentReport> {
    let mut sums = [[MovementPower::default(); 4]; 3];
    let mut violations = 0;
    let upper = robot.retargeter()?.upper_joints();
    for clip in clips {
        anyhow::ensure!(clip.duration_s() >= 5.0, "{}: at least 5 s are needed", clip.name);
        let frames = clip.frames();
        let perfect = Simulated::run(&faster(robot), &frames, false)?;
        let real = Simulated::run(robot, &frames, true)?;
        violations += real.violations;
        let stages = [&perfect.commands, &real.commands, &real.servos];
        let arms =
            [&perfect.dancer, &perfect.commands.arms, &real.commands.arms, &real.servos.arms];
        for (sum, channels) in sums[0].iter_mut().zip(arms) {
            add(sum, power(channels));
        }
        for (at, stage) in stages.iter().enumerate() {
            let of_upper: Channels =
                upper.iter().map(|&joint| stage.joints[joint].clone()).collect();
            add(&mut sums[1][at + 1], power(&of_upper));
            add(&mut sums[2][at + 1], power(&stage.joints));
        }
    }
    let shares = |[dancer, perfect, commands, servos]: [MovementPower; 4]| {
        Some(StageShares {
            dancer: dancer.over(perfect),
            perfect,
            commands: commands.over(perfect)?,
            servos: servos.over(perfect)?,
        })
    };
    let [arms, upper_joints, all_joints] = sums.map(shares);
    Ok(AccentReport { robot: robot.name.clone(), arms, upper_joints, all_joints, violations })
}

fn add(sum: &mut MovementPower, power: MovementPower) {
    sum.energy += power.energy;
    sum.accents += power.accents;
}

/// The same robot, so many times as fast.
fn faster(robot: &Robot) -> Robot {
    let mut free = robot.clone();
    for servo in &mut free.servos {
        servo.limits.velocity_rad_s *= FASTER;
        servo.limits.acceleration_rad_s2 *= FASTER.powi(2);
    }
    free.retarget.jerk_rise_s = (robot.retarget.jerk_rise_s / FASTER).max(LEAST_RISE_S);
    free.retarget.jerk_deg_s3.values_mut().for_each(|jerk| *jerk *= FASTER.powi(3));
    free
}

struct Simulated {
    dancer: Channels,
    commands: Stage,
    servos: Stage,
    violations: u64,
}

impl Simulated {
    /// Retargets the frames; with `servos`, simulated ones follow.
    fn run(robot: &Robot, frames: &[MotionFrame], servos: bool) -> anyhow::Result<Self> {
        let mut retargeter = match servos {
            true => robot.servo_retargeter()?,
            false => robot.retargeter()?,
        };
        let names: Vec<&str> = robot.servos.iter().map(|servo| servo.name.as_str()).collect();
        let likeness = LimbDirectionError::new(&robot.urdf_xml, &robot.retarget, &names)?;
        let mut buses = match servos {
            true => Some(armed(robot)?),
            false => None,
        };
        let mut targets = retargeter.rest().to_vec();
        if let Some(buses) = &buses {
            targets = buses.states().iter().map(|state| state.position_rad).collect();
            retargeter.seed(&targets)?;
        }
        let mut found = Self {
            dancer: Vec::new(),
            commands: Stage::default(),
            servos: Stage::default(),
            violations: 0,
        };
        let mut waiting = frames.iter().peekable();
        let mut shown = frames.iter().peekable();
        let cycles = (frames.len() as f64 / FRAME_RATE_HZ * robot.control_hz) as u64;
        for cycle in 0..cycles {
            let time_s = cycle as f64 * robot.period_s();
            let needed_s = time_s + retargeter.lookahead_s();
            while let Some(frame) = waiting.next_if(|frame| frame.time_s <= needed_s) {
                retargeter.push(frame);
            }
            retargeter.next(time_s, &mut targets)?;
            if let Some(buses) = &mut buses {
                buses.cycle(time_s, &targets)?;
            }
            let Some(frame) = shown.next_if(|frame| frame.time_s <= time_s + 1e-9) else {
                continue;
            };
            if time_s < SKIPPED_S {
                continue;
            }
            let root = retargeter.world_from_root(&targets);
            let (mut of_robot, mut of_dancer) = (Vec::new(), Vec::new());
            let see = |positions: &[f64], of_robot: &mut Vec<f64>, of_dancer: &mut Vec<f64>| {
                likeness.directions(&root, positions, frame, |segment, robot, dancer| {
                    if segment.is_arm() {
                        of_robot.extend(robot.normalize().iter());
                        of_dancer.extend(dancer.normalize().iter());
                    }
                });
            };
            see(&targets, &mut of_robot, &mut of_dancer);
            push(&mut found.commands.arms, &of_robot);
            push(&mut found.dancer, &of_dancer);
            push(&mut found.commands.joints, &targets);
            if let Some(buses) = &buses {
                let present: Vec<f64> =
                    buses.states().iter().map(|state| state.position_rad).collect();
                let mut of_servos = Vec::new();
                see(&present, &mut of_servos, &mut Vec::new());
                push(&mut found.servos.arms, &of_servos);
                push(&mut found.servos.joints, &present);
            }
        }
        if let Some(mut buses) = buses {
            buses.disarm("the motion is over")?;
            let broken = buses.violations().unwrap_or_default();
            found.violations = broken.position + broken.velocity + broken.acceleration;
        }
        Ok(found)
    }
}

fn armed(robot: &Robot) -> anyhow::Result<RobotBuses> {
    let choices = bus_choice::choose(robot, &["sim".to_owned()])?;
    let mut buses = RobotBuses::open(robot, &choices, Speed::Max, &EStop::default())?;
    buses.arm()?;
    Ok(buses)
}

fn push(channels: &mut Channels, values: &[f64]) {
    channels.resize(values.len().max(channels.len()), Vec::new());
    channels.iter_mut().zip(values).for_each(|(channel, value)| channel.push(*value));
}

/// Summed over the channels.
fn power(channels: &Channels) -> MovementPower {
    let mut sum = MovementPower::default();
    for channel in channels {
        let velocity: Vec<f64> =
            channel.windows(2).map(|pair| (pair[1] - pair[0]) * FRAME_RATE_HZ).collect();
        let squares: f64 = velocity.iter().map(|v| v * v).sum();
        sum.energy += squares / velocity.len().max(1) as f64;
        sum.accents += band_power(&velocity);
    }
    sum
}

/// Mean square from 3 to 8 Hz: windows of 3.2 s under a Hann window, overlapping by half.
fn band_power(signal: &[f64]) -> f64 {
    let window = |i: usize| {
        let phase = std::f64::consts::TAU * i as f64 / WINDOW as f64;
        0.5 * (1.0 - phase.cos())
    };
    let gain: f64 = (0..WINDOW).map(|i| window(i).powi(2)).sum();
    let (mut sum, mut windows) = (0.0, 0);
    let mut from = 0;
    while let Some(part) = signal.get(from..from + WINDOW) {
        for bin in 1..WINDOW / 2 {
            let hz = bin as f64 * FRAME_RATE_HZ / WINDOW as f64;
            if !(ACCENTS_HZ.0..=ACCENTS_HZ.1).contains(&hz) {
                continue;
            }
            let (mut re, mut im) = (0.0, 0.0);
            for (i, value) in part.iter().enumerate() {
                let turn = std::f64::consts::TAU * (bin * i % WINDOW) as f64 / WINDOW as f64;
                re += window(i) * value * turn.cos();
                im += window(i) * value * turn.sin();
            }
            sum += 2.0 * (re * re + im * im) / (gain * WINDOW as f64);
        }
        windows += 1;
        from += WINDOW / 2;
    }
    sum / f64::from(windows.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swing_has_its_power_in_its_band_alone() {
        let swing = |hz: f64| -> Channels {
            let angle = |k: i32| 0.1 * (std::f64::consts::TAU * hz * f64::from(k) / 20.0).sin();
            vec![(0..400).map(angle).collect()]
        };
        for (hz, share) in [(1.0, 0.0), (5.0, 1.0), (9.5, 0.0)] {
            let found = power(&swing(hz));
            let shown = found.accents / found.energy;
            assert!((shown - share).abs() < 0.05, "{hz} Hz: {shown}");
        }
    }

    #[test]
    fn a_perfect_robot_shows_at_least_what_the_servos_show() {
        let clip = crate::bench::retarget::motion(None, 8.0).unwrap();
        let robot = Robot::load("torso13").unwrap();
        let report = run(&robot, &[clip]).unwrap();
        assert_eq!(report.violations, 0);
        let arms = report.arms.unwrap();
        assert!(arms.servos.energy > 0.5 && arms.servos.energy < 1.1, "{arms:?}");
        assert!(arms.servos.accents < 1.1, "{arms:?}");
    }
}
