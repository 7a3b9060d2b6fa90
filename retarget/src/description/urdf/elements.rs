//! The elements of a URDF, one function each: what the file says, repaired.

use std::collections::HashMap;

use k::nalgebra::{Quaternion, UnitQuaternion};
use roxmltree::Node;
use urdf_rs::{Axis, Collision, Color, Geometry, Inertia, Inertial, JointLimit, JointType};
use urdf_rs::{LinkName, Mass, Material, Mimic, Pose, Vec3, Vec4, Visual};

use crate::description::diagnostic::{DiagnosticCode, Diagnostics};

/// Rates that newer files give in `<limit>`, as they stand:
/// radians (metres) and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RateLimits {
    pub acceleration: Option<f64>,
    pub deceleration: Option<f64>,
    pub jerk: Option<f64>,
}

/// Red, green, blue and alpha, 0 to 1, by the name of a material.
pub(super) type NamedColors = HashMap<String, [f64; 4]>;

pub(crate) type RateLimitsByJoint = HashMap<String, RateLimits>;

/// The joint or link that an attribute belongs to, for diagnostics.
#[derive(Clone, Copy)]
enum Owner<'a> {
    Joint(&'a str),
    Link(&'a str),
}

pub(super) struct ElementReader<'f> {
    pub rates: RateLimitsByJoint,
    /// `quat_xyzw` counts from URDF 1.1 on.
    has_quaternions: bool,
    colors: NamedColors,
    diagnostics: &'f mut Diagnostics,
}

