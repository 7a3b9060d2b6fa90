//! Files with something broken in them, at random.

use rand::Rng;
use rand::seq::IndexedRandom;

const WORDS: [&str; 20] = [
    "nan",
    "inf",
    "-inf",
    "-1e308",
    "1e-320",
    "0",
    "-0",
    "99999999999",
    "\"",
    "'",
    "<",
    "/>",
    "]]",
    "[[",
    "=",
    "true",
    "\u{0}",
    "é",
    "../..",
    "<joint name=\"x\">",
];

/// `text` with one to three edits: bytes changed, cut or put in, pieces doubled
/// or moved, numbers replaced.
pub fn mutated(rng: &mut impl Rng, text: &str) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..rng.random_range(1..=3) {
        if bytes.is_empty() {
            break;
        }
        let at = rng.random_range(0..bytes.len());
        let end = (at + rng.random_range(1..100)).min(bytes.len());
        match rng.random_range(0..12) {
            0 => bytes[at] = rng.random(),
            1 => {
                bytes.drain(at..end);
            }
            2 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            3 => {
                let piece: Vec<u8> = bytes.drain(at..end).collect();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            4 => bytes.truncate(at),
            _ => {
                // A number or a word becomes something else.
                let is_word = |b: &u8| b.is_ascii_alphanumeric() || b"._-".contains(b);
                let start = at - bytes[..at].iter().rev().take_while(|b| is_word(b)).count();
                let stop = at + bytes[at..].iter().take_while(|b| is_word(b)).count();
                let word = WORDS.choose(rng).unwrap_or(&"");
                bytes.splice(start..stop, word.bytes());
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
