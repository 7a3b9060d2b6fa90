//! The robot as flat arrays: forward kinematics without locks or allocation.
//!
//! Built once from `k`'s tree. Links come parents before children; link 0 is
//! the root. Positions are radians (metres for prismatic joints) in the order
//! of the joints the model was built with; joints that are not among them stay
//! at their rest position. Poses are in the root link's frame.

use std::collections::HashMap;

use k::nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::RetargetError;
use crate::collision::Capsule;
use crate::config::{CapsuleConfig, RetargetConfig, Tip};
use crate::error::choices;
use crate::urdf::{self, Description};

/// Effort limits from here on are placeholders.
const PLACEHOLDER_NM: f64 = 1000.0;

/// How a link moves against its parent.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Motion {
    Fixed,
    Turn(Unit<Vector3<f64>>),
    Slide(Unit<Vector3<f64>>),
}

/// Position of a link's joint: `scale * positions[joint] + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drive {
    pub joint: usize,
    pub scale: f64,
    pub offset: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub parent: Option<usize>,
    origin: Isometry3<f64>,
    pub motion: Motion,
    /// `None`: held at `held`.
    pub drive: Option<Drive>,
    held: f64,
    pub mass_kg: f64,
    pub com: Point3<f64>,
}

impl Link {
    /// Pose in the parent link's frame.
    pub fn local(&self, positions: &[f64]) -> Isometry3<f64> {
        let position = self.drive.map_or(self.held, |drive| {
            drive.scale * positions.get(drive.joint).copied().unwrap_or(0.0) + drive.offset
        });
        match self.motion {
            Motion::Fixed => self.origin,
            Motion::Turn(axis) => self.origin * UnitQuaternion::from_axis_angle(&axis, position),
            Motion::Slide(axis) => self.origin * Translation3::from(axis.into_inner() * position),
        }
    }
}

/// A simple shape to draw.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A box with these side lengths, metres.
    Box {
        /// Length along x, y and z.
        size_m: [f64; 3],
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius, metres.
        radius_m: f64,
        /// Length, metres.
        length_m: f64,
    },
    /// A ball.
    Sphere {
        /// Radius, metres.
        radius_m: f64,
    },
}

/// A shape fixed to a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// Index into [`RobotModel::link_names`].
    pub link: usize,
    /// Centre of the shape in the link's frame.
    pub pose_in_link: Isometry3<f64>,
    /// What to draw.
    pub shape: Shape,
    /// Colour, each part 0 to 1.
    pub rgba: [f32; 4],
}

/// A mesh fixed to a link.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshVisual {
    /// Index into [`RobotModel::link_names`].
    pub link: usize,
    /// The mesh's frame in the link's.
    pub pose_in_link: Isometry3<f64>,
    /// As the description has it: a path, or `package://NAME/PATH`.
    pub filename: String,
    /// Metres a unit of the file, along each axis.
    pub scale: [f64; 3],
    /// Colour, each part 0 to 1.
    pub rgba: [f32; 4],
}

/// One driven joint above a link: which column it moves and from which link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lever {
    pub joint: usize,
    pub link: usize,
    pub scale: f64,
}

/// A robot's tree, masses and shapes.
#[derive(Clone, Debug)]
pub struct RobotModel {
    joint_names: Vec<String>,
    link_names: Vec<String>,
    /// Name of the joint above each link.
    pub(crate) parent_joints: Vec<String>,
    pub(crate) links: Vec<Link>,
    /// For each link the driven joints between it and the root, root first.
    pub(crate) levers: Vec<Vec<Lever>>,
    segments: Vec<(usize, usize)>,
    visuals: Vec<Visual>,
    meshes: Vec<MeshVisual>,
    /// Simple shapes given for collision.
    solids: Vec<Visual>,
    /// Capsules of the robot file.
    pub(crate) capsules: Vec<Capsule>,
    pub(crate) mass_kg: f64,
    /// Effort limit of each driven joint; `None` where unset or a placeholder.
    pub(crate) effort_nm: Vec<Option<f64>>,
}

