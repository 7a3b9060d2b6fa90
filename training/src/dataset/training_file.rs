//! The training file: many clips of motion and music in one safetensors file.
//!
//! | tensor | shape | what |
//! |---|---|---|
//! | `motion` | `[N, 137]` f32 | pose vectors, not normalised |
//! | `music` | `[N, 39]` f32 | music vectors; zeros where there is none |
//! | `encodec` | `[N, 128]` f32 | Encodec latents, if they were asked for; likewise |
//! | `clip_start`, `clip_length` | `[C]` i64 | the frames of each clip |
//! | `style`, `split`, `dance`, `has_music`, `synthetic`, `variant` | `[C]` i64 | see [`TrainingClip`] |
//!
//! Metadata: `clips` and `styles` (JSON lists of names) and `recipe` (JSON).

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors};
use servodance_types::MUSIC_DIM;

use super::clip_entry::Split;
use super::styles::{self, STYLES};
use servodance_model::conditioning::{LATENT_DIM, Latent, MusicKind};
use servodance_model::motion::MotionError;
use servodance_model::motion::representation::{POSE_DIM, PoseVector};
use servodance_model::weights::tensor_file::{self, Entry};

/// One clip of the training file.
#[derive(Clone, Debug)]
pub struct TrainingClip {
    /// Its name; copies of one clip differ in what follows `#`.
    pub name: String,
    /// Pose vectors, one a frame, not normalised.
    pub motion: Vec<PoseVector>,
    /// Music, one vector a frame, as many as `motion`; `None`: no music known.
    pub music: Option<Vec<[f32; MUSIC_DIM]>>,
    /// The same music as Encodec hears it, in files that were built with it.
    pub latents: Option<Vec<Latent>>,
    /// An index into [`STYLES`].
    pub style: usize,
    /// Whether it trains, chooses or judges.
    pub split: Split,
    /// Whether it is dance; other motion trains the VQ-VAE.
    pub dance: bool,
    /// Whether the motion was made by the choreographer.
    pub synthetic: bool,
    /// 0: original motion; 1: an augmented copy (mirrored, warped).
    pub variant: usize,
}

impl TrainingClip {
    /// `None`: no music is known, or not what Encodec hears of it.
    pub(crate) fn music_row(&self, kind: MusicKind, frame: usize) -> Option<&[f32]> {
        match kind {
            MusicKind::Encodec128 => Some(&self.latents.as_ref()?[frame]),
            MusicKind::Servodance39 | MusicKind::Librosa35 => {
                Some(&self.music.as_ref()?[frame][..kind.dim()])
            }
        }
    }
}

