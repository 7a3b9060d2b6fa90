//! The networks against the PyTorch twin, and streaming against one pass.
//!
//! `golden/` is written by `model/reference/golden.py`: a tiny model with
//! random weights, and what the twin computes with it.

use candle_core::Tensor;
use safetensors::SafeTensors;

use super::{
    Dtype, Engine, EngineOptions, ModelConfig, MotionSeq, OneShotDecoder, OneShotSeq, Positions,
    VqDecoder, VqEncoder, Weights,
};
use crate::{Generator, ModelError};

pub(super) const TINY: &[u8] = include_bytes!("golden/tiny.safetensors");
const GOLDEN: &[u8] = include_bytes!("golden/golden.safetensors");
const TOLERANCE: f32 = 1e-4;
const STYLE: Option<usize> = Some(1);

struct Golden {
    decoder: OneShotDecoder,
    seq: OneShotSeq,
    codes: Vec<Vec<usize>>,
    previous: Vec<Vec<usize>>,
    music: Vec<f32>,
}

impl Golden {
    fn load() -> Self {
        let weights = Weights::open(TINY, "tiny").unwrap();
        let codes = code_rows("codes");
        let mut previous = codes.clone();
        previous.rotate_right(1);
        previous[0] = codes[0].clone();
        Self {
            decoder: OneShotDecoder::load(&weights).unwrap(),
            seq: OneShotSeq::load(&weights).unwrap(),
            codes,
            previous,
            music: floats("music"),
        }
    }
}

fn bytes_as<T>(name: &str, read: impl Fn([u8; 4]) -> T) -> Vec<T> {
    let golden = SafeTensors::deserialize(GOLDEN).unwrap();
    let view = golden.tensor(name).unwrap();
    view.data()
        .as_chunks::<4>()
        .0
        .iter()
        .map(|b| read(*b))
        .collect()
}

/// Rows of one code per part (the tiny model has two parts).
pub(super) fn code_rows(name: &str) -> Vec<Vec<usize>> {
    let codes = bytes_as(name, |b| i32::from_le_bytes(b) as usize);
    codes.chunks(2).map(<[usize]>::to_vec).collect()
}

pub(super) fn floats(name: &str) -> Vec<f32> {
    bytes_as(name, f32::from_le_bytes)
}

pub(super) fn check_same(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let gaps = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = gaps.fold(0.0, f32::max);
    let largest = expected.iter().fold(0f32, |m, v| m.max(v.abs()));
    assert!(
        largest > 0.1,
        "{what}: the expected numbers are all near zero"
    );
    assert!(
        worst <= TOLERANCE * largest.max(1.0),
        "{what}: off by {worst}"
    );
}

pub(super) fn flat(tensor: &Tensor) -> Vec<f32> {
    tensor.flatten_all().unwrap().to_vec1().unwrap()
}

#[test]
fn one_shot_decoding_agrees_with_the_twin() {
    let g = Golden::load();
    check_same(
        "motion",
        &g.decoder.one_shot(&g.codes).unwrap().concat(),
        &floats("motion"),
    );
}

/// Two threads, f32.
fn engine(weights: &Weights) -> Engine {
    let options = EngineOptions {
        dtype: Some(Dtype::F32),
        threads: Some(2),
    };
    Engine::new(weights, options).unwrap()
}

/// Motion of the codes, a frame at a time.
fn decoded(weights: &Weights, codes: &[Vec<usize>]) -> Vec<f32> {
    let engine = engine(weights);
    let decoder = VqDecoder::load(weights, &engine).unwrap();
    let mut state = decoder.start();
    let team = engine.pool().team();
    let frames = codes.iter();
    frames
        .flat_map(|codes| decoder.step(&team, &mut state, codes).to_vec())
        .collect()
}

