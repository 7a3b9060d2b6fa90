//! What a frame of the model takes, both networks together, and what memory
//! allows on this machine at the same time.
//!
//! Random weights unless a file is given: time does not depend on the numbers.
//! The bandwidth is that of threads that do nothing but read a piece of memory
//! as large as the weights, so that a small model is held against the cache
//! that it fits into. One token is one frame.

use std::path::{Path, PathBuf};
use std::sync::Barrier;
use std::time::{Duration, Instant};

use anyhow::Context;
use serde::Serialize;
use servodance_model::ModelError;
use servodance_model::config::{ModelConfig, PRESETS};
use servodance_model::engine::Engine;
use servodance_model::motionseq::MotionSeq;
use servodance_model::vqvae::VqDecoder;
use servodance_model::weights::Weights;
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::process::number_range::within;

const WARM_UP: usize = 10;
/// How long bandwidth is measured, before and after.
const READING: Duration = Duration::from_millis(400);
/// Most frames of context; beyond, a cache would fill the memory.
const CONTEXT_MAX: usize = 4096;

/// Which networks are timed, how they are computed, for how long.
#[derive(Clone, Debug, clap::Args)]
pub struct ModelBench {
    /// Sizes of the networks: live, paper or tiny.
    #[arg(long, default_value = "live", value_name = "NAME")]
    pub preset: String,
    /// Weights of that preset; random ones if left out (they take as long).
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
    /// How the steps are computed.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Frames of past that every layer sees; the preset's own if left out.
    #[arg(long, value_name = "FRAMES", value_parser = within(1..=CONTEXT_MAX))]
    pub context: Option<usize>,
    /// The frame from which on time is taken; 36000 is minute 30. With a full
    /// context if left out.
    #[arg(long, value_name = "FRAME")]
    pub position: Option<u64>,
    /// How many frames are timed.
    #[arg(long, default_value_t = 300, value_name = "N", value_parser = within(1..=100_000_usize))]
    pub frames: usize,
    /// Also compute the dance without music, as guidance does.
    #[arg(long)]
    pub guidance: bool,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// What `bench model` prints.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct ModelBenchReport {
    pub preset: String,
    pub dtype: &'static str,
    pub context: usize,
    pub position: u64,
    pub threads: usize,
    /// Passes a frame: 1, or 2 with guidance.
    pub lanes: usize,
    pub frames: usize,
    /// Milliseconds a frame: half of them take less.
    pub ms_p50: f64,
    /// 99 of 100 take less.
    pub ms_p99: f64,
    pub weight_bytes: usize,
    /// Bytes of keys and values that a frame reads.
    pub cache_bytes: usize,
    /// Gigabytes a second that as many threads read from so much memory.
    pub read_gbps: f64,
    /// What reading the weights takes at that rate, milliseconds.
    pub limit_ms: f64,
    pub allocations: u64,
}

/// Times the model frame by frame.
/// Fails for: options out of range, or a weights file of another preset.
pub fn run(request: &ModelBench) -> anyhow::Result<ModelBenchReport> {
    let config = ModelConfig::preset(&request.preset).with_context(|| {
        let known = PRESETS.join(", ");
        format!("unknown preset `{}`; choose one of: {known}", request.preset)
    })?;
    match &request.model {
        None => measure(request, Weights::random(sized(config, request.context)?)),
        Some(path) => {
            anyhow::ensure!(request.context.is_none(), "--context: a weights file has its own");
            let bytes = Weights::read(path)?;
            let weights = Weights::open(&bytes, &name(path))?;
            weights.expect_preset(&request.preset)?;
            measure(request, weights)
        }
    }
}

fn name(path: &Path) -> String {
    path.display().to_string()
}

fn sized(mut config: ModelConfig, context: Option<usize>) -> anyhow::Result<ModelConfig> {
    if let Some(context) = context {
        anyhow::ensure!(
            (1..=CONTEXT_MAX).contains(&context),
            "--context {context} is outside 1..{CONTEXT_MAX}"
        );
        config.vq.decoder_window = context;
        config.seq.window = context;
    }
    Ok(config)
}

fn measure(request: &ModelBench, weights: Weights) -> anyhow::Result<ModelBenchReport> {
    let engine = Engine::new(&weights, request.engine.options())?;
    let seq = MotionSeq::load(&weights, &engine)?;
    let decoder = VqDecoder::load(&weights, &engine)?;
    let config = weights.config().clone();
    drop(weights);
    let threads = engine.pool().threads();
    let weight_bytes = seq.bytes() + decoder.bytes();
    let before_gbps = read_gbps(weight_bytes, threads);
    let position = request.position.unwrap_or(config.seq.window as u64);
    let lanes = if request.guidance { 2 } else { 1 };
    let (mut times_ms, allocations) =
        frame_times_ms((&engine, &seq, &decoder), &config, (lanes, position), request.frames)?;
    times_ms.sort_by(f64::total_cmp);
    let rank = |share: f64| {
        let rank = (times_ms.len() as f64 * share).ceil() as usize;
        times_ms[rank.clamp(1, times_ms.len()) - 1]
    };
    let read_gbps = before_gbps.max(read_gbps(weight_bytes, threads));
    Ok(ModelBenchReport {
        preset: config.preset.clone(),
        dtype: engine.dtype().name(),
        context: config.seq.window,
        position,
        threads,
        lanes,
        frames: request.frames,
        ms_p50: rank(0.5),
        ms_p99: rank(0.99),
        weight_bytes,
        cache_bytes: seq.cache_bytes(lanes) + decoder.cache_bytes(),
        read_gbps,
        limit_ms: weight_bytes as f64 / read_gbps / 1e6,
        allocations,
    })
}

