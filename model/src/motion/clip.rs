//! A motion clip: named, a fixed frame rate, 22 joints a frame.
//!
//! Reads and writes `.npz` files with `positions` float32 [T, 22, 3] (metres,
//! y up) and `fps`. Refuses files without frames, with another joint count or
//! with numbers that are not finite.

use std::path::Path;

use servodance_types::{BodyJoint, FRAME_RATE_HZ, JOINT_COUNT, MUSIC_DIM, MotionFrame};

use super::Pose;
use super::error::MotionError;
use super::numpy::{Npz, write_npz};
use super::representation::{contacts, encode, headings_rad};
use super::skeleton;
use super::vec3::{narrow, sub, turn, wide};
use crate::conditioning::{LATENT_DIM, Latent};

/// What is heard in one frame.
pub type MusicVector = [f32; MUSIC_DIM];

/// Frames of joint positions at a fixed rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// What errors and data sets call it.
    pub name: String,
    /// Frames a second.
    pub fps: f64,
    /// Joint positions, metres, y up.
    pub poses: Vec<Pose>,
}

impl Clip {
    /// Reads `positions` [T, 22, 3] and `fps` from an npz file. The clip gets
    /// the file's stem as its name.
    pub fn read_npz(path: impl AsRef<Path>) -> Result<Self, MotionError> {
        let path = path.as_ref();
        let content = |reason: String| MotionError::content(path, reason);
        let mut npz = Npz::open(path)?;
        let (positions, fps) = (npz.need("positions")?, npz.need("fps")?);
        let fps = match fps.values[..] {
            [fps] if fps.is_finite() && fps > 0.0 => fps,
            _ => {
                return Err(content(format!(
                    "`fps` must be one positive number, not {:?}",
                    fps.values
                )));
            }
        };
        match positions.shape[..] {
            [frames, JOINT_COUNT, 3] if frames > 0 => {}
            _ => {
                let dims = positions.shape;
                return Err(content(format!(
                    "`positions` must be [frames, {JOINT_COUNT}, 3] with at least 1 frame, not {dims:?}"
                )));
            }
        }
        let flat: Vec<f32> = positions.values.iter().map(|v| *v as f32).collect();
        if let Some(at) = flat.iter().position(|v| !v.is_finite()) {
            let (frame, joint) = (at / (3 * JOINT_COUNT), at / 3 % JOINT_COUNT);
            return Err(content(format!(
                "frame {frame}, joint {}: position is not finite",
                BodyJoint::ALL[joint].name()
            )));
        }
        let (points, _) = flat.as_chunks::<3>();
        let (poses, _) = points.as_chunks::<JOINT_COUNT>();
        Ok(Self::of_file(path, fps, poses.to_vec()))
    }

    /// Poses at `fps` frames a second, named after the stem of a file.
    pub fn of_file(path: &Path, fps: f64, poses: Vec<Pose>) -> Self {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self { name: name.into_owned(), fps, poses }
    }

    /// Poses at the generator's 20 frames a second, without a name.
    pub fn of_frames(poses: Vec<Pose>) -> Self {
        Self { name: String::new(), fps: FRAME_RATE_HZ, poses }
    }

    /// Writes `positions` float32 [T, 22, 3] and `fps` float32 to an npz file.
    pub fn write_npz(&self, path: impl AsRef<Path>) -> Result<(), MotionError> {
        self.write_with_music(path, None, None)
    }

    /// The same with `music` float32 [T, 39] and `encodec` float32 [T, 128]
    /// beside it, where there is some.
    pub fn write_with_music(
        &self,
        path: impl AsRef<Path>,
        music: Option<&[MusicVector]>,
        latents: Option<&[Latent]>,
    ) -> Result<(), MotionError> {
        let path = path.as_ref();
        let positions = self.poses.as_flattened().as_flattened();
        let fps = [self.fps as f32];
        let mut arrays: Vec<(&str, Vec<usize>, &[f32])> = vec![
            ("positions", vec![self.poses.len(), JOINT_COUNT, 3], positions),
            ("fps", vec![], &fps),
        ];
        if let Some(music) = music {
            arrays.push(("music", vec![music.len(), MUSIC_DIM], music.as_flattened()));
        }
        if let Some(latents) = latents {
            arrays.push(("encodec", vec![latents.len(), LATENT_DIM], latents.as_flattened()));
        }
        write_npz(path, &arrays).map_err(|error| MotionError::write(path, error))
    }