/// Hidden vectors of each lane, a frame at a time; lane 1 hears nothing.
pub(super) fn hidden(
    weights: &Weights,
    previous: &[Vec<usize>],
    music: &[f32],
    lanes: usize,
) -> [Vec<f32>; 2] {
    let engine = engine(weights);
    let seq = MotionSeq::load(weights, &engine).unwrap();
    let mut state = seq.start(lanes);
    seq.restyle(&mut state, &seq.style(STYLE));
    let team = engine.pool().team();
    let mut found = [Vec::new(), Vec::new()];
    for (codes, music) in previous.iter().zip(music.chunks(39)) {
        seq.step(&team, &mut state, codes, &[Some(music), None][..lanes]);
        for (lane, found) in found.iter_mut().enumerate().take(lanes) {
            found.extend(state.hidden(lane));
        }
    }
    found
}

#[test]
fn streaming_decoding_agrees_with_the_twin() {
    let weights = Weights::open(TINY, "tiny").unwrap();
    check_same(
        "motion",
        &decoded(&weights, &code_rows("codes")),
        &floats("motion"),
    );
}

#[test]
fn encoding_gives_the_codes_of_the_twin() {
    let encoder = VqEncoder::load(&Weights::open(TINY, "tiny").unwrap()).unwrap();
    let poses = floats("poses");
    let expected = code_rows("encoded");
    assert!(expected.iter().any(|row| row != &expected[0]));
    assert_eq!(encoder.encode(poses.as_chunks().0).unwrap(), expected);
}

#[test]
fn long_motion_is_encoded_as_in_one_pass() {
    let encoder = VqEncoder::load(&Weights::open(TINY, "tiny").unwrap()).unwrap();
    let noise = |i: usize| ((i * 7919 % 1009) as f32 / 504.0) - 1.0;
    let motion: Vec<_> = (0..1300)
        .map(|t| std::array::from_fn(|c| noise(t * 137 + c)))
        .collect();
    let tail = encoder.encode(&motion[400..900]).unwrap();
    // Away from the cut ends, where the excerpt lacks its neighbours.
    assert_eq!(encoder.encode(&motion).unwrap()[420..880], tail[20..480]);
}

#[test]
fn one_shot_motionseq_agrees_with_the_twin() {
    let g = Golden::load();
    for (name, music, style) in [("heard", Some(&g.music[..]), STYLE), ("deaf", None, None)] {
        let hidden = g.seq.one_shot(&g.previous, music, style).unwrap();
        check_same(name, &flat(&hidden), &floats(&format!("{name}_hidden")));
        for part in 0..2 {
            let logits = g.seq.logits(part, &hidden, &g.codes).unwrap();
            check_same(
                name,
                &flat(&logits),
                &floats(&format!("{name}_logits{part}")),
            );
        }
    }
}

#[test]
fn streaming_motionseq_agrees_with_the_twin() {
    let g = Golden::load();
    let weights = Weights::open(TINY, "tiny").unwrap();
    let [heard, _] = hidden(&weights, &g.previous, &g.music, 1);
    check_same("hidden", &heard, &floats("heard_hidden"));
}

#[test]
fn two_lanes_give_what_two_dances_give() {
    let g = Golden::load();
    let weights = Weights::open(TINY, "tiny").unwrap();
    let [heard, deaf] = hidden(&weights, &g.previous, &g.music, 2);
    assert_eq!(heard, hidden(&weights, &g.previous, &g.music, 1)[0]);
    let expected = g.seq.one_shot(&g.previous, None, STYLE).unwrap();
    check_same("deaf", &deaf, &flat(&expected));
}

/// Small networks of the shapes that the tiny file does not have.
fn other_shapes() -> Vec<ModelConfig> {
    let tiny = ModelConfig::preset("tiny").unwrap();
    let mut paper_like = tiny.clone();
    paper_like.activation = super::Activation::Gelu;
    paper_like.parts = vec!["whole".into()];
    (paper_like.vq.head_dim, paper_like.seq.head_dim) = (Some(12), Some(20));
    paper_like.seq.eos = true;
    let mut absolute = tiny.clone();
    absolute.seq.positions = Positions::Sinusoidal;
    absolute.seq.window = 40;
    let mut live = ModelConfig::preset("live").unwrap();
    (live.vq.decoder_window, live.seq.window) = (9, 11);
    vec![paper_like, absolute, live]
}

