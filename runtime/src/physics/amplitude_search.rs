//! How much of a dance a robot can stand: found by dancing it in several worlds.

use std::fmt;

use servodance_model::motion::Clip;
use servodance_retarget::RetargetConfig;
use servodance_sim::world::WorldOptions;

use super::servo_loop::ServoVariation;
use super::standing_trial::{StandingTrial, TrialOptions, TrialReport};
use super::upper_speed::{upper_speed2, upper_speed2_by_limits};
use crate::robot::Robot;

/// What is tried, largest first (pelvis, `arm_zmp_limit`, arms): the pelvis gives way before the
/// arms do, and the arms in wild stretches before they do everywhere. From 0.3 to 1 of the pelvis
/// there is nothing: what stood there in these dances fell in others.
const LADDER: [StandingShares; 14] = [
    StandingShares::new(1.0, 0.6, 1.0),
    StandingShares::new(0.3, 0.6, 1.0),
    StandingShares::new(0.0, 0.6, 1.0),
    StandingShares::new(0.0, 0.5, 1.0),
    StandingShares::new(0.0, 0.45, 1.0),
    StandingShares::new(0.0, 0.4, 1.0),
    StandingShares::new(0.0, 0.35, 1.0),
    StandingShares::new(0.0, 0.3, 1.0),
    StandingShares::new(0.0, 0.25, 1.0),
    StandingShares::new(0.0, 0.2, 1.0),
    StandingShares::new(0.0, 0.15, 1.0),
    StandingShares::new(0.0, 0.1, 1.0),
    StandingShares::new(0.0, 0.1, 0.7),
    StandingShares::new(0.0, 0.1, 0.4),
];
/// A robot that leans at most this share of its tipping angle beyond its plan has a margin
/// for dances that it was not tried with. What stands on four feet need only not fall.
const MOST_LEAN: f64 = 0.6;
/// A moving pelvis takes from what the soles can carry of the arms: where the arms keep less than
/// this share of the mean squared speed that their limits allow, the pelvis moves less.
const ENOUGH_ARMS: f64 = 0.65;

/// How much of a dance a robot is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandingShares {
    /// Share of the movement of pelvis and legs.
    pub pelvis: f64,
    /// That key of the robot's file.
    pub arm_zmp_limit: f64,
    /// Share of the movement of arms and head.
    pub arms: f64,
}

impl StandingShares {
    const fn new(pelvis: f64, arm_zmp_limit: f64, arms: f64) -> Self {
        Self { pelvis, arm_zmp_limit, arms }
    }

    /// Sets the limit and scales the gains.
    pub fn scale(&self, config: &mut RetargetConfig) {
        config.arm_zmp_limit = self.arm_zmp_limit;
        let gain = &mut config.gain;
        for part in [&mut gain.torso, &mut gain.left_leg, &mut gain.right_leg] {
            *part *= self.pelvis;
        }
        for part in [&mut gain.left_arm, &mut gain.right_arm, &mut gain.head] {
            *part *= self.arms;
        }
    }
}

impl fmt::Display for StandingShares {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pelvis, arm_zmp_limit, arms } = self;
        let [pelvis, arm_zmp_limit, arms] =
            [pelvis, arm_zmp_limit, arms].map(|share| share * 100.0);
        write!(
            out,
            "{pelvis:.0} % of the pelvis's movement and {arms:.0} % of the arms', whose swings \
             have {arm_zmp_limit:.0} % of the soles before they give way"
        )
    }
}

/// What a robot can stand, and how it went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandingAmplitude {
    /// The largest that it stands.
    pub shares: StandingShares,
    /// The worst of the worlds.
    pub worst: TrialReport,
    /// Mean squared speed of arms and head over what their limits allow.
    pub arms_kept: f64,
}

