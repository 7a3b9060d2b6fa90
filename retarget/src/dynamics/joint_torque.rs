//! What the motion costs the motors: torque and heat, estimated.
//!
//! Each link's force is its mass times gravity and the second difference of where
//! the outputs of three cycles put its centre of mass; its moment is the change of
//! its angular momentum about that. A joint carries the moment of all that is beyond it about its axis. A
//! joint of a leg that stands carries the floor's force as well: it acts at the
//! zero-moment point and is shared between the feet by where that is.
//! Friction and rotor inertia are left out.
//!
//! Two things follow, limb by limb: an overloaded ankle costs the legs and the
//! pelvis, not the arms. A torque near the limit lowers the limb's amplitude within
//! a third of a second. Heat lowers it slowly: the square of torque over the
//! torque that can be held for ever, averaged over minutes; 1 is where a servo
//! shuts down. Joints without a limit or without mass beyond them are left out
//! and counted as unknown. Newton metres, seconds; nothing allocates per cycle.

use crate::config::{EVERY_LIMB, Limb, TorqueConfig};
use crate::kinematics::{JointMotion, RobotModel};
use k::nalgebra::{Isometry3, Point3, Vector3};
use servodance_types::HeldBack;

pub(crate) const GRAVITY_M_S2: f64 = 9.81;
/// Share of the torque limit from which the amplitude is lowered, and the time
/// constants of lowering and of recovering, seconds.
const EASED_FROM: f64 = 0.8;
const EASE_S: f64 = 0.3;
const RECOVER_S: f64 = 3.0;
/// Heat from which the amplitude is lowered; 1 is shutdown.
const WARM: f64 = 0.7;
/// The amplitude is never lowered further.
const LEAST: f64 = 0.2;
/// A share above this is all of the movement to those who watch.
const FELT: f64 = 0.98;

/// Torque and heat of a run, for the report.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueReport {
    /// Joints whose torque can be estimated: they have a limit and carry mass.
    pub known_joints: usize,
    /// The hottest joint so far and its heat; 1 is where a servo shuts down.
    pub hottest: Option<(String, f64)>,
    /// The joint nearest to its torque limit so far, and the share of it.
    pub strongest: Option<(String, f64)>,
    /// Share of the amplitude that torque and heat left at worst.
    pub lowest_amplitude: f64,
    /// Cycles in which a joint needed more torque than its limit.
    pub overloaded_cycles: u64,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct StanceFoot {
    pub sole: usize,
    pub down: bool,
}

const LIMBS: usize = EVERY_LIMB.len();

pub(crate) struct TorqueEstimator {
    limits_nm: Vec<Option<f64>>,
    /// The limb that each joint's load lowers, as a number.
    limbs: Vec<usize>,
    config: TorqueConfig,
    dt_s: f64,
    /// Centres of mass of the links in the last two cycles.
    before: [Vec<Point3<f64>>; 2],
    /// Poses of the links in the last cycle: the one that accelerations are of.
    poses: Vec<Isometry3<f64>>,
    /// Angular momentum of each link about its centre of mass on the way to that cycle.
    spins: Vec<Vector3<f64>>,
    cycles: usize,
    down: Option<[bool; 2]>,
    zmp: Option<Point3<f64>>,
    /// Force and moment about the origin of what is at and beyond each link.
    forces: Vec<Vector3<f64>>,
    moments: Vec<Vector3<f64>>,
    torque_nm: Vec<f64>,
    heat: Vec<f64>,
    hottest: Vec<f64>,
    strongest: Vec<f64>,
    ease: [f64; LIMBS],
    lowest: f64,
    overloaded: u64,
}

