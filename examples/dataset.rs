//! The training file from captured motion and choreography:
//! `cargo run --release --example dataset -- MOTION_DIR|- OUT.safetensors [SONGS] [CHOREOGRAPHY_MINUTES] [SEED]`

use std::process::ExitCode;

use servodance::dataset::{Options, build};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, out, rest @ ..] = &args[..] else {
        eprintln!(
            "usage: dataset MOTION_DIR|- OUT.safetensors [SONGS] [CHOREOGRAPHY_MINUTES] [SEED]"
        );
        return ExitCode::from(2);
    };
    let number = |i: usize, usual: f64| -> f64 {
        rest.get(i)
            .and_then(|text| text.parse().ok())
            .unwrap_or(usual)
    };
    let options = Options {
        motion: (folder != "-").then(|| folder.into()),
        out: out.into(),
        songs_per_clip: number(0, 3.0) as usize,
        choreography_minutes: number(1, 75.0),
        seed: number(2, 1.0) as u64,
    };
    match build(&options) {
        Ok(summary) => {
            for (kind, minutes) in &summary.minutes {
                println!("{minutes:7.2} min  {kind}");
            }
            println!(
                "{} clips; captured dance {:.1} min, {:.1} of them with a beat; left out: {:?}",
                summary.clips,
                summary.captured_dance_minutes,
                summary.captured_dance_with_beat_minutes,
                summary.left_out
            );
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
