//! Motion of other programs and data sets into one folder: a clip a file (22
//! joints, 20 FPS, metres, y up, the common skeleton on the floor, facing +z,
//! with the music that is danced to, if there is some) and a list of them.
//!
//! A file that cannot be used is skipped, reported and counted; it never stops the
//! rest. Clips are written whole; the list is written last.

use super::feature_args::FeatureArgs;
use super::music::hear_file;
use super::sources::{aist_song, aist_style, usual_licence};
use crate::dataset::clip_entry::{ClipEntry, Split};
use crate::dataset::index;
use crate::dataset::splits::assign_splits;
use crate::dataset::styles::{STYLES, style_number};
use crate::motion::format::{FileCorrections, ImportFormat, read_format};
use crate::motion::named_skeleton::GivenNames;
use crate::motion::soundness;
use anyhow::{Context, bail};
use servodance_model::conditioning::{Encodec, HeardFrame, Latent};
use servodance_model::motion::Clip;
use servodance_model::motion::clip::MusicVector;
use servodance_runtime::process::number_range::within;
use servodance_runtime::process::wrong_usage::WrongUsage;
use servodance_runtime::telemetry::pending_file::{PendingFile, write_whole};
use servodance_types::{BodyJoint, FRAME_RATE_HZ};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Shorter clips are skipped, seconds.
const SHORTEST_S: f64 = 1.0;
const AUDIO: [&str; 5] = ["wav", "mp3", "flac", "ogg", "m4a"];

/// Which files to import, what they do not say themselves, where to write.
#[derive(Clone, Debug, clap::Args)]
pub struct ImportRequest {
    /// aist (pkl), humanml3d (npy), bvh, amc (beside its asf), smpl (npz, as in
    /// AMASS) or npz (22 joints).
    #[arg(value_parser = ImportFormat::parse)]
    pub kind: ImportFormat,
    /// A file, or a folder of them.
    pub path: PathBuf,
    /// The folder to write to; what it holds of other imports stays.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Whose motion it is, one word.
    #[arg(long, value_name = "NAME")]
    pub source: Option<String>,
    /// On what terms it may be used.
    #[arg(long, value_name = "TEXT")]
    pub licence: Option<String>,
    /// It is dance (AIST++ always is).
    #[arg(long)]
    pub dance: bool,
    /// The style of the dance; an unknown one lists those that there are.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,
    /// A folder of recordings, named as the clips or as AIST++'s songs.
    #[arg(long, value_name = "DIR")]
    pub music: Option<PathBuf>,
    /// Which features of the music are written.
    #[command(flatten)]
    pub features: FeatureArgs,
    /// Which joint of the skeleton a body joint is, where the guess is wrong.
    #[arg(long, value_name = "FILE.toml")]
    pub mapping: Option<PathBuf>,
    /// Frames a second, in place of what the files say.
    #[arg(long, value_name = "N", value_parser = within(1.0..=1000.0))]
    pub fps: Option<f64>,
    /// Print only errors and what was skipped.
    #[arg(long, short)]
    pub quiet: bool,
}

/// What came of an import.
#[derive(Clone, Debug, Default)]
pub struct ImportSummary {
    /// Clips that were written.
    pub clips: usize,
    /// Minutes of motion in them.
    pub minutes: f64,
    /// Clips that hold the music they are danced to.
    pub with_music: usize,
    /// Files that were not used, each with the reason.
    pub skipped: Vec<String>,
    /// Mirrored copies of HumanML3D that were passed over.
    pub mirrored: usize,
}

