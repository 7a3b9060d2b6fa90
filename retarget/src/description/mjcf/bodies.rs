//! Bodies and joints of an MJCF model as links and joints of a tree.

use std::collections::HashSet;

use k::nalgebra::{Isometry3, Point3, Translation3, Vector3};
use roxmltree::Node;
use urdf_rs::{Axis, Inertia, Inertial, JointLimit, JointType, LinkName, Mass, Mimic, Pose, Vec3};

use super::attributes::{MjcfAttributes, MjcfElement};
use super::geoms::MjcfGeom;
use crate::config::RetargetError;
use crate::description::diagnostic::{DiagnosticCode, Diagnostics};

pub(super) struct MjcfBodies<'d> {
    diagnostics: &'d mut Diagnostics,
    links: Vec<urdf_rs::Link>,
    joints: Vec<urdf_rs::Joint>,
    /// Names of links and of joints: one body and one joint may share theirs.
    names: [HashSet<String>; 2],
}

/// Which names a new one must differ from.
#[derive(Clone, Copy)]
enum Named {
    Link,
    Joint,
}

/// The link that carries a body, and the frame of the carrier's body in that link.
type Carrier = (usize, Isometry3<f64>);

/// Whether a body of the world hangs from it by one hinge or slide. More are a root that
/// floats in a plane.
fn turns_against_world(body: &MjcfElement) -> bool {
    let joints = parts_if_readable(body, "joint");
    let kinds: Vec<_> = joints.iter().map(|joint| joint.text("type").unwrap_or("hinge")).collect();
    matches!(kinds[..], ["hinge" | "slide"])
}

/// Whether a body of the world is bolted to it.
fn is_bolted(body: &MjcfElement) -> bool {
    ["joint", "freejoint"].iter().all(|tag| parts_if_readable(body, tag).is_empty())
}

/// A frame that cannot be read is refused where its body is added.
fn parts_if_readable<'a>(body: &MjcfElement<'a>, tag: &str) -> Vec<MjcfElement<'a>> {
    body.parts(tag).unwrap_or_default()
}

/// Joints of a body and of all below it.
fn joints_of(body: &MjcfElement) -> usize {
    body.node.descendants().filter(|node| node.has_tag_name("joint")).count()
}

impl<'d> MjcfBodies<'d> {
    /// The body with the most joints, and all below it; the world, where that body turns
    /// against it by one joint, or another one like it is bolted to the world, too: the base
    /// of such a robot is part of the world.
    pub fn read(
        root: Node,
        attributes: &MjcfAttributes,
        diagnostics: &'d mut Diagnostics,
    ) -> Result<Self, RetargetError> {
        let mut limbs = Vec::new();
        let mut base_of = None;
        for world in root.children().filter(|n| n.has_tag_name("worldbody")) {
            let class = world.attribute("childclass").unwrap_or("main");
            let world = MjcfElement::new(world, class, attributes);
            let bodies = world.parts("body")?;
            base_of = base_of.or((!bodies.is_empty()).then_some(world));
            limbs.extend(bodies);
        }
        let Some(world) = base_of else {
            let reason = "there is no <body> in <worldbody>";
            return Err(RetargetError::Mjcf(reason.into()));
        };
        limbs.sort_by_key(|body| std::cmp::Reverse(joints_of(body)));
        let most = joints_of(&limbs[0]);
        let is_arm = |body: &MjcfElement| is_bolted(body) && most > 1 && joints_of(body) == most;
        let turning = turns_against_world(&limbs[0]);
        let is_limb = |body: &MjcfElement| match turning {
            true => turns_against_world(body),
            false => is_arm(body),
        };
        let is_world_base = turning || limbs.iter().filter(|body| is_arm(body)).count() > 1;
        let objects: Vec<MjcfElement> = match is_world_base {
            true => limbs.extract_if(.., |body| !is_limb(body)).collect(),
            false => limbs.split_off(1),
        };
        let (links, joints, names) = Default::default();
        let mut tree = Self { diagnostics, links, joints, names };
        for other in objects {
            let name = other.node.attribute("name").unwrap_or("(unnamed)");
            tree.leave_out(name, "an object beside the robot: left out");
        }
        let mut base = None;
        if is_world_base {
            let name = tree.unique(Named::Link, None, "base".into());
            let link = tree.add_link(name);
            tree.add_shapes_and_mass(world, link, Isometry3::identity())?;
            base = Some((link, Isometry3::identity()));
        }
        for limb in limbs {
            tree.add_body(limb, base)?;
        }
        Ok(tree)
    }

