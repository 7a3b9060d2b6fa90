//! Bodies and joints of an MJCF model as links and joints of a tree.

use std::collections::HashSet;

use k::nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::attributes::{Attributes, from_z};
use crate::RetargetError;
use crate::finding::{Code, Findings};

/// Density of shapes without mass, kg/m^3.
const DENSITY: f64 = 1000.0;

/// A box, cylinder or ball in its link's frame.
pub(super) struct Geom {
    pub pose: Isometry3<f64>,
    pub shape: GeomShape,
    pub rgba: [f64; 4],
}

pub(super) enum GeomShape {
    Box([f64; 3]),
    Cylinder { radius: f64, length: f64 },
    Sphere { radius: f64 },
}

#[derive(Default)]
pub(super) struct Link {
    pub name: String,
    pub mass_kg: f64,
    pub com: Point3<f64>,
    /// Moments about the link's axes, kg m^2; rough where shapes give them.
    pub moments: [f64; 3],
    pub geoms: Vec<Geom>,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Fixed,
    Hinge,
    Slide,
}

pub(super) struct Joint {
    pub name: String,
    pub kind: Kind,
    pub parent: usize,
    pub child: usize,
    pub origin: Isometry3<f64>,
    pub axis: [f64; 3],
    pub range: Option<[f64; 2]>,
    pub effort: f64,
    pub mimic: Option<(String, f64, f64)>,
}

/// The tree so far.
#[derive(Default)]
pub(super) struct Bodies {
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
    names: HashSet<String>,
}

impl Bodies {
    /// The body with the most joints, and all below it.
    pub fn read(
        root: Node,
        attributes: &Attributes,
        findings: &mut Findings,
    ) -> Result<Self, RetargetError> {
        let mut bodies: Vec<Node> = root
            .children()
            .filter(|node| node.has_tag_name("worldbody"))
            .flat_map(|world| world.children())
            .filter(|node| node.has_tag_name("body"))
            .collect();
        let joints = |body: &Node| {
            body.descendants()
                .filter(|n| n.has_tag_name("joint"))
                .count()
        };
        bodies.sort_by_key(|body| std::cmp::Reverse(joints(body)));
        let Some(robot) = bodies.first() else {
            return Err(RetargetError::Mjcf(
                "there is no <body> in <worldbody>".into(),
            ));
        };
        for other in &bodies[1..] {
            let name = other.attribute("name").unwrap_or("(unnamed)");
            findings.add(
                Code::MjcfLeftOut,
                name,
                "an object beside the robot: left out",
            );
        }
        let mut tree = Self::default();
        let world = robot
            .parent()
            .and_then(|world| world.attribute("childclass"));
        tree.body(*robot, None, world.unwrap_or("main"), attributes, findings)?;
        Ok(tree)
    }

    /// A name that no other link or joint has.
    fn unique(&mut self, wanted: Option<&str>, otherwise: String) -> String {
        let base = match wanted {
            Some(name) if !name.trim().is_empty() => name.to_owned(),
            _ => otherwise,
        };
        let mut name = base.clone();
        let mut count = 1;
        while !self.names.insert(name.clone()) {
            count += 1;
            name = format!("{base}_{count}");
        }
        name
    }

