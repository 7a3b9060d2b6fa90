//! The training file: many clips of motion and music in one safetensors file.
//!
//! | tensor | shape | what |
//! |---|---|---|
//! | `motion` | `[N, 137]` f32 | pose vectors, not normalised |
//! | `music` | [N, 39] f32 | music vectors; zeros where there is none |
//! | `clip_start`, `clip_length` | `[C]` i64 | the frames of each clip |
//! | `style`, `split`, `dance`, `has_music`, `synthetic`, `variant` | `[C]` i64 | see [`CorpusClip`] |
//!
//! Metadata: `clips` and `styles` (JSON lists of names) and `recipe` (JSON).

use std::collections::HashMap;
use std::path::Path;

use safetensors::tensor::{Dtype, TensorView};
use servodance_types::MUSIC_DIM;

use super::MotionError;
use super::index::{STYLES, Split};
use super::representation::{POSE_DIM, PoseVector};

/// One clip of the training file.
#[derive(Clone, Debug)]
pub struct CorpusClip {
    /// Its name; copies of one clip differ in what follows `#`.
    pub name: String,
    /// Motion, one vector a frame.
    pub motion: Vec<PoseVector>,
    /// Music, one vector a frame, as many as `motion`; `None`: no music known.
    pub music: Option<Vec<[f32; MUSIC_DIM]>>,
    /// An index into [`STYLES`].
    pub style: usize,
    /// What the clip is for.
    pub split: Split,
    /// Whether it is dance.
    pub dance: bool,
    /// Whether the motion was made by the choreographer.
    pub synthetic: bool,
    /// 0: original motion; 1: an augmented copy (mirrored, warped).
    pub variant: usize,
}

/// Writes the training file. Clips without motion are refused, as is music of
/// another length than its motion.
pub fn write(
    path: &Path,
    clips: &[CorpusClip],
    recipe: &serde_json::Value,
) -> Result<(), MotionError> {
    let content = |reason: String| MotionError::Content {
        path: path.to_owned(),
        reason,
    };
    let frames: usize = clips.iter().map(|clip| clip.motion.len()).sum();
    let mut motion = Vec::with_capacity(frames * POSE_DIM * 4);
    let mut music = Vec::with_capacity(frames * MUSIC_DIM * 4);
    let mut starts = Vec::new();
    let mut start = 0;
    for clip in clips {
        let frames = clip.motion.len();
        if frames == 0 {
            return Err(content(format!("clip {} has no frames", clip.name)));
        }
        push_f32(&mut motion, clip.motion.as_flattened());
        match &clip.music {
            Some(vectors) if vectors.len() == frames => {
                push_f32(&mut music, vectors.as_flattened());
            }
            Some(vectors) => {
                return Err(content(format!(
                    "clip {} has {frames} frames of motion, but {} of music",
                    clip.name,
                    vectors.len()
                )));
            }
            None => music.resize(music.len() + frames * MUSIC_DIM * 4, 0),
        }
        starts.push(start as i64);
        start += frames;
    }
    let column = |value: &dyn Fn(&CorpusClip) -> i64| -> Vec<u8> {
        clips
            .iter()
            .flat_map(|clip| value(clip).to_le_bytes())
            .collect()
    };
    let columns = [
        (
            "clip_start",
            starts.iter().flat_map(|s| s.to_le_bytes()).collect(),
        ),
        ("clip_length", column(&|clip| clip.motion.len() as i64)),
        ("style", column(&|clip| clip.style as i64)),
        ("split", column(&|clip| clip.split as i64)),
        ("dance", column(&|clip| clip.dance.into())),
        ("has_music", column(&|clip| clip.music.is_some().into())),
        ("synthetic", column(&|clip| clip.synthetic.into())),
        ("variant", column(&|clip| clip.variant as i64)),
    ];
    let view = |dtype, shape: &[usize], bytes| {
        TensorView::new(dtype, shape.to_vec(), bytes).map_err(|error| content(error.to_string()))
    };
    let mut tensors = vec![
        ("motion", view(Dtype::F32, &[frames, POSE_DIM], &motion)?),
        ("music", view(Dtype::F32, &[frames, MUSIC_DIM], &music)?),
    ];
    for (name, bytes) in &columns {
        tensors.push((name, view(Dtype::I64, &[clips.len()], bytes)?));
    }
    let names: Vec<&str> = clips.iter().map(|clip| clip.name.as_str()).collect();
    let metadata = HashMap::from([
        ("clips".to_owned(), serde_json::json!(names).to_string()),
        ("styles".to_owned(), serde_json::json!(STYLES).to_string()),
        ("recipe".to_owned(), recipe.to_string()),
    ]);
    safetensors::serialize_to_file(tensors, Some(metadata), path)
        .map_err(|error| content(error.to_string()))
}

fn push_f32(bytes: &mut Vec<u8>, values: &[f32]) {
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(frames: usize, music: Option<usize>) -> CorpusClip {
        CorpusClip {
            name: format!("clip of {frames}"),
            motion: vec![[0.5; POSE_DIM]; frames],
            music: music.map(|frames| vec![[0.25; MUSIC_DIM]; frames]),
            style: 4,
            split: Split::Test,
            dance: true,
            synthetic: false,
            variant: 1,
        }
    }

    #[test]
    fn file_holds_every_clip_in_order() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let recipe = serde_json::json!({ "seed": 7 });
        write(file.path(), &[clip(3, None), clip(2, Some(2))], &recipe).unwrap();
        let bytes = std::fs::read(file.path()).unwrap();
        let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(tensors.tensor("motion").unwrap().shape(), [5, POSE_DIM]);
        let ints = |name: &str| -> Vec<i64> {
            let data = tensors.tensor(name).unwrap().data().to_vec();
            let (chunks, _) = data.as_chunks::<8>();
            chunks.iter().map(|c| i64::from_le_bytes(*c)).collect()
        };
        assert_eq!(ints("clip_start"), [0, 3]);
        assert_eq!(ints("has_music"), [0, 1]);
        assert_eq!(ints("split"), [2, 2]);
        let music = tensors.tensor("music").unwrap().data();
        assert!(music[..3 * MUSIC_DIM * 4].iter().all(|b| *b == 0));
        assert_eq!(music[3 * MUSIC_DIM * 4..][..4], 0.25f32.to_le_bytes());
    }

    #[test]
    fn music_of_another_length_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = write(file.path(), &[clip(3, Some(2))], &serde_json::json!({}));
        let message = error.unwrap_err().to_string();
        assert!(message.contains("3 frames of motion, but 2"), "{message}");
    }
}