/// Fails on clips without motion, and on music of another length than its motion.
pub fn write(
    path: &Path,
    clips: &[TrainingClip],
    recipe: &serde_json::Value,
) -> Result<(), MotionError> {
    let content = |reason: String| MotionError::content(path, reason);
    let frames: usize = clips.iter().map(|clip| clip.motion.len()).sum();
    let with_latents = clips.iter().any(|clip| clip.latents.is_some());
    let (mut motion, mut music, mut latents) = (Vec::new(), Vec::new(), Vec::new());
    for clip in clips {
        let TrainingClip { name, .. } = clip;
        let frames = clip.motion.len();
        if frames == 0 {
            return Err(content(format!("clip {name} has no frames")));
        }
        let other = |found: usize, what: &str| {
            content(format!("clip {name} has {frames} frames of motion, but {found} of {what}"))
        };
        push_f32(&mut motion, clip.motion.as_flattened());
        match &clip.music {
            Some(rows) if rows.len() == frames => push_f32(&mut music, rows.as_flattened()),
            Some(rows) => return Err(other(rows.len(), "music")),
            None => push_f32(&mut music, &vec![0.0; frames * MUSIC_DIM]),
        }
        match &clip.latents {
            _ if !with_latents => {}
            Some(rows) if rows.len() == frames => push_f32(&mut latents, rows.as_flattened()),
            None if clip.music.is_none() => push_f32(&mut latents, &vec![0.0; frames * LATENT_DIM]),
            rows => {
                let found = rows.as_ref().map_or(0, Vec::len);
                return Err(other(found, "Encodec latents"));
            }
        }
    }
    let column = |value: &dyn Fn(&TrainingClip) -> i64| -> Vec<u8> {
        clips.iter().flat_map(|clip| value(clip).to_le_bytes()).collect()
    };
    let starts = clips.iter().scan(0, |start, clip| {
        let this = *start as i64;
        *start += clip.motion.len();
        Some(this.to_le_bytes())
    });
    let columns = [
        ("clip_start", starts.flatten().collect()),
        ("clip_length", column(&|clip| clip.motion.len() as i64)),
        ("style", column(&|clip| clip.style as i64)),
        ("split", column(&|clip| clip.split as i64)),
        ("dance", column(&|clip| clip.dance.into())),
        ("has_music", column(&|clip| clip.music.is_some().into())),
        ("synthetic", column(&|clip| clip.synthetic.into())),
        ("variant", column(&|clip| clip.variant as i64)),
    ];
    let entry = |name, dtype, shape, data| Entry { name, dtype, shape, data };
    let shapes = [POSE_DIM, MUSIC_DIM, LATENT_DIM].map(|columns| [frames, columns]);
    let rows = [clips.len()];
    let mut tensors = vec![
        entry("motion", Dtype::F32, &shapes[0][..], &motion[..]),
        entry("music", Dtype::F32, &shapes[1], &music),
    ];
    if with_latents {
        tensors.push(entry("encodec", Dtype::F32, &shapes[2], &latents));
    }
    for (name, bytes) in &columns {
        tensors.push(entry(name, Dtype::I64, &rows, bytes));
    }
    let styles = styles::named(clips.iter().map(|clip| clip.style));
    let names: Vec<&str> = clips.iter().map(|clip| clip.name.as_str()).collect();
    let metadata = BTreeMap::from([
        ("clips".to_owned(), serde_json::json!(names).to_string()),
        ("styles".to_owned(), serde_json::json!(styles).to_string()),
        ("recipe".to_owned(), recipe.to_string()),
    ]);
    let written = File::create(path).map(BufWriter::new).and_then(|mut out| {
        tensor_file::write(&mut out, &metadata, tensors)?;
        out.flush()
    });
    written.map_err(|error| content(error.to_string()))
}

/// Reads a training file. Fails on another layout, with what is missing or wrong.
pub fn read(path: &Path) -> Result<Vec<TrainingClip>, MotionError> {
    let content = |reason: String| MotionError::content(path, reason);
    let bytes = std::fs::read(path).map_err(|error| MotionError::read(path, error))?;
    let file = SafeTensors::deserialize(&bytes)
        .map_err(|error| content(format!("not a training file: {error}")))?;
    let (_, header) =
        SafeTensors::read_metadata(&bytes).map_err(|error| content(error.to_string()))?;
    let names = header.metadata().as_ref().and_then(|m| m.get("clips"));
    let names: Vec<String> = names
        .and_then(|text| serde_json::from_str(text).ok())
        .ok_or_else(|| content("no list of `clips` in the metadata".into()))?;
    let tensor = |name: &str, dtype, columns: usize| -> Result<&[u8], MotionError> {
        let view = file.tensor(name).map_err(|_| content(format!("no tensor `{name}`")))?;
        let wide = view.shape().get(1).copied().unwrap_or(1);
        if view.dtype() != dtype || wide != columns {
            return Err(content(format!(
                "tensor `{name}` is {:?} {:?}, expected {dtype:?} with {columns} columns",
                view.dtype(),
                view.shape()
            )));
        }
        Ok(view.data())
    };
    let floats = |name: &str, columns| -> Result<Vec<f32>, MotionError> {
        let (values, _) = tensor(name, Dtype::F32, columns)?.as_chunks::<4>();
        Ok(values.iter().map(|b| f32::from_le_bytes(*b)).collect())
    };
    let column = |name: &str| -> Result<Vec<usize>, MotionError> {
        let (values, _) = tensor(name, Dtype::I64, 1)?.as_chunks::<8>();
        let values = values.iter().map(|b| i64::from_le_bytes(*b) as usize);
        let values: Vec<usize> = values.collect();
        match values.len() == names.len() {
            true => Ok(values),
            false => Err(content(format!(
                "`{name}` has {} rows for {} clips",
                values.len(),
                names.len()
            ))),
        }
    };
    let (motion, music) = (floats("motion", POSE_DIM)?, floats("music", MUSIC_DIM)?);
    let (motion, _) = motion.as_chunks::<POSE_DIM>();
    let (music, _) = music.as_chunks::<MUSIC_DIM>();
    let latents = match file.tensor("encodec") {
        Ok(_) => Some(floats("encodec", LATENT_DIM)?),
        Err(_) => None,
    };
    let latents = latents.as_ref().map(|rows| rows.as_chunks::<LATENT_DIM>().0);
    let [starts, lengths, style, split] =
        ["clip_start", "clip_length", "style", "split"].map(column);
    let (starts, lengths, style, split) = (starts?, lengths?, style?, split?);
    let [dance, has_music, synthetic, variant] =
        ["dance", "has_music", "synthetic", "variant"].map(column);
    let (dance, has_music, synthetic, variant) = (dance?, has_music?, synthetic?, variant?);
    (names.into_iter().enumerate())
        .map(|(c, name)| {
            let rows = starts[c]..starts[c].saturating_add(lengths[c]);
            let latents = latents.map(|latents| latents.get(rows.clone()));
            let (Some(motion), Some(music)) = (motion.get(rows.clone()), music.get(rows)) else {
                return Err(content(format!("clip {name} lies outside the file")));
            };
            if latents == Some(None) {
                return Err(content(format!("clip {name} lies outside `encodec`")));
            }
            let split = Split::ALL.get(split[c]).copied();
            Ok(TrainingClip {
                motion: motion.to_vec(),
                music: (has_music[c] == 1).then(|| music.to_vec()),
                latents: (has_music[c] == 1)
                    .then(|| latents.flatten().map(<[_]>::to_vec))
                    .flatten(),
                style: style[c].min(STYLES.len() - 1),
                split: split.ok_or_else(|| content(format!("clip {name}: unknown split")))?,
                dance: dance[c] == 1,
                synthetic: synthetic[c] == 1,
                variant: variant[c],
                name,
            })
        })
        .collect()
}

