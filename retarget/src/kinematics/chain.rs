//! The robot's kinematic chain as flat arrays: forward kinematics without locks
//! or allocation.
//!
//! Built once from `k`'s tree, whose forward kinematics locks and caches each
//! node: fit for checking this one (a test does), not for a control loop. Links
//! come parents before children; link 0 is the root. Positions are radians
//! (metres for prismatic joints) in the order of the joints the model was built
//! with; joints that are not among them stay at their rest position. Poses are
//! in the root link's frame.

use std::collections::HashMap;

use k::nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::config::{CapsuleConfig, RetargetConfig, RetargetError, RodConfig, Tip, choices};
use crate::description::{Description, held_position, is_driven};
use crate::kinematics::{
    Capsule, JointDrive, LinkShapes, MeshVisual, Platform, Rod, Shape, Visual,
};

/// A ball on a frame that weighs no more marks a point, kg.
const MARKER_KG: f64 = 2e-3;
const PLACEHOLDER_NM: f64 = 1000.0;

#[derive(Clone, Copy, Debug)]
pub(crate) enum JointMotion {
    Fixed,
    Revolute(Unit<Vector3<f64>>),
    Prismatic(Unit<Vector3<f64>>),
    /// Six rods carry it: see [`Platform`].
    Platform,
}

#[derive(Clone, Debug)]
pub(crate) struct ChainLink {
    pub parent: Option<usize>,
    origin: Isometry3<f64>,
    pub motion: JointMotion,
    /// `None`: held at `held`.
    pub drive: Option<JointDrive>,
    held: f64,
    pub mass_kg: f64,
    pub com: Point3<f64>,
    /// About the centre of mass, axes of the link.
    pub inertia: Matrix3<f64>,
}

impl ChainLink {
    /// Pose in the parent of a joint that nothing drives; of one that is driven, at zero.
    pub fn still_pose(&self) -> Isometry3<f64> {
        match self.drive {
            Some(_) => self.origin,
            None => self.local(&[]),
        }
    }

    pub fn local(&self, positions: &[f64]) -> Isometry3<f64> {
        let position = self.drive.map_or(self.held, |drive| {
            drive.scale * positions.get(drive.joint).copied().unwrap_or(0.0) + drive.offset
        });
        match self.motion {
            JointMotion::Fixed | JointMotion::Platform => self.origin,
            JointMotion::Revolute(axis) => {
                self.origin * UnitQuaternion::from_axis_angle(&axis, position)
            }
            JointMotion::Prismatic(axis) => {
                self.origin * Translation3::from(axis.into_inner() * position)
            }
        }
    }
}

/// A driven joint between a link and the root: which column of the Jacobian it
/// is, and the link that it moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DrivenAncestor {
    pub joint: usize,
    pub link: usize,
    pub scale: f64,
}

/// A robot's tree, masses and shapes.
#[derive(Clone, Debug)]
pub struct RobotModel {
    joint_names: Vec<String>,
    link_names: Vec<String>,
    pub(crate) parent_joints: Vec<String>,
    pub(crate) links: Vec<ChainLink>,
    /// For each link the driven joints between it and the root, root first.
    pub(crate) driven_ancestors: Vec<Vec<DrivenAncestor>>,
    segments: Vec<(usize, usize)>,
    shapes: LinkShapes,
    pub(crate) capsules: Vec<Capsule>,
    pub(crate) platform: Option<Box<Platform>>,
    mass_kg: f64,
    /// Effort limit of each driven joint; `None` where unset or a placeholder.
    pub(crate) effort_nm: Vec<Option<f64>>,
}

impl RobotModel {
    /// Builds the model of a URDF whose driven joints are `joints`, in order.
    /// Fails, by name, where a joint or link is missing or unusable.
    pub fn new(urdf_xml: &str, joints: &[&str]) -> Result<Self, RetargetError> {
        Self::of_description(&Description::from_urdf(urdf_xml)?, joints)
    }

    /// The same, with the points, capsules and couplings of a robot file.
    /// Fails, by name, where a joint or link is missing or unusable.
    pub fn configured(
        urdf_xml: &str,
        joints: &[&str],
        config: &RetargetConfig,
    ) -> Result<Self, RetargetError> {
        let mut description = Description::from_urdf(urdf_xml)?;
        for coupling in &config.couple {
            description.couple(coupling)?;
        }
        let mut model = Self::of_description(&description, joints)?;
        model.add_platform(&config.rod)?;
        model.add_tips(&config.tip)?;
        model.add_capsules(&config.capsule)?;
        Ok(model)
    }

