//! Replay of a dance without compensation: what the servos would have done.
//!
//! After the dance its motion is run once more at an even pace, by a fresh
//! retargeter on simulated servos of its own, in simulated time. The report sets
//! its beat alignment beside that of the dance.

use crate::control::bus_choice;
use crate::control::robot_buses::RobotBuses;
use crate::control::timing::LEAD_IN_S;
use crate::control::trace::JointTrace;
use crate::process::speed::Speed;
use crate::robot::Robot;
use servodance_drivers::EStop;
use servodance_types::MotionFrame;

/// Seconds of the dance that are replayed; a longer one is judged by its beginning.
const MOST_S: f64 = 600.0;

pub struct Replay {
    /// What the retargeter asked for, radians.
    pub targets: JointTrace,
    /// What the servos reported, radians.
    pub servos: JointTrace,
}

/// Replays `motion`, sent `lead_s` ahead of the music; one sample of
/// the traces every `decimation` cycles.
pub fn replay(
    robot: &Robot,
    motion: &[MotionFrame],
    lead_s: f64,
    decimation: u64,
) -> anyhow::Result<Replay> {
    let mut servos = RobotBuses::open(
        robot,
        &bus_choice::choose(robot, &["sim".to_owned()])?,
        Speed::Max,
        &EStop::default(),
    )?;
    servos.arm()?;
    let mut retargeter = robot.servo_retargeter()?;
    let mut targets: Vec<f64> = servos.states().iter().map(|s| s.position_rad).collect();
    retargeter.seed(&targets)?;
    let joints = targets.len();
    let mut replay = Replay { targets: JointTrace::new(joints), servos: JointTrace::new(joints) };
    let mut frames = motion.iter().peekable();
    // Of a long live run only the newest minutes are there.
    let first_s = motion.first().map_or(0.0, |f| f.time_s);
    let last_s = motion.last().map_or(0.0, |f| f.time_s);
    let end_s = last_s.min(first_s + MOST_S) - lead_s;
    let mut cycle = 0_u64;
    loop {
        let robot_s = cycle as f64 * robot.period_s();
        let time_s = first_s + robot_s - LEAD_IN_S;
        if time_s > end_s {
            break;
        }
        let needed_s = time_s + lead_s + retargeter.lookahead_s() + robot.period_s();
        while let Some(frame) = frames.next_if(|frame| frame.time_s <= needed_s) {
            retargeter.push(frame);
        }
        retargeter.next(time_s + lead_s, &mut targets)?;
        servos.cycle(robot_s, &targets)?;
        if time_s >= first_s - 1e-9 && cycle.is_multiple_of(decimation) {
            replay.targets.push(time_s, targets.iter().copied());
            let reported = servos.states().iter().map(|s| s.position_rad);
            replay.servos.push(time_s, reported);
        }
        cycle += 1;
    }
    servos.disarm("the music is over")?;
    Ok(replay)
}