    /// Adds a body and those in it. `above`: the link that carries it and the
    /// carrier's body frame in that link's.
    fn body(
        &mut self,
        node: Node,
        above: Option<(usize, Isometry3<f64>)>,
        outer_class: &str,
        attributes: &Attributes,
        findings: &mut Findings,
    ) -> Result<(), RetargetError> {
        let class = node.attribute("childclass").unwrap_or(outer_class);
        let number = self.links.len();
        let name = self.unique(node.attribute("name"), format!("body_{number}"));
        let pose = attributes.pose(node, class)?;
        let elements = |tag: &'static str| node.children().filter(move |c| c.has_tag_name(tag));
        // Where the body's frame is in the frame of the link made last.
        let mut frame = Isometry3::identity();
        let mut carrier = above.map(|(link, in_link)| (link, in_link * pose));
        for (index, joint) in elements("joint").enumerate() {
            let kind = attributes.text(joint, class, "type").unwrap_or("hinge");
            let Some((link, in_link)) = carrier else {
                findings.add(
                    Code::MjcfLeftOut,
                    joint.attribute("name").unwrap_or(kind),
                    "a joint of the root against the world: held",
                );
                continue;
            };
            let axes: &[[f64; 3]] = match kind {
                "ball" => &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                "free" => continue,
                _ => &[attributes.vector(joint, class, "axis", [0.0, 0.0, 1.0])?],
            };
            let anchor = attributes.vector(joint, class, "pos", [0.0; 3])?;
            let anchor = Translation3::from(Vector3::from(anchor));
            let joint_name = joint.attribute("name");
            let plain = self.unique(joint_name, format!("{name}_joint_{index}"));
            if kind == "ball" {
                let message = "a ball joint: three hinges stand for it";
                findings.add(Code::MjcfBall, &plain, message);
            }
            let (mut link, mut in_link) = (link, in_link);
            for (axis, letter) in axes.iter().zip(["x", "y", "z"]) {
                let joint_name = match kind {
                    "ball" => self.unique(None, format!("{plain}_{letter}")),
                    _ => plain.clone(),
                };
                let child = self.links.len();
                let link_name = format!("{joint_name}_link");
                self.links.push(Link {
                    name: link_name,
                    ..Link::default()
                });
                self.joints.push(Joint {
                    name: joint_name,
                    kind: if kind == "slide" {
                        Kind::Slide
                    } else {
                        Kind::Hinge
                    },
                    parent: link,
                    child,
                    origin: in_link * anchor,
                    axis: *axis,
                    range: range(joint, class, kind, attributes)?,
                    effort: effort(joint, class, attributes)?,
                    mimic: None,
                });
                link = child;
                in_link = anchor.inverse().into();
            }
            carrier = Some((link, in_link));
        }
        // The last joint's link is the body itself, its frame at the anchor.
        let link = match carrier {
            Some((link, in_link)) if elements("joint").count() > 0 && link >= number => {
                frame = in_link;
                self.links[link].name.clone_from(&name);
                link
            }
            Some((parent, in_link)) => {
                let link = self.links.len();
                self.links.push(Link {
                    name: name.clone(),
                    ..Link::default()
                });
                let joint = self.unique(None, format!("{name}_fixed"));
                self.joints.push(Joint {
                    name: joint,
                    kind: Kind::Fixed,
                    parent,
                    child: link,
                    origin: in_link,
                    axis: [0.0, 0.0, 1.0],
                    range: None,
                    effort: 0.0,
                    mimic: None,
                });
                link
            }
            None => {
                self.links.push(Link {
                    name: name.clone(),
                    ..Link::default()
                });
                number
            }
        };
        self.matter(node, link, frame, class, attributes, findings)?;
        for child in elements("body") {
            self.body(child, Some((link, frame)), class, attributes, findings)?;
        }
        Ok(())
    }

    /// Shapes and masses of a body.
    fn matter(
        &mut self,
        node: Node,
        link: usize,
        frame: Isometry3<f64>,
        class: &str,
        attributes: &Attributes,
        findings: &mut Findings,
    ) -> Result<(), RetargetError> {
        let mut weights: Vec<(f64, Point3<f64>, f64)> = Vec::new();
        let mut meshes = 0;
        for node in node.children().filter(|child| child.has_tag_name("geom")) {
            match geom(node, class, attributes)? {
                Some((mut geom, mass_kg, radius)) => {
                    geom.pose = frame * geom.pose;
                    let at = Point3::from(geom.pose.translation.vector);
                    weights.push((mass_kg, at, radius));
                    self.links[link].geoms.push(geom);
                }
                None => meshes += 1,
            }
        }
        if meshes > 0 {
            let message = format!("{meshes} shapes that are no box, cylinder or ball: left out");
            findings.add(Code::MjcfLeftOut, &self.links[link].name, message);
        }
        let link = &mut self.links[link];
        if let Some(inertial) = node.children().find(|child| child.has_tag_name("inertial")) {
            let pose = frame * attributes.pose(inertial, class)?;
            link.com = Point3::from(pose.translation.vector);
            let [mass_kg] = attributes.vector(inertial, class, "mass", [0.0])?;
            link.mass_kg = mass_kg;
            let diagonal = attributes.vector(inertial, class, "diaginertia", [0.0; 3])?;
            let full = attributes.vector(inertial, class, "fullinertia", diagonal)?;
            link.moments = full;
        } else {
            link.mass_kg = weights.iter().map(|(kg, ..)| kg).sum();
            let sum: Vector3<f64> = weights.iter().map(|(kg, at, _)| at.coords * *kg).sum();
            if link.mass_kg > 0.0 {
                link.com = Point3::from(sum / link.mass_kg);
            }
            let spread: f64 = weights
                .iter()
                .map(|(kg, at, r)| kg * (0.4 * r * r + (at - link.com).norm_squared()))
                .sum();
            link.moments = [spread; 3];
        }
        Ok(())
    }

    /// Joint equalities become mimics.
    pub fn couple(&mut self, root: Node, attributes: &Attributes, findings: &mut Findings) {
        let equalities = root.children().filter(|node| node.has_tag_name("equality"));
        let pairs = equalities.flat_map(|equality| equality.children());
        for pair in pairs.filter(|node| node.has_tag_name("joint")) {
            let (Some(follower), Some(leader)) =
                (pair.attribute("joint1"), pair.attribute("joint2"))
            else {
                continue;
            };
            let known = |name: &str| self.joints.iter().any(|joint| joint.name == name);
            let law = attributes.vector(pair, "main", "polycoef", [0.0, 1.0, 0.0, 0.0, 0.0]);
            let (true, true, Ok(law)) = (known(follower), known(leader), law) else {
                continue;
            };
            if law[2..].iter().any(|part| *part != 0.0) {
                let message = "follows by a curve: taken as a line";
                findings.add(Code::MjcfLeftOut, follower, message);
            }
            for joint in self
                .joints
                .iter_mut()
                .filter(|joint| joint.name == follower)
            {
                joint.mimic = Some((leader.to_owned(), law[1], law[0]));
            }
        }
    }

