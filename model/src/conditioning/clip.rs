//! A style in words, as CLIP's text encoder understands them: 512 numbers.
//!
//! The text tower of `openai/clip-vit-base-patch32` (causal transformer, quick
//! GELU, the last token's vector through a projection, not normalised), with
//! its own tokenizer. The files are not part of this program: a user brings
//! them (docs/conditioning.md). A text is encoded once a dance; nothing here is
//! for a control loop. candle-transformers has this tower too; building that
//! crate for it costs every user more than these lines (docs/conditioning.md).

use std::path::Path;

use candle_core::{D, Device, Result as TensorResult, Tensor};
use candle_nn::ops;
use tokenizers::{Tokenizer, TruncationParams};

use super::CLIP_DIM;
use super::checkpoint::{Checkpoint, file_error};
use crate::engine::candle::{TensorLinear, TensorNorm};
use crate::error::ModelError;

/// Most tokens of a text, with the two around it; what is longer is cut.
const TOKENS_MAX: usize = 77;
/// Width of an attention head in every CLIP.
const HEAD_DIM: usize = 64;

#[derive(Clone, Copy, Debug)]
struct Sizes {
    vocabulary: usize,
    width: usize,
    layers: usize,
}

/// The sizes of `openai/clip-vit-base-patch32`.
const PUBLIC: Sizes = Sizes { vocabulary: 49_408, width: 512, layers: 12 };

/// CLIP's text encoder with its tokenizer.
#[derive(Debug)]
pub struct ClipText {
    source: String,
    tokenizer: Tokenizer,
    tokens: Tensor,
    positions: Tensor,
    layers: Vec<Layer>,
    norm: TensorNorm,
    projection_t: Tensor,
}

impl ClipText {
    /// Reads `model.safetensors` and `tokenizer.json` in a folder. A file that
    /// is missing, torn or of another layout is named with what is wrong.
    pub fn load(folder: &Path) -> Result<Self, ModelError> {
        Self::with_sizes(folder, PUBLIC)
    }

    fn with_sizes(folder: &Path, sizes: Sizes) -> Result<Self, ModelError> {
        let path = folder.join("tokenizer.json");
        let bytes = std::fs::read(&path).map_err(|e| file_error(&path, e.to_string()))?;
        let tokenizer = Tokenizer::from_bytes(bytes)
            .map_err(|e| file_error(&path, format!("not a tokenizer: {e}")))?;
        let tokenizer = bounded(tokenizer).map_err(|e| file_error(&path, e))?;
        let file = Checkpoint::open(&folder.join("model.safetensors"))?;
        let width = sizes.width;
        let embedding = |what: &str, rows: usize| {
            let name = format!("text_model.embeddings.{what}_embedding.weight");
            file.tensor(&name, &[rows, width])
        };
        let layers = (0..sizes.layers).map(|layer| Layer::load(&file, layer, width));
        let clip = Self {
            source: path.display().to_string(),
            tokenizer,
            tokens: embedding("token", sizes.vocabulary)?,
            positions: embedding("position", TOKENS_MAX)?,
            layers: layers.collect::<Result<_, _>>()?,
            norm: TensorNorm::load(&file, "text_model.final_layer_norm", width)?,
            projection_t: file.tensor("text_projection.weight", &[CLIP_DIM, width])?.t()?,
        };
        clip.tokens_of("")?; // a tokenizer that is not CLIP's is told at once
        Ok(clip)
    }

    /// The vector of a text, [`CLIP_DIM`] numbers. Only the first 75 tokens
    /// (about 60 words) count.
    pub fn embed(&self, text: &str) -> Result<Vec<f32>, ModelError> {
        let ids = self.tokens_of(text)?;
        let count = ids.len();
        let ids = Tensor::from_vec(ids, count, &Device::Cpu)?;
        let places = self.positions.narrow(0, 0, count)?;
        let mut x = (self.tokens.index_select(&ids, 0)? + places)?;
        let mask = causal_mask(count)?;
        for layer in &self.layers {
            x = layer.forward(&x, &mask)?;
        }
        let last = self.norm.forward(&x)?.narrow(0, count - 1, 1)?;
        Ok(last.matmul(&self.projection_t)?.squeeze(0)?.to_vec1()?)
    }