fn push_f32(bytes: &mut Vec<u8>, values: &[f32]) {
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(frames: usize, music: Option<usize>) -> TrainingClip {
        TrainingClip {
            name: format!("clip of {frames}"),
            motion: vec![[0.5; POSE_DIM]; frames],
            music: music.map(|frames| vec![[0.25; MUSIC_DIM]; frames]),
            latents: None,
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
    fn the_same_clips_are_the_same_bytes() {
        let [a, b] = [0, 1].map(|_| {
            let file = tempfile::NamedTempFile::new().unwrap();
            let recipe = serde_json::json!({ "seed": 7 });
            write(file.path(), &[clip(3, None), clip(2, Some(2))], &recipe).unwrap();
            std::fs::read(file.path()).unwrap()
        });
        assert_eq!(a, b);
    }

    #[test]
    fn reading_returns_what_was_written() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let clips = [clip(3, None), clip(2, Some(2))];
        write(file.path(), &clips, &serde_json::json!({})).unwrap();
        for (found, wanted) in read(file.path()).unwrap().iter().zip(&clips) {
            assert_eq!(found.name, wanted.name);
            assert_eq!((&found.motion, &found.music), (&wanted.motion, &wanted.music));
            assert_eq!((found.split, found.variant), (wanted.split, wanted.variant));
        }
        std::fs::write(file.path(), [0; 40]).unwrap();
        assert!(read(file.path()).is_err());
    }

    #[test]
    fn latents_come_back_and_music_without_them_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut clips = [clip(3, None), clip(2, Some(2))];
        clips[1].latents = Some(vec![[0.75; LATENT_DIM]; 2]);
        write(file.path(), &clips, &serde_json::json!({})).unwrap();
        let back = read(file.path()).unwrap();
        assert_eq!(back[0].latents, None);
        assert_eq!(back[1].latents, clips[1].latents);
        let both = [clips[1].clone(), clip(4, Some(4))];
        let error = write(file.path(), &both, &serde_json::json!({}));
        let message = error.unwrap_err().to_string();
        assert!(message.contains("4 frames of motion, but 0"), "{message}");
    }

    #[test]
    fn music_of_another_length_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = write(file.path(), &[clip(3, Some(2))], &serde_json::json!({}));
        let message = error.unwrap_err().to_string();
        assert!(message.contains("3 frames of motion, but 2"), "{message}");
    }
}
