//! `servodance bench model`.

use crate::cli::options::engine::EngineArgs;
use servodance_lab::bench::model::{ModelBench, ModelBenchReport, run as measure};
use servodance_model::EngineKind;
use servodance_runtime::process::console::stdout_line;
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance bench model
      what ships, as it ships
  servodance bench model --preset paper --dtype q8_0 --context 300 --threads 2
      the sizes of the paper, random weights of 8 bits
  servodance bench model --preset paper --dtype q8_0 --context 800 --position 36000 --json
      the same at minute 30, as one JSON object
  servodance bench model --engine candle
      both engines in one run, candle first";

/// What `bench model` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
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
    #[arg(long, value_name = "FRAMES")]
    pub context: Option<usize>,
    /// The frame from which on time is taken; 36000 is minute 30. With a full
    /// context if left out.
    #[arg(long, value_name = "FRAME")]
    pub position: Option<u64>,
    /// How many frames are timed.
    #[arg(long, default_value_t = 300, value_name = "N")]
    pub frames: usize,
    /// Also compute the dance without music, as guidance does.
    #[arg(long)]
    pub guidance: bool,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let asked = args.engine.engine;
    let mut bench = ModelBench {
        preset: args.preset,
        file: args.model,
        engine: args.engine.options(),
        context: args.context,
        position: args.position,
        frames: args.frames,
        guidance: args.guidance,
    };
    let figures = measure(&bench)?;
    let Some(asked) = asked else {
        if args.json {
            stdout_line!("{}", serde_json::to_string(&figures)?);
        } else {
            print(&figures);
        }
        return Ok(ExitCode::SUCCESS);
    };
    // An engine that was asked for is held against the other one.
    bench.engine.kind = match asked {
        EngineKind::Own => EngineKind::Candle,
        EngineKind::Candle => EngineKind::Own,
    };
    let others = measure(&bench)?;
    if args.json {
        let both = serde_json::json!({
            asked.name(): figures,
            bench.engine.kind.name(): others,
        });
        stdout_line!("{both}");
        return Ok(ExitCode::SUCCESS);
    }
    for (kind, figures) in [(asked, &figures), (bench.engine.kind, &others)] {
        stdout_line!("engine {kind}");
        print(figures);
    }
    stdout_line!(
        "{asked} takes {:.2} times as long as {}",
        figures.ms_p50 / others.ms_p50,
        bench.engine.kind
    );
    Ok(ExitCode::SUCCESS)
}

fn print(figures: &ModelBenchReport) {
    stdout_line!(
        "{} {}, context {}, {} threads: {:.2} ms a frame p50, {:.2} p99 ({} frames from {}{})",
        figures.preset,
        figures.dtype,
        figures.context,
        figures.threads,
        figures.ms_p50,
        figures.ms_p99,
        figures.frames,
        figures.position,
        if figures.lanes > 1 { ", with guidance" } else { "" }
    );
    stdout_line!(
        "limit {:.2} ms: {:.1} MB of weights at {:.1} GB/s read here; keys and values {:.1} MB more",
        figures.limit_ms,
        figures.weight_bytes as f64 / 1e6,
        figures.read_gbps,
        figures.cache_bytes as f64 / 1e6
    );
}
