//! The pelvis goes slowly against the weight of the arms, so that it rests on the middle
//! of the soles while they are stretched to one side.

use k::nalgebra::Vector3;

/// Time constant of each of two low-pass filters, seconds: the legs' servos shake with
/// what is quicker.
const SLOW_S: f64 = 1.5;

pub(crate) struct Counterweight {
    slow: [Vector3<f64>; 2],
    share: f64,
}

impl Counterweight {
    pub fn new(dt_s: f64) -> Self {
        Self { slow: [Vector3::zeros(); 2], share: dt_s / (SLOW_S + dt_s) }
    }

    pub fn restart(&mut self) {
        self.slow = [Vector3::zeros(); 2];
    }

    /// How far the pelvis is moved now, metres.
    pub fn shift(&self) -> Vector3<f64> {
        self.slow[1]
    }

    /// One cycle in which all of the weight would be in the middle with the pelvis at `wanted`.
    pub fn step(&mut self, wanted: Vector3<f64>) {
        let mut input = Vector3::new(wanted.x, wanted.y, 0.0);
        for slow in &mut self.slow {
            *slow += (input - *slow) * self.share;
            input = *slow;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 0.01;

    fn after(seconds: f64, wanted: impl Fn(f64) -> f64) -> Vector3<f64> {
        let mut counterweight = Counterweight::new(DT_S);
        for cycle in 0..(seconds / DT_S) as usize {
            counterweight.step(Vector3::new(0.0, wanted(cycle as f64 * DT_S), 0.5));
        }
        counterweight.shift()
    }

    #[test]
    fn arms_that_stay_out_are_met_and_the_height_is_left_alone() {
        let shift = after(15.0, |_| 0.02);
        assert!((shift.y - 0.02).abs() < 0.001, "{shift}");
        assert_eq!((shift.x, shift.z), (0.0, 0.0));
    }

    #[test]
    fn arms_that_swing_with_the_beat_leave_the_pelvis_still() {
        let shift = after(15.0, |time_s| 0.02 * (std::f64::consts::TAU * 2.0 * time_s).sin());
        assert!(shift.y.abs() < 0.0005, "{shift}");
    }
}