impl TorqueEstimator {
    /// `limits_nm` by joint, `None` where unknown; the load of a joint lowers the
    /// amplitude of its limb in `limbs`.
    pub fn new(
        model: &RobotModel,
        mut limits_nm: Vec<Option<f64>>,
        limbs: &[Limb],
        config: TorqueConfig,
        dt_s: f64,
    ) -> Self {
        for (joint, limit) in limits_nm.iter_mut().enumerate() {
            let carries = |link: usize| {
                let moved =
                    model.driven_ancestors[link].iter().any(|ancestor| ancestor.joint == joint);
                moved && model.links[link].mass_kg > 0.0
            };
            if !(0..model.links.len()).any(carries) {
                *limit = None;
            }
        }
        let (links, joints) = (model.links.len(), limits_nm.len());
        Self {
            limits_nm,
            limbs: limbs.iter().map(|limb| *limb as usize).collect(),
            config,
            dt_s,
            before: [vec![Point3::origin(); links], vec![Point3::origin(); links]],
            poses: vec![Isometry3::identity(); links],
            spins: vec![Vector3::zeros(); links],
            cycles: 0,
            down: None,
            zmp: None,
            forces: vec![Vector3::zeros(); links],
            moments: vec![Vector3::zeros(); links],
            torque_nm: vec![0.0; joints],
            heat: vec![0.0; joints],
            hottest: vec![0.0; joints],
            strongest: vec![0.0; joints],
            ease: [1.0; LIMBS],
            lowest: 1.0,
            overloaded: 0,
        }
    }

    /// Nothing is known of how the robot moved before.
    pub fn restart(&mut self) {
        self.cycles = 0;
        self.torque_nm.fill(0.0);
    }

    /// Share of the movement that torque and heat leave a limb.
    pub fn amplitude(&self, limb: Limb) -> f64 {
        self.ease[limb as usize].min(self.cool(limb))
    }

    /// Which of the two leaves it less than all of its movement.
    pub fn held_back(&self, limb: Limb) -> HeldBack {
        match (self.ease[limb as usize], self.cool(limb)) {
            (ease, cool) if ease.min(cool) > FELT => HeldBack::Nothing,
            (ease, cool) if ease < cool => HeldBack::Torque,
            _ => HeldBack::Heat,
        }
    }

    fn cool(&self, limb: Limb) -> f64 {
        let limb = limb as usize;
        let heat = self.heat.iter().zip(&self.limbs).filter(|(_, own)| **own == limb);
        let hottest = heat.map(|(heat, _)| *heat).fold(0.0, f64::max);
        let cool = 1.0 - ((hottest - WARM) / (1.0 - WARM)).clamp(0.0, 1.0);
        LEAST + (1.0 - LEAST) * cool
    }

    /// Takes in one cycle: the poses of the links in the world.
    pub fn observe(
        &mut self,
        model: &RobotModel,
        poses: &[Isometry3<f64>],
        feet: Option<[StanceFoot; 2]>,
    ) {
        let down = feet.map(|feet| feet.map(|foot| foot.down));
        if down != std::mem::replace(&mut self.down, down) {
            // Another foot is now what the world hangs from.
            self.cycles = 0;
        }
        self.sum_forces(model, poses);
        if let Some(feet) = feet {
            self.stand(model, feet);
        }
        // What is known in the first cycles is no acceleration: what was known before stays.
        self.cycles += 1;
        if self.cycles > 2 {
            self.turn_into_torque(model);
            self.judge();
        }
        self.poses.copy_from_slice(poses);
    }

    fn turn_into_torque(&mut self, model: &RobotModel) {
        self.torque_nm.fill(0.0);
        for (index, link) in model.links.iter().enumerate() {
            let Some(drive) = link.drive else { continue };
            let pose = &self.poses[index];
            let torque = match link.motion {
                JointMotion::Revolute(axis) => {
                    let about =
                        self.moments[index] - pose.translation.vector.cross(&self.forces[index]);
                    (pose.rotation * axis.into_inner()).dot(&about)
                }
                JointMotion::Prismatic(axis) => {
                    (pose.rotation * axis.into_inner()).dot(&self.forces[index])
                }
                JointMotion::Fixed | JointMotion::Platform => 0.0,
            };
            self.torque_nm[drive.joint] += drive.scale * torque;
        }
    }