/// `report` receives what was guessed and skipped, a line each; `on_progress` the share done.
/// Fails before anything is written on a bad request, or where the folder cannot be written to.
pub fn import(
    request: &ImportRequest,
    mut report: impl FnMut(&str),
    on_progress: impl Fn(f64),
) -> anyhow::Result<ImportSummary> {
    let encodec = request.features.encodec()?;
    let corrections = FileCorrections {
        names: match &request.mapping {
            Some(path) => joint_names(path)?,
            None => GivenNames::new(),
        },
        fps: request.fps,
    };
    if let Some(name) = request.style.as_deref()
        && style_number(name).is_none()
    {
        let known = STYLES.join(", ");
        return Err(WrongUsage(format!("--style {name}: choose one of {known}")).into());
    }
    let source = (request.source.as_deref()).unwrap_or(request.kind.name());
    if source.is_empty() || source.contains(['/', '\\', ',', '"']) || source.starts_with('.') {
        bail!("--source \"{source}\": a plain word is needed, it becomes a folder");
    }
    let mut files = motion_files(request.kind, &request.path)?;
    let mut done = ImportSummary::default();
    if request.kind == ImportFormat::HumanMl {
        let all = files.len();
        files.retain(|path| !stem(path).starts_with('M'));
        done.mirrored = all - files.len();
    }
    let songs = match &request.music {
        Some(folder) => Some(audio_files(folder)?),
        None => None,
    };
    let lists = AistLists::near(&request.path);
    let folder = request.out.join(source);
    let mut all = existing_entries(&request.out)?;
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot write {}", folder.display()))?;
    let (mut fresh, mut names, mut shown) = (Vec::new(), BTreeSet::new(), Vec::new());
    for (number, path) in files.iter().enumerate() {
        on_progress(number as f64 / files.len() as f64);
        let name = unique(&mut names, &stem(path));
        match import_file(request, encodec.as_ref(), path, &corrections, songs.as_ref(), &lists) {
            Ok((found, lines)) => {
                if shown != lines {
                    report(&format!("{}: joints found\n  {}", path.display(), lines.join("\n  ")));
                    shown = lines;
                }
                let file = folder.join(format!("{name}.npz"));
                let pending = PendingFile::create(&file)?;
                let (music, latents) = (found.music_vectors(), found.latents());
                (found.clip).write_with_music(
                    pending.path(),
                    music.as_deref(),
                    latents.as_deref(),
                )?;
                pending.finish()?;
                done.clips += 1;
                done.with_music += usize::from(music.is_some());
                done.minutes += found.clip.poses.len() as f64 / FRAME_RATE_HZ / 60.0;
                fresh.push(found.entry(request, source, &name));
            }
            Err(reason) => {
                report(&format!("skipped {reason}"));
                done.skipped.push(reason);
            }
        }
    }
    let mut undecided: Vec<ClipEntry> =
        fresh.iter().filter(|e| e.1.is_none()).map(|e| e.0.clone()).collect();
    assign_splits(&mut undecided);
    let decided = fresh
        .into_iter()
        .filter_map(|(entry, split)| split.map(|split| ClipEntry { split, ..entry }));
    for entry in decided.chain(undecided) {
        all.insert(entry.name.clone(), entry);
    }
    if done.clips > 0 {
        let entries: Vec<ClipEntry> = all.into_values().collect();
        write_whole(&request.out.join("index.csv"), index::text(&entries).as_bytes())?;
    }
    Ok(done)
}

struct ImportedClip {
    clip: Clip,
    music: Option<Vec<HeardFrame>>,
    bone_change: f64,
    style: Option<usize>,
    split: Option<Split>,
}

impl ImportedClip {
    fn music_vectors(&self) -> Option<Vec<MusicVector>> {
        let music = self.music.as_ref()?;
        Some(music.iter().map(|heard| heard.frame.vector()).collect())
    }

    fn latents(&self) -> Option<Vec<Latent>> {
        self.music.as_ref()?.iter().map(|heard| heard.latent).collect()
    }

    fn entry(
        &self,
        request: &ImportRequest,
        source: &str,
        name: &str,
    ) -> (ClipEntry, Option<Split>) {
        let licence = request.licence.as_deref();
        let named = request.style.as_deref().and_then(style_number);
        let entry = ClipEntry {
            name: format!("{source}/{name}"),
            source: source.to_owned(),
            licence: licence.unwrap_or(usual_licence(request.kind)).to_owned(),
            dance: request.dance || request.kind == ImportFormat::Aist,
            label: name.to_owned(),
            minutes: self.clip.poses.len() as f64 / FRAME_RATE_HZ / 60.0,
            written_style: named.or(self.style),
            music: self.music.is_some(),
            bone_change: Some(self.bone_change),
            split: Split::Train,
        };
        (entry, self.split)
    }
}

/// Reads, checks and normalises one file. The error names it.
fn import_file(
    request: &ImportRequest,
    encodec: Option<&Encodec>,
    path: &Path,
    corrections: &FileCorrections,
    songs: Option<&BTreeMap<String, PathBuf>>,
    lists: &AistLists,
) -> Result<(ImportedClip, Vec<String>), String> {
    let named = |reason: String| format!("{}: {reason}", path.display());
    let stem = stem(path);
    if lists.ignored.contains(&stem) {
        return Err(named("on the data set's own list of bad clips".into()));
    }
    let (raw, lines) =
        read_format(request.kind, path, corrections).map_err(|error| error.to_string())?;
    soundness::checked_motion(&raw.poses).map_err(named)?;
    let bone_change = soundness::bone_change(&raw.poses).map_err(named)?;
    if raw.duration_s() < SHORTEST_S {
        let seconds = raw.duration_s();
        return Err(named(format!("{seconds:.2} s of motion, at least {SHORTEST_S} s are needed")));
    }
    let mut clip = raw.normalised();
    if clip.poses.iter().flatten().flatten().any(|v| !v.is_finite()) {
        return Err(named("a position is not finite after normalisation".into()));
    }
    let song = match request.kind {
        ImportFormat::Aist => aist_song(&stem).unwrap_or(&stem),
        _ => &stem,
    };
    let music = match songs.map(|songs| songs.get(song)) {
        Some(Some(file)) => {
            let heard = hear_file(file, clip.poses.len(), encodec);
            Some(heard.map_err(|e| named(e.to_string()))?)
        }
        Some(None) => return Err(named(format!("no music `{song}` in the folder of music"))),
        None => None,
    };
    if let Some(music) = &music {
        clip.poses.truncate(music.len());
    }
    let style = (request.kind == ImportFormat::Aist).then(|| aist_style(&stem)).flatten();
    let split = lists.split(&stem);
    let found = ImportedClip { clip, music, bone_change, style, split };
    Ok((found, lines))
}