impl RobotModel {
    /// Builds the model of a URDF whose driven joints are `joints`, in order.
    ///
    /// # Errors
    /// Names the joint or link that is missing or unusable.
    pub fn new(urdf_xml: &str, joints: &[&str]) -> Result<Self, RetargetError> {
        Self::build(&urdf::read(urdf_xml)?, joints)
    }

    /// The same, with the points, capsules and couplings of a robot file.
    ///
    /// # Errors
    /// Names the joint or link that is missing or unusable.
    pub fn configured(
        urdf_xml: &str,
        joints: &[&str],
        config: &RetargetConfig,
    ) -> Result<Self, RetargetError> {
        let mut description = urdf::read(urdf_xml)?;
        for couple in &config.couple {
            urdf::couple(&mut description.robot, couple)?;
        }
        let mut model = Self::build(&description, joints)?;
        model.add_tips(&config.tip)?;
        model.add_capsules(&config.capsule)?;
        Ok(model)
    }

    fn build(description: &Description, joints: &[&str]) -> Result<Self, RetargetError> {
        let column = columns(description, joints)?;
        let mut model = Self {
            joint_names: joints.iter().map(|name| name.to_string()).collect(),
            link_names: Vec::new(),
            parent_joints: Vec::new(),
            links: Vec::new(),
            levers: Vec::new(),
            segments: Vec::new(),
            visuals: Vec::new(),
            meshes: Vec::new(),
            solids: Vec::new(),
            capsules: Vec::new(),
            mass_kg: 0.0,
            effort_nm: vec![None; joints.len()],
        };
        for joint in &description.robot.joints {
            let effort = joint.limit.effort;
            if let (Some(&index), true) = (
                column.get(joint.name.as_str()),
                effort > 0.0 && effort < PLACEHOLDER_NM,
            ) {
                model.effort_nm[index] = Some(effort);
            }
        }
        model.add_links(description, &column);
        model.mass_kg = model.links.iter().map(|link| link.mass_kg).sum();
        Ok(model)
    }

    fn add_links(&mut self, description: &Description, column: &HashMap<&str, usize>) {
        let joints: HashMap<&str, &urdf_rs::Joint> = description
            .robot
            .joints
            .iter()
            .map(|joint| (joint.name.as_str(), joint))
            .collect();
        let mut nodes: Vec<k::Node<f64>> = Vec::new();
        for node in description.chain.iter() {
            let index = self.links.len();
            let name = node.joint().name.clone();
            let parent = node
                .parent()
                .and_then(|parent| nodes.iter().position(|known| *known == parent));
            let motion = match node.joint().joint_type {
                k::JointType::Fixed => Motion::Fixed,
                k::JointType::Rotational { axis } => Motion::Turn(axis),
                k::JointType::Linear { axis } => Motion::Slide(axis),
            };
            let drive = drive_of(&name, &joints, column);
            let held = joints
                .get(name.as_str())
                .map_or(0.0, |joint| held_position(joint));
            let (mut mass_kg, mut com) = (0.0, Point3::origin());
            let mut link_name = String::new();
            if let Some(link) = node.link().as_ref() {
                mass_kg = link.inertial.mass;
                com = Point3::from(link.inertial.origin().translation.vector);
                link_name.clone_from(&link.name);
                let visuals = link.visuals.iter();
                self.visuals.extend(
                    visuals.filter_map(|v| visual(index, &v.geometry, *v.origin(), rgba_of(v))),
                );
                self.meshes
                    .extend(link.visuals.iter().filter_map(|v| mesh(index, v)));
                let solids = link.collisions.iter();
                self.solids.extend(
                    solids.filter_map(|c| visual(index, &c.geometry, *c.origin(), [1.0; 4])),
                );
            }
            let mut levers = parent.map_or_else(Vec::new, |p| self.levers[p].clone());
            if let (Some(drive), false) = (drive, matches!(motion, Motion::Fixed)) {
                levers.push(Lever {
                    joint: drive.joint,
                    link: index,
                    scale: drive.scale,
                });
            }
            if let Some(parent) = parent {
                self.segments.push((parent, index));
            }
            self.levers.push(levers);
            self.link_names.push(link_name);
            self.links.push(Link {
                parent,
                origin: node.origin(),
                motion,
                drive,
                held,
                mass_kg,
                com,
            });
            self.parent_joints.push(name);
            nodes.push(node.clone());
        }
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
        &self.visuals
    }