    /// Gathers force and moment from the leaves to the root.
    fn sum_forces(&mut self, model: &RobotModel, poses: &[Isometry3<f64>]) {
        let [last, before] = &mut self.before;
        for (index, (link, pose)) in model.links.iter().zip(poses).enumerate() {
            let com = pose * link.com;
            let acceleration = (com - last[index]) - (last[index] - before[index]);
            let acceleration = acceleration / (self.dt_s * self.dt_s);
            let force = (acceleration + Vector3::z() * GRAVITY_M_S2) * link.mass_kg;
            self.forces[index] = force;
            let turned = pose.rotation * self.poses[index].rotation.inverse();
            let rate = turned.vector() * (2.0 * turned.w.signum() / self.dt_s);
            let spin = pose.rotation * (link.inertia * (pose.rotation.inverse() * rate));
            let spun = (spin - self.spins[index]) / self.dt_s;
            self.spins[index] = spin;
            self.moments[index] = last[index].coords.cross(&force) + spun;
            before[index] = last[index];
            last[index] = com;
        }
        for index in (1..model.links.len()).rev() {
            if let Some(parent) = model.links[index].parent {
                let (force, moment) = (self.forces[index], self.moments[index]);
                self.forces[parent] += force;
                self.moments[parent] += moment;
            }
        }
    }

    /// Where the floor's force would have to act alone in the last cycle: the
    /// zero-moment point. `None` in the first cycles and without weight.
    pub fn zero_moment_point(&self) -> Option<Point3<f64>> {
        self.zmp
    }

    /// Takes the floor's force off the chains of the feet that stand: all of it
    /// at the zero-moment point, and the moment about the vertical.
    fn stand(&mut self, model: &RobotModel, feet: [StanceFoot; 2]) {
        let (force, moment) = (self.forces[0], self.moments[0]);
        self.zmp = None;
        if self.cycles < 2 || force.z < 1e-6 {
            return;
        }
        let zmp = Vector3::new(-moment.y / force.z, moment.x / force.z, 0.0);
        self.zmp = Some(Point3::from(zmp));
        let twist = Vector3::z() * (moment - zmp.cross(&force)).z;
        let at = |foot: StanceFoot| self.poses[foot.sole].translation.vector;
        let between = at(feet[1]) - at(feet[0]);
        let along = (zmp - at(feet[0])).dot(&between) / between.norm_squared().max(1e-6);
        let right = match feet.map(|foot| foot.down) {
            [true, false] => 0.0,
            [false, true] => 1.0,
            _ => along.clamp(0.0, 1.0),
        };
        for (foot, share) in feet.into_iter().zip([1.0 - right, right]) {
            let moment = (zmp.cross(&force) + twist) * share;
            for link in model.ancestors(foot.sole) {
                self.forces[link] -= force * share;
                self.moments[link] -= moment;
            }
        }
    }

    fn judge(&mut self) {
        let mut most = [0.0_f64; LIMBS];
        for (joint, limit) in self.limits_nm.iter().enumerate() {
            let Some(limit) = limit else { continue };
            let share = self.torque_nm[joint].abs() / limit;
            let square = (share / self.config.continuous_share).powi(2);
            let heat = &mut self.heat[joint];
            *heat += (square - *heat) * self.dt_s / (self.config.warm_up_s + self.dt_s);
            self.hottest[joint] = self.hottest[joint].max(*heat);
            self.strongest[joint] = self.strongest[joint].max(share);
            let most = &mut most[self.limbs[joint]];
            *most = most.max(share);
        }
        self.overloaded += u64::from(most.iter().any(|share| *share > 1.0));
        for (ease, most) in self.ease.iter_mut().zip(most) {
            let wanted = match most > EASED_FROM {
                true => (1.0 - (most - EASED_FROM)).max(LEAST),
                false => 1.0,
            };
            let time_s = if wanted < *ease { EASE_S } else { RECOVER_S };
            *ease += (wanted - *ease) * self.dt_s / (time_s + self.dt_s);
        }
        for limb in EVERY_LIMB {
            self.lowest = self.lowest.min(self.amplitude(limb));
        }
    }

