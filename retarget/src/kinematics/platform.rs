//! A plate that six rods carry, each on a servo's crank: a Stewart platform.
//!
//! Where the plate is for six crank angles is found by Newton's method: each rod keeps its
//! length, so that `(socket - pin) . twist of the plate = (socket - pin) . way of the pin`.
//! The same six rows give the plate's velocity for each crank, and so its column of the
//! Jacobian. The other way round, cranks for a pose of the plate, is a closed form
//! ([`Platform::crank_rad`]): the solver turns a head's cranks by it. Metres and radians, in the frame of the link that carries both.

use crate::kinematics::JointDrive;
use k::nalgebra::{
    Isometry3, Matrix6, Point3, Translation3, Unit, UnitQuaternion, Vector3, Vector6,
};

/// Steps of Newton's method, and the error of a rod's length that ends it.
const STEPS: usize = 8;
const CLOSE_M: f64 = 1e-10;
/// Longest step, metres and radians: far from home the rows bend.
const LONGEST_STEP: f64 = 0.5;

#[derive(Clone, Debug)]
pub(crate) struct Rod {
    pub drive: JointDrive,
    /// The crank's link, whose joint turns about `axis` in it.
    pub crank: usize,
    pub axis: Unit<Vector3<f64>>,
    /// The crank's frame in the carrier where the joint is zero.
    pub origin: Isometry3<f64>,
    /// Where the rod meets the crank, and the plate: in the frame of each.
    pub pin: Point3<f64>,
    pub socket: Point3<f64>,
    pub length_m: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Platform {
    pub plate: usize,
    pub carrier: usize,
    /// The plate in the carrier where all joints are zero.
    pub home: Isometry3<f64>,
    pub rods: [Rod; 6],
}

/// A velocity of the plate: shift of its origin, and turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twist {
    pub shift: Vector3<f64>,
    pub turn: Vector3<f64>,
}

impl Rod {
    fn pin_at(&self, crank_rad: f64) -> Point3<f64> {
        self.origin * (UnitQuaternion::from_axis_angle(&self.axis, crank_rad) * self.pin)
    }

    fn position(&self, positions: &[f64]) -> f64 {
        let joint = positions.get(self.drive.joint).copied().unwrap_or(0.0);
        self.drive.scale * joint + self.drive.offset
    }
}

impl Platform {
    /// Pose of the plate in the carrier; the nearest that was found where no pose keeps all
    /// rods' lengths.
    pub fn plate_in_carrier(&self, positions: &[f64]) -> Isometry3<f64> {
        let pins = self.rods.each_ref().map(|rod| rod.pin_at(rod.position(positions)));
        let mut pose = self.home;
        for _ in 0..STEPS {
            let mut rows = Matrix6::zeros();
            let mut errors = Vector6::zeros();
            for (index, (rod, pin)) in self.rods.iter().zip(&pins).enumerate() {
                let lever = pose.rotation * rod.socket.coords;
                let along = Point3::from(pose.translation.vector + lever) - pin;
                let length = along.norm().max(1e-9);
                rows.set_row(index, &row(&(along / length), &lever));
                errors[index] = rod.length_m - length;
            }
            if errors.amax() < CLOSE_M {
                break;
            }
            let Some(step) = rows.lu().solve(&errors) else { break };
            let step = step.map(|part| part.clamp(-LONGEST_STEP, LONGEST_STEP));
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
            pose = Isometry3::from_parts(
                Translation3::from(pose.translation.vector + step.fixed_rows::<3>(0)),
                turn * pose.rotation,
            );
        }
        pose
    }

    /// Velocity of the plate in the world for each rod's crank, rad/s, where links are at
    /// `poses`; nothing moves in a singular pose.
    pub fn twists(&self, poses: &[Isometry3<f64>]) -> [Twist; 6] {
        let plate = &poses[self.plate];
        let mut rows = Matrix6::zeros();
        let mut rates = Vector6::zeros();
        for (index, rod) in self.rods.iter().enumerate() {
            let lever = plate.rotation * rod.socket.coords;
            let crank = &poses[rod.crank];
            let pin = crank * rod.pin;
            let along = (Point3::from(plate.translation.vector + lever) - pin).normalize();
            let way = (crank.rotation * rod.axis.into_inner())
                .cross(&(pin.coords - crank.translation.vector));
            rows.set_row(index, &row(&along, &lever));
            rates[index] = along.dot(&way) * rod.drive.scale;
        }
        let inverse = rows.try_inverse().unwrap_or_else(Matrix6::zeros);
        std::array::from_fn(|index| {
            let column = inverse.column(index) * rates[index];
            Twist {
                shift: Vector3::new(column[0], column[1], column[2]),
                turn: Vector3::new(column[3], column[4], column[5]),
            }
        })
    }

