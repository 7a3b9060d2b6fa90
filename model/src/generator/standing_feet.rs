//! Feet stand or are lifted: a foot that is low and slow stays where it came to stand, one that
//! is low and fast is raised over the floor.

use servodance_types::{BodyJoint, FRAME_RATE_HZ};

use crate::motion::{Pose, skeleton};

const FEET: [[BodyJoint; 2]; 2] =
    [[BodyJoint::LeftAnkle, BodyJoint::LeftFoot], [BodyJoint::RightAnkle, BodyJoint::RightFoot]];
/// A toe below this is on the floor, metres.
const FLOOR_M: f32 = 0.055;
/// A foot that is slower comes to stand; one that stands goes when it is faster, m/s.
const STANDS_M_S: f32 = 0.5;
const GOES_M_S: f32 = 1.0;
/// A foot goes that was led so far from where the dancer put it, metres.
const FARTHEST_M: f32 = 0.1;
/// How much of the way to where the dancer puts a foot is left after a frame.
const LEFT_OVER: f32 = 0.7;
/// How much of the way up, or down again, a foot goes in a frame: one that moves skates until it
/// is off the floor.
const RAISED: f32 = 0.95;

/// Both feet of one dance.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StandingFeet {
    feet: [StandingFoot; 2],
}

#[derive(Clone, Copy, Debug, Default)]
struct StandingFoot {
    /// The toe as the dancer put it last: x, y, z.
    last: Option<[f32; 3]>,
    /// Where it stands.
    place: Option<[f32; 2]>,
    /// What is added to where the dancer puts it.
    offset: [f32; 3],
}

impl StandingFeet {
    /// The pose with legs led to where its feet stand; bones keep their lengths.
    pub fn place(&mut self, mut pose: Pose) -> Pose {
        for (foot, joints) in self.feet.iter_mut().zip(FEET) {
            let offset = foot.offset(pose[joints[1] as usize]);
            for joint in joints {
                for (axis, by) in offset.iter().enumerate() {
                    pose[joint as usize][axis] += by;
                }
            }
        }
        skeleton::fit(&pose, 1.0)
    }
}

impl StandingFoot {
    fn offset(&mut self, toe: [f32; 3]) -> [f32; 3] {
        let last = self.last.replace(toe).unwrap_or(toe);
        let speed_m_s = distance([toe[0], toe[2]], [last[0], last[2]]) * FRAME_RATE_HZ as f32;
        let is_low = toe[1] < FLOOR_M;
        let slow_m_s = if self.place.is_some() { GOES_M_S } else { STANDS_M_S };
        let here = [toe[0] + self.offset[0], toe[2] + self.offset[2]];
        let place = self.place.unwrap_or(here);
        let stands =
            is_low && speed_m_s < slow_m_s && distance(place, [toe[0], toe[2]]) < FARTHEST_M;
        self.place = stands.then_some(place);
        let [x, y, z] = &mut self.offset;
        let raised = if is_low && !stands { FLOOR_M - toe[1] } else { 0.0 };
        *y += (raised - *y) * RAISED;
        (*x, *z) = match stands {
            true => (place[0] - toe[0], place[1] - toe[2]),
            false => (*x * LEFT_OVER, *z * LEFT_OVER),
        };
        self.offset
    }
}

fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dancer who stands; the left leg is put to (x, lift).
    fn pose(x: f32, lift: f32) -> Pose {
        let mut pose: Pose = std::array::from_fn(|_| [0.0; 3]);
        for (joint, height, ahead) in [(1, 0.85, 0.0), (4, 0.45, 0.05), (7, 0.06, 0.0)] {
            pose[joint] = [0.1, height, ahead];
            pose[joint + 1] = [-0.1, height, ahead];
        }
        for (joint, side) in [(10, 0.1), (11, -0.1)] {
            pose[joint] = [side, 0.02, 0.12];
        }
        for joint in [0, 3, 6, 9, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21] {
            pose[joint] = [0.0, 0.9 + 0.03 * joint as f32, 0.0];
        }
        for joint in [7, 10] {
            pose[joint][0] += x;
            pose[joint][1] += lift;
        }
        skeleton::fit(&pose, 1.0)
    }

    fn danced(x: impl Fn(usize) -> f32, lift: impl Fn(usize) -> f32) -> Vec<[f32; 3]> {
        let mut feet = StandingFeet::default();
        (0..30).map(|i| feet.place(pose(x(i), lift(i)))[10]).collect()
    }

    #[test]
    fn a_foot_that_slides_slowly_stands() {
        let toes = danced(|i| 0.08 * (0.4 * i as f32).sin(), |_| 0.0);
        let moved = toes.iter().map(|toe| (toe[0] - toes[0][0]).abs()).fold(0.0, f32::max);
        assert!(moved < 0.005, "{moved}");
    }

    #[test]
    fn a_foot_that_is_fast_on_the_floor_is_raised() {
        let toes = danced(|i| 0.06 * i.min(4) as f32, |_| 0.0);
        assert!(toes[3][1] > 0.045, "{toes:?}");
        assert!(toes[29][1] < 0.025, "{toes:?}");
    }

    #[test]
    fn a_foot_in_the_air_goes_where_the_dancer_puts_it() {
        let toes = danced(|i| 0.08 * (0.4 * i as f32).sin(), |_| 0.15);
        let asked = pose(0.08 * 4.0_f32.sin(), 0.15)[10];
        assert!((toes[10][0] - asked[0]).abs() < 1e-4, "{:?} {asked:?}", toes[10]);
    }
}
