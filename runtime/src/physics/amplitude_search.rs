//! How much of a dance a robot can stand: found by dancing it in several worlds.

use servodance_model::motion::Clip;
use servodance_retarget::{BodyKind, BodyLinks, RetargetConfig};
use servodance_sim::world::WorldOptions;

use super::servo_loop::ServoVariation;
use super::standing_trial::{StandingTrial, TrialOptions, TrialReport};
use super::upper_speed::{upper_speed2, upper_speed2_by_limits};
use crate::robot::Robot;

/// Shares of the pelvis's movement that are tried. From 0.3 to 1 there is nothing: what stood
/// there in these dances fell in others.
const PELVIS: [f64; 3] = [1.0, 0.3, 0.0];
/// The same of legs alone: with none of it nothing moves.
const LEGS: [f64; 3] = [1.0, 0.3, 0.15];
/// Shares of the trunk's movement over four feet: with none of it nothing moves.
const TRUNK: [f64; 4] = [1.0, 0.6, 0.3, 0.15];
/// Of `arm_zmp_limit`: the arms give way in wild stretches before they do everywhere.
const LIMITS: [f64; 11] = [0.6, 0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05];
/// Of the arms, where none of those limits is enough.
const ARMS: [f64; 4] = [0.85, 0.7, 0.55, 0.4];
/// A robot that leans at most this share of its tipping angle beyond its plan has a margin
/// for dances that it was not tried with.
const MOST_LEAN: f64 = 0.6;
/// Mean squared speed of arms, head and waist over what their limits allow: with more than
/// `PLENTY_OF_ARMS` a smaller limit costs little and leaves the robot steadier; with less than
/// `ENOUGH_ARMS` the pelvis, whose movement takes from what the soles can carry of the arms,
/// moves less. `SPARE_ARMS` are left before it does for want of a margin.
const PLENTY_OF_ARMS: f64 = 0.85;
const SPARE_ARMS: f64 = 0.75;
const ENOUGH_ARMS: f64 = 0.55;

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

    /// In words, of what the body has.
    pub fn shown(&self, body: &BodyLinks) -> String {
        let [pelvis, arms] = [self.pelvis, self.arms].map(|share| share * 100.0);
        let pelvis = format!("{pelvis:.0} % of the pelvis's movement");
        let has_arms = body.left_elbow.is_some() || body.right_elbow.is_some();
        match (has_arms, body.head.is_some()) {
            (true, _) => format!(
                "{pelvis} and {arms:.0} % of the arms', whose swings have {:.0} % of the soles \
                 before they give way",
                self.arm_zmp_limit * 100.0
            ),
            (false, true) => format!("{pelvis} and {arms:.0} % of the head's"),
            (false, false) => pelvis,
        }
    }
}

/// A dance that a robot is tried with.
#[derive(Clone, Debug)]
pub struct TrialDance {
    /// The dancer's motion.
    pub clip: Clip,
    /// Wilder than most: the robot has to stand it in the nominal world, with no margin.
    pub wild: bool,
}

/// What a robot can stand, and how it went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandingAmplitude {
    /// The largest that it stands.
    pub shares: StandingShares,
    /// The worst of the worlds.
    pub worst: TrialReport,
    /// Mean squared speed of arms, head and waist over what their limits allow.
    pub arms_kept: f64,
}

/// The largest share of `dances` that the robot stands, in every world and with a margin those
/// that are not wild. Of what leaves no margin, the largest with which the robot also stands the
/// wild ones and their mirror images in every world; then the same with smaller arms, or else
/// what the robot stands most steadily. On four feet the trunk moves less. `None` if the robot
/// falls whatever it leaves out.
pub fn find_amplitude(
    robot: &Robot,
    dances: &[TrialDance],
    sized: bool,
) -> anyhow::Result<Option<StandingAmplitude>> {
    let trials = Trials::new(robot, dances, sized)?;
    if robot.retarget.kind == BodyKind::Quadruped {
        return trials.on_four_feet();
    }
    let legs_alone = trials.are_legs_alone();
    let mut without_margin = Vec::new();
    for pelvis in if legs_alone { LEGS } else { PELVIS } {
        for shares in trials.shares(pelvis)? {
            let Some(found) = trials.stand(shares)? else { continue };
            if keeps_enough(&found) && trials.has_margin(&found) {
                return Ok(Some(found));
            }
            without_margin.push(found);
        }
    }
    for found in without_margin.iter().filter(|found| keeps_enough(found)) {
        if trials.stands_wild(found.shares)? {
            return Ok(Some(*found));
        }
    }
    for arms in ARMS.into_iter().filter(|_| !legs_alone) {
        let shares = StandingShares::new(0.0, LIMITS[LIMITS.len() - 1], arms);
        let Some(found) = trials.stand(shares)? else { continue };
        if trials.has_margin(&found) || trials.stands_wild(shares)? {
            return Ok(Some(found));
        }
        without_margin.push(found);
    }
    let lean = |found: &StandingAmplitude| found.worst.tilt_beyond_plan_max_deg;
    Ok(without_margin.into_iter().min_by(|one, other| lean(one).total_cmp(&lean(other))))
}

/// Whether the arms have what the pelvis's movement leaves them.
fn keeps_enough(found: &StandingAmplitude) -> bool {
    found.shares.pelvis == 0.0 || found.arms_kept >= ENOUGH_ARMS
}

/// A robot and the dances that it is tried with.
struct Trials<'a> {
    robot: &'a Robot,
    dances: Vec<&'a Clip>,
    wild: Vec<&'a Clip>,
    sized: bool,
    most_lean_deg: f64,
    /// See `upper_speed2_by_limits`.
    free_speed2: f64,
}