/// What AIST++ says of its clips in files of its own.
#[derive(Default)]
struct AistLists {
    ignored: BTreeSet<String>,
    splits: BTreeMap<String, Split>,
}

impl AistLists {
    /// `ignore_list.txt` and `splits/crossmodal_*.txt` in the folder or above it.
    fn near(path: &Path) -> Self {
        let mut lists = Self::default();
        for folder in path.ancestors().take(3).filter(|folder| folder.is_dir()) {
            let words = |file: &str| -> Vec<String> {
                let text = std::fs::read_to_string(folder.join(file)).unwrap_or_default();
                text.split_whitespace().map(str::to_owned).collect()
            };
            lists.ignored.extend(words("ignore_list.txt"));
            for (split, file) in [
                (Split::Train, "splits/crossmodal_train.txt"),
                (Split::Validation, "splits/crossmodal_val.txt"),
                (Split::Test, "splits/crossmodal_test.txt"),
            ] {
                lists.splits.extend(words(file).into_iter().map(|name| (name, split)));
            }
        }
        lists
    }

    /// What a clip is for: a clip that the lists leave out is for training.
    fn split(&self, stem: &str) -> Option<Split> {
        let listed = self.splits.get(stem).copied();
        listed.or((!self.splits.is_empty()).then_some(Split::Train))
    }
}

fn existing_entries(folder: &Path) -> anyhow::Result<BTreeMap<String, ClipEntry>> {
    if !folder.join("index.csv").exists() {
        return Ok(BTreeMap::new());
    }
    let entries = index::read(folder)?;
    Ok(entries.into_iter().map(|entry| (entry.name.clone(), entry)).collect())
}

fn motion_files(kind: ImportFormat, path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut out: Vec<PathBuf> = walk(path)?.into_iter().filter(|path| kind.fits(path)).collect();
    if out.is_empty() {
        bail!("{} holds no files that end in .{}", path.display(), kind.endings().join(" or ."));
    }
    out.sort();
    Ok(out)
}

fn walk(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (mut folders, mut out) = (vec![folder.to_owned()], Vec::new());
    while let Some(folder) = folders.pop() {
        let entries = std::fs::read_dir(&folder)
            .with_context(|| format!("cannot read {}", folder.display()))?;
        for entry in entries {
            let entry = entry.with_context(|| format!("cannot read {}", folder.display()))?;
            // Links to folders are not followed: they may lead in a circle.
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => folders.push(entry.path()),
                _ => out.push(entry.path()),
            }
        }
    }
    Ok(out)
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().replace([',', '"'], "_")
}

fn unique(names: &mut BTreeSet<String>, stem: &str) -> String {
    let numbered = (2..).map(|n| format!("{stem}-{n}"));
    let mut candidates = std::iter::once(stem.to_owned()).chain(numbered);
    let name = candidates.find(|name| !names.contains(name)).unwrap_or_default();
    names.insert(name.clone());
    name
}

/// Music files of a folder by their names without the ending.
fn audio_files(folder: &Path) -> anyhow::Result<BTreeMap<String, PathBuf>> {
    let is_audio = |path: &PathBuf| {
        let ending = path.extension().and_then(|e| e.to_str());
        ending.is_some_and(|e| AUDIO.contains(&&*e.to_ascii_lowercase()))
    };
    let files = walk(folder)?.into_iter().filter(is_audio);
    let songs: BTreeMap<String, PathBuf> = files.map(|path| (stem(&path), path)).collect();
    if songs.is_empty() {
        bail!("--music {}: no {} files", folder.display(), AUDIO.join(", "));
    }
    Ok(songs)
}

fn joint_names(path: &Path) -> anyhow::Result<GivenNames> {
    let name = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
        let line = error.span().map_or(0, |span| text[..span.start].lines().count().max(1));
        anyhow::anyhow!("{name}: line {line}: {}", error.message())
    })?;
    let pair = |(key, value): (String, toml::Value)| {
        let joint = BodyJoint::from_name(&key).with_context(|| {
            let all: Vec<&str> = BodyJoint::ALL.iter().map(|joint| joint.name()).collect();
            format!("{name}: `{key}` is no body joint; choose of {}", all.join(", "))
        })?;
        let value = value.as_str().map(str::to_owned);
        Ok((
            joint,
            value.with_context(|| {
                format!("{name}: `{key}` must be the name of a joint, in quotes")
            })?,
        ))
    };
    table.into_iter().map(pair).collect()
}
