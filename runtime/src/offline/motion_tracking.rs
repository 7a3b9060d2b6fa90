//! A known motion becomes joint commands: a dance without music, servos and
//! clock.
//!
//! Retargeter and limits are those of a dance; limits are judged by the commands
//! alone.

use crate::robot::Robot;
use crate::telemetry::report::ViolationReport;
use servodance_drivers::Limiter;
use servodance_retarget::{
    LimbDirectionError, LimbSegment, RetargetCounts, Retargeter, TorqueReport, surrounding_postures,
};
use servodance_types::{FRAME_RATE_HZ, JointLimits, MotionFrame};
use std::time::Instant;

/// Commands for a whole motion, measured.
#[derive(Clone, Debug)]
pub struct TrackedMotion {
    /// Number of control cycles.
    pub cycles: u64,
    /// Limits broken by the commands.
    pub violations: ViolationReport,
    /// Joint cycles in which the safety layer changed a command.
    pub interventions: u64,
    /// What the retargeter had to give up, counted.
    pub counts: RetargetCounts,
    /// Angles between the dancer's arm segments and the robot's, degrees, sorted.
    pub direction_errors_deg: Vec<f64>,
    /// Angles of every limb segment, legs too, degrees.
    pub limb_errors_deg: Vec<(LimbSegment, f64)>,
    /// Torque and heat of the motors, estimated.
    pub effort: TorqueReport,
    /// Root mean square jerk over all joints, rad/s^3.
    pub jerk_rms_rad_s3: f64,
    /// Time of each cycle, microseconds, sorted.
    pub cycle_us: Vec<f64>,
}

impl TrackedMotion {
    /// A quantile (0 to 1) of sorted values; 0 where there are none.
    pub fn quantile(sorted: &[f64], share: f64) -> f64 {
        let last = sorted.len().saturating_sub(1);
        let at = (share * last as f64).round() as usize;
        sorted.get(at.min(last)).copied().unwrap_or(0.0)
    }

    /// Median angle of the segments that `pick` picks, degrees; `None` where the
    /// robot has none of them.
    pub fn median_deg(&self, pick: impl Fn(LimbSegment) -> bool) -> Option<f64> {
        let picked = self.limb_errors_deg.iter().filter(|(s, _)| pick(*s));
        let mut angles: Vec<f64> = picked.map(|(_, angle)| *angle).collect();
        angles.sort_by(f64::total_cmp);
        (!angles.is_empty()).then(|| Self::quantile(&angles, 0.5))
    }
}

/// Tracks `frames` from the pose of the first one on; `each` gets time and commands of
/// every cycle.
pub fn track_motion(
    robot: &Robot,
    frames: &[MotionFrame],
    each: impl FnMut(f64, &[f64]) -> anyhow::Result<()>,
) -> anyhow::Result<TrackedMotion> {
    track_with(robot.retargeter()?, robot, frames, each)
}

