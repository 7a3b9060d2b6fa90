//! `<include file="…"/>` of an MJCF model: the included file's elements take its place.

use crate::config::RetargetError;
use crate::description::xml::{check_depth, parse, readable};
use std::collections::HashSet;
use std::ops::Range;

/// More than any model has; keeps hostile files cheap.
const MOST_INCLUDES: usize = 64;
const MOST_BYTES: usize = 16 << 20;

/// The model with everything that it includes. `read` gives the text of a file by the
/// name in the model; what it refuses is refused here, with that name.
pub fn with_includes(
    text: &str,
    mut read: impl FnMut(&str) -> Result<String, String>,
) -> Result<String, RetargetError> {
    let mut text = text.to_owned();
    let mut known = HashSet::new();
    while let Some((place, file)) = first_include(&text)? {
        let refused = |why: &str| RetargetError::Mjcf(format!("include \"{file}\": {why}"));
        if !known.insert(file.clone()) {
            return Err(refused("it is included twice"));
        }
        if known.len() > MOST_INCLUDES {
            return Err(refused(&format!("more than {MOST_INCLUDES} files are included")));
        }
        let included = read(&file).map_err(|why| refused(&why))?;
        let inner = inside_root(&included).map_err(|error| refused(&error.to_string()))?;
        text.replace_range(place, &included[inner]);
        if text.len() > MOST_BYTES {
            return Err(refused("the model is too large with it"));
        }
    }
    Ok(text)
}

/// Where the first include stands in the text, and the file it names.
fn first_include(text: &str) -> Result<Option<(Range<usize>, String)>, RetargetError> {
    // As long as the text itself: places are the same.
    let text = &*readable(text);
    check_depth(text)?;
    let document = parse(text).map_err(|error| RetargetError::Mjcf(error.to_string()))?;
    let include = document.descendants().find(|node| node.has_tag_name("include"));
    Ok(include.map(|node| (node.range(), node.attribute("file").unwrap_or_default().to_owned())))
}

/// The part of a text that stands inside its root element.
fn inside_root(text: &str) -> Result<Range<usize>, RetargetError> {
    // As long as the text itself: places are the same.
    let text = &*readable(text);
    check_depth(text)?;
    let document = parse(text).map_err(|error| RetargetError::Mjcf(error.to_string()))?;
    let root = document.root_element();
    let ends = root.first_child().zip(root.last_child());
    Ok(ends.map_or(0..0, |(first, last)| first.range().start..last.range().end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn included_elements_stand_where_the_include_stood() {
        let read = |name: &str| match name {
            "legs.xml" => Ok("<mujocoinclude><body name='leg'/></mujocoinclude>".into()),
            _ => Err("there is no such file".to_owned()),
        };
        let model = "<mujoco><worldbody><include file='legs.xml'/></worldbody></mujoco>";
        let whole = with_includes(model, read).unwrap();
        assert_eq!(whole, "<mujoco><worldbody><body name='leg'/></worldbody></mujoco>");
        let error = with_includes("<mujoco><include file='a.xml'/></mujoco>", read).unwrap_err();
        assert!(error.to_string().contains("a.xml"), "{error}");
        let circle = |_: &str| Ok("<m><include file='x.xml'/></m>".to_owned());
        let error = with_includes("<mujoco><include file='x.xml'/></mujoco>", circle).unwrap_err();
        assert!(error.to_string().contains("twice"), "{error}");
    }
}