    /// The ids of a text between those of its start and its end.
    fn tokens_of(&self, text: &str) -> Result<Vec<u32>, ModelError> {
        let refused = |reason: String| file_error(Path::new(&self.source), reason);
        let encoding = self.tokenizer.encode(text, true);
        let encoding = encoding.map_err(|e| refused(format!("cannot split {text:?}: {e}")))?;
        let ids = encoding.get_ids().to_vec();
        let vocabulary = self.tokens.dim(0)? as u32;
        if let Some(id) = ids.iter().find(|id| **id >= vocabulary) {
            return Err(refused(format!(
                "token {id} is outside the vocabulary of model.safetensors, {vocabulary}"
            )));
        }
        let [start, end] =
            ["<|startoftext|>", "<|endoftext|>"].map(|token| self.tokenizer.token_to_id(token));
        match (start, end) {
            (Some(start), Some(end)) if ids.first() == Some(&start) && ids.last() == Some(&end) => {
                Ok(ids)
            }
            _ => Err(refused(
                "not CLIP's: a text does not stand between <|startoftext|> and <|endoftext|>"
                    .into(),
            )),
        }
    }
}

/// The tokenizer with long texts cut and short ones left as they are.
fn bounded(mut tokenizer: Tokenizer) -> Result<Tokenizer, String> {
    tokenizer.with_padding(None);
    let cut = TruncationParams { max_length: TOKENS_MAX, ..TruncationParams::default() };
    tokenizer.with_truncation(Some(cut)).map_err(|e| e.to_string())?;
    Ok(tokenizer)
}

/// Minus infinity where a token would see a later one.
fn causal_mask(count: usize) -> TensorResult<Tensor> {
    let hidden = |i: usize, j: usize| if j > i { f32::NEG_INFINITY } else { 0.0 };
    let mask = (0..count * count).map(|at| hidden(at / count, at % count));
    Tensor::from_vec(mask.collect(), (count, count), &Device::Cpu)
}

/// Self-attention, then two linear layers; each on the normalised input.
#[derive(Debug)]
struct Layer {
    norms: [TensorNorm; 2],
    query: TensorLinear,
    key: TensorLinear,
    value: TensorLinear,
    out: TensorLinear,
    up: TensorLinear,
    down: TensorLinear,
}

impl Layer {
    fn load(file: &Checkpoint, layer: usize, width: usize) -> Result<Self, ModelError> {
        let name = format!("text_model.encoder.layers.{layer}");
        let linear = |what: &str, input, output| {
            TensorLinear::load(file, &format!("{name}.{what}"), input, output)
        };
        let norm = |number| TensorNorm::load(file, &format!("{name}.layer_norm{number}"), width);
        Ok(Self {
            norms: [norm(1)?, norm(2)?],
            query: linear("self_attn.q_proj", width, width)?,
            key: linear("self_attn.k_proj", width, width)?,
            value: linear("self_attn.v_proj", width, width)?,
            out: linear("self_attn.out_proj", width, width)?,
            up: linear("mlp.fc1", width, 4 * width)?,
            down: linear("mlp.fc2", 4 * width, width)?,
        })
    }

    fn forward(&self, x: &Tensor, mask: &Tensor) -> TensorResult<Tensor> {
        let x = (x + self.attended(&self.norms[0].forward(x)?, mask)?)?;
        let inner = self.up.forward(&self.norms[1].forward(&x)?)?;
        // Quick GELU: x sigmoid(1.702 x).
        let inner = (&inner * ops::sigmoid(&(&inner * 1.702)?)?)?;
        x + self.down.forward(&inner)?
    }

