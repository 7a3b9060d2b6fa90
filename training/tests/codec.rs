//! Motion through the built-in codes and back.

use servodance_model::motion::{Clip, mpjpe_m};
use servodance_model::{Codec, Generator, GeneratorOptions};
use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};

fn disco() -> Clip {
    let beats: Vec<DanceBeat> =
        (0..40).map(|i| DanceBeat { time_s: f64::from(i) * 0.5, downbeat: i % 4 == 0 }).collect();
    choreograph(&beats, 20.0, DanceStyle::Disco, 5).normalised()
}

#[test]
fn a_dance_goes_on_where_another_motion_ended() {
    let past = disco();
    let generator = Generator::built_in().unwrap();
    let mut dance = generator.start(GeneratorOptions::default()).unwrap();
    let last = *past.poses.last().unwrap();
    let codes = Codec::built_in().unwrap().encode_all(&past).unwrap();
    assert_eq!(codes.len(), past.poses.len());
    dance.follow(&codes, &last).unwrap();
    let silence = servodance_types::MusicFrame {
        time_s: 0.0,
        spectral: [0.0; servodance_types::SPECTRAL_DIM],
        beat: Default::default(),
        presence: 0.0,
    };
    let next = dance.step(&silence).unwrap().positions;
    let jumps = last.iter().zip(&next).map(|(a, b)| {
        let d: [f32; 3] = std::array::from_fn(|k| a[k] - b[k]);
        d.iter().map(|x| x * x).sum::<f32>().sqrt()
    });
    let mean_m = jumps.sum::<f32>() / last.len() as f32;
    assert!(mean_m < 0.06, "{mean_m} m");
}

#[test]
fn motion_survives_the_codes() {
    let codec = Codec::built_in().unwrap();
    let danced = disco();
    let codes = codec.encode(&danced).unwrap();
    assert_eq!(codes.len(), danced.poses.len() - 1);
    let back = codec.decode("back", &codes).unwrap();
    let error_m = mpjpe_m(&danced.poses[..codes.len()], &back.poses).unwrap();
    assert!(error_m < 0.04, "{error_m} m");
    let frozen = vec![danced.poses[0]; codes.len()];
    assert!(mpjpe_m(&frozen, &back.poses).unwrap() > 2.0 * error_m);
}