impl<'a> Trials<'a> {
    fn new(robot: &'a Robot, dances: &'a [TrialDance], sized: bool) -> anyhow::Result<Self> {
        let tipping_rad = robot.retargeter()?.tipping_angle_rad();
        let clips = |wild: bool| {
            let dances = dances.iter().filter(move |dance| dance.wild == wild);
            dances.map(|dance| &dance.clip).collect::<Vec<&Clip>>()
        };
        let (dances, wild) = (clips(false), clips(true));
        Ok(Self {
            robot,
            sized,
            most_lean_deg: tipping_rad.map_or(f64::INFINITY, |it| MOST_LEAN * it.to_degrees()),
            free_speed2: mean(dances.iter().chain(&wild), |dance| {
                upper_speed2_by_limits(robot, &dance.frames())
            })?,
            dances,
            wild,
        })
    }

    fn scaled(&self, shares: StandingShares) -> Robot {
        let mut scaled = self.robot.clone();
        shares.scale(&mut scaled.retarget);
        scaled
    }

    fn are_legs_alone(&self) -> bool {
        self.free_speed2 == 0.0
    }

    fn arms_kept(&self, shares: StandingShares) -> anyhow::Result<f64> {
        if self.are_legs_alone() {
            return Ok(1.0);
        }
        let scaled = self.scaled(shares);
        let every = self.dances.iter().chain(&self.wild);
        Ok(mean(every, |dance| upper_speed2(&scaled, &dance.frames()))? / self.free_speed2)
    }

    /// What is tried with a share of the pelvis and all of the arms, largest first: limits
    /// that leave the arms spare movement where the pelvis moves, with the pelvis at rest all.
    fn shares(&self, pelvis: f64) -> anyhow::Result<Vec<StandingShares>> {
        let limits = LIMITS.map(|limit| StandingShares::new(pelvis, limit, 1.0));
        if self.are_legs_alone() {
            return Ok(limits[..1].to_vec());
        }
        let mut kept = Vec::new();
        for shares in limits {
            kept.push(self.arms_kept(shares)?);
            if kept.last().is_none_or(|kept| *kept < SPARE_ARMS) {
                break;
            }
        }
        let with = |least: f64| kept.iter().filter(|kept| **kept >= least).count().max(1);
        let until = if pelvis > 0.0 { with(SPARE_ARMS) } else { limits.len() };
        Ok(limits[with(PLENTY_OF_ARMS) - 1..until].to_vec())
    }

    /// The largest share of the trunk's movement with which it does not fall.
    fn on_four_feet(&self) -> anyhow::Result<Option<StandingAmplitude>> {
        for trunk in TRUNK {
            let found = self.stand(StandingShares::new(trunk, LIMITS[0], 1.0))?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// How it went; `None` if the robot fell.
    fn stand(&self, shares: StandingShares) -> anyhow::Result<Option<StandingAmplitude>> {
        let scaled = self.scaled(shares);
        let worst = worst_of(&self.dances, |dance| stands_everywhere(&scaled, dance, self.sized))?;
        let Some(worst) = worst else { return Ok(None) };
        let nominal =
            [TrialOptions { sized: self.sized, feedback: false, ..TrialOptions::default() }];
        if worst_of(&self.wild, |dance| stands(&scaled, dance, &nominal))?.is_none() {
            return Ok(None);
        }
        Ok(Some(StandingAmplitude { shares, worst, arms_kept: self.arms_kept(shares)? }))
    }

    /// Whether the robot stands the wild dances and their mirror images in every world.
    fn stands_wild(&self, shares: StandingShares) -> anyhow::Result<bool> {
        let scaled = self.scaled(shares);
        for wild in &self.wild {
            for dance in [(*wild).clone(), wild.mirrored()] {
                if stands_everywhere(&scaled, &dance, self.sized)?.is_none() {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    fn has_margin(&self, found: &StandingAmplitude) -> bool {
        found.worst.tilt_beyond_plan_max_deg <= self.most_lean_deg
    }
}

fn mean<'a>(
    dances: impl Iterator<Item = &'a &'a Clip>,
    of: impl Fn(&Clip) -> anyhow::Result<f64> + Sync,
) -> anyhow::Result<f64> {
    let each = side_by_side(dances, |dance| of(dance));
    let each = each.into_iter().collect::<anyhow::Result<Vec<f64>>>()?;
    Ok(each.iter().sum::<f64>() / each.len().max(1) as f64)
}

/// Runs each in a thread of its own; the results in their order.
fn side_by_side<T: Send, R: Send>(
    each: impl Iterator<Item = T>,
    run: impl Fn(T) -> anyhow::Result<R> + Sync,
) -> Vec<anyhow::Result<R>> {
    std::thread::scope(|scope| {
        let run = &run;
        let running: Vec<_> = each.map(|one| scope.spawn(move || run(one))).collect();
        let failed = |_| Err(anyhow::anyhow!("a trial in the simulated world panicked"));
        running.into_iter().map(|thread| thread.join().unwrap_or_else(failed)).collect()
    })
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

fn stands_everywhere(
    robot: &Robot,
    dance: &Clip,
    sized: bool,
) -> anyhow::Result<Option<TrialReport>> {
    stands(robot, dance, &worlds(sized))
}

/// The worst report of these worlds; `None` if the robot falls in one.
fn stands(
    robot: &Robot,
    dance: &Clip,
    worlds: &[TrialOptions],
) -> anyhow::Result<Option<TrialReport>> {
    let frames = dance.frames();
    let reports = side_by_side(worlds.iter(), |&options| {
        StandingTrial::new(robot, options)?.run(&frames, |_, _, _| ())
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
