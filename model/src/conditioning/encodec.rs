//! Music as Encodec hears it: 128 numbers, 20 times a second.
//!
//! As in MAGMA the public 24 kHz checkpoint is given sound of 6.4 kHz, so that
//! its frame of 320 samples lasts 50 ms, and the latent is taken after the
//! quantiser: the sum of eight codes out of eight codebooks (6 kbit/s). Causal:
//! frame `i` knows the samples before `320 (i + 1)`. The weights are not part
//! of this program: a user brings `facebook/encodec_24khz` (docs/conditioning.md).

use std::path::Path;
use std::sync::Arc;

use candle_core::{D, Result as TensorResult, Tensor};

use super::checkpoint::Checkpoint;
use super::music::Latent;
use super::seanet::{Encoder, FIRST_FRAMES, HOP};
use crate::config::LATENT_DIM;
use crate::error::ModelError;

/// Filters in the first layer of the public checkpoint.
const FILTERS: usize = 32;
/// Codebooks used, of the 32 that there are.
const CODEBOOKS: usize = 8;
/// Codes in a codebook.
const CODES: usize = 1024;

/// The encoder and the codebooks; start as many streams from it as you like.
#[derive(Clone, Debug)]
pub struct Encodec {
    encoder: Encoder,
    codebooks: Arc<[Codebook]>,
}

#[derive(Debug)]
struct Codebook {
    codes: Tensor,
    /// Half the squared length of each row of `codes` [codes, 128].
    half_squares: Tensor,
}

impl Encodec {
    /// Reads the encoder and the codebooks out of `model.safetensors` of
    /// `facebook/encodec_24khz`. Another layout is refused with the tensor's
    /// name and the shapes expected and found.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        let file = Checkpoint::open(path)?;
        let codebooks = (0..CODEBOOKS).map(|number| Codebook::load(&file, number));
        Ok(Self {
            encoder: Encoder::load(&file, FILTERS, LATENT_DIM)?,
            codebooks: codebooks.collect::<Result<_, _>>()?,
        })
    }

    /// A stream that begins as a recording does in the original: the sound is
    /// reflected to before its start, so that the first seven frames need each
    /// other and come together, 0.35 s after the start.
    pub fn start(&self) -> EncodecStream {
        EncodecStream {
            encoder: self.encoder.clone(),
            codebooks: self.codebooks.clone(),
            waiting: Vec::new(),
            started: false,
        }
    }

    /// A stream before which it was silent, and what is heard then: from the
    /// first sample on every frame comes when its samples are there.
    pub fn start_in_silence(&self) -> Result<(EncodecStream, Latent), ModelError> {
        let mut stream = self.start();
        let mut silence = [0.0; LATENT_DIM];
        stream.push(&[0.0; FIRST_FRAMES * HOP], |latent| silence = *latent)?;
        Ok((stream, silence))
    }
}

impl Codebook {
    fn load(file: &Checkpoint, number: usize) -> Result<Self, ModelError> {
        let name = format!("quantizer.layers.{number}.codebook.embed");
        let codes = file.tensor(&name, &[CODES, LATENT_DIM])?;
        let half_squares = (codes.sqr()?.sum(D::Minus1)? / 2.0)?;
        Ok(Self { codes, half_squares })
    }

    /// The nearest codes [n, 128] to the rows: |x - c|^2 / 2 less |x|^2 / 2.
    fn nearest(&self, rows: &Tensor) -> TensorResult<Tensor> {
        let products = rows.matmul(&self.codes.t()?)?;
        let distances = self.half_squares.broadcast_sub(&products)?;
        self.codes.index_select(&distances.argmin(D::Minus1)?, 0)
    }
}

/// The sum of the codes of the rows [n, 128]: each codebook codes what the
/// ones before left over.
fn quantised(codebooks: &[Codebook], rows: &Tensor) -> TensorResult<Tensor> {
    let mut sum = rows.zeros_like()?;
    for codebook in codebooks {
        sum = (&sum + codebook.nearest(&(rows - &sum)?)?)?;
    }
    Ok(sum)
}