    pub fn robot(self, name: &str) -> urdf_rs::Robot {
        urdf_rs::Robot {
            name: name.to_owned(),
            links: self.links,
            joints: self.joints,
            materials: Vec::new(),
        }
    }

    fn unique(&mut self, named: Named, wanted: Option<&str>, otherwise: String) -> String {
        let base = match wanted {
            Some(name) if !name.trim().is_empty() => name.to_owned(),
            _ => otherwise,
        };
        let mut name = base.clone();
        let mut count = 1;
        while !self.names[named as usize].insert(name.clone()) {
            count += 1;
            name = format!("{base}_{count}");
        }
        name
    }

    fn add_link(&mut self, name: String) -> usize {
        self.links.push(urdf_rs::Link {
            name,
            inertial: Inertial::default(),
            visual: Vec::new(),
            collision: Vec::new(),
        });
        self.links.len() - 1
    }

    /// Adds a link below `parent` and the joint between them.
    fn add_joint(
        &mut self,
        joint_name: String,
        link_name: String,
        joint_type: JointType,
        parent: usize,
        origin: &Isometry3<f64>,
    ) -> usize {
        self.joints.push(urdf_rs::Joint {
            name: joint_name,
            joint_type,
            origin: pose(origin),
            parent: LinkName { link: self.links[parent].name.clone() },
            child: LinkName { link: link_name.clone() },
            axis: Axis::default(),
            limit: JointLimit::default(),
            calibration: None,
            dynamics: None,
            mimic: None,
            safety_controller: None,
        });
        self.add_link(link_name)
    }

    fn add_body(
        &mut self,
        body: MjcfElement,
        around: Option<Carrier>,
    ) -> Result<(), RetargetError> {
        let class = body.node.attribute("childclass").unwrap_or(body.class);
        let body = MjcfElement { class, ..body };
        let number = self.links.len();
        let name = self.unique(Named::Link, body.node.attribute("name"), format!("body_{number}"));
        let pose = body.pose()?;
        let mut carrier = around.map(|(link, in_link)| (link, in_link * pose));
        for (index, joint) in body.parts("joint")?.into_iter().enumerate() {
            let Some(on) = carrier else {
                let kind = joint.text("type").unwrap_or("hinge");
                let subject = joint.node.attribute("name").unwrap_or(kind);
                self.leave_out(subject, "a joint of the root against the world: held");
                continue;
            };
            carrier = Some(self.add_hinges(joint, on, format!("{name}_joint_{index}"))?);
        }
        // The last joint's link is the body itself, its frame at the anchor.
        let (link, frame) = match carrier {
            Some((link, in_link)) if link >= number => {
                self.links[link].name.clone_from(&name);
                if let Some(joint) = self.joints.last_mut() {
                    joint.child.link = name;
                }
                (link, in_link)
            }
            Some((parent, in_link)) => {
                let joint = self.unique(Named::Joint, None, format!("{name}_fixed"));
                let link = self.add_joint(joint, name, JointType::Fixed, parent, &in_link);
                (link, Isometry3::identity())
            }
            None => (self.add_link(name), Isometry3::identity()),
        };
        self.add_shapes_and_mass(body, link, frame)?;
        for child in body.parts("body")? {
            self.add_body(child, Some((link, frame)))?;
        }
        Ok(())
    }

    fn leave_out(&mut self, subject: &str, message: impl Into<String>) {
        self.diagnostics.add(DiagnosticCode::MjcfLeftOut, subject, message);
    }