impl<'f> ElementReader<'f> {
    pub fn new(root: Node, colors: NamedColors, diagnostics: &'f mut Diagnostics) -> Self {
        let version = root.attribute("version").unwrap_or("1.0");
        let version = version.trim().split_once('.').and_then(|(major, minor)| {
            Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?))
        });
        Self {
            rates: RateLimitsByJoint::new(),
            has_quaternions: version.is_some_and(|version| version >= (1, 1)),
            colors,
            diagnostics,
        }
    }

    fn report(&mut self, code: DiagnosticCode, subject: &str, message: impl Into<String>) {
        self.diagnostics.add(code, subject, message);
    }

    fn refuse_joint(&mut self, code: DiagnosticCode, joint: &str, reason: impl Into<String>) {
        self.diagnostics.refuse_joint(code, joint, reason);
    }

    /// The one child of this name; a second one is reported and passed over.
    fn only<'a, 'd: 'a>(
        &mut self,
        node: Node<'a, 'd>,
        name: &'static str,
        subject: &str,
    ) -> Option<Node<'a, 'd>> {
        let mut found = children(node, name);
        let first = found.next();
        if found.next().is_some() {
            let message = format!("<{name}> stands twice; the first is used");
            self.report(DiagnosticCode::ElementTwice, subject, message);
        }
        first
    }

    fn name(&mut self, node: Node, kind: &str) -> Option<String> {
        match node.attribute("name") {
            Some(name) if !name.trim().is_empty() => Some(plain(name)),
            _ => {
                let line = node.document().text_pos_at(node.range().start).row;
                let reason = format!("a {kind} without a name (line {line})");
                self.diagnostics.refuse_tree(DiagnosticCode::NameMissing, reason);
                None
            }
        }
    }

    /// The numbers of an attribute, `default` where it is left out; refused
    /// where they cannot be read.
    fn vector<const N: usize>(
        &mut self,
        node: Option<Node>,
        key: &str,
        default: [f64; N],
        owner: Owner,
    ) -> [f64; N] {
        let Some(text) = node.and_then(|node| node.attribute(key)) else {
            return default;
        };
        if let Some(values) = numbers(text) {
            return values;
        }
        let code = DiagnosticCode::NumberUnreadable;
        let element = node.map_or("", |node| node.tag_name().name());
        let reason = format!("<{element} {key}=\"{text}\">: expected {N} number(s)");
        match owner {
            Owner::Joint(name) => self.diagnostics.refuse_joint(code, name, reason),
            Owner::Link(name) => self.diagnostics.refuse_link(code, name, reason),
        }
        default
    }

    fn number(&mut self, node: Option<Node>, key: &str, default: f64, owner: Owner) -> f64 {
        let [value] = self.vector(node, key, [default], owner);
        value
    }

    fn origin(&mut self, node: Node, owner: Owner) -> Pose {
        let (Owner::Joint(name) | Owner::Link(name)) = owner;
        let origin = self.only(node, "origin", name);
        let xyz = Vec3(self.vector(origin, "xyz", [0.0; 3], owner));
        let mut rpy = Vec3(self.vector(origin, "rpy", [0.0; 3], owner));
        let turned = origin.filter(|origin| origin.attribute("rpy").is_none());
        let quat = turned.and_then(|origin| origin.attribute("quat_xyzw"));
        if let (true, Some([x, y, z, w])) = (self.has_quaternions, quat.and_then(numbers)) {
            let quaternion = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0);
            let (roll, pitch, yaw) = quaternion.unwrap_or_default().euler_angles();
            rpy = Vec3([roll, pitch, yaw]);
        }
        Pose { xyz, rpy }
    }

    pub fn link(&mut self, node: Node) -> Option<urdf_rs::Link> {
        let name = self.name(node, "link")?;
        let inertial = self.only(node, "inertial", &name);
        let inertial = inertial.map(|inertial| self.inertial(inertial, &name));
        let visual = children(node, "visual").filter_map(|shape| {
            let (origin, geometry) = self.shape("visual", shape, &name)?;
            let material = self.only(shape, "material", &name);
            Some(Visual {
                name: None,
                origin,
                geometry,
                material: material.map(|material| self.material(material)),
            })
        });
        let visual = visual.collect();
        let collision = children(node, "collision").filter_map(|shape| {
            let (origin, geometry) = self.shape("collision", shape, &name)?;
            Some(Collision { name: None, origin, geometry })
        });
        let collision = collision.collect();
        Some(urdf_rs::Link { name, inertial: inertial.unwrap_or_default(), visual, collision })
    }

    fn inertial(&mut self, node: Node, link: &str) -> Inertial {
        let owner = Owner::Link(link);
        let mass = self.only(node, "mass", link);
        let inertia = self.only(node, "inertia", link);
        for (element, name) in [(mass, "mass"), (inertia, "inertia")] {
            if element.is_none() {
                let message = format!("<inertial> without <{name}>; it counts as zero");
                self.report(DiagnosticCode::InertialIncomplete, link, message);
            }
        }
        let origin = self.origin(node, owner);
        let value = self.number(mass, "value", 0.0, owner);
        let mut moment = |key| self.number(inertia, key, 0.0, owner);
        Inertial {
            origin,
            mass: Mass { value },
            inertia: Inertia {
                ixx: moment("ixx"),
                ixy: moment("ixy"),
                ixz: moment("ixz"),
                iyy: moment("iyy"),
                iyz: moment("iyz"),
                izz: moment("izz"),
            },
        }
    }

    /// Pose and geometry of a visual or collision, if they can be read.
    fn shape(&mut self, kind: &'static str, node: Node, link: &str) -> Option<(Pose, Geometry)> {
        let geometry = self.geometry(node, kind, link)?;
        Some((self.origin(node, Owner::Link(link)), geometry))
    }

    fn geometry(&mut self, node: Node, kind: &str, link: &str) -> Option<Geometry> {
        let geometry = self.only(node, "geometry", link);
        let mut shapes = geometry.into_iter().flat_map(|g| g.children()).filter(Node::is_element);
        let first = shapes.next();
        if shapes.next().is_some() {
            let message = format!("the geometry of a {kind} holds two shapes; the first is used");
            self.report(DiagnosticCode::GeometryTwo, link, message);
        }
        let name = first.map_or("nothing", |shape| shape.tag_name().name());
        let read = first.and_then(simple_geometry);
        if read.is_none() {
            let message = format!("the geometry of a {kind} ({name}) cannot be read; left out");
            self.report(DiagnosticCode::GeometryUnreadable, link, message);
        }
        read
    }

    pub fn material(&mut self, node: Node) -> Material {
        let name = node.attribute("name").unwrap_or_default();
        let texture = children(node, "texture").next();
        if texture.is_some_and(|texture| texture.attribute("filename").is_none()) {
            let message = "a texture without a file name; left out";
            self.report(DiagnosticCode::TextureUnnamed, name, message);
        }
        let rgba = color_of(node).or_else(|| self.colors.get(name).copied());
        Material {
            name: plain(name),
            color: rgba.map(|rgba| Color { rgba: Vec4(rgba) }),
            texture: None,
        }
    }

    pub fn joint(&mut self, node: Node) -> Option<urdf_rs::Joint> {
        let name = self.name(node, "joint")?;
        let joint_type = match node.attribute("type").unwrap_or_default() {
            "revolute" => JointType::Revolute,
            "continuous" => JointType::Continuous,
            "prismatic" => JointType::Prismatic,
            "fixed" => JointType::Fixed,
            held @ ("floating" | "planar" | "spherical") => {
                let message = format!("a {held} joint has no one position; held fixed");
                self.report(DiagnosticCode::RootFloating, &name, message);
                JointType::Fixed
            }
            other => {
                let reason = format!(
                    "type \"{other}\" is none of revolute, continuous, prismatic, fixed, \
                     floating, planar"
                );
                self.refuse_joint(DiagnosticCode::TypeUnknown, &name, reason);
                return None;
            }
        };
        let ends = ["parent", "child"].map(|end| {
            let link = self.only(node, end, &name)?.attribute("link")?;
            Some(LinkName { link: plain(link) })
        });
        let [Some(parent), Some(child)] = ends else {
            let reason = "parent or child link is not given";
            self.refuse_joint(DiagnosticCode::LinkUnknown, &name, reason);
            return None;
        };
        let mut joint = urdf_rs::Joint {
            origin: self.origin(node, Owner::Joint(&name)),
            name,
            joint_type,
            parent,
            child,
            axis: Axis::default(),
            limit: JointLimit::default(),
            calibration: None,
            dynamics: None,
            mimic: None,
            safety_controller: None,
        };
        let mimic = self.only(node, "mimic", &joint.name);
        if joint.joint_type != JointType::Fixed {
            joint.axis = self.axis(node, &joint.name);
            joint.limit = self.limit(node, &joint.name);
            joint.mimic = mimic.and_then(|mimic| self.mimic(mimic, &joint.name));
        } else if mimic.is_some() {
            let message = "a fixed joint cannot follow another; it stays";
            self.report(DiagnosticCode::MimicOnFixed, &joint.name, message);
        }
        Some(joint)
    }

    fn axis(&mut self, node: Node, joint: &str) -> Axis {
        let axis = self.only(node, "axis", joint);
        if axis.and_then(|axis| axis.attribute("xyz")).is_none() {
            let message = "no axis; 1 0 0 is used";
            self.report(DiagnosticCode::AxisUnset, joint, message);
        }
        let xyz = self.vector(axis, "xyz", *Axis::default().xyz, Owner::Joint(joint));
        Axis { xyz: Vec3(xyz) }
    }

    fn limit(&mut self, node: Node, joint: &str) -> JointLimit {
        let limit = self.only(node, "limit", joint);
        let mut value = |key| self.number(limit, key, 0.0, Owner::Joint(joint));
        let read = JointLimit {
            lower: value("lower"),
            upper: value("upper"),
            effort: value("effort"),
            velocity: value("velocity"),
        };
        self.rate_limits(limit, joint);
        read
    }

    /// Acceleration, deceleration and jerk, which `urdf_rs` has no place for.
    fn rate_limits(&mut self, limit: Option<Node>, joint: &str) {
        let mut given = Vec::new();
        let mut rate = |key: &str| {
            let text = limit?.attribute(key)?;
            given.push(format!("{key} {text}"));
            let [value] = numbers(text)?;
            (value.is_finite() && value > 0.0).then_some(value)
        };
        let rates = RateLimits {
            acceleration: rate("acceleration"),
            deceleration: rate("deceleration"),
            jerk: rate("jerk"),
        };
        if !given.is_empty() {
            let message = format!("<limit> also gives {}", given.join(", "));
            self.report(DiagnosticCode::LimitExtended, joint, message);
            self.rates.insert(joint.to_owned(), rates);
        }
    }

    fn mimic(&mut self, node: Node, joint: &str) -> Option<Mimic> {
        let Some(followed) = node.attribute("joint") else {
            let reason = "<mimic> names no joint";
            self.refuse_joint(DiagnosticCode::MimicUnknown, joint, reason);
            return None;
        };
        let mut value =
            |key, default| Some(self.number(Some(node), key, default, Owner::Joint(joint)));
        Some(Mimic {
            multiplier: value("multiplier", 1.0),
            offset: value("offset", 0.0),
            joint: plain(followed),
        })
    }
}