    fn attended(&self, x: &Tensor, mask: &Tensor) -> TensorResult<Tensor> {
        let (count, width) = x.dims2()?;
        let heads = |x: Tensor| {
            let split = x.reshape((count, width / HEAD_DIM, HEAD_DIM))?;
            split.transpose(0, 1)?.contiguous()
        };
        let query = heads((self.query.forward(x)? / (HEAD_DIM as f64).sqrt())?)?;
        let (key, value) = (heads(self.key.forward(x)?)?, heads(self.value.forward(x)?)?);
        let scores = query.matmul(&key.t()?)?.broadcast_add(mask)?;
        let mixed = ops::softmax(&scores, D::Minus1)?.matmul(&value)?;
        self.out.forward(&mixed.transpose(0, 1)?.reshape((count, width))?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::golden::{Golden, Manifest, check_same, write_checkpoint};
    use super::*;

    const TOLERANCE: f32 = 1e-4;
    const TOKENIZER: &str = include_str!("golden/tokenizer.json");

    fn golden() -> Golden {
        Golden::open(include_bytes!("golden/clip.safetensors"))
    }

    /// A folder with both files, the checkpoint's manifest changed.
    fn folder(change: impl Fn(&mut Manifest)) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut manifest = golden().weights();
        change(&mut manifest);
        write_checkpoint(&folder.path().join("model.safetensors"), &manifest);
        std::fs::write(folder.path().join("tokenizer.json"), TOKENIZER).unwrap();
        folder
    }

    fn load(folder: &Path) -> Result<ClipText, ModelError> {
        let sizes = Sizes { vocabulary: golden().json("vocabulary"), width: 128, layers: 2 };
        ClipText::with_sizes(folder, sizes)
    }

    #[test]
    fn texts_agree_with_the_reference() {
        let golden = golden();
        let clip = load(folder(|_| {}).path()).unwrap();
        let texts: Vec<String> = golden.json("texts");
        let ids: Vec<Vec<u32>> = golden.json("ids");
        for (number, text) in texts.iter().enumerate() {
            assert_eq!(clip.tokens_of(text).unwrap(), ids[number], "{text:?}");
            let found = clip.embed(text).unwrap();
            let expected = golden.floats(&format!("embed{number}"));
            check_same(text, &found, &expected, TOLERANCE);
        }
        assert_eq!(ids.iter().map(Vec::len).max(), Some(TOKENS_MAX));
    }

    /// The tower in its public size, 250 MB of random numbers:
    /// `CLIP_FULL=DIR cargo test --release -p servodance-model -- --ignored clip`.
    #[test]
    #[ignore = "needs the folder CLIP_FULL that `golden/make.py --full` writes"]
    fn texts_agree_with_the_reference_in_full_size() {
        let folder = std::env::var("CLIP_FULL").unwrap();
        let bytes = std::fs::read(Path::new(&folder).join("clip.safetensors")).unwrap();
        let golden = Golden::open(bytes.leak());
        let clip = ClipText::load(Path::new(&folder)).unwrap();
        for (number, text) in golden.json::<Vec<String>>("texts").iter().enumerate() {
            let expected = golden.floats(&format!("embed{number}"));
            check_same(text, &clip.embed(text).unwrap(), &expected, TOLERANCE);
        }
    }

    #[test]
    fn every_missing_file_is_named() {
        for name in ["model.safetensors", "tokenizer.json"] {
            let folder = folder(|_| {});
            std::fs::remove_file(folder.path().join(name)).unwrap();
            let text = load(folder.path()).unwrap_err().to_string();
            assert!(text.contains(name) && text.contains("No such file"), "{text}");
        }
    }

    #[test]
    fn another_layout_is_refused_by_name_and_shape() {
        let lost = folder(|m| drop(m.remove("text_projection.weight")));
        let text = load(lost.path()).unwrap_err().to_string();
        assert!(text.contains("text_projection.weight"), "{text}");
        let text = ClipText::load(folder(|_| {}).path()).unwrap_err().to_string();
        let name = "text_model.embeddings.token_embedding.weight";
        assert!(text.contains(name) && text.contains("[49408, 512]"), "{text}");
    }

    #[test]
    fn a_tokenizer_that_is_not_clips_is_refused() {
        let folder = folder(|_| {});
        let path = folder.path().join("tokenizer.json");
        let refused = |content: &str, words: &str| {
            std::fs::write(&path, content).unwrap();
            let text = load(folder.path()).unwrap_err().to_string();
            assert!(text.contains("tokenizer.json") && text.contains(words), "{text}");
        };
        refused("{}", "not a tokenizer");
        refused(&TOKENIZER[..TOKENIZER.len() / 2], "not a tokenizer");
        let other = TOKENIZER.replace("<|startoftext|>", "[CLS]");
        refused(&other, "<|startoftext|>");
        // One more token than the embedding has rows.
        let end = format!("\"<|endoftext|>\":{}", 520);
        assert!(TOKENIZER.contains(&end));
        let far = TOKENIZER.replace("520", "521");
        refused(&far, "521 is outside the vocabulary");
    }
}
