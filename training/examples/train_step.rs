//! How long a training step takes, in turns with the PyTorch twin:
//! `cargo run --release -p servodance-training --example train_step -- PYTHON [THREADS] [ROUNDS]`
//!
//! Preset `live`, both stages, the same batch sizes; PYTHON needs torch. One
//! step of ours, one of the twin's in f32, one in bfloat16, and again: whatever
//! else the machine does falls on all of them. Medians and their ratio.

use anyhow::{Context, ensure};
use servodance_runtime::process::console;
use servodance_training::dataset::Split;
use servodance_training::dataset::training_file::{self, TrainingClip};
use servodance_training::train::{
    SettingsFile, TrainedNetwork, Trainer, TrainingData, VqVaeWeights, with_threads,
};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let python = args.first().context("usage: train_step PYTHON [THREADS] [ROUNDS]")?;
    let number = |at: usize, default: usize| args.get(at).map_or(Ok(default), |text| text.parse());
    let (threads, rounds) = (number(1, 2)?, number(2, 7)?);
    for stage in [TrainedNetwork::VqVae, TrainedNetwork::MotionSeq] {
        with_threads(threads, || compare(stage, python, threads, rounds))?;
    }
    Ok(())
}

fn compare(
    stage: TrainedNetwork,
    python: &str,
    threads: usize,
    rounds: usize,
) -> anyhow::Result<()> {
    let mut ours = trainer(stage)?;
    let run = ours.settings().run.clone();
    let mut twins = ["f32", "bf16"].map(|precision| {
        let sizes = [run.batch, run.length, threads].map(|n| n.to_string());
        Twin::start(python, stage, &sizes, precision)
    });
    let mut times = [const { Vec::new() }; 3];
    // The first round brings memory and threads up and does not count.
    for round in 0..=rounds {
        let start = Instant::now();
        ours.step()?;
        let mut row = vec![1e3 * start.elapsed().as_secs_f64()];
        for twin in &mut twins {
            row.push(twin.as_mut().map_err(|e| anyhow::anyhow!("{e}"))?.step()?);
        }
        if round > 0 {
            times.iter_mut().zip(row).for_each(|(all, time)| all.push(time));
        }
    }
    let [ours, f32, bf16] = times.map(|mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    });
    console::stdout(format_args!(
        "{} {} x {}, {threads} threads, median of {rounds}: ours {ours:.0} ms; \
         twin f32 {f32:.0} ms (ratio {:.2}), bf16 {bf16:.0} ms (ratio {:.2})\n",
        stage.name(),
        run.batch,
        run.length,
        ours / f32,
        ours / bf16
    ));
    Ok(())
}

/// A trainer on motion and music of random numbers.
fn trainer(stage: TrainedNetwork) -> anyhow::Result<Trainer> {
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    let clip = TrainingClip {
        name: "noise".into(),
        motion: (0..2000).map(|_| std::array::from_fn(|_| noise())).collect(),
        music: Some((0..2000).map(|_| std::array::from_fn(|_| noise())).collect()),
        latents: None,
        style: 0,
        split: Split::Train,
        dance: true,
        synthetic: false,
        variant: 0,
    };
    let file = tempfile::NamedTempFile::new()?;
    training_file::write(file.path(), &[clip], &serde_json::json!({}))?;
    let mut settings = SettingsFile::default();
    settings.quantise.free_steps = 0;
    let shipped = include_bytes!("../../model/weights/live.safetensors");
    let stage_one = match stage {
        TrainedNetwork::VqVae => None,
        TrainedNetwork::MotionSeq => Some(VqVaeWeights::open(shipped, "built-in weights")?),
    };
    Ok(Trainer::new(settings.resolve(stage)?, TrainingData::read(file.path())?, stage_one)?)
}

/// The twin in a process of its own.
struct Twin {
    child: Child,
    lines: BufReader<std::process::ChildStdout>,
}

impl Twin {
    fn start(
        python: &str,
        stage: TrainedNetwork,
        sizes: &[String; 3],
        precision: &str,
    ) -> anyhow::Result<Self> {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../model/reference/step_time.py");
        let mut child = Command::new(python)
            .args([script, stage.name()])
            .args(sizes)
            .arg(precision)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {python}"))?;
        let out = child.stdout.take().context("no output")?;
        Ok(Self { child, lines: BufReader::new(out) })
    }

    /// Milliseconds of one step.
    fn step(&mut self) -> anyhow::Result<f64> {
        let input = self.child.stdin.as_mut().context("no input")?;
        input.write_all(b"\n")?;
        input.flush()?;
        let mut line = String::new();
        self.lines.read_line(&mut line)?;
        ensure!(!line.is_empty(), "the twin ended");
        Ok(line.trim().parse()?)
    }
}

impl Drop for Twin {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}
