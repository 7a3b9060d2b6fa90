//! Takes out the tremble that codes leave in the motion as they change from frame to frame: an
//! alpha-beta filter, which does not lag behind steady movement.

use crate::motion::representation::{JOINTS_AT, POSE_DIM, PoseVector, STEPS_AT};

/// Share of the newest frame in what is shown, and in its speed.
const ALPHA: f32 = 0.79;
const BETA: f32 = 0.66;

/// The motion that was shown last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SmoothMotion {
    last: Option<Shown>,
}

#[derive(Clone, Copy, Debug)]
struct Shown {
    vector: PoseVector,
    /// To the next frame.
    change: PoseVector,
}

impl SmoothMotion {
    /// The next frame, smoothed; contacts and joint steps are left as they are.
    pub fn push(&mut self, vector: PoseVector) -> PoseVector {
        let Some(Shown { vector: last, mut change }) = self.last else {
            self.last = Some(Shown { vector, change: [0.0; POSE_DIM] });
            return vector;
        };
        let mut shown = vector;
        // Steps of the root are speeds already.
        for i in 0..JOINTS_AT - 1 {
            shown[i] = last[i] + ALPHA * (vector[i] - last[i]);
        }
        for i in JOINTS_AT - 1..STEPS_AT {
            let expected = last[i] + change[i];
            let off = vector[i] - expected;
            shown[i] = expected + ALPHA * off;
            change[i] += BETA * off;
        }
        self.last = Some(Shown { vector: shown, change });
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wrist of which `at` gives the place in each of 100 frames.
    fn shown(at: impl Fn(usize) -> f32) -> Vec<f32> {
        let mut smooth = SmoothMotion::default();
        let frame = |i: usize| {
            let mut vector = [0.0; POSE_DIM];
            vector[66] = at(i);
            smooth.push(vector)[66]
        };
        (0..100).map(frame).collect()
    }

    #[test]
    fn steady_movement_is_shown_without_lag() {
        let shown = shown(|i| 0.05 * i as f32);
        assert!((shown[20] - 1.0).abs() < 1e-3 && (shown[99] - 4.95).abs() < 1e-4, "{shown:?}");
    }

    #[test]
    fn tremble_is_less_and_a_swing_of_one_second_stays() {
        let size = |shown: &[f32]| shown[50..].iter().fold(0.0_f32, |most, v| most.max(v.abs()));
        let tremble = size(&shown(|i| if i % 2 == 0 { 0.01 } else { -0.01 }));
        let swing = size(&shown(|i| 0.2 * (0.1 * std::f32::consts::PI * i as f32).sin()));
        assert!(tremble < 0.0085 && (0.199..0.206).contains(&swing), "{tremble} {swing}");
    }
}
