//! What share of the arms' movement feet that stay can carry.
//!
//! Swings that push the zero-moment point towards the edges of the soles rock the robot on
//! them, and each swing adds to the last. The time that the point spends beyond its limit
//! is added up over two seconds, and the arms swing less for as long: a share that changed
//! with the beat would itself move the point. Each joint gives way by what it does to the point
//! (`zmp_weights`). Ordinary swings cost next to nothing, wild ones most
//! of their size. What arms that stay out weigh does not count: the pelvis goes against that
//! (`counterweight`).

use k::nalgebra::Vector3;

use crate::contact::SupportPolygon;
use crate::dynamics::GRAVITY_M_S2;

/// For how long a swing counts, less and less, seconds: a dance that begins later shows the
/// same after so long.
const MEMORY_S: f64 = 1.9;
/// In time constants of the robot's fall (the root of height over gravity): over how long
/// accelerations are measured, and how long beyond, by half a sole, halves the arms' movement.
const MEASURED: f64 = 0.5;
const HALVES: f64 = 0.6;
/// The share of a dance that begins: what its arms will do is not known yet.
const FIRST_SHARE: f64 = 0.3;

pub(crate) struct ArmShare {
    /// Cycles between the positions by which accelerations are measured.
    pub step: usize,
    /// `arm_zmp_limit`: the way from the middle to the sole's edge is 1.
    zmp_limit: f64,
    /// By joint.
    weights: Vec<f64>,
    halves_s: f64,
    dt_s: f64,
    /// How far beyond the limit in the last cycles, in half soles; a ring.
    beyond: Vec<f64>,
    next: usize,
}

impl ArmShare {
    /// `height_m`: of the centre of mass above the feet; `weights` by joint: see `zmp_weights`.
    pub fn new(height_m: f64, zmp_limit: f64, weights: Vec<f64>, dt_s: f64) -> Self {
        let fall_s = (height_m.max(0.01) / GRAVITY_M_S2).sqrt();
        let mut arms = Self {
            step: ((MEASURED * fall_s / dt_s).round() as usize).max(1),
            zmp_limit,
            weights,
            halves_s: HALVES * fall_s,
            dt_s,
            beyond: vec![0.0; (MEMORY_S / dt_s).ceil() as usize],
            next: 0,
        };
        arms.restart();
        arms
    }

    /// As if the dance so far had left [`FIRST_SHARE`].
    pub fn restart(&mut self) {
        self.beyond.fill(1.0);
        let wanted_s = self.halves_s * (1.0 / FIRST_SHARE - 1.0).sqrt();
        let beyond = wanted_s / self.beyond_s();
        self.beyond.fill(beyond);
    }

    /// The share after one cycle in which the whole of the arms' movement would put the
    /// zero-moment point at `swing` from the centre of mass.
    pub fn share(&mut self, swing: &Vector3<f64>, support: &SupportPolygon) -> f64 {
        let middle = support.middle();
        let beyond = support.edges.iter().map(|edge| {
            let half_m = (edge.offset_m - edge.normal.dot(&middle)).max(1e-3);
            edge.normal.dot(swing) / half_m - self.zmp_limit
        });
        self.beyond[self.next] = beyond.fold(0.0, f64::max);
        self.next = (self.next + 1) % self.beyond.len();
        1.0 / (1.0 + (self.beyond_s() / self.halves_s).powi(2))
    }

    /// What of a joint's movement is left where the arms keep `share`.
    pub fn of_joint(&self, joint: usize, share: f64) -> f64 {
        share.powf(self.weights[joint])
    }

    /// Time beyond, weighted by how far and how long ago.
    fn beyond_s(&self) -> f64 {
        let (newer, older) = self.beyond.split_at(self.next);
        let by_age = newer.iter().rev().chain(older.iter().rev()).enumerate();
        let weight = |age: usize| 1.0 - (age as f64 / self.beyond.len() as f64).powi(2);
        by_age.map(|(age, beyond)| weight(age) * beyond).sum::<f64>() * self.dt_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use k::nalgebra::Isometry3;

    const DT_S: f64 = 0.01;

    /// The share after swings of a size (the soles' half is 0.1 m) and a time of rest.
    fn share_after(swing_m: f64, zmp_limit: f64, swings_s: f64, rests_s: f64) -> f64 {
        let foot = |y: f64| Isometry3::translation(0.0, y, 0.0);
        let support = SupportPolygon::new(&[foot(0.1), foot(-0.1)], [0.2, 0.1]);
        let mut arms = ArmShare::new(0.8, zmp_limit, Vec::new(), DT_S);
        let mut share = 1.0;
        for cycle in 0..((swings_s + rests_s) / DT_S) as usize {
            let time_s = cycle as f64 * DT_S;
            let swing_m = if time_s < swings_s { swing_m } else { 0.0 };
            let swing = Vector3::new(swing_m * (6.0 * time_s).sin(), 0.0, 0.0);
            share = arms.share(&swing, &support);
        }
        share
    }

    #[test]
    fn a_joint_that_weighs_less_keeps_more() {
        let arms = ArmShare::new(0.8, 0.6, vec![1.0, 0.5, 0.0], DT_S);
        assert_eq!([0, 1, 2].map(|joint| arms.of_joint(joint, 0.25)), [0.25, 0.5, 1.0]);
    }

    #[test]
    fn swings_inside_the_limit_keep_their_size() {
        assert_eq!(share_after(0.05, 0.6, 10.0, 0.0), 1.0);
        assert!(share_after(0.05, 0.3, 10.0, 0.0) < 0.9);
    }

    #[test]
    fn swings_beyond_the_limit_shrink_one_by_one_and_are_forgotten_in_two_seconds() {
        let shares = [0.5, 1.0, 1.5].map(|swings_s| share_after(0.12, 0.6, swings_s, 0.0));
        assert!(shares.is_sorted_by(|a, b| a > b) && shares[2] < 0.5, "{shares:?}");
        let later = [0.5, 1.5, 2.0].map(|rests_s| share_after(0.12, 0.6, 1.5, rests_s));
        assert!(later.is_sorted() && later[0] < 0.7 && later[2] == 1.0, "{later:?}");
    }
}
