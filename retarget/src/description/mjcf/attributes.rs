//! Attributes with their defaults: classes, units, orientations.

use std::collections::HashMap;

use crate::config::RetargetError;
use k::nalgebra::{
    Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};
use roxmltree::Node;
use urdf_rs::Geometry;

/// A mesh as shapes refer to it.
#[derive(Clone, Debug)]
pub(super) struct MeshAsset {
    /// The file, by its way from the model's folder, and the scale of its corners.
    pub geometry: Geometry,
    /// The file's frame in that of a shape.
    pub pose: Isometry3<f64>,
}

type DefaultClasses = HashMap<String, HashMap<(String, String), String>>;

pub(super) struct MjcfAttributes {
    classes: DefaultClasses,
    angle: f64,
    euler: Vec<char>,
    pub autolimits: bool,
    /// Colours of the materials among the assets, by name.
    pub materials: HashMap<String, [f64; 4]>,
    /// Meshes among the assets, by name: see `meshes`.
    pub meshes: HashMap<String, MeshAsset>,
}

fn child<'a, 'd>(node: Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    node.children().find(|child| child.has_tag_name(name))
}

impl MjcfAttributes {
    pub fn new(root: Node) -> Result<Self, RetargetError> {
        let compiler = child(root, "compiler");
        let setting = |key: &str| compiler.and_then(|compiler| compiler.attribute(key));
        if setting("coordinate") == Some("global") {
            let reason = "compiler coordinate=\"global\" is not supported: use local";
            return Err(RetargetError::Mjcf(reason.into()));
        }
        let euler = setting("eulerseq").unwrap_or("xyz");
        if euler.len() != 3 || !euler.chars().all(|c| "xyzXYZ".contains(c)) {
            return Err(RetargetError::Mjcf(format!("eulerseq \"{euler}\" is none")));
        }
        let mut classes = DefaultClasses::new();
        for default in root.children().filter(|node| node.has_tag_name("default")) {
            let name = default.attribute("class").unwrap_or("main");
            add_class(default, name, &HashMap::new(), &mut classes);
        }
        let mut attributes = Self {
            classes,
            angle: match setting("angle") {
                Some("radian") => 1.0,
                _ => 1.0_f64.to_radians(),
            },
            euler: euler.chars().collect(),
            autolimits: setting("autolimits") != Some("false"),
            materials: HashMap::new(),
            meshes: HashMap::new(),
        };
        attributes.materials = attributes.read_materials(root)?;
        Ok(attributes)
    }

    fn read_materials(&self, root: Node) -> Result<HashMap<String, [f64; 4]>, RetargetError> {
        let mut colors = HashMap::new();
        for material in self.assets(root, "material") {
            if let Some(name) = material.node.attribute("name") {
                colors.insert(name.to_owned(), material.vector("rgba", [1.0; 4])?);
            }
        }
        Ok(colors)
    }

    /// The assets of a kind.
    pub fn assets<'a>(
        &'a self,
        root: Node<'a, 'a>,
        tag: &'static str,
    ) -> impl Iterator<Item = MjcfElement<'a>> {
        let root = MjcfElement::new(root, "main", self);
        root.children("asset").flat_map(move |asset| asset.children(tag))
    }

    /// An angle of the file in radians.
    pub fn radians(&self, angle: f64) -> f64 {
        angle * self.angle
    }

    fn euler(&self, angles: [f64; 3]) -> UnitQuaternion<f64> {
        let mut turned = UnitQuaternion::identity();
        for (letter, angle) in self.euler.iter().zip(angles) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => Vector3::x_axis(),
                'y' => Vector3::y_axis(),
                _ => Vector3::z_axis(),
            };
            let step = UnitQuaternion::from_axis_angle(&axis, self.radians(angle));
            // Small letters turn about the turned axes, capitals about fixed ones.
            turned = match letter.is_lowercase() {
                true => turned * step,
                false => step * turned,
            };
        }
        turned
    }
}

/// An element and the class that the bodies around it ask for.
#[derive(Clone, Copy)]
pub(super) struct MjcfElement<'a> {
    pub node: Node<'a, 'a>,
    pub class: &'a str,
    pub attributes: &'a MjcfAttributes,
    /// The frame around it in that of its body.
    pub around: Isometry3<f64>,
}

impl<'a> MjcfElement<'a> {
    pub fn new(node: Node<'a, 'a>, class: &'a str, attributes: &'a MjcfAttributes) -> Self {
        Self { node, class, attributes, around: Isometry3::identity() }
    }

    /// A child of this one, or any other element, with the same class around it.
    pub fn at(self, node: Node<'a, 'a>) -> Self {
        Self::new(node, self.class, self.attributes)
    }

    /// The children of this name.
    pub fn children(self, tag: &'static str) -> impl Iterator<Item = Self> {
        let named = self.node.children().filter(move |child| child.has_tag_name(tag));
        named.map(move |node| self.at(node))
    }

    /// The same of a body, with what stands in a `frame`. Fails where a frame's numbers cannot be
    /// read.
    pub fn parts(self, tag: &str) -> Result<Vec<Self>, RetargetError> {
        let mut found = Vec::new();
        self.at(self.node).gather(tag, &mut found)?;
        Ok(found)
    }