    /// Adds one joint of a body below a link and a frame in that; three for a
    /// ball. Where the body's frame is then.
    fn add_hinges(
        &mut self,
        joint: MjcfElement,
        (mut link, mut in_link): Carrier,
        fallback: String,
    ) -> Result<Carrier, RetargetError> {
        let kind = joint.text("type").unwrap_or("hinge");
        let axes: &[[f64; 3]] = match kind {
            "ball" => &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            "free" => return Ok((link, in_link)),
            _ => &[joint.vector("axis", [0.0, 0.0, 1.0])?],
        };
        let anchor = Point3::from(joint.vector("pos", [0.0; 3])?);
        let anchor = Translation3::from(joint.around * anchor);
        let plain = self.unique(Named::Joint, joint.node.attribute("name"), fallback);
        if kind == "ball" {
            let message = "a ball joint: three hinges stand for it";
            self.diagnostics.add(DiagnosticCode::MjcfBall, &plain, message);
        }
        for (axis, letter) in axes.iter().zip(["x", "y", "z"]) {
            let name = match kind {
                "ball" => self.unique(Named::Joint, None, format!("{plain}_{letter}")),
                _ => plain.clone(),
            };
            let range = range(joint, kind)?;
            let joint_type = match (kind, range) {
                ("slide", _) => JointType::Prismatic,
                (_, Some(_)) => JointType::Revolute,
                (_, None) => JointType::Continuous,
            };
            let [lower, upper] = range.unwrap_or_default();
            let effort = joint.numbers("actuatorfrcrange")?;
            let link_name = format!("{name}_link");
            link = self.add_joint(name, link_name, joint_type, link, &(in_link * anchor));
            if let Some(added) = self.joints.last_mut() {
                let axis = joint.around.rotation * Vector3::from(*axis);
                added.axis = Axis { xyz: Vec3(axis.into()) };
                added.limit = JointLimit {
                    lower,
                    upper,
                    effort: effort.and_then(|r| r.last().copied()).unwrap_or(0.0).abs(),
                    velocity: 0.0,
                };
            }
            in_link = anchor.inverse().into();
        }
        Ok((link, in_link))
    }

    fn add_shapes_and_mass(
        &mut self,
        body: MjcfElement,
        link: usize,
        frame: Isometry3<f64>,
    ) -> Result<(), RetargetError> {
        let mut geoms = Vec::new();
        let mut others = 0;
        for geom in body.parts("geom")? {
            match MjcfGeom::read(geom, frame)? {
                Some(geom) => geoms.push(geom),
                None => others += 1,
            }
        }
        let link = &mut self.links[link];
        if others > 0 {
            let message =
                format!("{others} shapes that are no box, cylinder, ball or mesh: left out");
            self.diagnostics.add(DiagnosticCode::MjcfLeftOut, &link.name, message);
        }
        let (shown, touching) = shown_and_touching(&geoms);
        link.visual = shown.iter().map(|geom| geom.visual(pose)).collect();
        link.collision = touching.iter().map(|geom| geom.collision(pose)).collect();
        let (mass_kg, com, moments) = match body.parts("inertial")?.into_iter().next() {
            Some(inertial) => {
                let pose = frame * inertial.pose()?;
                let [mass_kg] = inertial.vector("mass", [0.0])?;
                let diagonal = inertial.vector("diaginertia", [0.0; 3])?;
                let full = inertial.vector("fullinertia", diagonal)?;
                (mass_kg, Point3::from(pose.translation.vector), full)
            }
            None => mass_of(&geoms),
        };
        if mass_kg != 0.0 {
            link.inertial = inertial(mass_kg, com, moments);
        }
        Ok(())
    }

    pub fn add_mimics(&mut self, root: MjcfElement) {
        for pair in root.children("equality").flat_map(|equality| equality.children("joint")) {
            let ends = ["joint1", "joint2"].map(|end| pair.node.attribute(end));
            let [Some(follower), Some(leader)] = ends else {
                continue;
            };
            let known = |name: &str| self.joints.iter().any(|joint| joint.name == name);
            let law = pair.vector("polycoef", [0.0, 1.0, 0.0, 0.0, 0.0]);
            let (true, true, Ok(law)) = (known(follower), known(leader), law) else {
                continue;
            };
            if law[2..].iter().any(|part| *part != 0.0) {
                self.leave_out(follower, "follows by a curve: taken as a line");
            }
            for joint in self.joints.iter_mut().filter(|j| j.name == follower) {
                joint.mimic = Some(Mimic {
                    joint: leader.to_owned(),
                    multiplier: Some(law[1]),
                    offset: Some(law[0]),
                });
            }
        }
    }

