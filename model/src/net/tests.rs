//! The networks against the PyTorch twin, and streaming against one pass.
//!
//! `golden/` is written by `model/reference/golden.py`: a tiny model with
//! random weights, and what the twin computes with it.

use candle_core::Tensor;
use safetensors::SafeTensors;

use super::{MotionSeq, VqDecoder, VqEncoder, Weights};
use crate::{Generator, ModelError};

const TINY: &[u8] = include_bytes!("golden/tiny.safetensors");
const GOLDEN: &[u8] = include_bytes!("golden/golden.safetensors");
const TOLERANCE: f32 = 1e-4;
const STYLE: Option<usize> = Some(1);

struct Golden {
    decoder: VqDecoder,
    seq: MotionSeq,
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
            decoder: VqDecoder::load(&weights).unwrap(),
            seq: MotionSeq::load(&weights).unwrap(),
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
fn code_rows(name: &str) -> Vec<Vec<usize>> {
    let codes = bytes_as(name, |b| i32::from_le_bytes(b) as usize);
    codes.chunks(2).map(<[usize]>::to_vec).collect()
}

fn floats(name: &str) -> Vec<f32> {
    bytes_as(name, f32::from_le_bytes)
}

fn check_same(what: &str, found: &[f32], expected: &[f32]) {
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

fn flat(tensor: &Tensor) -> Vec<f32> {
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

#[test]
fn streaming_decoding_agrees_with_the_twin() {
    let g = Golden::load();
    let mut state = g.decoder.start().unwrap();
    let frames = g
        .codes
        .iter()
        .map(|codes| g.decoder.step(&mut state, codes).unwrap());
    check_same(
        "motion",
        &frames.flatten().collect::<Vec<_>>(),
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
    let mut state = g.seq.start(STYLE).unwrap();
    let mut found = Vec::new();
    for (codes, music) in g.previous.iter().zip(g.music.chunks(39)) {
        found.extend(flat(&g.seq.step(&mut state, codes, Some(music)).unwrap()));
    }
    check_same("hidden", &found, &floats("heard_hidden"));
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

mod dance {
    use super::*;
    use crate::{Dance, GeneratorOptions};
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
        dance.guide(false).unwrap();
        assert_eq!(dance.passes(), 1);
        let alone = dance.step(&music(1)).unwrap();
        dance.guide(true).unwrap();
        assert_eq!(dance.passes(), 2);
        let again = dance.step(&music(2)).unwrap();
        assert!(guided.time_s < alone.time_s && alone.time_s < again.time_s);
        // A dance that was never guided stays so.
        let mut unguided = start(3, 1.0);
        unguided.guide(true).unwrap();
        assert_eq!(unguided.passes(), 1);
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