/// The largest share of `dances` that the robot stands in every world with a margin and with
/// arms that move enough, or else the one with most of the arms, or else the one that it stands
/// most steadily; `None` if it falls whatever it leaves out.
pub fn find_amplitude(
    robot: &Robot,
    dances: &[Clip],
    sized: bool,
) -> anyhow::Result<Option<StandingAmplitude>> {
    let lean = |found: &StandingAmplitude| found.worst.tilt_beyond_plan_max_deg;
    let tipping_rad = robot.retargeter()?.tipping_angle_rad();
    let most_deg = tipping_rad.map_or(f64::INFINITY, |angle| MOST_LEAN * angle.to_degrees());
    let free = mean(dances, |dance| upper_speed2_by_limits(robot, &dance.frames()))?;
    let mut steadiest: Option<StandingAmplitude> = None;
    let mut liveliest: Option<StandingAmplitude> = None;
    for shares in LADDER {
        let mut scaled = robot.clone();
        shares.scale(&mut scaled.retarget);
        let Some(worst) = worst_of(dances, |dance| stands_everywhere(&scaled, dance, sized))?
        else {
            continue;
        };
        let shown = mean(dances, |dance| upper_speed2(&scaled, &dance.frames()))?;
        let arms_kept = if free > 0.0 { shown / free } else { 1.0 };
        let found = StandingAmplitude { shares, worst, arms_kept };
        if lean(&found) <= most_deg {
            let best = liveliest.filter(|it| it.arms_kept >= found.arms_kept).unwrap_or(found);
            // With the pelvis at rest there is less of the arms further down.
            if shares.pelvis == 0.0 || found.arms_kept >= ENOUGH_ARMS {
                return Ok(Some(best));
            }
            liveliest = Some(best);
        }
        if steadiest.as_ref().is_none_or(|before| lean(&found) < lean(before)) {
            steadiest = Some(found);
        }
    }
    Ok(liveliest.or(steadiest))
}

fn mean(dances: &[Clip], of: impl Fn(&Clip) -> anyhow::Result<f64>) -> anyhow::Result<f64> {
    let sum: f64 = dances.iter().map(of).sum::<anyhow::Result<f64>>()?;
    Ok(sum / dances.len().max(1) as f64)
}

/// The report of the trial that leaned most; `None` if the robot fell in one.
fn worst_of<T>(
    trials: impl IntoIterator<Item = T>,
    run: impl Fn(T) -> anyhow::Result<Option<TrialReport>>,
) -> anyhow::Result<Option<TrialReport>> {
    let mut worst = TrialReport::default();
    for trial in trials {
        let Some(report) = run(trial)? else { return Ok(None) };
        if report.tilt_beyond_plan_max_deg >= worst.tilt_beyond_plan_max_deg {
            worst = report;
        }
    }
    Ok(Some(worst))
}

/// The worst report of all worlds; `None` if the robot falls in one.
fn stands_everywhere(
    robot: &Robot,
    dance: &Clip,
    sized: bool,
) -> anyhow::Result<Option<TrialReport>> {
    let frames = dance.frames();
    let dance = |options| StandingTrial::new(robot, options)?.run(&frames, |_, _, _| ());
    let reports: Vec<anyhow::Result<TrialReport>> = std::thread::scope(|scope| {
        let trials = worlds(sized).map(|options| scope.spawn(move || dance(options)));
        let failed = |_| Err(anyhow::anyhow!("a trial in the simulated world panicked"));
        trials.into_iter().map(|trial| trial.join().unwrap_or_else(failed)).collect()
    });
    worst_of(reports, |report| report.map(|it| it.fell_s.is_none().then_some(it)))
}

/// Worlds that a robot must stand in, without the help of a sensor: softer and stiffer
/// servos, a slippery floor, a heavier robot, a floor that leans.
fn worlds(sized: bool) -> [TrialOptions; 5] {
    let plain = TrialOptions { sized, feedback: false, ..TrialOptions::default() };
    let servos = |stiffness: f64| TrialOptions {
        servos: ServoVariation { stiffness, ..plain.servos },
        ..plain
    };
    let world = |friction: f64, tilt_rad: [f64; 2]| TrialOptions {
        world: WorldOptions { friction, tilt_rad, ..plain.world },
        ..plain
    };
    let lean = 1.0_f64.to_radians();
    [
        servos(0.8),
        servos(1.3),
        world(0.4, [0.0; 2]),
        TrialOptions { mass: 1.1, ..world(0.8, [lean, -lean]) },
        world(0.8, [-lean, lean]),
    ]
}