    pub fn torque_nm(&self) -> &[f64] {
        &self.torque_nm
    }

    pub fn report(&self, names: &[String]) -> TorqueReport {
        let highest = |values: &[f64]| {
            let known = (0..values.len()).filter(|&joint| self.limits_nm[joint].is_some());
            let joint = known.max_by(|&a, &b| values[a].total_cmp(&values[b]))?;
            Some((names[joint].clone(), values[joint]))
        };
        TorqueReport {
            known_joints: self.limits_nm.iter().flatten().count(),
            hottest: highest(&self.hottest),
            strongest: highest(&self.strongest),
            lowest_amplitude: self.lowest,
            overloaded_cycles: self.overloaded,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RetargetConfig, Retargeter};
    use servodance_types::{JointLimits, MotionFrame};

    const HZ: f64 = 100.0;

    /// A weight of 2 kg, 0.3 m out on a joint that turns about y.
    fn pendulum(limit_nm: f64, config: &RetargetConfig) -> Retargeter {
        let urdf = format!(
            r#"<robot name="p"><link name="base"/><link name="arm"><inertial>
            <origin xyz="0.3 0 0"/><mass value="2"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
            </inertial></link><joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
            <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="{limit_nm}" velocity="3"/></joint></robot>"#
        );
        let limits = JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.0,
            velocity_rad_s: 3.0,
            acceleration_rad_s2: 20.0,
        };
        Retargeter::new(&urdf, config, &[("turn".into(), limits)], HZ).unwrap()
    }

    #[test]
    fn a_weight_held_out_needs_its_lever_times_its_weight() {
        let mut robot = pendulum(10.0, &RetargetConfig::default());
        let mut out = [0.0];
        for cycle in 0..10 {
            robot.next(f64::from(cycle) / HZ, &mut out).unwrap();
        }
        let [torque] = robot.torque_nm() else { panic!("one joint") };
        // Gravity turns the weight to positive angles; the motor holds against.
        assert!((torque + 2.0 * GRAVITY_M_S2 * 0.3).abs() < 1e-9, "{torque}");
        assert_eq!(robot.torque_report().known_joints, 1);
    }

    #[test]
    fn a_motor_that_gets_hot_is_spared_slowly() {
        let config = RetargetConfig {
            torque: TorqueConfig {
                continuous_share: 0.5,
                warm_up_s: 20.0,
                ..TorqueConfig::default()
            },
            ..RetargetConfig::default()
        };
        // 5.9 N m of 8: above half, below the limit.
        let mut robot = pendulum(8.0, &config);
        let mut out = [0.0];
        let mut before = 1.0;
        for cycle in 0..6000 {
            robot.next(f64::from(cycle) / HZ, &mut out).unwrap();
            let left = robot.torque_report().lowest_amplitude;
            assert!((left - before).abs() < 4e-3, "{left} after {before}");
            before = left;
        }
        let report = robot.torque_report();
        assert_eq!(report.lowest_amplitude, LEAST);
        assert_eq!(report.overloaded_cycles, 0);
        assert!(report.hottest.unwrap().1 > 1.0);
    }

