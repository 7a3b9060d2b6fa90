//! A URDF text becomes one [`urdf_rs::Robot`] in memory, repaired as it is read.
//!
//! `urdf-rs` gives the types, not the parser: that stops at the first
//! unexpected element and names neither joint nor value. Here what has a stated
//! default is repaired and reported, the rest is refused by name.

mod elements;
mod named_colors;

use roxmltree::{Document, Node};

use crate::config::RetargetError;
use crate::description::diagnostic::{DiagnosticCode, Diagnostics};
use crate::description::xml::parse;
use elements::{ElementReader, children, has_commas, numbers, plain};
use named_colors::named_colors;

pub(super) use elements::RateLimitsByJoint;

const MOST_PREFIXES: usize = 16;

/// The robot of a URDF text and its further rate limits; `None` where the text
/// is refused as a whole.
pub(super) fn read(
    xml: &str,
    diagnostics: &mut Diagnostics,
) -> Option<(urdf_rs::Robot, RateLimitsByJoint)> {
    const END: &str = "</robot>";
    let mut text = xml.trim_start_matches('\u{feff}').to_owned();
    if let Some(end) = text.rfind(END).map(|at| at + END.len())
        && !text[end..].trim().is_empty()
        && !text[end..].contains('<')
    {
        let message = format!("{} characters behind {END}; passed over", text.len() - end);
        diagnostics.add(DiagnosticCode::TextBehind, "robot", message);
        text.truncate(end);
    }
    for _ in 0..=MOST_PREFIXES {
        let prefix = match parse(&text) {
            Ok(document) => return robot(&document, diagnostics),
            Err(roxmltree::Error::UnknownNamespace(prefix, _)) => prefix,
            Err(error) => {
                let error = RetargetError::Xml(error.to_string());
                diagnostics.refuse(DiagnosticCode::Xml, error);
                return None;
            }
        };
        let Some(at) = text.find("<robot").map(|at| at + "<robot".len()) else {
            break;
        };
        diagnostics.add(
            DiagnosticCode::PrefixUndeclared,
            &prefix,
            "the prefix is used but not declared; what has it is passed over",
        );
        text.insert_str(at, &format!(" xmlns:{prefix}=\"undeclared:{prefix}\""));
    }
    let error = RetargetError::Xml("too many undeclared prefixes".into());
    diagnostics.refuse(DiagnosticCode::Xml, error);
    None
}

fn robot(
    document: &Document,
    diagnostics: &mut Diagnostics,
) -> Option<(urdf_rs::Robot, RateLimitsByJoint)> {
    let root = document.root_element();
    let name = root.tag_name().name();
    if name != "robot" {
        let hint = match name {
            "mujoco" => " (MJCF: `servodance robot new` converts it)",
            "sdf" => " (SDF: convert it first)",
            _ => "",
        };
        let reason = format!("the root element is <{name}>{hint}, not <robot>");
        diagnostics.refuse(DiagnosticCode::Xml, RetargetError::Xml(reason));
        return None;
    }
    if is_xacro(root) {
        diagnostics.refuse(DiagnosticCode::Xacro, RetargetError::Xacro);
        return None;
    }
    report_commas(root, diagnostics);
    let mut reader = ElementReader::new(root, named_colors(root), diagnostics);
    let links = children(root, "link").filter_map(|node| reader.link(node));
    let links = links.collect();
    let joints = children(root, "joint").filter_map(|node| reader.joint(node));
    let joints = joints.collect();
    for material in children(root, "material") {
        reader.material(material);
    }
    let robot = urdf_rs::Robot {
        name: plain(root.attribute("name").unwrap_or("robot")),
        links,
        joints,
        materials: Vec::new(),
    };
    Some((robot, reader.rates))
}

fn report_commas(root: Node, diagnostics: &mut Diagnostics) {
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
        diagnostics.add(DiagnosticCode::NumberCommas, "robot", message);
    }
}

/// Whether xacro elements or expressions are left where they count; comments
/// and simulator plugins often keep some.
fn is_xacro(root: Node) -> bool {
    let is_call = |node: &Node| {
        let namespace = node.tag_name().namespace().unwrap_or_default();
        namespace.contains("xacro") && !["property", "arg"].contains(&node.tag_name().name())
    };
    let parts = root.children().filter(|node| ["link", "joint"].contains(&node.tag_name().name()));
    let mut attributes =
        parts.flat_map(|part| part.descendants()).flat_map(|node| node.attributes());
    root.descendants().any(|node| node.is_element() && is_call(&node))
        || attributes.any(|attribute| attribute.value().contains("${"))
}
