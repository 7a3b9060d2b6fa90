//! A URDF as found becomes one that `urdf-rs` reads.
//!
//! The parser stops at the first thing it does not expect, and says neither
//! joint nor value. So the text is read into a tree here and written anew with
//! what counts: what can be left out or has a stated default is repaired and
//! said, the rest is refused by name.

use std::collections::HashMap;
use std::fmt::Write;

use roxmltree::{Document, Node};

use crate::RetargetError;
use crate::finding::{Code, Findings};

/// More elements than any description has; keeps hostile files cheap.
const MOST_NODES: u32 = 500_000;
/// Undeclared prefixes that are declared for the file.
const MOST_PREFIXES: usize = 16;

/// Rates that newer files give in `<limit>`; not in every unit's favour: as
/// they stand, radians (metres) and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Rates {
    pub acceleration: Option<f64>,
    pub deceleration: Option<f64>,
    pub jerk: Option<f64>,
}

/// The text that `urdf-rs` reads, and what it would have passed over.
pub(super) struct Cleaned {
    pub xml: String,
    pub rates: HashMap<String, Rates>,
}

pub(super) fn clean(xml: &str, findings: &mut Findings) -> Option<Cleaned> {
    const END: &str = "</robot>";
    let mut text = xml.trim_start_matches('\u{feff}').to_owned();
    if let Some(end) = text.rfind(END).map(|at| at + END.len())
        && !text[end..].trim().is_empty()
        && !text[end..].contains('<')
    {
        let message = format!("{} characters behind {END}; passed over", text.len() - end);
        findings.add(Code::TextBehind, "robot", message);
        text.truncate(end);
    }
    for _ in 0..=MOST_PREFIXES {
        let options = roxmltree::ParsingOptions {
            nodes_limit: MOST_NODES,
            ..Default::default()
        };
        let prefix = match Document::parse_with_options(&text, options) {
            Ok(document) => return robot(&document, findings),
            Err(roxmltree::Error::UnknownNamespace(prefix, _)) => prefix,
            Err(error) => {
                findings.refuse(Code::Xml, RetargetError::Xml(error.to_string()));
                return None;
            }
        };
        let Some(at) = text.find("<robot").map(|at| at + "<robot".len()) else {
            break;
        };
        findings.add(
            Code::PrefixUndeclared,
            &prefix,
            "the prefix is used but not declared; what has it is passed over",
        );
        text.insert_str(at, &format!(" xmlns:{prefix}=\"undeclared:{prefix}\""));
    }
    let error = RetargetError::Xml("too many undeclared prefixes".into());
    findings.refuse(Code::Xml, error);
    None
}

fn robot(document: &Document, findings: &mut Findings) -> Option<Cleaned> {
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        let name = root.tag_name().name();
        let hint = match name {
            "mujoco" => " (MJCF: `servodance robot new` converts it)",
            "sdf" => " (SDF: convert it first)",
            _ => "",
        };
        let reason = format!("the root element is <{name}>{hint}, not <robot>");
        findings.refuse(Code::Xml, RetargetError::Xml(reason));
        return None;
    }
    if is_xacro(root) {
        findings.refuse(Code::Xacro, RetargetError::Xacro);
        return None;
    }
    let mut out = Writer {
        xml: String::new(),
        rates: HashMap::new(),
        findings,
    };
    note_commas(root, out.findings);
    let name = root.attribute("name").unwrap_or("robot");
    let version = root.attribute("version").unwrap_or("1.0");
    out.open("robot", &[("name", name), ("version", version)]);
    for link in children(root, "link") {
        out.link(link);
    }
    for joint in children(root, "joint") {
        out.joint(joint);
    }
    for material in children(root, "material") {
        out.material(material);
    }
    out.close("robot");
    Some(Cleaned {
        xml: out.xml,
        rates: out.rates,
    })
}

/// Says once for the file that vectors have commas.
fn note_commas(root: Node, findings: &mut Findings) {
    let vectors = root.descendants().flat_map(|node| {
        ["xyz", "rpy", "quat_xyzw", "size", "scale", "rgba"]
            .into_iter()
            .filter_map(move |key| node.attribute(key).map(|text| (node, text)))
    });
    let mut found = vectors.filter(|(_, text)| {
        has_commas(text) && (numbers::<3>(text).is_some() || numbers::<4>(text).is_some())
    });
    if let Some((node, text)) = found.next() {
        let line = node.document().text_pos_at(node.range().start).row;
        let message = format!(
            "{} vectors have commas between their numbers (first \"{text}\" in line {line}); \
             read as numbers with blanks between",
            1 + found.count()
        );
        findings.add(Code::NumberCommas, "robot", message);
    }
}