    /// Meshes to draw, by the names that the description gives them.
    pub fn meshes(&self) -> &[MeshVisual] {
        &self.meshes
    }

    /// Simple shapes given for collision.
    pub(crate) fn solids(&self) -> &[Visual] {
        &self.solids
    }

    /// Adds points as massless links, after all others.
    pub(crate) fn add_tips(&mut self, tips: &[Tip]) -> Result<(), RetargetError> {
        for tip in tips {
            let parent = self.named(&tip.link, "tip")?;
            if self.link(&tip.name).is_some() {
                return Err(RetargetError::Link {
                    link: tip.name.clone(),
                    reason: "a tip may not have the name of a link".into(),
                });
            }
            let index = self.links.len();
            self.links.push(Link {
                parent: Some(parent),
                origin: Translation3::from(Vector3::from(tip.at_m)).into(),
                motion: Motion::Fixed,
                drive: None,
                held: 0.0,
                mass_kg: 0.0,
                com: Point3::origin(),
            });
            self.levers.push(self.levers[parent].clone());
            self.link_names.push(tip.name.clone());
            self.parent_joints.push(tip.name.clone());
            self.segments.push((parent, index));
        }
        Ok(())
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

    fn named(&self, link: &str, part: &str) -> Result<usize, RetargetError> {
        self.link(link).ok_or_else(|| RetargetError::NoSuchLink {
            part: part.into(),
            name: link.into(),
            choices: choices(self.link_names.iter().map(String::as_str)),
        })
    }

    /// Total mass of all links, kg.
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Pose of each link in the root link's frame. Missing positions count as 0.
    pub fn link_poses(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let mut poses = vec![Isometry3::identity(); self.links.len()];
        self.place(&Isometry3::identity(), positions, &mut poses);
        poses
    }

    /// Origin of each link in the root link's frame, metres.
    pub fn link_points(&self, positions: &[f64]) -> Vec<[f64; 3]> {
        self.link_poses(positions)
            .iter()
            .map(|pose| pose.translation.vector.into())
            .collect()
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
            poses[index] = base * link.local(positions);
        }
    }

    /// Pose of one link in the root link's frame, without allocating.
    pub(crate) fn link_pose(&self, link: usize, positions: &[f64]) -> Isometry3<f64> {
        let mut pose = Isometry3::identity();
        for index in self.ancestors(link) {
            pose = self.links[index].local(positions) * pose;
        }
        pose
    }

    /// Whether `link` is `ancestor` or hangs below it.
    pub(crate) fn is_below(&self, link: usize, ancestor: usize) -> bool {
        self.ancestors(link).any(|above| above == ancestor)
    }

    /// `link`, its parent, … up to the root.
    pub(crate) fn ancestors(&self, link: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(Some(link), |&at| self.links[at].parent)
    }

    /// The deepest link above both.
    pub(crate) fn common_ancestor(&self, one: usize, other: usize) -> usize {
        self.ancestors(one)
            .find(|&above| self.is_below(other, above))
            .unwrap_or(0)
    }

    /// Centre of mass of the links at `poses`; their root where nothing weighs.
    pub(crate) fn centre_of_mass(&self, poses: &[Isometry3<f64>]) -> Point3<f64> {
        if self.mass_kg <= 0.0 {
            return Point3::from(poses[0].translation.vector);
        }
        let sum: Vector3<f64> = self
            .links
            .iter()
            .zip(poses)
            .map(|(link, pose)| (pose * link.com).coords * link.mass_kg)
            .sum();
        Point3::from(sum / self.mass_kg)
    }
}

