//! Motion files of other programs, by their ending.

use std::path::Path;

use super::aist::read_aist;
use super::bvh::read_bvh;
use super::{Clip, MotionError};

/// Reads `.npz` (22 joints), `.bvh` or `.pkl` (AIST++) on the common skeleton:
/// 20 FPS, floor at 0, above the origin, facing +z. With it comes what was
/// guessed, a line each.
pub fn read_motion(path: &Path) -> Result<(Clip, Vec<String>), MotionError> {
    let ending = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    let (clip, lines) = match ending.to_ascii_lowercase().as_str() {
        "npz" => (Clip::read_npz(path)?, Vec::new()),
        "bvh" => {
            let named = read_bvh(path)?;
            (named.clip, named.mapping.lines())
        }
        "pkl" | "pickle" => (read_aist(path)?, Vec::new()),
        _ => {
            return Err(MotionError::Content {
                path: path.to_owned(),
                reason: "a motion file ends in .npz (22 joints), .bvh or .pkl (AIST++)".into(),
            });
        }
    };
    Ok((clip.normalised(), lines))
}