#[test]
fn a_frame_at_a_time_gives_what_one_pass_gives() {
    for config in other_shapes() {
        let (parts, codes) = (config.parts.len(), config.codes);
        let weights = Weights::random(config);
        let rows: Vec<Vec<usize>> = (0..30)
            .map(|t| (0..parts).map(|p| (t * 7919 + p * 31) % codes).collect())
            .collect();
        let music: Vec<f32> = (0..30 * 39).map(|i| (i as f32 * 0.37).sin()).collect();
        let what = &weights.config().preset;
        let one_shot = OneShotDecoder::load(&weights).unwrap();
        check_same(
            what,
            &decoded(&weights, &rows),
            &one_shot.one_shot(&rows).unwrap().concat(),
        );
        let seq = OneShotSeq::load(&weights).unwrap();
        let expected = seq.one_shot(&rows, Some(&music), STYLE).unwrap();
        check_same(
            what,
            &hidden(&weights, &rows, &music, 1)[0],
            &flat(&expected),
        );
        let found = logits(&weights, &rows[0], &music[..39]);
        let first = expected.narrow(0, 0, 1).unwrap();
        for (part, found) in found.iter().enumerate() {
            let expected = seq.logits(part, &first, &rows[..1]).unwrap();
            check_same(what, found, &flat(&expected));
        }
    }
}

/// Logits of every part at the first frame.
fn logits(weights: &Weights, codes: &[usize], music: &[f32]) -> Vec<Vec<f32>> {
    let engine = engine(weights);
    let seq = MotionSeq::load(weights, &engine).unwrap();
    let mut state = seq.start(1);
    seq.restyle(&mut state, &seq.style(STYLE));
    let team = engine.pool().team();
    seq.step(&team, &mut state, codes, &[Some(music)]);
    let mut of_part = |part| -> Vec<f32> {
        let lanes = seq.logits(&team, &mut state, part, &codes[..part]);
        lanes.flatten().copied().collect()
    };
    (0..codes.len()).map(&mut of_part).collect()
}

#[test]
fn another_start_forgets_the_past() {
    let g = Golden::load();
    let weights = Weights::open(TINY, "tiny").unwrap();
    let engine = engine(&weights);
    let seq = MotionSeq::load(&weights, &engine).unwrap();
    let mut state = seq.start(1);
    let team = engine.pool().team();
    let mut run = || -> Vec<f32> {
        let frames = g.previous.iter().zip(g.music.chunks(39)).take(5);
        let mut step = |(codes, music): (&Vec<usize>, _)| {
            seq.step(&team, &mut state, codes, &[Some(music)]);
            state.hidden(0).to_vec()
        };
        let found = frames.flat_map(&mut step).collect();
        state.restart();
        found
    };
    let first = run();
    assert_eq!(first, run());
}

/// The tiny file with one change to its header or data.
fn broken(change: impl Fn(&mut Vec<u8>)) -> ModelError {
    let mut bytes = TINY.to_vec();
    change(&mut bytes);
    Generator::from_bytes(&bytes, "broken").unwrap_err()
}

/// Replaces text in the header by text of the same length.
fn swap(bytes: &mut [u8], from: &str, to: &str) {
    assert_eq!(from.len(), to.len());
    let at = bytes
        .windows(from.len())
        .position(|w| w == from.as_bytes())
        .unwrap();
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
}

#[test]
fn a_truncated_file_is_refused() {
    let error = broken(|bytes| bytes.truncate(100_000));
    assert!(matches!(error, ModelError::File { .. }), "{error}");
    let error = broken(|bytes| bytes.truncate(5));
    assert!(matches!(error, ModelError::File { .. }), "{error}");
}

#[test]
fn a_missing_tensor_is_named_with_its_shape() {
    let error = broken(|bytes| swap(bytes, "seq.head.upper.bias", "seq.head.uppex.bias"));
    let text = error.to_string();
    assert!(
        text.contains("seq.head.upper.bias") && text.contains("[16]"),
        "{text}"
    );
}

