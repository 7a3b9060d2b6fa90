//! Words as the text encoder takes them: a vector of meaning (GloVe) and which
//! of 15 kinds the word is of.
//!
//! A token is written `word/KIND`. Words of places, body parts, things, acts and
//! manners that matter for motion have kinds of their own, whatever the token
//! says; which ones those are is in the user's `words.json`.

use std::collections::HashMap;
use std::path::Path;

use candle_core::{Device, Result as TensorResult, Tensor};
use serde::Deserialize;

use servodance_model::ModelError;
use servodance_model::conditioning::checkpoint::{Checkpoint, file_error};

pub(super) const WORD_DIM: usize = 300;
pub(super) const KINDS: usize = 15;
/// Tokens of a text that count; what follows is left out.
const MOST_TOKENS: usize = 20;
/// The kind of words that have no other.
const OTHER: &str = "OTHER";
/// Stands for words that are not in the list.
const UNKNOWN: &str = "unk";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WordList {
    /// The words of the rows of `words.weight`.
    words: Vec<String>,
    kinds: Vec<String>,
    kind_of: HashMap<String, String>,
}

#[derive(Debug)]
pub(super) struct WordTable {
    vectors: Tensor,
    rows: HashMap<String, u32>,
    kinds: HashMap<String, usize>,
    kind_of: HashMap<String, usize>,
    unknown: u32,
    other: usize,
}

impl WordTable {
    /// `words.json`, and `words.weight` of the checkpoint.
    pub fn load(path: &Path, file: &Checkpoint) -> Result<Self, ModelError> {
        let failed = |reason: String| file_error(path, reason);
        let text = std::fs::read_to_string(path).map_err(|e| failed(e.to_string()))?;
        let list: WordList =
            serde_json::from_str(&text).map_err(|e| failed(format!("not a list of words: {e}")))?;
        if list.kinds.len() != KINDS {
            let found = list.kinds.len();
            return Err(failed(format!("{found} `kinds`, expected {KINDS}")));
        }
        let kinds: HashMap<String, usize> = list.kinds.into_iter().zip(0..).collect();
        let number = |(word, kind): (String, String)| match kinds.get(&kind) {
            Some(number) => Ok((word, *number)),
            None => {
                Err(failed(format!("`kind_of` says {word} is {kind}, which is not in `kinds`")))
            }
        };
        let kind_of = list.kind_of.into_iter().map(number);
        let kind_of = kind_of.collect::<Result<_, _>>()?;
        let vectors = file.tensor("words.weight", &[list.words.len(), WORD_DIM])?;
        let rows: HashMap<String, u32> = list.words.into_iter().zip(0..).collect();
        let missing = |what: &str| failed(format!("`{what}` is missing"));
        Ok(Self {
            unknown: *rows.get(UNKNOWN).ok_or_else(|| missing(UNKNOWN))?,
            other: *kinds.get(OTHER).ok_or_else(|| missing(OTHER))?,
            vectors,
            rows,
            kinds,
            kind_of,
        })
    }

    /// Vectors [n, 300], kinds [n, 15] of the tokens of a text between the signs of start and end.
    pub fn of(&self, tokens: &[&str]) -> TensorResult<(Tensor, Tensor)> {
        let tokens = tokens.iter().take(MOST_TOKENS).copied();
        let all = ["sos/OTHER"].into_iter().chain(tokens).chain(["eos/OTHER"]);
        let (rows, kinds): (Vec<u32>, Vec<usize>) = all.map(|token| self.one(token)).unzip();
        let count = rows.len();
        let mut chosen = vec![0.0f32; count * KINDS];
        for (at, kind) in kinds.into_iter().enumerate() {
            chosen[at * KINDS + kind] = 1.0;
        }
        let rows = Tensor::from_vec(rows, count, &Device::Cpu)?;
        Ok((
            self.vectors.index_select(&rows, 0)?,
            Tensor::from_vec(chosen, (count, KINDS), &Device::Cpu)?,
        ))
    }

    /// Row and kind of a token; a word that is not known has no kind either.
    fn one(&self, token: &str) -> (u32, usize) {
        let (word, kind) = token.split_once('/').unwrap_or((token, OTHER));
        match self.rows.get(word) {
            None => (self.unknown, self.other),
            Some(row) => {
                let own = self.kind_of.get(word);
                let kind = own.or_else(|| self.kinds.get(kind));
                (*row, *kind.unwrap_or(&self.other))
            }
        }
    }
}