    pub(crate) fn of_description(
        description: &Description,
        joints: &[&str],
    ) -> Result<Self, RetargetError> {
        let column = columns(description, joints)?;
        let mut model = Self {
            joint_names: joints.iter().map(|name| name.to_string()).collect(),
            link_names: Vec::new(),
            parent_joints: Vec::new(),
            links: Vec::new(),
            driven_ancestors: Vec::new(),
            segments: Vec::new(),
            shapes: LinkShapes::default(),
            capsules: Vec::new(),
            platform: None,
            mass_kg: 0.0,
            effort_nm: vec![None; joints.len()],
        };
        for joint in &description.robot.joints {
            let effort = joint.limit.effort;
            let is_given = effort > 0.0 && effort < PLACEHOLDER_NM;
            if let (Some(&index), true) = (column.get(joint.name.as_str()), is_given) {
                model.effort_nm[index] = Some(effort);
            }
        }
        model.add_links(description, &column);
        model.mass_kg = model.links.iter().map(|link| link.mass_kg).sum();
        Ok(model)
    }

    fn add_links(&mut self, description: &Description, column: &HashMap<&str, usize>) {
        let joints = description.robot.joints.iter();
        let joints: HashMap<&str, &urdf_rs::Joint> =
            joints.map(|joint| (joint.name.as_str(), joint)).collect();
        let mut nodes: Vec<k::Node<f64>> = Vec::new();
        for node in description.chain.iter() {
            let index = self.links.len();
            let name = node.joint().name.clone();
            let parent =
                node.parent().and_then(|parent| nodes.iter().position(|known| *known == parent));
            let motion = match node.joint().joint_type {
                k::JointType::Fixed => JointMotion::Fixed,
                k::JointType::Rotational { axis } => JointMotion::Revolute(axis),
                k::JointType::Linear { axis } => JointMotion::Prismatic(axis),
            };
            let drive = drive_of(&name, &joints, column);
            let mut link = ChainLink {
                parent,
                origin: node.origin(),
                motion,
                drive,
                held: joints.get(name.as_str()).map_or(0.0, |joint| held_position(joint)),
                mass_kg: 0.0,
                com: Point3::origin(),
                inertia: Matrix3::zeros(),
            };
            let mut link_name = String::new();
            if let Some(body) = node.link().as_ref() {
                link.mass_kg = body.inertial.mass;
                let inertial = body.inertial.origin();
                link.com = Point3::from(inertial.translation.vector);
                let turn = inertial.rotation.to_rotation_matrix();
                link.inertia = turn * body.inertial.inertia * turn.inverse();
                link_name.clone_from(&body.name);
                self.shapes.add(index, body);
            }
            self.add_link(link, link_name, name);
            if let (Some(drive), false) = (drive, matches!(motion, JointMotion::Fixed)) {
                self.driven_ancestors[index].push(DrivenAncestor {
                    joint: drive.joint,
                    link: index,
                    scale: drive.scale,
                });
            }
            nodes.push(node.clone());
        }
    }

    /// Adds a link that no driven joint moves against its parent.
    fn add_link(&mut self, link: ChainLink, name: String, parent_joint: String) {
        let above = |parent: usize| self.driven_ancestors[parent].clone();
        let ancestors = link.parent.map_or_else(Vec::new, above);
        self.driven_ancestors.push(ancestors);
        self.segments.extend(link.parent.map(|parent| (parent, self.links.len())));
        self.links.push(link);
        self.link_names.push(name);
        self.parent_joints.push(parent_joint);
    }

    /// Names of the joints, in the order of all position slices.
    pub fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    /// Names of the links, root first, parents before children.
    pub fn link_names(&self) -> &[String] {
        &self.link_names
    }

    /// Index of the link called `name`.
    pub fn link(&self, name: &str) -> Option<usize> {
        self.link_names.iter().position(|other| other == name)
    }

    /// Pairs of link indices, parent and child: the sticks of a stick figure.
    pub fn segments(&self) -> &[(usize, usize)] {
        &self.segments
    }

    /// Boxes, cylinders and balls to draw; meshes are left out.
    pub fn visuals(&self) -> &[Visual] {
        &self.shapes.visuals
    }

    /// Meshes to draw, by the names that the description gives them.
    pub fn meshes(&self) -> &[MeshVisual] {
        &self.shapes.meshes
    }

    /// What can touch: the collision shapes, or what is drawn where there are none.
    pub(crate) fn touch_shapes(&self) -> impl Iterator<Item = &Visual> {
        let solids = &self.shapes.solids;
        if solids.is_empty() { self.shapes.visuals.iter() } else { solids.iter() }
    }