#[test]
fn sizes_that_do_not_match_the_tensors_are_named() {
    let error = broken(|bytes| swap(bytes, r#"\"codes\":16"#, r#"\"codes\":15"#));
    let text = error.to_string();
    assert!(
        matches!(error, ModelError::Config { .. } | ModelError::Shape { .. }),
        "{text}"
    );
    let error = broken(|bytes| swap(bytes, r#"\"code_dim\":8"#, r#"\"code_dim\":9"#));
    let text = error.to_string();
    assert!(
        text.contains("[16, 9]") && text.contains("[16, 8]"),
        "{text}"
    );
}

#[test]
fn a_configuration_of_another_kind_is_refused() {
    let error = broken(|bytes| swap(bytes, r#"\"music_dim\":39"#, r#"\"music_dim\":35"#));
    assert!(
        error.to_string().contains("music_dim is 35, expected 39"),
        "{error}"
    );
    let error = broken(|bytes| swap(bytes, "servodance-model-1", "servodance-model-7"));
    assert!(error.to_string().contains("servodance-model-7"), "{error}");
}

#[test]
fn a_weight_that_is_not_a_number_is_refused() {
    let error = broken(|bytes| {
        let header = u64::from_le_bytes(*bytes.first_chunk().unwrap()) as usize;
        let at = 8 + header + 40_000;
        bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    });
    assert!(matches!(error, ModelError::NotFinite { .. }), "{error}");
}

/// A change to the tensors of a whole file: name, type, shape and bytes.
type Change = fn(&mut Vec<(String, safetensors::Dtype, Vec<usize>, Vec<u8>)>);

/// The file with changed tensors.
fn rewritten(bytes: &[u8], change: Change) -> Vec<u8> {
    let tensors = SafeTensors::deserialize(bytes).unwrap();
    let (_, header) = SafeTensors::read_metadata(bytes).unwrap();
    let owned = tensors.tensors().into_iter().map(|(name, view)| {
        let (dtype, shape) = (view.dtype(), view.shape().to_vec());
        (name, dtype, shape, view.data().to_vec())
    });
    let mut owned: Vec<_> = owned.collect();
    change(&mut owned);
    let views = owned.iter().map(|(name, dtype, shape, data)| {
        let view = safetensors::tensor::TensorView::new(*dtype, shape.clone(), data);
        (name.as_str(), view.unwrap())
    });
    safetensors::serialize(views, header.metadata().clone()).unwrap()
}

#[test]
fn every_number_format_is_checked_at_load() {
    const UP: &str = "seq.layers.1.ff.up.weight";
    let cases: [(Dtype, Change, &[&str]); 8] = [
        (
            Dtype::F32,
            |t| t.retain(|t| t.0 != UP),
            &["is missing", "[64, 32]"],
        ),
        (
            Dtype::Q8_0,
            |t| t.retain(|t| t.0 != UP),
            &["is missing", "[64, 32]"],
        ),
        (
            Dtype::Q8_0,
            |t| t.retain(|t| t.0 != UP.to_owned() + ".scale"),
            &[".scale", "[64, 1]"],
        ),
        (
            Dtype::Q6,
            |t| t.retain(|t| t.0 != UP.to_owned() + ".scale"),
            &[".scale", "[64, 1]"],
        ),
        (
            Dtype::Q4_0,
            |t| {
                let up = t.iter_mut().find(|t| t.0 == UP).unwrap();
                up.2 = vec![32, 32];
            },
            &["[32, 32]", "[64, 16]"],
        ),
        (
            Dtype::Q4_0,
            |t| {
                let scale = t
                    .iter_mut()
                    .find(|t| t.0.starts_with(UP) && t.0 != UP)
                    .unwrap();
                scale.3[..2].copy_from_slice(&half::f16::NAN.to_le_bytes());
            },
            &["not finite"],
        ),
        (
            Dtype::F16,
            |t| {
                let up = t.iter_mut().find(|t| t.0 == UP).unwrap();
                up.3[6..8].copy_from_slice(&half::f16::INFINITY.to_le_bytes());
            },
            &["not finite", "index 3"],
        ),
        (
            Dtype::F32,
            |t| {
                let up = t.iter_mut().find(|t| t.0 == UP).unwrap();
                (up.1, up.2) = (safetensors::Dtype::F64, vec![32, 32]);
            },
            &["[32, 32]", "[64, 32]"],
        ),
    ];
    for (dtype, change, words) in cases {
        let bytes = rewritten(&super::convert(TINY, "tiny", dtype).unwrap(), change);
        let text = Generator::from_bytes(&bytes, "broken")
            .unwrap_err()
            .to_string();
        for word in words.iter().chain(&[UP, "broken"]) {
            assert!(text.contains(word), "{dtype}: {text} lacks {word}");
        }
        assert!(!text.contains('\n'), "{text}");
    }
}

#[test]
fn converted_weights_give_nearly_the_same() {
    let g = Golden::load();
    let expected = decoded(&Weights::open(TINY, "tiny").unwrap(), &g.codes);
    let size = expected.iter().map(|v| v * v).sum::<f32>();
    for (dtype, tolerance) in [
        (Dtype::F32, 0.0),
        (Dtype::F16, 1e-3),
        (Dtype::Q8_0, 2e-2),
        (Dtype::Q6, 0.1),
        (Dtype::Q4_0, 0.4),
    ] {
        let bytes = super::convert(TINY, "tiny", dtype).unwrap();
        let weights = Weights::open(&bytes, "converted").unwrap();
        assert_eq!(weights.dtype(), dtype);
        let found = decoded(&weights, &g.codes);
        let gap: f32 = found
            .iter()
            .zip(&expected)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        assert!(
            gap <= size * tolerance * tolerance,
            "{dtype}: {gap} of {size}"
        );
        // What is kept as blocks is what a wider format makes of it.
        let options = EngineOptions {
            dtype: Some(dtype),
            threads: Some(1),
        };
        let engine = Engine::new(&weights, options).unwrap();
        assert_eq!(VqDecoder::load(&weights, &engine).unwrap().dtype(), dtype);
        let wide = super::convert(&bytes, "converted", Dtype::F32).unwrap();
        let wide = Weights::open(&wide, "wide").unwrap();
        assert_eq!(decoded(&wide, &g.codes), found);
    }
}

#[test]
fn another_preset_than_asked_is_refused() {
    let weights = Weights::open(TINY, "mine").unwrap();
    assert!(weights.expect_preset("tiny").is_ok());
    let text = weights.expect_preset("paper").unwrap_err().to_string();
    assert!(
        text.contains("mine") && text.contains("preset is `tiny`, expected `paper`"),
        "{text}"
    );
}

mod dance {
    use super::*;
    use crate::{AtEnd, Dance, GeneratorOptions};
    use proptest::prelude::*;
    use servodance_types::{Beat, MotionFrame, MusicFrame, SPECTRAL_DIM};

    fn start(seed: u64, guidance: f32) -> Dance {
        let options = GeneratorOptions {
            seed,
            guidance,
            style: Some("wild".into()),
            ..GeneratorOptions::default()
        };
        Generator::from_bytes(TINY, "tiny")
            .unwrap()
            .start(options)
            .unwrap()
    }

    fn music(k: usize) -> MusicFrame {
        MusicFrame {
            time_s: k as f64 / 20.0,
            spectral: std::array::from_fn(|i| ((k * 7 + i) as f32 * 0.37).sin()),
            beat: Beat {
                phase: k as f32 * 0.1 % 1.0,
                tempo_bpm: 120.0,
                confidence: 1.0,
                ..Beat::default()
            },
            presence: 1.0,
        }
    }

    fn frames(mut dance: Dance, count: usize) -> Vec<MotionFrame> {
        (0..count).map(|k| dance.step(&music(k)).unwrap()).collect()
    }

    #[test]
    fn the_same_seed_dances_the_same() {
        assert_eq!(frames(start(3, 1.0), 40), frames(start(3, 1.0), 40));
        assert_ne!(frames(start(3, 1.0), 40), frames(start(4, 1.0), 40));
    }

    #[test]
    fn guidance_changes_the_dance_and_one_does_not() {
        assert_ne!(frames(start(3, 1.0), 40), frames(start(3, 4.0), 40));
    }

    #[test]
    fn guidance_can_be_left_out_and_taken_up_again() {
        let mut dance = start(3, 4.0);
        assert_eq!(dance.passes(), 2);
        let guided = dance.step(&music(0)).unwrap();
        dance.guide(false);
        assert_eq!(dance.passes(), 1);
        let alone = dance.step(&music(1)).unwrap();
        dance.guide(true);
        assert_eq!(dance.passes(), 2);
        let again = dance.step(&music(2)).unwrap();
        assert!(guided.time_s < alone.time_s && alone.time_s < again.time_s);
        // A dance that was never guided stays so.
        let mut unguided = start(3, 1.0);
        unguided.guide(true);
        assert_eq!(unguided.passes(), 1);
    }

    #[test]
    fn a_reset_dance_begins_again_and_another_start_gives_the_same() {
        let mut dance = start(3, 2.0);
        let mut run = |seed| -> Vec<_> {
            dance.reset(seed);
            (0..30).map(|k| dance.step(&music(k)).unwrap()).collect()
        };
        let first = run(3);
        assert_ne!(first, run(8));
        assert_eq!(first, run(3));
        assert_eq!(first, frames(start(3, 2.0), 30));
    }

    #[test]
    fn chained_sequences_are_one_motion() {
        let mut dance = start(3, 1.0);
        let mut codes = Vec::new();
        for k in 0..40 {
            if k % 9 == 8 {
                dance.chain();
            }
            dance.step(&music(k)).unwrap();
            codes.push(dance.codes().to_vec());
        }
        // Stage 1 went on over every seam, as if the codes had come in one piece.
        let weights = Weights::open(TINY, "tiny").unwrap();
        let whole = super::decoded(&weights, &codes);
        let one_pass = OneShotDecoder::load(&weights)
            .unwrap()
            .one_shot(&codes)
            .unwrap();
        super::check_same("motion", &whole, &one_pass.concat());
        // And the sequences did begin anew: without the seams it goes elsewhere.
        let mut unbroken = start(3, 1.0);
        let gone_on: Vec<_> = (0..40)
            .map(|k| {
                unbroken.step(&music(k)).unwrap();
                unbroken.codes().to_vec()
            })
            .collect();
        assert_eq!(codes[..8], gone_on[..8]);
        assert_ne!(codes, gone_on);
    }

    #[test]
    fn repetition_control_makes_codes_come_less_often() {
        let most_frequent = |repetition| {
            let options = GeneratorOptions {
                repetition,
                guidance: 1.0,
                temperature: 0.3,
                ..GeneratorOptions::default()
            };
            let generator = Generator::from_bytes(TINY, "tiny").unwrap();
            let mut dance = generator.start(options).unwrap();
            let mut counts = [0; 16];
            for k in 0..200 {
                dance.step(&music(k)).unwrap();
                counts[dance.codes()[0]] += 1;
            }
            counts.into_iter().max().unwrap()
        };
        let (free, held) = (most_frequent(0.0), most_frequent(20.0));
        assert!(held < free, "{held} {free}");
    }

    /// The tiny model with one class more in its first head, which is as likely
    /// as its bias says.
    fn with_end(bias: f32) -> Vec<u8> {
        use safetensors::tensor::{Dtype as Stored, SafeTensors, TensorView};
        let tensors = SafeTensors::deserialize(TINY).unwrap();
        let (_, header) = SafeTensors::read_metadata(TINY).unwrap();
        let mut metadata = header.metadata().clone().unwrap();
        let config = metadata.get_mut("config").unwrap();
        *config = config.replace(r#""music_at_input""#, r#""eos":true,"music_at_input""#);
        let mut views = Vec::new();
        for name in tensors.names() {
            let view = tensors.tensor(name).unwrap();
            let (mut shape, mut data) = (view.shape().to_vec(), view.data().to_vec());
            if name == "seq.head.lower.weight" {
                shape[0] += 1;
                data.extend(vec![0; 4 * shape[1]]);
            } else if name == "seq.head.lower.bias" {
                shape[0] += 1;
                data.extend(bias.to_le_bytes());
            }
            views.push((name.to_owned(), view.dtype(), shape, data));
        }
        let views = views
            .iter()
            .map(|(name, dtype, shape, data): &(_, Stored, _, _)| {
                let view = TensorView::new(*dtype, Vec::clone(shape), data).unwrap();
                (name.as_str(), view)
            });
        safetensors::serialize(views, Some(metadata)).unwrap()
    }

    #[test]
    fn the_end_stops_a_dance_or_begins_the_next_sequence() {
        let run = |bias, at_end| {
            let generator = Generator::from_bytes(&with_end(bias), "with an end").unwrap();
            let options = GeneratorOptions {
                at_end,
                ..GeneratorOptions::default()
            };
            let mut dance = generator.start(options).unwrap();
            let danced = (0..30).map_while(|k| match dance.step(&music(k)) {
                Ok(frame) => Some(frame),
                Err(ModelError::Ended { frame }) => {
                    assert_eq!(frame, k as u64);
                    None
                }
                Err(error) => panic!("{error}"),
            });
            danced.count()
        };
        // A sequence has at least one frame, however likely the end is.
        assert_eq!(run(1e4, AtEnd::Stop), 1);
        assert_eq!(run(1e4, AtEnd::Chain), 30);
        assert_eq!(run(-1e4, AtEnd::Stop), 30);
    }

    #[test]
    fn bad_music_is_replaced_by_the_last_good_frame_and_counted() {
        let (mut clean, mut dirty) = (start(1, 1.0), start(1, 1.0));
        for k in 0..20 {
            let heard = music(k - k % 2);
            let mut broken = heard;
            if k % 2 == 1 {
                broken.spectral[k % SPECTRAL_DIM] = f32::NAN;
            }
            assert_eq!(clean.step(&heard).unwrap(), dirty.step(&broken).unwrap());
        }
        assert_eq!(
            (clean.bad_music_frames(), dirty.bad_music_frames()),
            (0, 10)
        );
    }

    #[test]
    fn an_unknown_style_lists_the_styles() {
        let generator = Generator::from_bytes(TINY, "tiny").unwrap();
        let options = GeneratorOptions {
            style: Some("polka".into()),
            ..GeneratorOptions::default()
        };
        let text = generator.start(options).unwrap_err().to_string();
        assert!(
            text.contains("polka") && text.contains("plain, wild"),
            "{text}"
        );
    }

    #[test]
    fn the_built_in_weights_dance_in_every_style() {
        let generator = Generator::built_in().unwrap();
        assert!(generator.styles().len() > 5, "{:?}", generator.styles());
        for style in generator.styles() {
            let options = GeneratorOptions {
                style: Some(style.clone()),
                ..GeneratorOptions::default()
            };
            let danced = frames(generator.start(options).unwrap(), 60);
            let hips: Vec<f32> = danced.iter().map(|f| f.positions[0][1]).collect();
            assert!(
                hips.iter().all(|y| (0.2..1.5).contains(y)),
                "{style}: {hips:?}"
            );
            let moved = danced[20].positions != danced[59].positions;
            assert!(moved, "{style} stands still");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn any_music_gives_finite_motion(values in prop::collection::vec(any::<f32>(), SPECTRAL_DIM), phase in any::<f32>()) {
            let mut dance = start(9, 1.0);
            for k in 0..4 {
                let mut heard = music(k);
                heard.spectral.copy_from_slice(&values);
                heard.beat.phase = phase;
                prop_assert!(dance.step(&heard).unwrap().is_finite());
            }
        }
    }
}
