//! The styles of dance, by name and number.

/// The names of all styles, in the order of the style numbers. The first six
/// are captured motion, the next four come from the choreographer, the rest
/// with "pop" are AIST++'s (`motion/aist.rs`).
pub const STYLES: [&str; 19] = [
    "everyday",
    "martial",
    "modern",
    "pop",
    "salsa",
    "street",
    "groove",
    "disco",
    "robot",
    "hype",
    "break",
    "lock",
    "middle-hip-hop",
    "la-hip-hop",
    "house",
    "waack",
    "krump",
    "street-jazz",
    "ballet-jazz",
];

/// How many of [`STYLES`] every training file names, so that older weights can
/// go on learning from new ones; later styles are named where they are used.
const ALWAYS_NAMED: usize = 10;

/// The styles that a training file and its weights name, where clips have `used`.
pub(crate) fn named(used: impl Iterator<Item = usize>) -> &'static [&'static str] {
    let count = used.max().map_or(0, |last| last + 1);
    &STYLES[..count.clamp(ALWAYS_NAMED, STYLES.len())]
}

/// The number of a style; `None` for a name that is not in [`STYLES`].
pub fn style_number(name: &str) -> Option<usize> {
    STYLES.iter().position(|style| *style == name)
}
