//! Colours of materials that a URDF names once and uses by that name: at its top, or in the
//! link that uses the name first.

use roxmltree::Node;

use super::elements::{NamedColors, children, color_of};

/// The first definition of a name counts, those at the top before those in links.
pub(super) fn named_colors(root: Node) -> NamedColors {
    let mut colors = NamedColors::new();
    let everywhere = root.descendants().filter(|node| node.has_tag_name("material"));
    for material in children(root, "material").chain(everywhere) {
        if let (Some(name), Some(rgba)) = (material.attribute("name"), color_of(material)) {
            colors.entry(name.to_owned()).or_insert(rgba);
        }
    }
    colors
}