fn simple_geometry(shape: Node) -> Option<Geometry> {
    let number = |key: &str| shape.attribute(key).and_then(numbers).map(|[value]| value);
    let vector = |key: &str| shape.attribute(key).and_then(numbers).map(Vec3);
    Some(match shape.tag_name().name() {
        "box" => Geometry::Box { size: vector("size")? },
        "sphere" => Geometry::Sphere { radius: number("radius")? },
        "cylinder" => Geometry::Cylinder { radius: number("radius")?, length: number("length")? },
        "capsule" => Geometry::Capsule { radius: number("radius")?, length: number("length")? },
        "mesh" => {
            Geometry::Mesh { filename: plain(shape.attribute("filename")?), scale: vector("scale") }
        }
        _ => return None,
    })
}

/// The colour that a material itself has.
pub(super) fn color_of(material: Node) -> Option<[f64; 4]> {
    let color = children(material, "color").next()?;
    color.attribute("rgba").and_then(numbers)
}

pub(super) fn children<'a, 'd: 'a>(
    node: Node<'a, 'd>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'd>> {
    node.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

pub(super) fn plain(text: &str) -> String {
    text.replace(char::is_control, " ")
}

/// A number, or a vector of them with blanks between; with a comma between all
/// of them, too (what has both, or too many, may be decimal commas).
pub(super) fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    if has_commas(text) {
        return fill(text.split(',').map(str::trim));
    }
    fill(text.split_whitespace())
}

/// Whether a text could be a vector with commas between its numbers.
pub(super) fn has_commas(text: &str) -> bool {
    text.matches(',').count() > 1
}

fn fill<'a, const N: usize>(mut words: impl Iterator<Item = &'a str>) -> Option<[f64; N]> {
    let mut values = [0.0; N];
    for value in &mut values {
        *value = words.next()?.parse().ok()?;
    }
    words.next().is_none().then_some(values)
}