    /// Strength of the motors, where the joints do not say it.
    pub fn strengthen(&mut self, root: Node, attributes: &Attributes) {
        let actuators = root.children().filter(|node| node.has_tag_name("actuator"));
        for motor in actuators.flat_map(|actuator| actuator.children()) {
            let Some(name) = motor.attribute("joint") else {
                continue;
            };
            let number = |key: &str| {
                let values = attributes.numbers(motor, "main", key).ok().flatten()?;
                let last = if key == "gear" {
                    values.first()
                } else {
                    values.last()
                };
                last.copied()
            };
            let gear = number("gear").unwrap_or(1.0);
            let control = match motor.has_tag_name("motor") {
                true => number("ctrlrange"),
                false => None,
            };
            let Some(force) = number("forcerange").or(control) else {
                continue;
            };
            for joint in self
                .joints
                .iter_mut()
                .filter(|j| j.name == name && j.effort == 0.0)
            {
                joint.effort = (force * gear).abs();
            }
        }
    }
}

fn range(
    joint: Node,
    class: &str,
    kind: &str,
    attributes: &Attributes,
) -> Result<Option<[f64; 2]>, RetargetError> {
    let given = attributes.numbers(joint, class, "range")?;
    let limited = match attributes.text(joint, class, "limited") {
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

fn effort(joint: Node, class: &str, attributes: &Attributes) -> Result<f64, RetargetError> {
    let given = attributes.numbers(joint, class, "actuatorfrcrange")?;
    Ok(given
        .and_then(|range| range.last().copied())
        .unwrap_or(0.0)
        .abs())
}

/// A simple shape with its mass and the radius of a ball about it.
fn geom(
    node: Node,
    class: &str,
    attributes: &Attributes,
) -> Result<Option<(Geom, f64, f64)>, RetargetError> {
    let mut pose = attributes.pose(node, class)?;
    let size = attributes.numbers(node, class, "size")?.unwrap_or_default();
    let part = |index: usize| size.get(index).copied().unwrap_or(0.0).abs();
    let kind = attributes.text(node, class, "type").unwrap_or("sphere");
    let mut half_length = part(1);
    if let Some([a, b, c, d, e, f]) = attributes.numbers(node, class, "fromto")?.as_deref() {
        let (from, to) = (Vector3::new(*a, *b, *c), Vector3::new(*d, *e, *f));
        half_length = (to - from).norm() / 2.0;
        let turned = match half_length > 1e-9 {
            true => from_z(to - from),
            false => UnitQuaternion::identity(),
        };
        pose = Isometry3::from_parts(Translation3::from((from + to) / 2.0), turned);
    }
    let fromto = attributes.text(node, class, "fromto").is_some();
    let radius = part(0);
    let pi = std::f64::consts::PI;
    let (shape, volume, reach) = match kind {
        "sphere" => (
            GeomShape::Sphere { radius },
            4.0 / 3.0 * pi * radius.powi(3),
            radius,
        ),
        "capsule" | "cylinder" => {
            let caps = if kind == "capsule" { radius } else { 0.0 };
            let length = 2.0 * (half_length + caps);
            let ends = if kind == "capsule" {
                4.0 / 3.0 * pi * radius.powi(3)
            } else {
                0.0
            };
            let volume = pi * radius * radius * 2.0 * half_length + ends;
            (
                GeomShape::Cylinder { radius, length },
                volume,
                half_length.max(radius),
            )
        }
        "box" | "ellipsoid" => {
            let half = match fromto {
                true => [radius, radius, half_length],
                false => [part(0), part(1), part(2)],
            };
            let share = if kind == "box" { 8.0 } else { 4.0 / 3.0 * pi };
            let volume = share * half.iter().product::<f64>();
            (
                GeomShape::Box(half.map(|h| 2.0 * h)),
                volume,
                half.into_iter().fold(0.0, f64::max),
            )
        }
        _ => return Ok(None),
    };
    let [density] = attributes.vector(node, class, "density", [DENSITY])?;
    let [mass_kg] = attributes.vector(node, class, "mass", [density * volume])?;
    let rgba = attributes.vector(node, class, "rgba", [0.5, 0.5, 0.5, 1.0])?;
    Ok(Some((Geom { pose, shape, rgba }, mass_kg.max(0.0), reach)))
}