/// Sound in, latents out; constant memory for any length.
#[derive(Debug)]
pub struct EncodecStream {
    encoder: Encoder,
    codebooks: Arc<[Codebook]>,
    waiting: Vec<f32>,
    started: bool,
}

impl EncodecStream {
    /// Takes samples at [`ENCODEC_RATE_HZ`](super::ENCODEC_RATE_HZ), any number of them, and hands out
    /// the frames that they complete. Samples that are not finite become 0. The
    /// block sizes change nothing, not a bit.
    pub fn push(
        &mut self,
        samples: &[f32],
        mut on_latent: impl FnMut(&Latent),
    ) -> Result<(), ModelError> {
        for &sample in samples {
            let finite = sample.is_finite();
            self.waiting.push(if finite { sample } else { 0.0 });
            let wanted = if self.started { 1 } else { FIRST_FRAMES };
            if self.waiting.len() < wanted * HOP {
                continue;
            }
            self.started = true;
            let rows = self.encoder.forward(&self.waiting)?;
            self.waiting.clear();
            let latents = quantised(&self.codebooks, &rows)?.flatten_all()?;
            for latent in latents.to_vec1::<f32>()?.as_chunks().0 {
                on_latent(latent);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::golden::{Golden, Manifest, check_same, noise, write_checkpoint};
    use super::*;
    use std::sync::OnceLock;

    const TOLERANCE: f32 = 1e-4;

    fn golden() -> Golden {
        Golden::open(include_bytes!("golden/encodec.safetensors"))
    }

    fn load(change: impl Fn(&mut Manifest)) -> Result<Encodec, ModelError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut manifest = golden().weights();
        change(&mut manifest);
        write_checkpoint(file.path(), &manifest);
        Encodec::load(file.path())
    }

    /// The full-size encoder that all tests share.
    fn encodec() -> &'static Encodec {
        static SHARED: OnceLock<Encodec> = OnceLock::new();
        SHARED.get_or_init(|| load(|_| {}).unwrap())
    }

    fn latents(stream: &mut EncodecStream, samples: &[f32]) -> Vec<f32> {
        let mut out = Vec::new();
        stream.push(samples, |latent| out.extend(latent)).unwrap();
        out
    }

    #[test]
    fn one_pass_agrees_with_the_reference() {
        let golden = golden();
        let rows = encodec().encoder.clone().forward(&golden.floats("sound"));
        let rows = rows.unwrap();
        let flat = |rows: &Tensor| rows.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        check_same("latents", &flat(&rows), &golden.floats("latents"), TOLERANCE);
        let sum = quantised(&encodec().codebooks, &rows).unwrap();
        check_same("sum of codes", &flat(&sum), &golden.floats("sum"), TOLERANCE);
    }

    #[test]
    fn the_stream_agrees_with_the_reference_from_its_first_frame_on() {
        let golden = golden();
        let (sound, sum) = (golden.floats("sound"), golden.floats("sum"));
        let whole = latents(&mut encodec().start(), &sound);
        check_same("stream", &whole, &sum, TOLERANCE);
        for block in [1000, 333] {
            let mut stream = encodec().start();
            let pieces = sound.chunks(block).map(|b| latents(&mut stream, b));
            assert!(pieces.flatten().eq(whole.iter().copied()), "{block}");
        }
    }

    /// The encoder's own numbers, before the codebooks hide small differences.
    #[test]
    fn pieces_give_the_latents_of_one_pass() {
        let sound = golden().floats("sound");
        let (first, rest) = sound.split_at(FIRST_FRAMES * HOP);
        let mut encoder = encodec().encoder.clone();
        let mut pieces = vec![encoder.forward(first).unwrap()];
        for piece in rest.chunks(HOP) {
            pieces.push(encoder.forward(piece).unwrap());
        }
        let pieces = Tensor::cat(&pieces, 0).unwrap().flatten_all().unwrap();
        let expected = golden().floats("latents");
        check_same("pieces", &pieces.to_vec1::<f32>().unwrap(), &expected, TOLERANCE);
    }

    #[test]
    fn after_silence_every_frame_comes_at_once_and_knows_nothing_of_the_next() {
        let sound: Vec<f32> = noise("music", 20 * HOP).collect();
        let (mut stream, silence) = encodec().start_in_silence().unwrap();
        let heard: Vec<Vec<f32>> = sound.chunks(HOP).map(|b| latents(&mut stream, b)).collect();
        assert!(heard.iter().all(|latent| latent.len() == LATENT_DIM));
        assert_ne!(heard[0], silence);
        // Another future changes nothing.
        let (mut stream, _) = encodec().start_in_silence().unwrap();
        assert_eq!(latents(&mut stream, &sound[..10 * HOP]), heard[..10].concat());
    }

    #[test]
    fn memory_does_not_grow_and_bad_samples_are_silence() {
        let (mut stream, _) = encodec().start_in_silence().unwrap();
        let (mut other, _) = encodec().start_in_silence().unwrap();
        let quiet = latents(&mut other, &[0.0; 3 * HOP]);
        assert_eq!(latents(&mut stream, &[f32::NAN; 3 * HOP]), quiet);
        latents(&mut stream, &[f32::INFINITY; 50 * HOP + 7]);
        assert_eq!(stream.waiting.len(), 7);
        assert!(stream.waiting.capacity() <= FIRST_FRAMES * HOP * 2);
    }

    #[test]
    fn both_names_of_normed_weights_are_read() {
        let newer = load(|manifest| {
            *manifest = std::mem::take(manifest)
                .into_iter()
                .map(|(name, entry)| {
                    let newer = name
                        .replace("weight_g", "parametrizations.weight.original0")
                        .replace("weight_v", "parametrizations.weight.original1");
                    (newer, entry)
                })
                .collect();
            assert!(manifest.keys().any(|name| name.contains("original0")));
        });
        let sound: Vec<f32> = noise("music", 8 * HOP).collect();
        let found = latents(&mut newer.unwrap().start(), &sound);
        assert_eq!(found, latents(&mut encodec().start(), &sound));
    }

    #[test]
    fn another_layout_is_refused_by_name_and_shape() {
        let text = |change: &dyn Fn(&mut Manifest)| load(change).unwrap_err().to_string();
        let lost = text(&|m| drop(m.remove("encoder.layers.13.lstm.bias_ih_l1")));
        assert!(
            lost.contains("encoder.layers.13.lstm.bias_ih_l1") && lost.contains("[2048]"),
            "{lost}"
        );
        let narrow = text(&|m| {
            let entry = m.get_mut("quantizer.layers.3.codebook.embed").unwrap();
            entry.0 = vec![1024, 64];
        });
        assert!(narrow.contains("[1024, 64]") && narrow.contains("[1024, 128]"), "{narrow}");
    }

    #[test]
    fn files_that_are_no_checkpoint_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.safetensors");
        let refused = |words: &str| {
            let text = Encodec::load(&path).unwrap_err().to_string();
            assert!(text.contains("model.safetensors") && text.contains(words), "{text}");
        };
        refused("No such file");
        let mut small = Manifest::new();
        small.insert("encoder.x".into(), (vec![100], 0.0, 1.0));
        write_checkpoint(&path, &small);
        refused("encoder.layers.0.conv.bias");
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 100]).unwrap();
        refused("as if a download broke off");
        std::fs::write(&path, &bytes[..20]).unwrap();
        refused("not a whole safetensors file");
        std::fs::write(&path, [1; 3]).unwrap();
        refused("ends within its header");
        std::fs::write(&path, "version https://git-lfs.github.com/spec/v1\n").unwrap();
        refused("Git LFS");
        let torch = [&[2, 0, 0, 0, 0, 0, 0, 0][..], b"PK", &[0; 50]].concat();
        std::fs::write(&path, torch).unwrap();
        refused("not a safetensors file");
    }

    #[test]
    fn weights_that_are_not_finite_are_refused() {
        let text = load(|m| m.get_mut("encoder.layers.3.conv.weight_v").unwrap().2 = f32::NAN);
        let text = text.unwrap_err().to_string();
        assert!(text.contains("encoder.layers.3.conv.weight_v"), "{text}");
    }
}