/// Column of each driven joint name, or why there is none.
fn columns<'a>(
    description: &Description,
    joints: &[&'a str],
) -> Result<HashMap<&'a str, usize>, RetargetError> {
    let movable: Vec<&urdf_rs::Joint> = description
        .robot
        .joints
        .iter()
        .filter(|joint| urdf::is_driven(joint))
        .collect();
    let mut column = HashMap::new();
    for (index, name) in joints.iter().enumerate() {
        let Some(joint) = movable.iter().find(|joint| joint.name == *name) else {
            return Err(RetargetError::NoSuchJoint {
                name: name.to_string(),
                choices: choices(movable.iter().map(|joint| joint.name.as_str())),
            });
        };
        if let Some(mimic) = &joint.mimic {
            return Err(RetargetError::Joint {
                joint: name.to_string(),
                reason: format!("follows `{}` and cannot be driven itself", mimic.joint),
            });
        }
        if column.insert(*name, index).is_some() {
            return Err(RetargetError::Joint {
                joint: name.to_string(),
                reason: "is in the servo map twice".into(),
            });
        }
    }
    Ok(column)
}

/// Follows mimics down to a driven joint.
fn drive_of(
    name: &str,
    joints: &HashMap<&str, &urdf_rs::Joint>,
    column: &HashMap<&str, usize>,
) -> Option<Drive> {
    let (mut scale, mut offset, mut at) = (1.0, 0.0, name);
    for _ in 0..=joints.len() {
        if let Some(&joint) = column.get(at) {
            return Some(Drive {
                joint,
                scale,
                offset,
            });
        }
        let mimic = joints.get(at)?.mimic.as_ref()?;
        offset += scale * mimic.offset.unwrap_or(0.0);
        scale *= mimic.multiplier.unwrap_or(1.0);
        at = mimic.joint.as_str();
    }
    None
}

fn rgba_of(visual: &k::link::Visual<f64>) -> [f32; 4] {
    let color = &visual.material.color;
    [color.r, color.g, color.b, color.a].map(|part| part as f32)
}

fn mesh(link: usize, visual: &k::link::Visual<f64>) -> Option<MeshVisual> {
    let k::link::Geometry::Mesh { filename, scale } = &visual.geometry else {
        return None;
    };
    Some(MeshVisual {
        link,
        pose_in_link: *visual.origin(),
        filename: filename.clone(),
        scale: [scale.x, scale.y, scale.z],
        rgba: rgba_of(visual),
    })
}

fn visual(
    link: usize,
    geometry: &k::link::Geometry<f64>,
    pose_in_link: Isometry3<f64>,
    rgba: [f32; 4],
) -> Option<Visual> {
    let shape = match *geometry {
        k::link::Geometry::Box {
            depth,
            width,
            height,
        } => Shape::Box {
            size_m: [depth, width, height],
        },
        k::link::Geometry::Cylinder { radius, length }
        | k::link::Geometry::Capsule { radius, length } => Shape::Cylinder {
            radius_m: radius,
            length_m: length,
        },
        k::link::Geometry::Sphere { radius } => Shape::Sphere { radius_m: radius },
        k::link::Geometry::Mesh { .. } => return None,
    };
    Some(Visual {
        link,
        pose_in_link,
        shape,
        rgba,
    })
}

/// Where a joint that nobody drives stays: zero, or the nearest limit.
pub(crate) fn held_position(joint: &urdf_rs::Joint) -> f64 {
    let limit = &joint.limit;
    let turns = joint.joint_type == urdf_rs::JointType::Continuous;
    match limit.lower < limit.upper && !turns {
        true => 0.0_f64.clamp(limit.lower, limit.upper),
        false => 0.0,
    }
}
