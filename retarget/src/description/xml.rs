//! Limits that keep hostile XML cheap, and what simulators read although it is no XML.

use std::borrow::Cow;

use crate::config::RetargetError;
use crate::description::diagnostic::{DiagnosticCode, Diagnostics};
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

/// The text without what XML forbids and simulators pass over: comments that hold `--`, and
/// anything blank before `<?xml`. Blanks stand in their place, so that lines keep their numbers.
pub(super) fn readable(text: &str) -> Cow<'_, str> {
    let mut out = Cow::Borrowed(text);
    // A mark of the byte order alone is no matter.
    let marked = text.strip_prefix('\u{feff}').unwrap_or(text);
    let start = text.len() - marked.trim_start().len();
    if marked.starts_with(char::is_whitespace)
        && text[start..].starts_with("<?xml")
        && let Some(end) = text[start..].find("?>")
    {
        blank_out(out.to_mut(), 0, start + end + 2);
    }
    let mut at = 0;
    while let Some(begin) = text[at..].find("<!--").map(|found| at + found) {
        let inside = begin + "<!--".len();
        let Some(end) = text[inside..].find("-->").map(|found| inside + found) else { break };
        let comment = &text[inside..end];
        at = end + "-->".len();
        if comment.contains("--") || comment.ends_with('-') {
            blank_out(out.to_mut(), begin, at);
        }
    }
    out
}

/// The same, with a finding where anything was passed over.
pub(super) fn read_loosely<'t>(text: &'t str, diagnostics: &mut Diagnostics) -> Cow<'t, str> {
    let readable = readable(text);
    if let Cow::Owned(_) = readable {
        let message = "`--` inside a comment, or blank lines before `<?xml`: passed over";
        diagnostics.add(DiagnosticCode::XmlLoose, "robot", message);
    }
    readable
}

/// Puts blanks in the place of bytes that are whole characters; line ends stay.
fn blank_out(text: &mut String, begin: usize, end: usize) {
    let blank = |byte: u8| if matches!(byte, b'\n' | b'\r') { char::from(byte) } else { ' ' };
    let blanks: String = text[begin..end].bytes().map(blank).collect();
    text.replace_range(begin..end, &blanks);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loose_xml_keeps_its_lines() {
        let loose =
            "\n <?xml version=\"1.0\"?>\n<robot>\n<!-- ä -- b\n --->\n<link name='a'/></robot>";
        assert!(parse(loose).is_err());
        let text = readable(loose);
        let document = parse(&text).unwrap();
        let link = document.descendants().find(|node| node.has_tag_name("link")).unwrap();
        assert_eq!(document.text_pos_at(link.range().start).row, 6);
        assert_eq!(text.len(), loose.len());
        let strict = "<?xml version=\"1.0\"?><robot><!-- a - b --></robot>";
        assert!(matches!(readable(strict), Cow::Borrowed(_)));
        assert!(matches!(readable("\u{feff}<?xml version=\"1.0\"?><robot/>"), Cow::Borrowed(_)));
        assert!(matches!(readable("<!-- -- "), Cow::Borrowed(_)));
    }
}
