//! The same dance without compensation: what the servos would have done.
//!
//! After the dance its motion is danced once more at an even pace, by a fresh
//! retargeter on simulated servos of its own, in simulated time. Nothing of it
//! touches the dance that was.

use crate::control::bus_choice;
use crate::control::robot_buses::Rig;
use crate::control::trace::JointTrace;
use crate::robot::Robot;
use crate::session::config::Speed;
use servodance_drivers::EStop;
use servodance_types::MotionFrame;

/// Seconds of dance that are danced again; a longer one is judged by its beginning.
pub const MOST_S: f64 = 600.0;
/// Seconds from torque on to the music.
const PRELUDE_S: f64 = 4.0;

/// Targets and servos of an uncompensated dance.
pub struct Shadow {
    /// What the retargeter asked for.
    pub targets: JointTrace,
    /// What the servos reported.
    pub servos: JointTrace,
}

/// Dances `motion` once more, sent `lead_s` ahead of the music; one sample of
/// the traces every `decimation` cycles.
pub fn shadow(
    robot: &Robot,
    motion: &[MotionFrame],
    lead_s: f64,
    decimation: u64,
) -> anyhow::Result<Shadow> {
    let mut rig = Rig::open(
        robot,
        &bus_choice::choose(robot, &["sim".to_owned()])?,
        Speed::Max,
        &EStop::default(),
    )?;
    rig.arm()?;
    let mut retargeter = robot.retargeter()?;
    let mut targets: Vec<f64> = rig.states().iter().map(|s| s.position_rad).collect();
    retargeter.seed(&targets)?;
    let joints = targets.len();
    let mut shadow = Shadow {
        targets: JointTrace::new(joints),
        servos: JointTrace::new(joints),
    };
    let mut frames = motion.iter().peekable();
    // Of a long live run only the newest minutes are there.
    let first_s = motion.first().map_or(0.0, |f| f.time_s);
    let last_s = motion.last().map_or(0.0, |f| f.time_s);
    let end_s = last_s.min(first_s + MOST_S) - lead_s;
    let mut cycle = 0_u64;
    loop {
        let robot_s = cycle as f64 * robot.period_s();
        let time_s = first_s + robot_s - PRELUDE_S;
        if time_s > end_s {
            break;
        }
        let needed_s = time_s + lead_s + retargeter.lookahead_s() + robot.period_s();
        while let Some(frame) = frames.next_if(|frame| frame.time_s <= needed_s) {
            retargeter.push(frame);
        }
        retargeter.next(time_s + lead_s, &mut targets)?;
        rig.cycle(robot_s, &targets)?;
        if time_s >= first_s - 1e-9 && cycle.is_multiple_of(decimation) {
            shadow.targets.push(time_s, targets.iter().copied());
            let reported = rig.states().iter().map(|s| s.position_rad);
            shadow.servos.push(time_s, reported);
        }
        cycle += 1;
    }
    rig.disarm("the music is over")?;
    Ok(shadow)
}
