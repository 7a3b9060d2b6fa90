//! Limits that keep hostile XML cheap.

use crate::config::RetargetError;
use roxmltree::{Document, ParsingOptions};

const MOST_NODES: u32 = 500_000;
/// Deeper than any description: the parser calls itself for each level, so that
/// a hostile file could use up the stack.
const DEEPEST: usize = 64;

pub(super) fn parse(text: &str) -> Result<Document<'_>, roxmltree::Error> {
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
}

/// Refuses what is nested too deep, before it is parsed.
pub(super) fn check_depth(xml: &str) -> Result<(), RetargetError> {
    let mut depth = 0_usize;
    for tag in xml.split('<').skip(1) {
        let tag_text = tag.split('>').next().unwrap_or_default();
        if tag.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !tag.starts_with(['!', '?']) && !tag_text.ends_with('/') {
            depth += 1;
        }
        if depth > DEEPEST {
            return Err(RetargetError::Xml(format!(
                "elements are nested more than {DEEPEST} deep"
            )));
        }
    }
    Ok(())
}
