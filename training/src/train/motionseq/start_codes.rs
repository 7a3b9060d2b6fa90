//! Where a dance begins: codes of calm moments of every style.

use super::tokens::ClipCodes;
use crate::dataset::clip_entry::Split;
use crate::dataset::styles::STYLES;
use crate::train::data::TrainingData;
use servodance_model::motion::representation::{CONTACTS_AT, POSE_DIM, STEPS_AT};

/// Beginnings kept for each style, and how far from a clip's ends they are.
const STARTS: usize = 24;
const AROUND_FRAMES: usize = 60;

/// Codes to begin a dance from, and their styles: moments in the middle of the
/// dance (with music where there is some), not faster than half of it.
pub(super) fn starts(data: &TrainingData, codes: &ClipCodes) -> (Vec<i32>, Vec<i32>) {
    let (mut rows, mut styles) = (Vec::new(), Vec::new());
    for style in 0..STYLES.len() {
        let of_style: Vec<usize> =
            data.of_split(Split::Train).filter(|c| data.clips[*c].style == style).collect();
        let heard = |c: &&usize| data.clips[**c].music.is_some();
        let with_music: Vec<usize> = of_style.iter().filter(heard).copied().collect();
        let clips = if with_music.is_empty() { of_style } else { with_music };
        let mut moments: Vec<(f32, usize, usize)> = Vec::new();
        for c in clips {
            let motion = &data.clips[c].motion;
            // Short clips are taken whole.
            let around = if motion.len() > 2 * AROUND_FRAMES { AROUND_FRAMES } else { 0 };
            let frames = around..motion.len() - around;
            moments.extend(frames.map(|f| (mean_speed(&motion[f]), c, f)));
        }
        moments.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (low, high) = (3 * moments.len() / 10, (moments.len() / 2).max(1));
        let Some(middle) = moments.get(low..high).filter(|middle| !middle.is_empty()) else {
            continue;
        };
        for i in 0..STARTS {
            let (_, clip, frame) = middle[i * (middle.len() - 1) / (STARTS - 1)];
            rows.extend(codes[clip].iter().map(|part| part[frame] as i32));
            styles.push(style as i32);
        }
    }
    (rows, styles)
}

fn mean_speed(row: &[f32; POSE_DIM]) -> f32 {
    let steps = row[STEPS_AT..CONTACTS_AT].chunks(3);
    steps.map(|s| s.iter().map(|v| v * v).sum::<f32>().sqrt()).sum()
}
