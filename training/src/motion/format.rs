//! Motion files of other programs and data sets: six kinds.

use std::path::Path;

use super::acclaim::read_amc;
use super::aist::read_aist;
use super::bvh::read_bvh;
use super::humanml::read_humanml;
use super::named_skeleton::GivenNames;
use super::smpl::read_smpl;
use servodance_model::motion::{Clip, MotionError};
use servodance_types::named;

/// Frames a second of Acclaim files, which do not say it: CMU's usual rate.
const AMC_FPS: f64 = 120.0;

/// The format of a motion file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImportFormat {
    /// SMPL angles in a pickle, as in AIST++.
    Aist,
    /// HumanML3D's vectors or joints, `.npy`.
    HumanMl,
    /// Biovision hierarchy: any skeleton.
    Bvh,
    /// Acclaim, `.amc` beside its `.asf`.
    Amc,
    /// SMPL, SMPL-H or SMPL-X angles, `.npz`, as in AMASS.
    Smpl,
    /// 22 joint positions, `.npz`, as this program writes them.
    Npz,
}

// Of two that fit a file name the last is the usual one.
named!(ImportFormat {
    Aist "aist", HumanMl "humanml3d", Bvh "bvh", Amc "amc", Smpl "smpl", Npz "npz"
});

impl ImportFormat {
    /// The format of that name; the error lists all names.
    pub fn parse(name: &str) -> Result<Self, String> {
        let known = || format!("choose one of {}", Self::ALL.map(Self::name).join(", "));
        Self::from_name(name).ok_or_else(known)
    }

    /// Endings of file names, in small letters.
    pub fn endings(self) -> &'static [&'static str] {
        match self {
            ImportFormat::Aist => &["pkl", "pickle"],
            ImportFormat::HumanMl => &["npy"],
            ImportFormat::Bvh => &["bvh"],
            ImportFormat::Amc => &["amc"],
            ImportFormat::Smpl | ImportFormat::Npz => &["npz"],
        }
    }

    /// Whether a file's name is that of this kind.
    pub fn fits(self, path: &Path) -> bool {
        let ending = path.extension().and_then(|e| e.to_str());
        ending.is_some_and(|ending| self.endings().contains(&&*ending.to_ascii_lowercase()))
    }
}

/// What a file does not say of itself.
#[derive(Clone, Debug, Default)]
pub struct FileCorrections {
    /// Which joint of a BVH or Acclaim skeleton a body joint is, where the guess is wrong.
    pub names: GivenNames,
    /// Frames a second, in place of what the file says or is taken for.
    pub fps: Option<f64>,
}

/// Reads a file as it is: own size, place and rate; with what was guessed, a line each.
pub fn read_format(
    kind: ImportFormat,
    path: &Path,
    corrections: &FileCorrections,
) -> Result<(Clip, Vec<String>), MotionError> {
    let (mut clip, lines) = match kind {
        ImportFormat::Npz => (Clip::read_npz(path)?, Vec::new()),
        ImportFormat::Aist => (read_aist(path)?, Vec::new()),
        ImportFormat::HumanMl => (read_humanml(path)?, Vec::new()),
        ImportFormat::Smpl => (read_smpl(path)?, Vec::new()),
        ImportFormat::Bvh => {
            let named = read_bvh(path, &corrections.names)?;
            (named.clip, named.mapping.lines())
        }
        ImportFormat::Amc => {
            let named = read_amc(path, AMC_FPS, &corrections.names)?;
            (named.clip, named.mapping.lines())
        }
    };
    clip.fps = corrections.fps.unwrap_or(clip.fps);
    Ok((clip, lines))
}

/// Reads a file of the format of its ending (an `.npz` is taken for 22 joints), on the
/// common skeleton: 20 FPS, floor at 0, above the origin, facing +z.
pub fn read_motion(path: &Path) -> Result<(Clip, Vec<String>), MotionError> {
    let mut kinds = ImportFormat::ALL.into_iter().rev(); // 22 joints before SMPL
    let kind = kinds.find(|kind| kind.fits(path));
    let kind = kind.ok_or_else(|| {
        MotionError::content(
            path,
            "a motion file ends in .npz (22 joints), .bvh, .pkl (AIST++), .amc or .npy (HumanML3D)",
        )
    })?;
    let (clip, lines) = read_format(kind, path, &FileCorrections::default())?;
    Ok((clip.normalised(), lines))
}
