//! How hard arms and pelvis may accelerate on feet that stay: by what each does, alone and
//! from the rest pose, to the zero-moment point. The preview then plans with limits that the
//! soles can carry, in place of movement that the governor has to take back.

use k::nalgebra::Vector3;

use super::zmp_governor::LEG_SHARE;
use crate::contact::SupportPolygon;
use crate::dynamics::GRAVITY_M_S2;
use crate::kinematics::PosedRobot;

/// Share of the way from the middle to the sole's edge that each may take: a joint above the
/// legs, the pelvis's sway, its turns. They add up.
const JOINT_SHARE: f64 = 0.4;
const SWAY_SHARE: f64 = 0.3;
const TURN_SHARE: f64 = 0.12;

pub(crate) struct CarriedAcceleration<'a> {
    pub robot: PosedRobot<'a>,
    pub support: &'a SupportPolygon,
    /// By link: whether it belongs to a leg that stands.
    pub is_leg: &'a [bool],
}

impl CarriedAcceleration<'_> {
    /// Radians per second squared by joint; infinite for joints of legs.
    pub fn joints(&self) -> Vec<f64> {
        let model = self.robot.model;
        let mut shifts = vec![Vector3::zeros(); model.joint_names().len()];
        for index in (0..model.links.len()).filter(|&index| !self.is_leg[index]) {
            let com = self.robot.poses[index] * model.links[index].com;
            for ancestor in &model.driven_ancestors[index] {
                shifts[ancestor.joint] += self.shift(index, &self.robot.velocity(ancestor, &com));
            }
        }
        shifts.iter().map(|shift| JOINT_SHARE * self.to_edge(shift)).collect()
    }

    /// Of the pelvis: sway along x and y and no limit along z, metres per second squared;
    /// turns about x, y and z, radians per second squared.
    pub fn pelvis(&self) -> [f64; 6] {
        let root = self.robot.origin(0);
        let all = |rate: &dyn Fn(usize) -> Vector3<f64>| {
            let links = 0..self.robot.model.links.len();
            self.to_edge(&links.map(|index| self.shift(index, &rate(index))).sum())
        };
        let sway = |along: Vector3<f64>| {
            SWAY_SHARE * all(&|index| along * if self.is_leg[index] { LEG_SHARE } else { 1.0 })
        };
        let turn = |about: Vector3<f64>| {
            let rate = |index: usize| match self.is_leg[index] {
                true => Vector3::zeros(),
                false => about.cross(&(self.com(index) - root.coords)),
            };
            TURN_SHARE * all(&rate)
        };
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        [sway(x), sway(y), f64::INFINITY, turn(x), turn(y), turn(z)]
    }

    fn com(&self, link: usize) -> Vector3<f64> {
        (self.robot.poses[link] * self.robot.model.links[link].com).coords
    }

    /// How far a link that accelerates so moves the zero-moment point, metres.
    fn shift(&self, link: usize, acceleration: &Vector3<f64>) -> Vector3<f64> {
        let model = self.robot.model;
        let weight = model.links.iter().map(|link| link.mass_kg).sum::<f64>() * GRAVITY_M_S2;
        let force = acceleration * (model.links[link].mass_kg / weight);
        let moment = self.com(link).cross(&force);
        let resting = model.centre_of_mass(self.robot.poses);
        Vector3::new(-moment.y - resting.x * force.z, moment.x - resting.y * force.z, 0.0)
    }

    /// How many times such a shift fits between the middle of the soles and an edge.
    fn to_edge(&self, shift: &Vector3<f64>) -> f64 {
        let middle = self.support.middle();
        let times = self.support.edges.iter().map(|edge| {
            let way = edge.normal.dot(shift).abs();
            let reach = edge.offset_m - edge.normal.dot(&middle);
            if way > 1e-9 { reach / way } else { f64::INFINITY }
        });
        times.fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::RobotModel;
    use k::nalgebra::Isometry3;

    /// A mast of 10 kg at 1 m over the feet, with an arm of 1 kg that hangs 0.4 m below a
    /// shoulder at 1.2 m.
    const MAST: &str = r#"<robot name="mast"><link name="base"><inertial><origin xyz="0 0 1"/>
        <mass value="10"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/>
        <origin xyz="0 0 1.2"/><axis xyz="0 1 0"/>
        <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
        <link name="arm"><inertial><origin xyz="0 0 -0.4"/><mass value="1"/>
        <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;

    #[test]
    fn an_arm_and_a_mast_are_limited_by_their_moments_about_the_feet() {
        let model = RobotModel::new(MAST, &["shoulder"]).unwrap();
        let mut poses = vec![Isometry3::identity(); model.links.len()];
        model.place(&Isometry3::identity(), &[0.0], &mut poses);
        let foot = |y: f64| Isometry3::translation(0.0, y, 0.0);
        let support = SupportPolygon::new(&[foot(0.1), foot(-0.1)], [0.2, 0.1]);
        let carried = CarriedAcceleration {
            robot: PosedRobot::new(&model, &poses),
            support: &support,
            is_leg: &[false, false],
        };
        // 1 kg, 0.4 m from its axis, 0.8 m over the floor; 0.1 m to the edge at 11 kg.
        let edge_nm = 0.1 * 11.0 * GRAVITY_M_S2;
        let arm = carried.joints()[0];
        assert!((arm - JOINT_SHARE * edge_nm / (0.4 * 0.8)).abs() < 1e-6, "{arm}");
        let [x, y, z, ..] = carried.pelvis();
        let sway = SWAY_SHARE * edge_nm / (10.0 + 0.8);
        assert!((x - sway).abs() < 1e-6, "{x}");
        assert!((y - 1.5 * sway).abs() < 1e-6, "{y}");
        assert!(z.is_infinite());
    }
}
