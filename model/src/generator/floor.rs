//! Where the dancer may go: near where it began.

use crate::motion::Pose;

/// Inside this distance from the start the dancer goes where it wants, metres.
const FREE_RADIUS_M: f32 = 1.0;
/// At this distance no step leads further away, metres.
const WALL_RADIUS_M: f32 = 3.0;

/// Keeps the dancer near where it began: the further out, the less of every
/// outward step counts. Inward steps and standing feet are left alone.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FloorBounds {
    /// Root of the last frame as recovered, and as shown (x, z).
    recovered: [f32; 2],
    shown: [f32; 2],
}

impl FloorBounds {
    /// Stands at a point (x, z) of the recovered motion.
    pub fn at(root: [f32; 2]) -> Self {
        Self { recovered: root, shown: root }
    }

    /// The next pose, moved to where it is shown.
    pub fn place(&mut self, mut pose: Pose) -> Pose {
        let root = [pose[0][0], pose[0][2]];
        let mut step = [root[0] - self.recovered[0], root[1] - self.recovered[1]];
        let distance = self.shown[0].hypot(self.shown[1]);
        if distance > FREE_RADIUS_M {
            let out = self.shown.map(|v| v / distance);
            let outward = step[0] * out[0] + step[1] * out[1];
            let share = (distance - FREE_RADIUS_M) / (WALL_RADIUS_M - FREE_RADIUS_M);
            let taken = outward.max(0.0) * share.min(1.0);
            step = [step[0] - taken * out[0], step[1] - taken * out[1]];
        }
        self.recovered = root;
        self.shown = [self.shown[0] + step[0], self.shown[1] + step[1]];
        let shift = [self.shown[0] - root[0], self.shown[1] - root[1]];
        for point in &mut pose {
            point[0] += shift[0];
            point[2] += shift[1];
        }
        pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::JOINT_COUNT;

    #[test]
    fn a_straight_walk_stays_within_bounds() {
        let mut floor = FloorBounds::default();
        for i in 0..20_000 {
            let root = [0.05 * i as f32, 1.0, 0.02 * i as f32];
            let placed = floor.place([root; JOINT_COUNT]);
            let distance = placed[0][0].hypot(placed[0][2]);
            assert!(distance < WALL_RADIUS_M + 0.1, "{distance} m at frame {i}");
        }
    }

    #[test]
    fn near_the_start_nothing_is_moved() {
        let mut floor = FloorBounds::default();
        let pose = [[0.3, 1.0, -0.5]; JOINT_COUNT];
        assert_eq!(floor.place(pose), pose);
    }
}
