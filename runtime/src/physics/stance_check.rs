//! What a robot on its feet can take, in a sentence: it stands, is pushed and dances in
//! the simulated world.

use serde::Serialize;
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

use super::push_search::survived_push_ns;
use super::standing_trial::{StandingTrial, TrialOptions};
use crate::robot::Robot;

/// Seconds of standing in which a push comes.
const PUSHED_S: f64 = 5.0;
const DIRECTIONS: [(&str, [f64; 2]); 4] = [
    ("the front", [-1.0, 0.0]),
    ("behind", [1.0, 0.0]),
    ("the left", [0.0, -1.0]),
    ("the right", [0.0, 1.0]),
];

/// What was seen of one robot in the simulated world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StanceCheck {
    /// When it fell in the dance, seconds; `None` if it stayed on its feet.
    pub fell_s: Option<f64>,
    /// Seconds of the dance.
    pub danced_s: f64,
    /// Lean of the pelvis that was not planned, degrees RMS.
    pub tilt_beyond_plan_rms_deg: f64,
    /// The largest push that it survives while it stands, newton seconds: from the front,
    /// from behind, from the left, from the right.
    pub survived_push_ns: [f64; 4],
}

impl StanceCheck {
    /// Lets the robot stand, be pushed and dance `dance`.
    pub fn of(robot: &Robot, dance: &[MotionFrame]) -> anyhow::Result<Self> {
        let still: Vec<MotionFrame> = (0..(PUSHED_S * FRAME_RATE_HZ) as usize)
            .filter_map(|index| {
                let time_s = index as f64 / FRAME_RATE_HZ;
                Some(MotionFrame { time_s, ..*dance.first()? })
            })
            .collect();
        let options = TrialOptions { feedback: robot.imu.is_some(), ..TrialOptions::default() };
        let danced = StandingTrial::new(robot, options)?.run(dance, |_, _, _| ())?;
        let pushed = std::thread::scope(|scope| {
            let search = |towards| survived_push_ns(robot, &still, options, towards);
            let found = DIRECTIONS.map(|(_, towards)| scope.spawn(move || search(towards)));
            found.map(|thread| {
                let panicked = |_| Err(anyhow::anyhow!("a trial in the simulated world panicked"));
                thread.join().unwrap_or_else(panicked)
            })
        });
        let mut survived_ns = [0.0; 4];
        for (survived, found) in survived_ns.iter_mut().zip(pushed) {
            *survived = found?;
        }
        Ok(Self {
            fell_s: danced.fell_s,
            danced_s: danced.danced_s,
            tilt_beyond_plan_rms_deg: danced.tilt_beyond_plan_rms_deg,
            survived_push_ns: survived_ns,
        })
    }

    /// A line for people.
    pub fn line(&self) -> String {
        let pushes: Vec<String> = DIRECTIONS
            .iter()
            .zip(self.survived_push_ns)
            .map(|((from, _), impulse)| format!("{impulse:.1} from {from}"))
            .collect();
        let pushes = format!("takes pushes of {} (N s)", pushes.join(", "));
        match self.fell_s {
            Some(fell_s) => {
                format!("in the simulated world: falls after {fell_s:.1} s of dance; {pushes}")
            }
            None => format!(
                "in the simulated world: stays on its feet for {:.0} s of dance, {:.1} degrees RMS \
                 off its plan; {pushes}",
                self.danced_s, self.tilt_beyond_plan_rms_deg
            ),
        }
    }
}