/// Whether xacro elements or expressions are left where they count; comments
/// and simulator plugins often keep some.
fn is_xacro(root: Node) -> bool {
    let asks = |node: &Node| {
        let namespace = node.tag_name().namespace().unwrap_or_default();
        namespace.contains("xacro") && !["property", "arg"].contains(&node.tag_name().name())
    };
    let body = ["link", "joint"];
    let parts = root
        .children()
        .filter(|node| body.contains(&node.tag_name().name()));
    let mut attributes = parts
        .flat_map(|part| part.descendants())
        .flat_map(|node| node.attributes());
    root.descendants()
        .any(|node| node.is_element() && asks(&node))
        || attributes.any(|attribute| attribute.value().contains("${"))
}

fn children<'a, 'd: 'a>(
    node: Node<'a, 'd>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'd>> {
    node.children()
        .filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// A number, or a vector of them with blanks between; with a comma between all
/// of them, too (what has both, or too many, may be decimal commas).
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    if has_commas(text) {
        return fill(text.split(',').map(str::trim));
    }
    fill(text.split_whitespace())
}

/// Whether a text could be a vector with commas between its numbers.
fn has_commas(text: &str) -> bool {
    text.matches(',').count() > 1
}

fn fill<'a, const N: usize>(mut words: impl Iterator<Item = &'a str>) -> Option<[f64; N]> {
    let mut values = [0.0; N];
    for value in &mut values {
        *value = words.next()?.parse().ok()?;
    }
    words.next().is_none().then_some(values)
}

fn joined(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(f64::to_string).collect();
    words.join(" ")
}

struct Writer<'f> {
    xml: String,
    rates: HashMap<String, Rates>,
    findings: &'f mut Findings,
}