    /// Frames are nested as deep as `check_depth` allows at most.
    fn gather(self, tag: &str, found: &mut Vec<Self>) -> Result<(), RetargetError> {
        for node in self.node.children() {
            let child = Self { node, ..self };
            if node.has_tag_name(tag) {
                found.push(child);
            } else if node.has_tag_name("frame") {
                let class = node.attribute("childclass").unwrap_or(self.class);
                Self { class, around: child.pose()?, ..child }.gather(tag, found)?;
            }
        }
        Ok(())
    }

    /// An attribute, or its class's.
    pub fn text(self, key: &str) -> Option<&'a str> {
        let class = self.node.attribute("class").unwrap_or(self.class);
        self.node.attribute(key).or_else(|| {
            let classes = &self.attributes.classes;
            let defaults = classes.get(class).or_else(|| classes.get("main"))?;
            let element = self.node.tag_name().name().to_owned();
            defaults.get(&(element, key.to_owned())).map(String::as_str)
        })
    }

    /// All numbers of an attribute; `None` if it is not there.
    pub fn numbers(self, key: &str) -> Result<Option<Vec<f64>>, RetargetError> {
        let Some(text) = self.text(key) else {
            return Ok(None);
        };
        let parsed: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
        match parsed {
            Ok(values) if values.iter().all(|v| v.is_finite() && v.abs() < 1e9) => Ok(Some(values)),
            _ => {
                let line = self.node.document().text_pos_at(self.node.range().start).row;
                let element = self.node.tag_name().name();
                Err(RetargetError::Mjcf(format!(
                    "line {line}: <{element} {key}=\"{text}\"> holds no usable numbers"
                )))
            }
        }
    }

    /// Exactly `N` numbers, or what stands for them.
    pub fn vector<const N: usize>(
        self,
        key: &str,
        default: [f64; N],
    ) -> Result<[f64; N], RetargetError> {
        let values = self.numbers(key)?;
        let values = values.as_deref().and_then(|values| values.first_chunk::<N>());
        Ok(values.copied().unwrap_or(default))
    }

    /// `pos` and whichever orientation is given, in the body around.
    pub fn pose(self) -> Result<Isometry3<f64>, RetargetError> {
        let at = Vector3::from(self.vector("pos", [0.0; 3])?);
        Ok(self.around * Isometry3::from_parts(Translation3::from(at), self.orientation()?))
    }

    fn orientation(self) -> Result<UnitQuaternion<f64>, RetargetError> {
        if let Some(quaternion) = self.numbers("quat")?.filter(|numbers| numbers.len() == 4) {
            return Ok(unit_quaternion(&quaternion));
        }
        if let Some([x, y, z, angle]) = self.numbers("axisangle")?.as_deref() {
            let axis = Unit::try_new(Vector3::new(*x, *y, *z), 1e-9);
            let turn =
                |axis| UnitQuaternion::from_axis_angle(&axis, self.attributes.radians(*angle));
            return Ok(axis.map_or_else(UnitQuaternion::identity, turn));
        }
        if let Some([a, b, c]) = self.numbers("euler")?.as_deref() {
            return Ok(self.attributes.euler([*a, *b, *c]));
        }
        if let Some([a, b, c, d, e, f]) = self.numbers("xyaxes")?.as_deref() {
            let x = Vector3::new(*a, *b, *c).try_normalize(1e-9);
            let y = Vector3::new(*d, *e, *f);
            let y = x.and_then(|x| (y - x * x.dot(&y)).try_normalize(1e-9));
            if let (Some(x), Some(y)) = (x, y) {
                let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
                let rotation = Rotation3::from_matrix_unchecked(axes);
                return Ok(UnitQuaternion::from_rotation_matrix(&rotation));
            }
        }
        if let Some([x, y, z]) = self.numbers("zaxis")?.as_deref() {
            return Ok(from_z(Vector3::new(*x, *y, *z)));
        }
        Ok(UnitQuaternion::identity())
    }
}

/// Of `w x y z`; none of other numbers.
pub(super) fn unit_quaternion(numbers: &[f64]) -> UnitQuaternion<f64> {
    let Some(&[w, x, y, z]) = numbers.first_chunk() else { return UnitQuaternion::identity() };
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9).unwrap_or_default()
}

pub(super) fn from_z(direction: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), &direction).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    })
}

fn add_class(
    default: Node,
    name: &str,
    inherited: &HashMap<(String, String), String>,
    classes: &mut DefaultClasses,
) {
    let mut own = inherited.clone();
    let elements = || default.children().filter(Node::is_element);
    for element in elements().filter(|element| !element.has_tag_name("default")) {
        for attribute in element.attributes() {
            let key = (element.tag_name().name().into(), attribute.name().into());
            own.insert(key, attribute.value().into());
        }
    }
    for nested in elements().filter(|element| element.has_tag_name("default")) {
        if let Some(class) = nested.attribute("class") {
            add_class(nested, class, &own, classes);
        }
    }
    classes.insert(name.into(), own);
}
