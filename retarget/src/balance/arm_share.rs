//! What share of the arms' movement feet that stay can carry.
//!
//! Swings that push the zero-moment point beyond the soles rock the robot on their edges, and
//! each swing adds to the last. The time that the point spends beyond is added up and fades
//! over seconds, and the arms swing less for as long: a share that changed with the beat would
//! itself move the point. Ordinary swings cost next to nothing, wild ones most of their size.

use k::nalgebra::Vector3;

use crate::contact::SupportPolygon;
use crate::dynamics::GRAVITY_M_S2;

/// Time in which what was added up fades, seconds.
const FADE_S: f64 = 3.0;
/// In time constants of the robot's fall (the root of height over gravity): over how long
/// accelerations are measured, and how long beyond, by half a sole, halves the arms' movement.
const MEASURED: f64 = 0.5;
const HALVES: f64 = 0.2;

pub(super) struct ArmShare {
    /// Cycles between the positions by which accelerations are measured.
    pub step: usize,
    halves_s: f64,
    dt_s: f64,
    /// Time beyond, weighted by how far, in half soles.
    beyond_s: f64,
}

impl ArmShare {
    /// `height_m`: of the centre of mass above the feet.
    pub fn new(height_m: f64, dt_s: f64) -> Self {
        let fall_s = (height_m.max(0.01) / GRAVITY_M_S2).sqrt();
        Self {
            step: ((MEASURED * fall_s / dt_s).round() as usize).max(1),
            halves_s: HALVES * fall_s,
            dt_s,
            beyond_s: 0.0,
        }
    }

    pub fn restart(&mut self) {
        self.beyond_s = 0.0;
    }

    /// The share after one cycle in which the whole of the arms' movement would put the
    /// zero-moment point at `zmp`.
    pub fn share(&mut self, zmp: &Vector3<f64>, support: &SupportPolygon) -> f64 {
        let middle = support.middle();
        let beyond = support.edges.iter().map(|edge| {
            let half_m = (edge.offset_m - edge.normal.dot(&middle)).max(1e-3);
            edge.normal.dot(&(zmp - middle)) / half_m - 1.0
        });
        let beyond = beyond.fold(0.0, f64::max);
        self.beyond_s += (beyond - self.beyond_s / FADE_S) * self.dt_s;
        1.0 / (1.0 + (self.beyond_s / self.halves_s).powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use k::nalgebra::Isometry3;

    const DT_S: f64 = 0.01;

    fn share_after(swing_m: f64, swings_s: f64, rests_s: f64) -> f64 {
        let foot = |y: f64| Isometry3::translation(0.0, y, 0.0);
        let support = SupportPolygon::new(&[foot(0.1), foot(-0.1)], [0.2, 0.1]);
        let mut arms = ArmShare::new(0.8, DT_S);
        let mut share = 1.0;
        for cycle in 0..((swings_s + rests_s) / DT_S) as usize {
            let time_s = cycle as f64 * DT_S;
            let swing_m = if time_s < swings_s { swing_m } else { 0.0 };
            let zmp = Vector3::new(swing_m * (6.0 * time_s).sin(), 0.0, 0.0);
            share = arms.share(&zmp, &support);
        }
        share
    }

    #[test]
    fn swings_inside_the_soles_keep_their_size() {
        assert_eq!(share_after(0.09, 10.0, 0.0), 1.0);
    }

    #[test]
    fn swings_beyond_the_soles_shrink_one_by_one_and_come_back_over_seconds() {
        let shares = [0.5, 1.0, 2.0].map(|swings_s| share_after(0.15, swings_s, 0.0));
        assert!(shares.is_sorted_by(|a, b| a > b) && shares[2] < 0.5, "{shares:?}");
        let later = [2.0, 8.0, 30.0].map(|rests_s| share_after(0.15, 2.0, rests_s));
        assert!(later.is_sorted() && later[0] < 0.5 && later[2] > 0.99, "{later:?}");
    }
}
