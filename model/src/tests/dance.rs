//! Whole dances of the tiny model, and of the built-in weights.

use proptest::prelude::*;
use servodance_types::{Beat, MotionFrame, MusicFrame, SPECTRAL_DIM};

use super::{TINY, check_same, decoded, decoded_at_once};
use crate::engine::EngineKind;
use crate::motion::{Pose, mean_joint_speed};
use crate::weights::Weights;
use crate::{AtEnd, Dance, Generator, GeneratorOptions, ModelError};

fn start(seed: u64, guidance: f32) -> Dance {
    let options = GeneratorOptions {
        seed,
        guidance,
        style: Some("wild".into()),
        ..GeneratorOptions::default()
    };
    Generator::from_bytes(TINY, "tiny").unwrap().start(options).unwrap()
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
    let whole = decoded(&weights, EngineKind::Own, &codes);
    check_same("motion", &whole, &decoded_at_once(&weights, &codes));
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
    let views = views.iter().map(|(name, dtype, shape, data): &(_, Stored, _, _)| {
        let view = TensorView::new(*dtype, Vec::clone(shape), data).unwrap();
        (name.as_str(), view)
    });
    safetensors::serialize(views, Some(metadata)).unwrap()
}

#[test]
fn the_end_stops_a_dance_or_begins_the_next_sequence() {
    let run = |bias, at_end| {
        let generator = Generator::from_bytes(&with_end(bias), "with an end").unwrap();
        let options = GeneratorOptions { at_end, ..GeneratorOptions::default() };
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
    assert_eq!((clean.bad_music_frames(), dirty.bad_music_frames()), (0, 10));
}

#[test]
fn an_unknown_style_lists_the_styles() {
    let generator = Generator::from_bytes(TINY, "tiny").unwrap();
    let options = GeneratorOptions { style: Some("polka".into()), ..GeneratorOptions::default() };
    let text = generator.start(options).unwrap_err().to_string();
    assert!(text.contains("polka") && text.contains("plain, wild"), "{text}");
}

#[test]
fn the_built_in_weights_dance_in_every_style() {
    let generator = Generator::built_in().unwrap();
    assert!(generator.styles().len() > 5, "{:?}", generator.styles());
    for style in generator.styles() {
        let options =
            GeneratorOptions { style: Some(style.clone()), ..GeneratorOptions::default() };
        let danced = frames(generator.start(options).unwrap(), 60);
        let hips: Vec<f32> = danced.iter().map(|f| f.positions[0][1]).collect();
        assert!(hips.iter().all(|y| (0.2..1.5).contains(y)), "{style}: {hips:?}");
        let moved = danced[20].positions != danced[59].positions;
        assert!(moved, "{style} stands still");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
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

/// Mean speed of the built-in dance on beats, in shares of that halfway between them.
fn speed_on_beats(beat_emphasis: f32) -> f64 {
    let options = GeneratorOptions { beat_emphasis, ..GeneratorOptions::default() };
    let frames = frames(Generator::built_in().unwrap().start(options).unwrap(), 600);
    let poses: Vec<Pose> = frames.iter().map(|frame| frame.positions).collect();
    let mut on_and_between = [0.0; 2];
    for (k, speed) in mean_joint_speed(&poses, 20.0).into_iter().enumerate() {
        let between = usize::from((0.25..0.75).contains(&music(k).beat.phase));
        on_and_between[between] += speed;
    }
    on_and_between[0] / on_and_between[1]
}

#[test]
fn emphasised_beats_are_danced_slower_than_what_lies_between() {
    let [plain, emphasised] = [0.0, 3.0].map(speed_on_beats);
    assert!(emphasised < 0.9 * plain, "{emphasised} {plain}");
}