    /// Strength of the motors, where the joints do not say it.
    pub fn add_effort_limits(&mut self, root: MjcfElement) {
        for motor in root.children("actuator").flat_map(|actuator| actuator.node.children()) {
            let Some(name) = motor.attribute("joint") else {
                continue;
            };
            let numbers = |key: &str| root.at(motor).numbers(key).ok().flatten();
            let last = |key: &str| numbers(key)?.last().copied();
            let gear = numbers("gear").and_then(|values| values.first().copied());
            let control = match motor.has_tag_name("motor") {
                true => last("ctrlrange"),
                false => None,
            };
            let Some(force) = last("forcerange").or(control) else {
                continue;
            };
            for joint in self.joints.iter_mut().filter(|j| j.name == name) {
                if joint.limit.effort == 0.0 {
                    joint.limit.effort = (force * gear.unwrap_or(1.0)).abs();
                }
            }
        }
    }
}

/// What is drawn of a body's shapes, and what only touches: a body with meshes is drawn by
/// those alone.
fn shown_and_touching(geoms: &[MjcfGeom]) -> (Vec<&MjcfGeom>, Vec<&MjcfGeom>) {
    let (meshes, simple): (Vec<_>, Vec<_>) = geoms.iter().partition(|geom| geom.is_mesh());
    if meshes.is_empty() {
        return (simple, Vec::new());
    }
    let any_shown = meshes.iter().any(|mesh| mesh.is_shown());
    let mut shown: Vec<&MjcfGeom> = Vec::new();
    for mesh in meshes.into_iter().filter(|mesh| mesh.is_shown() || !any_shown) {
        if !shown.iter().any(|other| other.is_same_mesh(mesh)) {
            shown.push(mesh);
        }
    }
    (shown, simple)
}

/// Mass, its centre and rough moments of a body from its shapes.
fn mass_of(geoms: &[MjcfGeom]) -> (f64, Point3<f64>, [f64; 3]) {
    let at = |geom: &MjcfGeom| Point3::from(geom.pose.translation.vector);
    let mass_kg: f64 = geoms.iter().map(|geom| geom.mass_kg).sum();
    let moments = geoms.iter().map(|geom| at(geom).coords * geom.mass_kg);
    let sum: Vector3<f64> = moments.sum();
    let com = match mass_kg > 0.0 {
        true => Point3::from(sum / mass_kg),
        false => Point3::origin(),
    };
    let about_com = |geom: &MjcfGeom| {
        let apart = (at(geom) - com).norm_squared();
        geom.mass_kg * (0.4 * geom.reach_m * geom.reach_m + apart)
    };
    (mass_kg, com, [geoms.iter().map(about_com).sum(); 3])
}

/// Rounded as the converted file has it, so that both are one robot.
fn pose(pose: &Isometry3<f64>) -> Pose {
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    Pose {
        xyz: Vec3(<[f64; 3]>::from(pose.translation.vector).map(to_nanometres)),
        rpy: Vec3([roll, pitch, yaw].map(to_nanometres)),
    }
}

fn inertial(value: f64, com: Point3<f64>, moments: [f64; 3]) -> Inertial {
    let [ixx, iyy, izz] = moments.map(|m| format!("{m:.6e}").parse().unwrap_or(m));
    Inertial {
        origin: Pose {
            xyz: Vec3(<[f64; 3]>::from(com.coords).map(to_nanometres)),
            rpy: Vec3::default(),
        },
        mass: Mass { value },
        inertia: Inertia { ixx, iyy, izz, ..Inertia::default() },
    }
}

fn to_nanometres(value: f64) -> f64 {
    format!("{value:.9}").parse().unwrap_or(value)
}

fn range(joint: MjcfElement, kind: &str) -> Result<Option<[f64; 2]>, RetargetError> {
    let attributes = joint.attributes;
    let given = joint.numbers("range")?;
    let limited = match joint.text("limited") {
        Some("true") => true,
        Some("false") => false,
        _ => attributes.autolimits && given.is_some(),
    };
    let Some([low, high]) = given.as_deref().and_then(|r| r.first_chunk::<2>()).copied() else {
        return Ok(None);
    };
    if !limited {
        return Ok(None);
    }
    Ok(Some(match kind {
        "slide" => [low, high],
        // One angle from the middle, any way.
        "ball" => [-attributes.radians(high), attributes.radians(high)],
        _ => [attributes.radians(low), attributes.radians(high)],
    }))
}
