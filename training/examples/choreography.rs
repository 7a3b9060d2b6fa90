//! A dance by the choreographer as npz, for a look at it:
//! `cargo run --release -p servodance-training --example choreography -- STYLE BPM SECONDS SEED OUT.npz`
//!
//! Prints how well the dance meets its beats.

use std::process::ExitCode;

use servodance_model::motion::{alignment, mean_joint_speed};
use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [style, bpm, seconds, seed, out] = &args[..] else {
        return Err("usage: choreography STYLE BPM SECONDS SEED OUT.npz".into());
    };
    let number = |text: &str| text.parse::<f64>().map_err(|_| format!("`{text}` is not a number"));
    let style = DanceStyle::ALL.into_iter().find(|known| known.name() == style).ok_or(format!(
        "no style `{style}`; choose of {:?}",
        DanceStyle::ALL.map(DanceStyle::name)
    ))?;
    let (interval_s, seconds) = (60.0 / number(bpm)?, number(seconds)?);
    let beats: Vec<DanceBeat> = (0..)
        .map(|i| DanceBeat { time_s: 2.0 + f64::from(i) * interval_s, downbeat: i % 4 == 0 })
        .take_while(|beat| beat.time_s < seconds)
        .collect();
    let clip = choreograph(&beats, seconds, style, number(seed)? as u64);
    let times: Vec<f64> = beats.iter().map(|beat| beat.time_s).collect();
    let speed = mean_joint_speed(&clip.poses, clip.fps);
    let score = alignment(&speed, clip.fps, &times);
    println!("{} at {bpm} BPM: {score:.3?}", style.name());
    clip.write_npz(out).map_err(|error| error.to_string())
}