    #[test]
    fn a_robot_without_masses_has_no_estimate() {
        let urdf = r#"<robot name="p"><link name="base"/><link name="arm"/>
            <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
            <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="3" velocity="3"/></joint></robot>"#;
        let limits = JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.0,
            velocity_rad_s: 3.0,
            acceleration_rad_s2: 20.0,
        };
        let joints = [("turn".to_string(), limits)];
        let robot = Retargeter::new(urdf, &RetargetConfig::default(), &joints, HZ).unwrap();
        let report = robot.torque_report();
        assert_eq!((report.known_joints, report.hottest), (0, None));
    }

    /// Feet that stand do no work: what the motors give is what the masses gain.
    #[test]
    fn work_of_the_motors_is_energy_of_the_masses() {
        let file: toml::Table = include_str!("../../../configs/op3.toml").parse().unwrap();
        let joints: Vec<(String, JointLimits)> = file["joint"]
            .as_array()
            .unwrap()
            .iter()
            .map(|joint| {
                let radians = |key: &str| joint[key].as_float().unwrap().to_radians();
                let limits = JointLimits {
                    lower_rad: radians("lower_deg"),
                    upper_rad: radians("upper_deg"),
                    velocity_rad_s: radians("velocity_deg_s"),
                    acceleration_rad_s2: radians("acceleration_deg_s2"),
                };
                (joint["name"].as_str().unwrap().into(), limits)
            })
            .collect();
        let config: RetargetConfig = file["retarget"].clone().try_into().unwrap();
        let urdf = include_str!("../../../configs/op3.urdf");
        let mut robot = Retargeter::new(urdf, &config, &joints, HZ).unwrap();
        let mut track = vec![robot.rest().to_vec(); 2];
        let mut out = track[0].clone();
        let (mut work, mut most_missed) = (0.0_f64, 0.0_f64);
        let (mut start, mut lowest, mut highest) = (None, f64::INFINITY, f64::NEG_INFINITY);
        let mut coms: Vec<Vec<Point3<f64>>> = Vec::new();
        for cycle in 0..600_u32 {
            if cycle % 5 == 0 {
                robot.push(&bobbing(f64::from(cycle) / HZ));
            }
            robot.next(f64::from(cycle) / HZ - robot.lookahead_s(), &mut out).unwrap();
            let root = robot.world_from_root(&out);
            let poses = robot.model().link_poses(&out);
            let links = robot.model().links.iter().zip(&poses);
            coms.push(links.map(|(link, pose)| root * pose * link.com).collect());
            track.push(out.clone());
            if cycle < 20 {
                continue;
            }
            let [.., before, last, now] = &coms[..] else {
                continue;
            };
            let last_track = &track[track.len() - 3..];
            work += robot
                .torque_nm()
                .iter()
                .enumerate()
                .map(|(joint, torque)| torque * (last_track[2][joint] - last_track[0][joint]) / 2.0)
                .sum::<f64>();
            let energy: f64 = robot
                .model()
                .links
                .iter()
                .enumerate()
                .map(|(index, link)| {
                    let velocity = (now[index] - before[index]) * HZ / 2.0;
                    let height = last[index].z;
                    link.mass_kg * (GRAVITY_M_S2 * height + 0.5 * velocity.norm_squared())
                })
                .sum();
            let gained = energy - *start.get_or_insert(energy);
            lowest = gained.min(lowest);
            highest = gained.max(highest);
            most_missed = most_missed.max((work - gained).abs());
        }
        assert!(highest - lowest > 0.03, "{lowest}..{highest} J");
        assert!(most_missed < 0.1 * (highest - lowest), "{most_missed} of {} J", highest - lowest);
    }

    fn bobbing(time_s: f64) -> MotionFrame {
        let beat = (time_s * 9.0).sin() as f32;
        let mut positions = [[0.0; 3]; 22];
        for (joint, point) in positions.iter_mut().enumerate() {
            let side = if joint % 3 == 1 { 1.0 } else { -1.0 };
            let height = 1.6 - 0.07 * joint as f32;
            *point = [side * 0.1 + 0.04 * beat, height, 0.0];
        }
        positions[0] = [0.04 * beat, 0.9 + 0.06 * beat, 0.0];
        for (side, [hip, knee, ankle]) in [(1.0, [1, 4, 7]), (-1.0, [2, 5, 8])] {
            positions[hip] = [0.1 * side + 0.04 * beat, 0.86 + 0.06 * beat, 0.0];
            positions[knee] = [0.1 * side, 0.45, 0.05];
            positions[ankle] = [0.1 * side, 0.05, 0.0];
        }
        MotionFrame { time_s, positions, contacts: Default::default() }
    }
}