    /// The link nearest to the root that moves with `link` as one.
    pub(crate) fn last_driven(&self, link: usize) -> usize {
        self.driven_ancestors[link].last().map_or(0, |ancestor| ancestor.link)
    }

    /// What is drawn and what can touch, without the balls that mark points.
    pub(crate) fn all_shapes(&self) -> impl Iterator<Item = &Visual> {
        let is_marker = |visual: &Visual| {
            let is_ball = matches!(visual.shape, Shape::Sphere { .. });
            let is_fixed = self.last_driven(visual.link) != visual.link;
            is_ball && is_fixed && self.links[visual.link].mass_kg < MARKER_KG
        };
        let visuals = self.shapes.visuals.iter().filter(move |visual| !is_marker(visual));
        self.shapes.solids.iter().chain(visuals)
    }

    pub(crate) fn add_tips(&mut self, tips: &[Tip]) -> Result<(), RetargetError> {
        for tip in tips {
            let parent = self.named(&tip.link, "tip")?;
            if self.link(&tip.name).is_some() {
                return Err(RetargetError::Link {
                    link: tip.name.clone(),
                    reason: "a tip may not have the name of a link".into(),
                });
            }
            let link = ChainLink {
                parent: Some(parent),
                origin: Translation3::from(Vector3::from(tip.at_m)).into(),
                motion: JointMotion::Fixed,
                drive: None,
                held: 0.0,
                mass_kg: 0.0,
                com: Point3::origin(),
                inertia: Matrix3::zeros(),
            };
            self.add_link(link, tip.name.clone(), tip.name.clone());
        }
        Ok(())
    }

    /// Lets six rods carry a plate that the description fixes to its parent.
    fn add_platform(&mut self, rods: &[RodConfig]) -> Result<(), RetargetError> {
        let Some(first) = rods.first() else { return Ok(()) };
        let refused = |link: &str, reason: &str| RetargetError::Link {
            link: link.to_owned(),
            reason: reason.to_owned(),
        };
        let plate = self.named(&first.plate, "rod.plate")?;
        let (Some(carrier), JointMotion::Fixed) =
            (self.links[plate].parent, self.links[plate].motion)
        else {
            return Err(refused(&first.plate, "the plate of rods must be fixed to a link"));
        };
        let poses = self.link_poses(&[]);
        let in_carrier = poses[carrier].inverse();
        let mut all = Vec::new();
        for rod in rods {
            if rod.plate != first.plate {
                return Err(refused(&rod.plate, "all rods carry one plate"));
            }
            let crank = self.named(&rod.crank, "rod.crank")?;
            let link = &self.links[crank];
            let (Some(drive), JointMotion::Revolute(axis)) = (link.drive, link.motion) else {
                return Err(refused(&rod.crank, "a rod's crank is turned by a servo"));
            };
            if link.parent != Some(carrier) {
                return Err(refused(
                    &rod.crank,
                    "the cranks turn on the link that carries the plate",
                ));
            }
            let (pin, socket) = (Point3::from(rod.pin_m), Point3::from(rod.socket_m));
            let length_m = (poses[crank] * pin - poses[plate] * socket).norm();
            let origin = in_carrier * poses[carrier] * link.still_pose();
            all.push(Rod { drive, crank, axis, origin, pin, socket, length_m });
        }
        let count = all.len();
        let rods: [Rod; 6] = all.try_into().map_err(|_| {
            refused(&first.plate, &format!("{count} rods carry it: a platform has six"))
        })?;
        let above = self.driven_ancestors[plate].len();
        let carried: Vec<usize> =
            (0..self.links.len()).filter(|&link| self.is_below(link, plate)).collect();
        for link in carried {
            let cranks = rods.iter().map(|rod| DrivenAncestor {
                joint: rod.drive.joint,
                link: plate,
                scale: 1.0,
            });
            self.driven_ancestors[link].splice(above..above, cranks);
        }
        self.links[plate].motion = JointMotion::Platform;
        let home = self.links[plate].origin;
        self.platform = Some(Box::new(Platform { plate, carrier, home, rods }));
        Ok(())
    }

    /// Pose of a link in its parent.
    fn local(&self, link: usize, positions: &[f64]) -> Isometry3<f64> {
        match &self.platform {
            Some(platform) if platform.plate == link => platform.plate_in_carrier(positions),
            _ => self.links[link].local(positions),
        }
    }

    fn add_capsules(&mut self, capsules: &[CapsuleConfig]) -> Result<(), RetargetError> {
        for capsule in capsules {
            self.capsules.push(Capsule {
                link: self.named(&capsule.link, "capsule")?,
                ends: [capsule.from_m, capsule.to_m].map(Point3::from),
                radius_m: capsule.radius_m,
            });
        }
        Ok(())
    }

