//! `servodance latency`.

use crate::cli::prelude::*;
use serde_json::{Value, json};
use servodance_lab::bench::click_test::{ClickTestReport, measure as click_test};
use servodance_runtime::control::bus_choice::BusChoice;
use servodance_runtime::control::bus_choice::choose as choose_buses;
use std::fmt::Write;

const EXAMPLES: &str = include_str!("examples/latency.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    pub robot: RobotFileArgs,
    /// Where commands go, as for `dance`.
    #[arg(long, default_value = "sim", value_name = "BUS")]
    pub bus: Vec<String>,
    #[arg(help = "Clicks to send", long, default_value_t = 8, value_name = "N")]
    #[arg(value_parser = within(1..=1000_u32))]
    pub clicks: u32,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = args.robot.load()?;
    let buses: Vec<BusChoice> = choose_buses(&robot, &args.bus)?;
    let stop = motor_stop_signal()?;
    let measured = click_test(&robot, &buses, args.clicks, &stop)?;
    match args.json {
        true => stdout_line!("{:#}", json_of(&robot, &measured)),
        false => stdout(format_args!("{}", table(&robot, &measured))),
    }
    Ok(ExitCode::SUCCESS)
}

/// A stage that was measured: what it holds, by the model and by the clicks.
struct Row {
    name: &'static str,
    parts: &'static [usize],
    measured_ms: f64,
}

/// What was measured between two moments, and the modelled delays in between.
fn rows(measured: &ClickTestReport) -> [Row; 3] {
    let median_ms = |part: fn(&servodance_lab::bench::click_test::ClickDelay) -> f64| {
        let mut all: Vec<f64> = measured.passages.iter().map(part).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2] * 1e3
    };
    [
        Row {
            name: "hear: air to music frame",
            parts: &[0, 1],
            measured_ms: median_ms(|p| p.heard_s),
        },
        Row {
            name: "decide: music frame to target",
            parts: &[2, 3, 4, 5],
            measured_ms: median_ms(|p| p.made_s + p.planned_s),
        },
        Row {
            name: "move: target to position",
            parts: &[6],
            measured_ms: median_ms(|p| p.moved_s),
        },
    ]
}

fn table(robot: &Robot, measured: &ClickTestReport) -> String {
    let named = measured.delays.named();
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "{:<32}{:>12}{:>14}", "stage", "expected ms", "measured ms");
    for row in rows(measured) {
        let expected: f64 = row.parts.iter().map(|part| named[*part].1).sum();
        let _ = writeln!(text, "{:<32}{:>12.0}{:>14.0}", row.name, expected * 1e3, row.measured_ms);
        for part in row.parts {
            let (name, seconds) = named[*part];
            let _ = writeln!(text, "  {name:<30}{:>12.0}", seconds * 1e3);
        }
    }
    let _ = writeln!(
        text,
        "{:<32}{:>12.0}{:>14.0}",
        "air to servo",
        measured.delays.total_s() * 1e3,
        total_ms(measured)
    );
    let _ = writeln!(
        text,
        "servo_lag_s = {:.3}   # {} has {:.3}; positions follow commands best at this lag",
        measured.servo_lag_s, robot.name, robot.servo_lag_s
    );
    text
}

fn total_ms(measured: &ClickTestReport) -> f64 {
    let mut all: Vec<f64> = measured.passages.iter().map(|p| p.total_s()).collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2] * 1e3
}

fn json_of(robot: &Robot, measured: &ClickTestReport) -> Value {
    let expected: serde_json::Map<String, Value> = measured
        .delays
        .named()
        .iter()
        .map(|(name, seconds)| ((*name).to_owned(), json!(seconds * 1e3)))
        .collect();
    let clicks: Vec<Value> = measured
        .passages
        .iter()
        .map(|p| {
            json!({
                "heard_ms": p.heard_s * 1e3,
                "made_ms": p.made_s * 1e3,
                "planned_ms": p.planned_s * 1e3,
                "moved_ms": p.moved_s * 1e3,
            })
        })
        .collect();
    json!({
        "robot": robot.name,
        "expected_ms": expected,
        "expected_total_ms": measured.delays.total_s() * 1e3,
        "measured_total_ms": total_ms(measured),
        "clicks": clicks,
        "servo_lag_s": measured.servo_lag_s,
        "servo_lag_s_of_file": robot.servo_lag_s,
    })
}