/// The same with a retargeter of that robot.
pub fn track_with(
    mut retargeter: Retargeter,
    robot: &Robot,
    frames: &[MotionFrame],
    mut each: impl FnMut(f64, &[f64]) -> anyhow::Result<()>,
) -> anyhow::Result<TrackedMotion> {
    let names: Vec<&str> = robot.servos.iter().map(|servo| servo.name.as_str()).collect();
    let likeness = LimbDirectionError::new(&robot.urdf_xml, &robot.retarget, &names)?;
    let postures = surrounding_postures(frames);
    if let (Some(first), Some(posture)) = (frames.first(), postures.first()) {
        retargeter.take_up(first, posture);
    }
    let mut targets = retargeter.positions_rad().to_vec();
    let mut limiters: Vec<Limiter> = robot
        .servos
        .iter()
        .zip(&targets)
        .map(|(servo, first)| Limiter::new(servo.limits, robot.period_s(), *first))
        .collect();
    let mut judge = LimitJudge::new(robot, &targets);
    let mut waiting = frames.iter().zip(&postures).peekable();
    let mut tracked = TrackedMotion {
        cycles: 0,
        violations: ViolationReport::default(),
        interventions: 0,
        counts: RetargetCounts::default(),
        direction_errors_deg: Vec::new(),
        limb_errors_deg: Vec::new(),
        effort: retargeter.torque_report(),
        jerk_rms_rad_s3: 0.0,
        cycle_us: Vec::new(),
    };
    let cycles = (frames.len() as f64 / FRAME_RATE_HZ * robot.control_hz) as u64;
    let mut next_frame = 0;
    for cycle in 0..cycles {
        let time_s = cycle as f64 * robot.period_s();
        while let Some((frame, posture)) =
            waiting.next_if(|(frame, _)| frame.time_s <= time_s + retargeter.lookahead_s())
        {
            retargeter.push_with_posture(frame, posture);
        }
        let begin = Instant::now();
        retargeter.next(time_s, &mut targets)?;
        tracked.cycle_us.push(begin.elapsed().as_secs_f64() * 1e6);
        for (target, limiter) in targets.iter_mut().zip(&mut limiters) {
            let limited = limiter.step(*target);
            let changed = limited.position || limited.velocity || limited.acceleration;
            tracked.interventions += u64::from(changed);
            *target = limited.position_rad;
        }
        judge.push(&targets);
        if let Some(frame) = frames.get(next_frame).filter(|f| f.time_s <= time_s + 1e-9) {
            let root = retargeter.world_from_root(&targets);
            likeness.compare(&root, &targets, frame, |segment, angle| {
                tracked.limb_errors_deg.push((segment, angle));
            });
            next_frame += 1;
        }
        each(time_s, &targets)?;
    }
    tracked.cycles = cycles;
    tracked.counts = *retargeter.counts();
    tracked.violations = judge.broken;
    tracked.jerk_rms_rad_s3 = (judge.jerk_squares / judge.jerks.max(1) as f64).sqrt();
    tracked.effort = retargeter.torque_report();
    let arms = tracked.limb_errors_deg.iter().filter(|(s, _)| s.is_arm());
    tracked.direction_errors_deg = arms.map(|(_, angle)| *angle).collect();
    tracked.direction_errors_deg.sort_by(f64::total_cmp);
    tracked.cycle_us.sort_by(f64::total_cmp);
    Ok(tracked)
}

/// RetargetCounts broken limits by positions and their first and second differences.
struct LimitJudge {
    limits: Vec<JointLimits>,
    control_hz: f64,
    /// The last three commands of each joint, newest last.
    last: Vec<[f64; 3]>,
    broken: ViolationReport,
    jerk_squares: f64,
    jerks: u64,
}

impl LimitJudge {
    fn new(robot: &Robot, start: &[f64]) -> Self {
        Self {
            limits: robot.servos.iter().map(|servo| servo.limits).collect(),
            control_hz: robot.control_hz,
            last: start.iter().map(|position| [*position; 3]).collect(),
            broken: ViolationReport::default(),
            jerk_squares: 0.0,
            jerks: 0,
        }
    }

    fn push(&mut self, positions: &[f64]) {
        let hz = self.control_hz;
        for ((limit, last), &now) in self.limits.iter().zip(&mut self.last).zip(positions) {
            let [a, b, c] = *last;
            let velocity = (now - c) * hz;
            let acceleration = (now - 2.0 * c + b) * hz * hz;
            let jerk = (now - 3.0 * c + 3.0 * b - a) * hz * hz * hz;
            let inside = limit.lower_rad - 1e-9..=limit.upper_rad + 1e-9;
            let slack = 1.0 + 1e-6;
            // What is not a number is not allowed, either.
            let kept = [
                inside.contains(&now),
                velocity.abs() <= limit.velocity_rad_s * slack,
                acceleration.abs() <= limit.acceleration_rad_s2 * slack,
            ];
            self.broken.position += u64::from(!kept[0]);
            self.broken.velocity += u64::from(!kept[1]);
            self.broken.acceleration += u64::from(!kept[2]);
            self.jerk_squares += jerk * jerk;
            self.jerks += 1;
            *last = [b, c, now];
        }
    }
}
