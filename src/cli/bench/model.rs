//! `servodance bench model`.

use crate::cli::prelude::*;
use servodance_lab::bench::model::{ModelBench, ModelBenchReport, run as measure};
use servodance_model::EngineKind;

const EXAMPLES: &str = include_str!("../examples/bench-model.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    bench: ModelBench,
}

pub fn run(Args { mut bench }: Args) -> anyhow::Result<ExitCode> {
    let asked = bench.engine.engine;
    let figures = measure(&bench)?;
    let Some(asked) = asked else {
        if bench.json {
            stdout_line!("{}", serde_json::to_string(&figures)?);
        } else {
            print(&figures);
        }
        return Ok(ExitCode::SUCCESS);
    };
    // An engine that was asked for is held against the other one.
    let other = match asked {
        EngineKind::Own => EngineKind::Candle,
        EngineKind::Candle => EngineKind::Own,
    };
    bench.engine.engine = Some(other);
    let others = measure(&bench)?;
    if bench.json {
        let both = serde_json::json!({
            asked.name(): figures,
            other.name(): others,
        });
        stdout_line!("{both}");
        return Ok(ExitCode::SUCCESS);
    }
    for (kind, figures) in [(asked, &figures), (other, &others)] {
        stdout_line!("engine {kind}");
        print(figures);
    }
    let ratio = figures.ms_p50 / others.ms_p50;
    stdout_line!("{asked} takes {ratio:.2} times as long as {other}");
    Ok(ExitCode::SUCCESS)
}

fn print(figures: &ModelBenchReport) {
    let ModelBenchReport { preset, dtype, context, threads, ms_p50, ms_p99, .. } = figures;
    let ModelBenchReport { frames, position, limit_ms, read_gbps, .. } = figures;
    let guidance = if figures.lanes > 1 { ", with guidance" } else { "" };
    let [weights_mb, cache_mb] =
        [figures.weight_bytes, figures.cache_bytes].map(|bytes| bytes as f64 / 1e6);
    stdout_line!(
        "{preset} {dtype}, context {context}, {threads} threads: {ms_p50:.2} ms a frame p50, \
         {ms_p99:.2} p99 ({frames} frames from {position}{guidance})"
    );
    stdout_line!(
        "limit {limit_ms:.2} ms: {weights_mb:.1} MB of weights at {read_gbps:.1} GB/s read here; \
         keys and values {cache_mb:.1} MB more"
    );
}
