//! The codes of a frame: of which part and level each is, and its name.

use super::ModelConfig;

/// Most codebooks of a part.
const MOST_LEVELS: usize = 4;

/// One of the codes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodePlace {
    /// Index of the part.
    pub part: usize,
    /// 0 for the part itself; each level more codes what those before it left.
    pub level: usize,
}

impl ModelConfig {
    /// Codebooks of a part.
    pub fn levels_of(&self, part: usize) -> usize {
        self.levels.get(part).copied().unwrap_or(1)
    }

    /// All codes of a frame in sampling order: the parts, then what the first codes left.
    pub fn code_places(&self) -> Vec<CodePlace> {
        let of_level = |level| {
            let has = move |part: &usize| level < self.levels_of(*part);
            (0..self.parts.len()).filter(has).map(move |part| CodePlace { part, level })
        };
        (0..MOST_LEVELS).flat_map(of_level).collect()
    }

    /// How many codes a frame has.
    pub fn codes_a_frame(&self) -> usize {
        (0..self.parts.len()).map(|part| self.levels_of(part)).sum()
    }

    /// Whether a code of a frame is the first of its part. Only such codes have layers of their
    /// own in MotionSeq, and a second embedding: what a residual code adds is linear in the codes
    /// before it, and there may be many of them.
    pub fn is_first_level(&self, code: usize) -> bool {
        code < self.parts.len()
    }

    /// Names of the codes of a frame, as they come.
    pub fn code_names(&self) -> Vec<String> {
        self.code_places().into_iter().map(|place| self.code_name(place)).collect()
    }

    /// The part, and from the second level on its number: `trunk`, `trunk_2`.
    pub fn code_name(&self, place: CodePlace) -> String {
        let part = &self.parts[place.part];
        match place.level {
            0 => part.clone(),
            level => format!("{part}_{}", level + 1),
        }
    }

    pub(super) fn check_levels(&self) -> Result<(), String> {
        let (found, parts) = (&self.levels, self.parts.len());
        let fits = found.is_empty() || found.len() == parts;
        match fits && found.iter().all(|levels| (1..=MOST_LEVELS).contains(levels)) {
            true => Ok(()),
            false => Err(format!(
                "levels is {found:?}, expected {parts} numbers from 1 to {MOST_LEVELS}, one a part"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_first_then_what_they_left_where_they_have_more_levels() {
        let tiny = ModelConfig::preset("tiny").unwrap();
        let mut config = ModelConfig { levels: vec![1, 3], ..tiny };
        assert_eq!(config.code_names(), ["lower", "upper", "upper_2", "upper_3"]);
        assert_eq!(config.codes_a_frame(), 4);
        for levels in [vec![2], vec![1, 0], vec![5, 1]] {
            config.levels = levels;
            assert!(config.check_levels().unwrap_err().contains("expected 2 numbers from 1 to 4"));
        }
    }
}
