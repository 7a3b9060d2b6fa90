//! The four feet of a quadruped: where they stand, and where its trunk is over them.

use crate::contact::PelvisTrajectory;
use crate::kinematics::BodyMap;
use k::nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Feet that stand, in the order front left, front right, hind left, hind right.
pub(crate) struct FourFeet {
    pub links: [usize; 4],
    /// Where they stand, and where the root link is at rest; the floor is at z = 0.
    pub places: [Point3<f64>; 4],
    pub root: Isometry3<f64>,
    /// Where the trunk goes, from its place at rest: inside rates that the legs can keep.
    trunk: PelvisTrajectory,
    /// Length of a leg, metres.
    leg_m: f64,
}

impl FourFeet {
    /// Feet that stand at `places` while the root link is at `root`; `rates` are the time
    /// of a cycle and of the preview, seconds.
    pub fn new(
        links: [usize; 4],
        places: [Point3<f64>; 4],
        root: Isometry3<f64>,
        leg_m: f64,
        [dt_s, preview_s]: [f64; 2],
    ) -> Self {
        let trunk = PelvisTrajectory::new(Isometry3::identity(), 1.0, dt_s, preview_s, 1.0);
        Self { links, places, root, trunk, leg_m }
    }

    /// Everything stands still again.
    pub fn restart(&mut self) {
        self.trunk.restart();
    }

    /// Where each foot is to be in this cycle, see [`seen_from`](Self::seen_from); the trunk
    /// is to be at `wanted` when the preview ends.
    pub fn step(&mut self, wanted: &[f64; 6]) -> [Point3<f64>; 4] {
        let trunk = self.trunk.step(wanted);
        self.seen_from(&trunk)
    }

    pub fn work(&self) -> u64 {
        self.trunk.work()
    }

    /// The links that stand; `None` unless all four are there.
    pub fn links(map: &BodyMap) -> Option<[usize; 4]> {
        let [front_left, front_right] = map.arms.map(|leg| leg.hand);
        let [hind_left, hind_right] = map.legs.map(|leg| leg.sole);
        Some([front_left?, front_right?, hind_left?, hind_right?])
    }

    /// Where each foot is to be in the world of a solver whose root link stays at rest,
    /// while the trunk goes to `trunk` (shifts in leg lengths).
    fn seen_from(&self, trunk: &Isometry3<f64>) -> [Point3<f64>; 4] {
        let mut moved = *trunk;
        moved.translation.vector *= self.leg_m;
        let middle = Translation3::from(self.root.translation.vector);
        let back = middle * moved.inverse() * middle.inverse();
        self.places.map(|place| back * place)
    }

    /// Where the root link is if the feet are at `seen` in it and stand in their places:
    /// the best fit of four points.
    pub fn world_from_root(&self, seen: [Point3<f64>; 4]) -> Isometry3<f64> {
        let mean = |points: &[Point3<f64>; 4]| {
            points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / 4.0
        };
        let (there, here) = (mean(&self.places), mean(&seen));
        let products = self.places.iter().zip(&seen);
        let products: Matrix3<f64> =
            products.map(|(a, b)| (a.coords - there) * (b.coords - here).transpose()).sum();
        let svd = products.svd(true, true);
        let rotation = match (svd.u, svd.v_t) {
            (Some(u), Some(v_t)) => {
                // A reflection is no way to stand.
                let sign = (u * v_t).determinant().signum();
                let turned = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turned))
            }
            _ => self.root.rotation,
        };
        Isometry3::from_parts(Translation3::from(there - rotation * here), rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_trunk_is_found_again_over_its_feet() {
        let root = Isometry3::translation(0.0, 0.0, 0.3);
        let places = [[0.2, 0.1], [0.2, -0.1], [-0.2, 0.1], [-0.2, -0.1]]
            .map(|[x, y]| Point3::new(x, y, 0.0));
        let feet = FourFeet::new([0; 4], places, root, 0.4, [0.01, 0.3]);
        let turned = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3);
        let trunk = Isometry3::from_parts(Translation3::new(0.02, -0.05, -0.1), turned);
        let seen = feet.seen_from(&trunk).map(|place| root.inverse() * place);
        let found = feet.world_from_root(seen);
        let wanted = root.translation.vector + trunk.translation.vector * 0.4;
        assert!((found.translation.vector - wanted).norm() < 1e-9, "{found}");
        assert!(found.rotation.angle_to(&turned) < 1e-9, "{found}");
    }
}