/// Times of frames from a position on, every part's likeliest code chosen, and
/// how often they allocated.
fn frame_times_ms(
    (engine, seq, decoder): (&Engine, &MotionSeq, &VqDecoder),
    config: &ModelConfig,
    (lanes, position): (usize, u64),
    frames: usize,
) -> Result<(Vec<f64>, u64), ModelError> {
    let (mut dance, mut motion) = (seq.start(lanes), decoder.start());
    dance.jump(position.saturating_sub(WARM_UP as u64));
    motion.jump(position.saturating_sub(WARM_UP as u64));
    let mut codes = vec![0; config.codes_a_frame()];
    let music: Vec<f32> = (0..config.music_dim).map(|i| (i as f32).sin()).collect();
    let heard = [Some(&music[..]), None];
    let mut frame = || -> Result<f64, ModelError> {
        let start = Instant::now();
        let team = engine.pool().team();
        seq.step(&team, &mut dance, &codes, &heard[..lanes])?;
        for part in 0..codes.len() {
            let mut logits = seq.logits(&team, &mut dance, part, &codes[..part])?;
            codes[part] = likeliest(&logits.next().unwrap_or_default()[..config.codes]);
        }
        decoder.step(&team, &mut motion, &codes)?;
        drop(team);
        Ok(start.elapsed().as_secs_f64() * 1e3)
    };
    for _ in 0..WARM_UP {
        frame()?;
    }
    let (mut times_ms, mut outcome) = (vec![0.0; frames], Ok(()));
    let mut all = || times_ms.iter_mut().try_for_each(|ms| frame().map(|took| *ms = took));
    let allocated = allocation_counter::measure(|| outcome = all());
    outcome?;
    Ok((times_ms, allocated.count_total))
}

fn likeliest(logits: &[f32]) -> usize {
    let best = logits.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
    best.map_or(0, |(code, _)| code)
}

/// Gigabytes a second that `threads` threads read from `bytes` of memory.
fn read_gbps(bytes: usize, threads: usize) -> f64 {
    let share = (bytes / threads / 8).max(1024);
    let start = Barrier::new(threads);
    let rate = || {
        let memory: Vec<u64> = (0..share as u64).collect();
        start.wait();
        let begun = Instant::now();
        let (mut passes, mut seen) = (0, 0u64);
        while begun.elapsed() < READING {
            seen = seen.wrapping_add(std::hint::black_box(&memory).iter().fold(0, |a, b| a ^ b));
            passes += 1;
        }
        std::hint::black_box(seen);
        (passes * share * 8) as f64 / begun.elapsed().as_secs_f64() / 1e9
    };
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(rate)).collect();
        let own = rate();
        own + others.into_iter().filter_map(|t| t.join().ok()).sum::<f64>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_model::engine::EngineOptions;
    use servodance_model::weights::Dtype;

    fn request(preset: &str) -> ModelBench {
        ModelBench {
            preset: preset.into(),
            model: None,
            engine: EngineArgs {
                dtype: Some(Dtype::Q8_0),
                threads: Some(2),
                ..EngineArgs::default()
            },
            context: Some(12),
            position: None,
            frames: 5,
            guidance: false,
            json: false,
        }
    }

    #[test]
    fn a_small_model_is_measured() {
        let found = run(&request("tiny")).unwrap();
        assert_eq!((found.dtype, found.context, found.threads), ("q8_0", 12, 2));
        assert!(found.ms_p50 > 0.0 && found.ms_p50 <= found.ms_p99);
        assert!(found.read_gbps > 0.0 && found.limit_ms > 0.0);
        assert_eq!(found.allocations, 0);
        let wide = ModelBench {
            engine: EngineArgs { dtype: Some(Dtype::F32), ..request("tiny").engine },
            guidance: true,
            ..request("tiny")
        };
        let wide = run(&wide).unwrap();
        assert!(wide.weight_bytes > 2 * found.weight_bytes, "{wide:?}");
        assert!(wide.cache_bytes > 2 * found.cache_bytes, "{wide:?}");
    }

    #[test]
    fn a_step_of_a_dance_allocates_nothing() {
        use servodance_model::{Generator, GeneratorOptions};
        let options = EngineOptions { threads: Some(2), ..EngineOptions::default() };
        let generator = Generator::built_in_with(options).unwrap();
        let mut dance = generator.start(GeneratorOptions::default()).unwrap();
        let music = |k| servodance_types::MusicFrame {
            time_s: f64::from(k) / 20.0,
            spectral: [0.3; servodance_types::SPECTRAL_DIM],
            beat: Default::default(),
            presence: 1.0,
        };
        // The sampler's room grows to its size with the first draw.
        dance.step(&music(0)).unwrap();
        let allocated = allocation_counter::measure(|| {
            for k in 1..200 {
                dance.step(&music(k)).unwrap();
            }
        });
        assert_eq!(allocated.count_total, 0);
    }

    #[test]
    fn what_cannot_be_measured_is_said() {
        let text = |request: &ModelBench| format!("{:#}", run(request).unwrap_err());
        assert!(text(&request("huge")).contains("live, paper, tiny"));
        let none = ModelBench { context: Some(0), ..request("tiny") };
        assert!(text(&none).contains("--context 0"));
        let other = ModelBench {
            model: Some(
                concat!(env!("CARGO_MANIFEST_DIR"), "/../model/weights/live.safetensors").into(),
            ),
            context: None,
            ..request("paper")
        };
        let said = text(&other);
        assert!(said.contains("preset is `live`, expected `paper`"), "{said}");
    }
}
