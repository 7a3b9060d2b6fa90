//! Generated motion against real motion, both as folders of npz clips:
//! `cargo run --release -p servodance-model --example score -- REAL_DIR GENERATED_DIR`
//!
//! Clips are brought to the common skeleton and cut into windows of ten
//! seconds. Prints one JSON line; the floors compare one half of the real
//! windows with the other.

use std::path::Path;
use std::process::ExitCode;

use servodance_model::motion::Clip;
use servodance_training::metrics::distribution::{Features, compare};
use servodance_training::metrics::features::{Acceleration, geometric, kinetic};
use servodance_training::metrics::quality::{foot_skate_ratio, freezing, jerk, pfc};

const WINDOW_FRAMES: usize = 200;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [real, generated] = &args[..] else {
        eprintln!("usage: score REAL_DIR GENERATED_DIR");
        return ExitCode::from(2);
    };
    match score(Path::new(real), Path::new(generated)) {
        Ok(line) => {
            println!("{line}");
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn score(real: &Path, generated: &Path) -> Result<serde_json::Value, String> {
    let (real, generated) = (windows(real)?, windows(generated)?);
    let mut out = serde_json::json!({
        "real": single(&real),
        "generated": single(&generated),
    });
    let published = |clip: &Clip| kinetic(clip, Acceleration::Published).map(|f| f.to_vec());
    let corrected = |clip: &Clip| kinetic(clip, Acceleration::Correct).map(|f| f.to_vec());
    let relations = |clip: &Clip| geometric(clip).map(|f| f.to_vec());
    type Extract<'a> = &'a dyn Fn(&Clip) -> Option<Vec<f64>>;
    let kinds: [(&str, Extract); 3] = [
        ("kinetic", &corrected),
        ("kinetic_published", &published),
        ("geometric", &relations),
    ];
    for (name, extract) in kinds {
        let features = |clips: &[Clip]| -> Features { clips.iter().filter_map(extract).collect() };
        let (real, generated) = (features(&real), features(&generated));
        let result = compare(&real, &generated).map_err(|error| error.to_string())?;
        let half = |odd: usize| real.iter().skip(odd).step_by(2).cloned().collect();
        let floor = compare(&half(0), &half(1)).map_err(|error| error.to_string())?;
        out[name] = serde_json::json!({
            "fid": result.fid,
            "fid_floor": floor.fid,
            "dist": result.dist,
            "dist_real": result.dist_real,
        });
    }
    Ok(out)
}

/// All clips of a folder and its folders, normalised, in windows.
fn windows(folder: &Path) -> Result<Vec<Clip>, String> {
    let mut paths = Vec::new();
    collect(folder, &mut paths)?;
    paths.sort();
    let mut out = Vec::new();
    for path in paths {
        let clip = Clip::read_npz(&path).map_err(|error| error.to_string())?;
        let clip = clip.normalised();
        for poses in clip.poses.chunks_exact(WINDOW_FRAMES) {
            out.push(Clip {
                poses: poses.to_vec(),
                name: clip.name.clone(),
                fps: clip.fps,
            });
        }
    }
    Ok(out)
}

fn collect(folder: &Path, paths: &mut Vec<std::path::PathBuf>) -> Result<(), String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for entry in entries {
        let path = entry
            .map_err(|e| format!("{}: {e}", folder.display()))?
            .path();
        if path.is_dir() {
            collect(&path, paths)?;
        } else if path.extension().is_some_and(|ending| ending == "npz") {
            paths.push(path);
        }
    }
    Ok(())
}

/// Means over windows of what one motion alone shows.
fn single(clips: &[Clip]) -> serde_json::Value {
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let course = |clip: &Clip| freezing(&clip.poses, clip.fps);
    serde_json::json!({
        "windows": clips.len(),
        "pfc": mean(clips.iter().filter_map(pfc).collect()),
        "foot_skate": mean(clips.iter().filter_map(foot_skate_ratio).collect()),
        "jerk_mean_m_s3": mean(clips.iter().map(|clip| jerk(clip).mean_m_s3).collect()),
        "speed_m_s": mean(clips.iter().flat_map(|clip| course(clip).per_second_m_s).collect()),
        "frozen_ratio": mean(clips.iter().map(|clip| course(clip).frozen_ratio).collect()),
    })
}
