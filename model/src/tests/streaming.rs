//! A piece at a time against everything in one pass.

use super::{
    Golden, STYLE, TINY, check_same, danced_at_once, decoded, decoded_at_once, engine, hidden,
    slices,
};
use crate::config::{Activation, ModelConfig, Positions};
use crate::engine::EngineKind;
use crate::motionseq::MotionSeq;
use crate::vqvae::VqEncoder;
use crate::weights::Weights;

#[test]
fn long_motion_is_encoded_as_in_one_pass() {
    let encoder = VqEncoder::load(&Weights::open(TINY, "tiny").unwrap()).unwrap();
    let noise = |i: usize| ((i * 7919 % 1009) as f32 / 504.0) - 1.0;
    let motion: Vec<_> = (0..1300).map(|t| std::array::from_fn(|c| noise(t * 137 + c))).collect();
    let tail = encoder.encode(&motion[400..900]).unwrap();
    // Away from the cut ends, where the excerpt lacks its neighbours.
    assert_eq!(encoder.encode(&motion).unwrap()[420..880], tail[20..480]);
}

#[test]
fn two_lanes_give_what_two_dances_give() {
    let g = Golden::load();
    for kind in EngineKind::ALL {
        let run = |lanes| hidden(&g.weights, kind, &g.previous, &g.music, lanes);
        let [heard, deaf] = run(2);
        match kind {
            EngineKind::Own => assert_eq!(heard, run(1)[0]),
            EngineKind::Candle => check_same("heard", &heard, &run(1)[0]),
        }
        let (_, expected) = danced_at_once(&g.weights, &g.previous, None, STYLE);
        check_same("deaf", &deaf, expected.hidden());
    }
}

/// Small networks of the shapes that the tiny file does not have.
fn other_shapes() -> Vec<ModelConfig> {
    let tiny = ModelConfig::preset("tiny").unwrap();
    let mut paper_like = tiny.clone();
    paper_like.activation = Activation::Gelu;
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
        let (wide, codes) = (config.codes_a_frame(), config.codes);
        let weights = Weights::random(config);
        let rows: Vec<Vec<usize>> =
            (0..30).map(|t| (0..wide).map(|p| (t * 7919 + p * 31) % codes).collect()).collect();
        let music: Vec<f32> = (0..30 * 39).map(|i| (i as f32 * 0.37).sin()).collect();
        let what = &weights.config().preset;
        let motion = decoded_at_once(&weights, &rows);
        let (seq, mut expected) = danced_at_once(&weights, &rows, Some(&music), STYLE);
        for kind in EngineKind::ALL {
            check_same(what, &decoded(&weights, kind, &rows), &motion);
            let found = &hidden(&weights, kind, &rows, &music, 1)[0];
            check_same(what, found, expected.hidden());
            let found = logits(&weights, kind, &rows[0], &music[..39]);
            for (part, found) in found.iter().enumerate() {
                let all = seq.logits(&mut expected, part, &slices(&rows)).unwrap();
                check_same(what, found, &all[..found.len()]);
            }
        }
    }
}

/// Logits of every part at the first frame.
fn logits(weights: &Weights, kind: EngineKind, codes: &[usize], music: &[f32]) -> Vec<Vec<f32>> {
    let engine = engine(weights, kind);
    let seq = MotionSeq::load(weights, &engine).unwrap();
    let mut state = seq.start(1);
    seq.set_style(&mut state, seq.style(STYLE));
    let team = engine.pool().team();
    seq.step(&team, &mut state, codes, &[Some(music)]).unwrap();
    let mut of_part = |part| -> Vec<f32> {
        let lanes = seq.logits(&team, &mut state, part, &codes[..part]).unwrap();
        lanes.flatten().copied().collect()
    };
    (0..codes.len()).map(&mut of_part).collect()
}

#[test]
fn another_start_forgets_the_past() {
    let g = Golden::load();
    for kind in EngineKind::ALL {
        let engine = engine(&g.weights, kind);
        let seq = MotionSeq::load(&g.weights, &engine).unwrap();
        let mut state = seq.start(1);
        let team = engine.pool().team();
        let mut run = || -> Vec<f32> {
            let frames = g.previous.iter().zip(g.music.chunks(39)).take(5);
            let mut step = |(codes, music): (&Vec<usize>, _)| {
                seq.step(&team, &mut state, codes, &[Some(music)]).unwrap();
                state.hidden(0).to_vec()
            };
            let found = frames.flat_map(&mut step).collect();
            state.restart();
            found
        };
        let first = run();
        assert_eq!(first, run());
    }
}

#[test]
fn both_engines_jump_to_the_same_place() {
    let g = Golden::load();
    let run = |kind| -> Vec<f32> {
        let engine = engine(&g.weights, kind);
        let seq = MotionSeq::load(&g.weights, &engine).unwrap();
        let (mut state, team) = (seq.start(2), engine.pool().team());
        state.jump(1000);
        let heard = [Some(&g.music[..39]), None];
        seq.step(&team, &mut state, &g.codes[0], &heard).unwrap();
        seq.step(&team, &mut state, &g.codes[1], &heard).unwrap();
        [state.hidden(0), state.hidden(1)].concat()
    };
    check_same("hidden", &run(EngineKind::Candle), &run(EngineKind::Own));
}