    /// Reads the `music` [T, 39] of a clip's npz file, if it has some.
    pub fn read_music(path: &Path) -> Result<Option<Vec<MusicVector>>, MotionError> {
        read_rows(path, "music")
    }

    /// Reads the `encodec` [T, 128] of a clip's npz file, if it has some.
    pub fn read_latents(path: &Path) -> Result<Option<Vec<Latent>>, MotionError> {
        read_rows(path, "encodec")
    }

    /// Length in seconds, from the first frame to the last.
    pub fn duration_s(&self) -> f64 {
        self.poses.len().saturating_sub(1) as f64 / self.fps
    }

    /// The clip in a mirror: x negated, left and right exchanged.
    pub fn mirrored(&self) -> Self {
        self.with_poses(self.poses.iter().map(skeleton::mirrored).collect())
    }

    /// The pose at `time_s` (clamped to the clip), by Catmull-Rom splines
    /// through the frames. Bone lengths may shrink a little between frames.
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let last = self.poses.len() - 1;
        let at = (time_s * self.fps).clamp(0.0, last as f64);
        let i = at.floor() as usize;
        let t = (at - i as f64) as f32;
        if t == 0.0 {
            return self.poses[i];
        }
        let frame = |k: isize| &self.poses[k.clamp(0, last as isize) as usize];
        let i = i as isize;
        let [a, b, c, d] = [frame(i - 1), frame(i), frame(i + 1), frame(i + 2)];
        std::array::from_fn(|j| {
            std::array::from_fn(|k| {
                let (a, b, c, d) = (a[j][k], b[j][k], c[j][k], d[j][k]);
                let (m0, m1) = ((c - a) / 2.0, (d - b) / 2.0);
                let (t2, t3) = (t * t, t * t * t);
                (2.0 * t3 - 3.0 * t2 + 1.0) * b
                    + (t3 - 2.0 * t2 + t) * m0
                    + (3.0 * t2 - 2.0 * t3) * c
                    + (t3 - t2) * m1
            })
        })
    }

    /// The clip read at other times: frame i of the result shows
    /// `source_times_s[i]`. The frame rate of the result is `fps`.
    pub fn at_times(&self, source_times_s: &[f64], fps: f64) -> Self {
        Self {
            name: self.name.clone(),
            fps,
            poses: source_times_s.iter().map(|t| self.pose_at(*t)).collect(),
        }
    }

    /// The clip at another frame rate.
    pub fn resampled(&self, fps: f64) -> Self {
        let frames = (self.duration_s() * fps + 1e-9).floor() as usize + 1;
        let times: Vec<f64> = (0..frames).map(|i| i as f64 / fps).collect();
        self.at_times(&times, fps)
    }

    /// The clip as a generator's frames: at 20 FPS from time 0, each with the
    /// contacts that its step shows (the last frame those of the one before).
    pub fn frames(&self) -> Vec<MotionFrame> {
        let poses = self.resampled(FRAME_RATE_HZ).poses;
        let steps = encode(&poses);
        let contacts = |frame: usize| steps.get(frame).or(steps.last()).map(contacts);
        poses
            .iter()
            .enumerate()
            .map(|(frame, &positions)| MotionFrame {
                time_s: frame as f64 / FRAME_RATE_HZ,
                positions,
                contacts: contacts(frame).unwrap_or_default(),
            })
            .collect()
    }

    /// The clip as the data set wants it: 20 FPS, the common skeleton, the
    /// floor at y = 0, the root above the origin, facing +z.
    pub fn normalised(&self) -> Self {
        let resampled;
        let source = if (self.fps - FRAME_RATE_HZ).abs() < 1e-9 {
            self
        } else {
            resampled = self.resampled(FRAME_RATE_HZ);
            &resampled
        };
        let size = skeleton::leg_scale(&source.poses);
        let mut poses: Vec<Pose> =
            source.poses.iter().map(|pose| skeleton::fit(pose, size)).collect();
        let floor_m = floor_height_m(&poses);
        let heading = headings_rad(&poses).first().copied().unwrap_or(0.0);
        let [x, _, z] = poses.first().map_or([0.0; 3], |pose| wide(pose[0]));
        for point in poses.iter_mut().flatten() {
            *point = narrow(turn(sub(wide(*point), [x, floor_m, z]), -heading));
        }
        source.with_poses(poses)
    }

    fn with_poses(&self, poses: Vec<Pose>) -> Self {
        Self { name: self.name.clone(), fps: self.fps, poses }
    }
}