    /// The cranks' angles that put the plate at a pose in the carrier, each on the side where
    /// its pin is at zero; `None` where a rod cannot reach.
    pub fn crank_rad(&self, plate: &Isometry3<f64>) -> Option<[f64; 6]> {
        let mut angles = [0.0; 6];
        for (angle, rod) in angles.iter_mut().zip(&self.rods) {
            // In the crank's frame at zero the pin runs on a circle about the axis:
            // |socket - pin|^2 = length^2 is a cosine of the angle.
            let socket = rod.origin.inverse() * (plate * rod.socket);
            let axis = rod.axis.into_inner();
            let height = rod.pin.coords.dot(&axis);
            let arm = rod.pin.coords - axis * height;
            let off = socket.coords - axis * socket.coords.dot(&axis);
            let beside = socket.coords.dot(&axis) - height;
            let side = axis.cross(&arm);
            let wanted = 0.5
                * (arm.norm_squared() + off.norm_squared() + beside * beside
                    - rod.length_m * rod.length_m);
            let (along, across) = (off.dot(&arm), off.dot(&side));
            let cosine = wanted / along.hypot(across);
            if cosine.is_nan() || cosine.abs() > 1.0 {
                return None;
            }
            let middle = across.atan2(along);
            let either = [middle + cosine.acos(), middle - cosine.acos()];
            let near = either.map(|angle| angle.sin().atan2(angle.cos()));
            *angle = if near[0].abs() < near[1].abs() { near[0] } else { near[1] };
        }
        Some(angles)
    }
}

/// What a twist of the plate, shift then turn, adds to a rod's length.
fn row(along: &Vector3<f64>, lever: &Vector3<f64>) -> k::nalgebra::RowVector6<f64> {
    let turn = lever.cross(along);
    k::nalgebra::RowVector6::new(along.x, along.y, along.z, turn.x, turn.y, turn.z)
}

#[cfg(test)]
mod tests {
    use crate::config::RetargetConfig;
    use crate::kinematics::{PosedRobot, RobotModel};
    use k::nalgebra::{Isometry3, Vector3};

    fn reachy_mini() -> RobotModel {
        let file: toml::Table =
            include_str!("../../../configs/reachy_mini.toml").parse().expect("a robot file");
        let config: RetargetConfig = file["retarget"].clone().try_into().expect("[retarget]");
        let servos = file["joint"].as_array().expect("[[joint]]");
        let names: Vec<&str> = servos.iter().map(|s| s["name"].as_str().expect("a name")).collect();
        let urdf = include_str!("../../../configs/reachy_mini.urdf");
        RobotModel::configured(urdf, &names, &config).expect("a model")
    }

    /// Positions of all servos from a seed: the body and six cranks within half a radian.
    fn positions(seed: u64) -> Vec<f64> {
        let part = |index: u64| ((seed * 7919 + index * 104_729) % 1000) as f64 / 1000.0 - 0.5;
        (0..9).map(part).collect()
    }

    #[test]
    fn cranks_of_a_pose_are_those_that_put_the_plate_there() {
        let model = reachy_mini();
        let platform = model.platform.as_ref().unwrap();
        for seed in 0..200 {
            let positions = positions(seed);
            let plate = platform.plate_in_carrier(&positions);
            let cranks = platform.crank_rad(&plate).expect("a pose within reach");
            for (rod, crank) in platform.rods.iter().zip(cranks) {
                let set = rod.position(&positions);
                assert!((set - crank).abs() < 1e-6, "{seed}: {set} {crank}");
            }
        }
        let far = Isometry3::translation(0.0, 0.0, 1.0);
        assert!(platform.crank_rad(&far).is_none());
    }

    #[test]
    fn twists_are_the_plate_s_velocity_for_each_crank() {
        let model = reachy_mini();
        let plate = model.platform.as_ref().unwrap().plate;
        const STEP: f64 = 1e-6;
        for seed in 0..20 {
            let at = positions(seed);
            let poses = model.link_poses(&at);
            let robot = PosedRobot::new(&model, &poses);
            let ancestors = &model.driven_ancestors[plate];
            assert_eq!(ancestors.len(), 7);
            let point = poses[plate] * k::nalgebra::Point3::new(0.02, -0.01, 0.05);
            let in_plate = poses[plate].inverse() * point;
            let mut jacobian = crate::kinematics::Jacobian::new(9, 9);
            jacobian.add_point(&robot, plate, &point, 1.0);
            for (joint, column) in jacobian.columns() {
                let mut moved = at.clone();
                moved[*joint] += STEP;
                let there = model.link_poses(&moved)[plate] * in_plate;
                let velocity: Vector3<f64> = (there - point) / STEP;
                assert!((velocity - column).norm() < 1e-4, "{joint}: {velocity} {column}");
            }
        }
    }
}