impl Writer<'_> {
    fn tag(&mut self, name: &str, attributes: &[(&str, &str)], end: &str) {
        let _ = write!(self.xml, "<{name}");
        for (key, value) in attributes {
            let _ = write!(self.xml, " {key}=\"");
            for letter in value.chars() {
                match letter {
                    '&' => self.xml.push_str("&amp;"),
                    '<' => self.xml.push_str("&lt;"),
                    '>' => self.xml.push_str("&gt;"),
                    '"' => self.xml.push_str("&quot;"),
                    '\'' => self.xml.push_str("&apos;"),
                    letter if letter.is_control() => self.xml.push(' '),
                    letter => self.xml.push(letter),
                }
            }
            self.xml.push('"');
        }
        self.xml.push_str(end);
    }

    fn open(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.tag(name, attributes, ">");
    }

    fn empty(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.tag(name, attributes, "/>");
    }

    fn close(&mut self, name: &str) {
        let _ = writeln!(self.xml, "</{name}>");
    }

    /// The one child of this name; a second one is said and passed over.
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
            self.findings.add(Code::ElementTwice, subject, message);
        }
        first
    }

    fn name(&mut self, node: Node, kind: &str) -> Option<String> {
        match node.attribute("name") {
            Some(name) if !name.trim().is_empty() => Some(name.to_owned()),
            _ => {
                let line = node.document().text_pos_at(node.range().start).row;
                let reason = format!("a {kind} without a name (line {line})");
                self.findings.refuse_tree(Code::NameMissing, reason);
                None
            }
        }
    }

    /// A vector or number of an attribute, `default` where it is left out;
    /// refused where it cannot be read.
    fn values<const N: usize>(
        &mut self,
        node: Option<Node>,
        key: &str,
        default: [f64; N],
        subject: (&str, &str),
    ) -> [f64; N] {
        let Some(text) = node.and_then(|node| node.attribute(key)) else {
            return default;
        };
        if let Some(values) = numbers(text) {
            return values;
        }
        let element = node.map_or("", |node| node.tag_name().name());
        let reason = format!("<{element} {key}=\"{text}\">: expected {N} number(s)");
        match subject.0 {
            "joint" => self
                .findings
                .refuse_joint(Code::NumberUnreadable, subject.1, reason),
            _ => self
                .findings
                .refuse_link(Code::NumberUnreadable, subject.1, reason),
        }
        default
    }

    fn origin(&mut self, node: Node, subject: (&str, &str)) {
        let origin = self.only(node, "origin", subject.1);
        let xyz: [f64; 3] = self.values(origin, "xyz", [0.0; 3], subject);
        let rpy: [f64; 3] = self.values(origin, "rpy", [0.0; 3], subject);
        let turned = origin.filter(|origin| origin.attribute("rpy").is_none());
        let quat = turned.and_then(|origin| origin.attribute("quat_xyzw"));
        match quat.and_then(numbers::<4>) {
            Some(quat) => {
                let (xyz, quat) = (joined(&xyz), joined(&quat));
                self.empty("origin", &[("xyz", &xyz), ("quat_xyzw", &quat)]);
            }
            _ => self.empty("origin", &[("xyz", &joined(&xyz)), ("rpy", &joined(&rpy))]),
        }
    }

    fn link(&mut self, node: Node) {
        let Some(name) = self.name(node, "link") else {
            return;
        };
        self.open("link", &[("name", &name)]);
        if let Some(inertial) = self.only(node, "inertial", &name) {
            self.inertial(inertial, &name);
        }
        for kind in ["visual", "collision"] {
            for shape in children(node, kind) {
                self.shape(kind, shape, &name);
            }
        }
        self.close("link");
    }

    fn inertial(&mut self, node: Node, link: &str) {
        let subject = ("link", link);
        let mass = self.only(node, "mass", link);
        let inertia = self.only(node, "inertia", link);
        for (element, name) in [(mass, "mass"), (inertia, "inertia")] {
            if element.is_none() {
                let message = format!("<inertial> without <{name}>; it counts as zero");
                self.findings.add(Code::InertialIncomplete, link, message);
            }
        }
        self.open("inertial", &[]);
        self.origin(node, subject);
        let value: [f64; 1] = self.values(mass, "value", [0.0], subject);
        self.empty("mass", &[("value", &joined(&value))]);
        let parts = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"].map(|key| {
            let value: [f64; 1] = self.values(inertia, key, [0.0], subject);
            (key, joined(&value))
        });
        self.empty("inertia", &parts.each_ref().map(|(k, v)| (*k, v.as_str())));
        self.close("inertial");
    }

    /// A visual or collision, if its geometry can be read.
    fn shape(&mut self, kind: &'static str, node: Node, link: &str) {
        let Some((shape, attributes)) = self.geometry(node, kind, link) else {
            return;
        };
        self.open(kind, &[]);
        self.origin(node, ("link", link));
        self.open("geometry", &[]);
        let attributes: Vec<_> = attributes.iter().map(|(k, v)| (*k, v.as_str())).collect();
        self.empty(shape, &attributes);
        self.close("geometry");
        if kind == "visual"
            && let Some(material) = self.only(node, "material", link)
        {
            self.material(material);
        }
        self.close(kind);
    }

    fn geometry(
        &mut self,
        node: Node,
        kind: &str,
        link: &str,
    ) -> Option<(&'static str, Vec<(&'static str, String)>)> {
        let geometry = self.only(node, "geometry", link);
        let mut shapes = geometry
            .into_iter()
            .flat_map(|g| g.children())
            .filter(Node::is_element);
        let first = shapes.next();
        if shapes.next().is_some() {
            let message = format!("the geometry of a {kind} holds two shapes; the first is used");
            self.findings.add(Code::GeometryTwo, link, message);
        }
        let number = |key: &str| {
            first?
                .attribute(key)
                .and_then(numbers::<1>)
                .map(|v| joined(&v))
        };
        let vector = |key: &str| {
            first?
                .attribute(key)
                .and_then(numbers::<3>)
                .map(|v| joined(&v))
        };
        let round = || {
            Some(vec![
                ("radius", number("radius")?),
                ("length", number("length")?),
            ])
        };
        let name = first.map_or("nothing", |shape| shape.tag_name().name());
        let read = match name {
            "box" => vector("size").map(|size| ("box", vec![("size", size)])),
            "sphere" => number("radius").map(|radius| ("sphere", vec![("radius", radius)])),
            "cylinder" => round().map(|keys| ("cylinder", keys)),
            "capsule" => round().map(|keys| ("capsule", keys)),
            "mesh" => first
                .and_then(|mesh| mesh.attribute("filename"))
                .map(|file| {
                    let mut keys = vec![("filename", file.to_owned())];
                    keys.extend(vector("scale").map(|scale| ("scale", scale)));
                    ("mesh", keys)
                }),
            _ => None,
        };
        if read.is_none() {
            let message = format!("the geometry of a {kind} ({name}) cannot be read; left out");
            self.findings.add(Code::GeometryUnreadable, link, message);
        }
        read
    }

    fn material(&mut self, node: Node) {
        let name = node.attribute("name").unwrap_or_default().to_owned();
        let texture = children(node, "texture").next();
        if texture.is_some_and(|texture| texture.attribute("filename").is_none()) {
            let message = "a texture without a file name; left out";
            self.findings.add(Code::TextureUnnamed, &name, message);
        }
        self.open("material", &[("name", &name)]);
        let color = children(node, "color").next();
        if let Some(rgba) = color
            .and_then(|color| color.attribute("rgba"))
            .and_then(numbers::<4>)
        {
            self.empty("color", &[("rgba", &joined(&rgba))]);
        }
        self.close("material");
    }

    fn joint(&mut self, node: Node) {
        let Some(name) = self.name(node, "joint") else {
            return;
        };
        let written = node.attribute("type").unwrap_or_default();
        let kind = match written {
            "revolute" | "continuous" | "prismatic" | "fixed" => written,
            "floating" | "planar" | "spherical" => {
                let message = format!("a {written} joint has no one position; held fixed");
                self.findings.add(Code::RootFloating, &name, message);
                "fixed"
            }
            other => {
                let reason = format!(
                    "type \"{other}\" is none of revolute, continuous, prismatic, fixed, \
                     floating, planar"
                );
                self.findings.refuse_joint(Code::TypeUnknown, &name, reason);
                return;
            }
        };
        let ends = ["parent", "child"].map(|end| {
            let link = self.only(node, end, &name);
            link.and_then(|link| link.attribute("link").map(str::to_owned))
        });
        let [Some(parent), Some(child)] = ends else {
            let reason = "parent or child link is not given";
            self.findings.refuse_joint(Code::LinkUnknown, &name, reason);
            return;
        };
        self.open("joint", &[("name", &name), ("type", kind)]);
        self.origin(node, ("joint", &name));
        self.empty("parent", &[("link", &parent)]);
        self.empty("child", &[("link", &child)]);
        let mimic = self.only(node, "mimic", &name);
        if kind != "fixed" {
            self.axis_and_limit(node, &name);
            if let Some(mimic) = mimic {
                self.mimic(mimic, &name);
            }
        } else if mimic.is_some() {
            let message = "a fixed joint cannot follow another; it stays";
            self.findings.add(Code::MimicOnFixed, &name, message);
        }
        self.close("joint");
    }

    fn axis_and_limit(&mut self, node: Node, joint: &str) {
        let subject = ("joint", joint);
        let axis = self.only(node, "axis", joint);
        if axis.and_then(|axis| axis.attribute("xyz")).is_none() {
            let message = "no axis; 1 0 0 is used";
            self.findings.add(Code::AxisUnset, joint, message);
        }
        let xyz: [f64; 3] = self.values(axis, "xyz", [1.0, 0.0, 0.0], subject);
        self.empty("axis", &[("xyz", &joined(&xyz))]);
        let limit = self.only(node, "limit", joint);
        let keys = ["lower", "upper", "effort", "velocity"].map(|key| {
            let value: [f64; 1] = self.values(limit, key, [0.0], subject);
            (key, joined(&value))
        });
        self.empty("limit", &keys.each_ref().map(|(k, v)| (*k, v.as_str())));
        self.more_rates(limit, joint);
    }

    fn more_rates(&mut self, limit: Option<Node>, joint: &str) {
        let mut given = Vec::new();
        let mut rate = |key: &str| {
            let text = limit?.attribute(key)?;
            given.push(format!("{key} {text}"));
            let [value] = numbers(text)?;
            (value.is_finite() && value > 0.0).then_some(value)
        };
        let rates = Rates {
            acceleration: rate("acceleration"),
            deceleration: rate("deceleration"),
            jerk: rate("jerk"),
        };
        if !given.is_empty() {
            let message = format!("<limit> also gives {}", given.join(", "));
            self.findings.add(Code::LimitExtended, joint, message);
            self.rates.insert(joint.to_owned(), rates);
        }
    }

    fn mimic(&mut self, node: Node, joint: &str) {
        let Some(followed) = node.attribute("joint") else {
            let reason = "<mimic> names no joint";
            self.findings
                .refuse_joint(Code::MimicUnknown, joint, reason);
            return;
        };
        let subject = ("joint", joint);
        let multiplier: [f64; 1] = self.values(Some(node), "multiplier", [1.0], subject);
        let offset: [f64; 1] = self.values(Some(node), "offset", [0.0], subject);
        self.empty(
            "mimic",
            &[
                ("joint", followed),
                ("multiplier", &joined(&multiplier)),
                ("offset", &joined(&offset)),
            ],
        );
    }
}