/// The rows of an array of a clip's npz file, if it has it.
fn read_rows<const N: usize>(path: &Path, key: &str) -> Result<Option<Vec<[f32; N]>>, MotionError> {
    let Some(array) = Npz::open(path)?.get(key)? else {
        return Ok(None);
    };
    let rows = array.rows::<N>(key);
    let rows = rows.map_err(|reason| MotionError::content(path, reason))?;
    Ok(Some(rows.iter().map(|row| row.map(|v| v as f32)).collect()))
}

/// How high the floor is: the lowest joint of a frame, at its 5th percentile
/// over all frames, because single frames dip below it in captured motion.
fn floor_height_m(poses: &[Pose]) -> f64 {
    let mut lowest: Vec<f32> =
        poses.iter().map(|pose| pose.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min)).collect();
    lowest.sort_by(f32::total_cmp);
    lowest.get(lowest.len() / 20).map_or(0.0, |y| f64::from(*y))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(frames: usize) -> Clip {
        let pose = |i: usize| -> Pose {
            std::array::from_fn(|j| [0.01 * i as f32, 0.9 - 0.04 * j as f32, 0.1 * j as f32])
        };
        Clip { name: "clip".into(), fps: 20.0, poses: (0..frames).map(pose).collect() }
    }

    #[test]
    fn npz_returns_what_was_written() {
        let file = tempfile::Builder::new().suffix(".npz").tempfile().unwrap();
        let written = clip(5);
        written.write_npz(file.path()).unwrap();
        let read = Clip::read_npz(file.path()).unwrap();
        assert_eq!((read.fps, read.poses), (20.0, written.poses));
    }

    #[test]
    fn bad_files_are_named_in_the_error() {
        let file = tempfile::Builder::new().suffix(".npz").tempfile().unwrap();
        let mut bad = clip(3);
        bad.poses[1][15][2] = f32::NAN;
        bad.write_npz(file.path()).unwrap();
        let message = Clip::read_npz(file.path()).unwrap_err().to_string();
        assert!(message.contains("frame 1, joint head"), "{message}");
        std::fs::write(file.path(), b"not a zip").unwrap();
        let message = Clip::read_npz(file.path()).unwrap_err().to_string();
        assert!(message.contains("cannot read motion"), "{message}");
    }

    #[test]
    fn mirroring_twice_changes_nothing() {
        assert_eq!(clip(3).mirrored().mirrored(), clip(3));
    }

    #[test]
    fn normalised_motion_stands_on_the_floor_at_the_origin() {
        let normal = clip(40).normalised();
        let lowest = normal.poses.iter().flatten().map(|p| p[1]).fold(9.0, f32::min);
        assert!(lowest.abs() < 1e-5, "lowest joint at {lowest} m");
        let [x, _, z] = normal.poses[0][0];
        assert!(x.abs() < 1e-6 && z.abs() < 1e-6);
    }
}