    /// The link called `link`, asked for as `part`.
    pub(crate) fn named(&self, link: &str, part: &str) -> Result<usize, RetargetError> {
        self.link(link).ok_or_else(|| RetargetError::NoSuchLink {
            part: part.into(),
            name: link.into(),
            choices: choices(self.link_names.iter().map(String::as_str)),
        })
    }

    /// Pose of each link in the root link's frame. Missing positions count as 0.
    pub fn link_poses(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let mut poses = vec![Isometry3::identity(); self.links.len()];
        self.place(&Isometry3::identity(), positions, &mut poses);
        poses
    }

    /// Forward kinematics into `poses` (one a link), the root being at `root`.
    pub(crate) fn place(
        &self,
        root: &Isometry3<f64>,
        positions: &[f64],
        poses: &mut [Isometry3<f64>],
    ) {
        for (index, link) in self.links.iter().enumerate() {
            let base = link.parent.map_or(*root, |parent| poses[parent]);
            poses[index] = base * self.local(index, positions);
        }
    }

    /// Pose of one link in the root link's frame, without allocating.
    pub(crate) fn link_pose(&self, link: usize, positions: &[f64]) -> Isometry3<f64> {
        let mut pose = Isometry3::identity();
        for index in self.ancestors(link) {
            pose = self.local(index, positions) * pose;
        }
        pose
    }

    /// How many driven joints there are between a link and the root.
    pub(crate) fn drives_above(&self, link: usize) -> usize {
        self.driven_ancestors[link].len()
    }

    /// Whether `link` is `ancestor` or hangs below it.
    pub(crate) fn is_below(&self, link: usize, ancestor: usize) -> bool {
        self.ancestors(link).any(|above| above == ancestor)
    }

    /// `link`, its parent, … up to the root.
    pub(crate) fn ancestors(&self, link: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(Some(link), |&at| self.links[at].parent)
    }

    pub(crate) fn common_ancestor(&self, one: usize, other: usize) -> usize {
        self.ancestors(one).find(|&above| self.is_below(other, above)).unwrap_or(0)
    }

    /// Centre of mass of the links at `poses`; their root where nothing weighs.
    pub(crate) fn centre_of_mass(&self, poses: &[Isometry3<f64>]) -> Point3<f64> {
        if self.mass_kg <= 0.0 {
            return Point3::from(poses[0].translation.vector);
        }
        let links = self.links.iter().zip(poses);
        let moments = links.map(|(link, pose)| (pose * link.com).coords * link.mass_kg);
        let sum: Vector3<f64> = moments.sum();
        Point3::from(sum / self.mass_kg)
    }
}

/// Column of each driven joint name, or why there is none.
fn columns<'a>(
    description: &Description,
    joints: &[&'a str],
) -> Result<HashMap<&'a str, usize>, RetargetError> {
    let all = description.robot.joints.iter();
    let movable: Vec<&urdf_rs::Joint> = all.filter(|joint| is_driven(joint)).collect();
    let mut column = HashMap::new();
    for (index, name) in joints.iter().enumerate() {
        let Some(joint) = movable.iter().find(|joint| joint.name == *name) else {
            return Err(RetargetError::NoSuchJoint {
                name: name.to_string(),
                choices: choices(movable.iter().map(|joint| joint.name.as_str())),
            });
        };
        let refused = |reason: String| RetargetError::Joint { joint: name.to_string(), reason };
        if let Some(mimic) = &joint.mimic {
            let followed = &mimic.joint;
            return Err(refused(format!("follows `{followed}` and cannot be driven itself")));
        }
        if column.insert(*name, index).is_some() {
            return Err(refused("is in the servo map twice".into()));
        }
    }
    Ok(column)
}

fn drive_of(
    name: &str,
    joints: &HashMap<&str, &urdf_rs::Joint>,
    column: &HashMap<&str, usize>,
) -> Option<JointDrive> {
    let (mut scale, mut offset, mut at) = (1.0, 0.0, name);
    for _ in 0..=joints.len() {
        if let Some(&joint) = column.get(at) {
            return Some(JointDrive { joint, scale, offset });
        }
        let mimic = joints.get(at)?.mimic.as_ref()?;
        offset += scale * mimic.offset.unwrap_or(0.0);
        scale *= mimic.multiplier.unwrap_or(1.0);
        at = mimic.joint.as_str();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masses_of_all_links_add_up() {
        let op3 = include_str!("../../../configs/op3.urdf");
        let model = RobotModel::new(op3, &[]).unwrap();
        assert!((model.mass_kg - 3.15).abs() < 1e-9);
    }
}
