//! A URDF text becomes one [`urdf_rs::Robot`] in memory, repaired as it is read.
//!
//! `urdf-rs` gives the types, not the parser: that stops at the first
//! unexpected element and names neither joint nor value. Here what has a stated
//! default is repaired and reported, the rest is refused by name.

mod elements;
mod named_colors;
mod xacro_values;

use std::collections::HashSet;

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
            Ok(document) => {
                let filled = xacro_values::filled(&document);
                // Values hold no marks of XML, so that the text stays one.
                let filled = filled.as_deref().and_then(|text| parse(text).ok());
                return robot(filled.as_ref().unwrap_or(&document), diagnostics);
            }
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
    report_includes(root, diagnostics);
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

/// Files with one of these words in their names have colours, motors or a simulator's settings.
const NO_PARTS: [&str; 8] = [
    "material",
    "materials",
    "color",
    "colors",
    "trans",
    "transmission",
    "transmissions",
    "gazebo",
];

/// Whether xacro elements or expressions are left where they count; comments
/// and simulator plugins often keep some.
fn is_xacro(root: Node) -> bool {
    let parts = root.children().filter(|node| ["link", "joint"].contains(&node.tag_name().name()));
    let mut attributes =
        parts.flat_map(|part| part.descendants()).flat_map(|node| node.attributes());
    let macros: HashSet<&str> = children(root, "macro")
        .filter(|&node| is_of_xacro(node) && !adds_parts(node))
        .filter_map(|node| node.attribute("name"))
        .collect();
    let is_left = |node: Node| match node.tag_name().name() {
        "property" | "arg" => true,
        "include" => adds_no_parts(node),
        "macro" | "if" | "unless" => !adds_parts(node),
        call => node.parent() == Some(root) && (macros.contains(call) || says_no_parts(call)),
    };
    let of_macro = |node: Node| node.ancestors().skip(1).any(|above| above.has_tag_name("macro"));
    root.descendants().any(|node| is_of_xacro(node) && !is_left(node) && !of_macro(node))
        || attributes.any(|attribute| attribute.value().contains("${"))
}

fn is_of_xacro(node: Node) -> bool {
    node.is_element() && node.tag_name().namespace().unwrap_or_default().contains("xacro")
}

/// Whether a macro holds a link, a joint or a call; a transmission names the joints that it moves.
fn adds_parts(node: Node) -> bool {
    let names = |node: Node| node.ancestors().any(|above| above.has_tag_name("transmission"));
    node.descendants().skip(1).any(|inside| {
        let part = inside.has_tag_name("link") || inside.has_tag_name("joint");
        (part && !names(inside)) || is_of_xacro(inside)
    })
}

/// Whether an include brings no links or joints, by the name of its file.
fn adds_no_parts(include: Node) -> bool {
    let path = include.attribute("filename").unwrap_or_default().to_lowercase();
    says_no_parts(path.rsplit(['/', '\\']).next().unwrap_or_default())
}

fn says_no_parts(name: &str) -> bool {
    name.split(|letter: char| !letter.is_alphanumeric()).any(|word| NO_PARTS.contains(&word))
}

fn report_includes(root: Node, diagnostics: &mut Diagnostics) {
    for include in children(root, "include").filter(|&node| is_of_xacro(node)) {
        let file = plain(include.attribute("filename").unwrap_or_default());
        let message = "not read; by its name it adds no link and no joint";
        diagnostics.add(DiagnosticCode::XacroInclude, &file, message);
    }
}
