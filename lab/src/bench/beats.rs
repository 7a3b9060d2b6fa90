//! How well the causal beat tracker follows songs with known beats, and what it
//! costs: `servodance bench beats SONGS_DIR`.
//!
//! Beside each recording stands NAME.beats: a line a beat, its time in seconds and
//! its place in the bar from 1 (`audio/reference/fresh_songs.py` makes such a
//! folder). The first 5 s of a song are left out. One offset, the same for all
//! songs, is fitted, since what a "beat" of a recording is differs by some hundredths.

use super::beat_scores::{continuity, f_measure, locked_s, off_beats};
use anyhow::Context;
use nix::time::{ClockId, clock_gettime};
use serde::Serialize;
use servodance_audio::{AudioSource, MusicAnalyzer};
use std::path::{Path, PathBuf};

const SKIPPED_S: f64 = 5.0;
/// A lock counts if it holds so long.
const HELD_S: f64 = 4.0;
const OFFSETS_MS: [i32; 9] = [-30, -20, -10, 0, 10, 20, 30, 40, 50];
const SOUNDS: [&str; 4] = ["wav", "ogg", "mp3", "flac"];

/// The scores of one song, without the first 5 s.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct SongScore {
    pub name: String,
    pub f: f64,
    pub cmlt: f64,
    pub amlt: f64,
    /// Whether more beats were between the true ones than on them.
    pub off_beat: bool,
    /// When the right tempo and phase were found and held for 4 s.
    pub locked_s: Option<f64>,
    /// F measure of the downbeats; none where the song tells no bars.
    pub downbeat_f: Option<f64>,
    pub tempo_bpm: f64,
    pub true_tempo_bpm: f64,
}

/// The scores of a folder of songs.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct BeatBenchReport {
    pub songs: usize,
    /// By which all found beats were moved before scoring, milliseconds.
    pub offset_ms: i32,
    pub f: f64,
    pub f_median: f64,
    pub cmlt: f64,
    pub amlt: f64,
    /// Shares of the songs.
    pub off_beat_share: f64,
    pub f_below_half_share: f64,
    pub never_locked_share: f64,
    /// Median over the songs; none where most are never locked.
    pub locked_s_median: Option<f64>,
    /// Mean over songs in three and four.
    pub downbeat_f: Option<f64>,
    /// Processor time for a second of sound, all of the analysis, milliseconds.
    pub cost_ms_per_s: f64,
    pub each: Vec<SongScore>,
}

struct Heard {
    name: String,
    truth_s: Vec<f64>,
    places: Vec<u32>,
    found_s: Vec<f64>,
    downbeats_s: Vec<f64>,
    audio_s: f64,
    cpu_s: f64,
}

/// Hears and scores every song of a folder.
/// Fails for: a folder without such songs, or a song that cannot be read.
pub fn run(folder: &Path) -> anyhow::Result<BeatBenchReport> {
    let songs: Vec<Heard> = songs_in(folder)?
        .iter()
        .map(|path| hear(path).with_context(|| format!("{}", path.display())))
        .collect::<Result<_, _>>()?;
    let mean_f = |offset_ms: i32| -> f64 {
        songs.iter().map(|song| score(song, offset_ms).f).sum()
    };
    let best = OFFSETS_MS.into_iter().max_by(|&a, &b| mean_f(a).total_cmp(&mean_f(b)));
    let offset_ms = best.unwrap_or(0);
    let each = songs.iter().map(|song| score(song, offset_ms)).collect();
    Ok(report(&songs, offset_ms, each))
}

fn songs_in(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let sound = path.extension().is_some_and(|e| SOUNDS.iter().any(|s| e == *s));
        if sound && path.with_extension("beats").exists() {
            paths.push(path);
        }
    }
    anyhow::ensure!(
        !paths.is_empty(),
        "{} holds no song with a .beats file beside it",
        folder.display()
    );
    paths.sort();
    Ok(paths)
}

fn hear(path: &Path) -> anyhow::Result<Heard> {
    let (truth_s, places) = truth(&path.with_extension("beats"))?;
    let mut source = AudioSource::open(path)?;
    let mut analyzer = MusicAnalyzer::keeping_history(source.sample_rate_hz())?;
    let (mut block, mut samples, mut cpu_s) = (Vec::new(), 0, 0.0);
    while source.next_block(&mut block)? {
        samples += block.len();
        let before_s = thread_cpu_s();
        analyzer.push(&block);
        cpu_s += thread_cpu_s() - before_s;
        while analyzer.pop().is_some() {}
    }
    let history = analyzer.history().context("the analyzer keeps its history")?;
    Ok(Heard {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        truth_s,
        places,
        found_s: history.live_track().times_s,
        downbeats_s: history.live_downbeats_s(),
        audio_s: samples as f64 / f64::from(source.sample_rate_hz()),
        cpu_s,
    })
}

/// Times and places of a .beats file.
fn truth(path: &Path) -> anyhow::Result<(Vec<f64>, Vec<u32>)> {
    let text = std::fs::read_to_string(path)?;
    let line = |line: &str| -> anyhow::Result<(f64, u32)> {
        let mut words = line.split_whitespace();
        let time_s = words.next().context("a line without a time")?.parse()?;
        Ok((time_s, words.next().map_or(Ok(0), str::parse)?))
    };
    let lines = text.lines().filter(|l| !l.trim().is_empty()).map(line);
    let beats: Vec<(f64, u32)> =
        lines.collect::<Result<_, _>>().with_context(|| format!("{}", path.display()))?;
    Ok(beats.into_iter().unzip())
}

fn thread_cpu_s() -> f64 {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)
        .map_or(0.0, |time| time.tv_sec() as f64 + 1e-9 * time.tv_nsec() as f64)
}

fn score(song: &Heard, offset_ms: i32) -> SongScore {
    let moved = |times: &[f64]| -> Vec<f64> {
        times.iter().map(|t| t + 1e-3 * f64::from(offset_ms)).collect()
    };
    let late = |times: &[f64]| -> Vec<f64> {
        times.iter().copied().filter(|&t| t >= SKIPPED_S).collect()
    };
    let found = moved(&song.found_s);
    let (truth, late_found) = (late(&song.truth_s), late(&found));
    let f = f_measure(&truth, &late_found);
    let between = f_measure(&off_beats(&truth), &late_found);
    let (cmlt, amlt) = continuity(&truth, &late_found);
    SongScore {
        name: song.name.clone(),
        f,
        cmlt,
        amlt,
        off_beat: between > f && between > 0.5,
        locked_s: locked_s(&song.truth_s, &found, HELD_S),
        downbeat_f: downbeats(song).map(|truth| f_measure(&late(&truth), &late(&moved(&song.downbeats_s)))),
        tempo_bpm: tempo_bpm(&late_found),
        true_tempo_bpm: tempo_bpm(&truth),
    }
}

/// The downbeats of a song in three or four.
fn downbeats(song: &Heard) -> Option<Vec<f64>> {
    let beats = *song.places.iter().max()?;
    let placed = song.truth_s.iter().zip(&song.places);
    (beats == 3 || beats == 4)
        .then(|| placed.filter(|(_, place)| **place == 1).map(|(time_s, _)| *time_s).collect())
}

fn tempo_bpm(times_s: &[f64]) -> f64 {
    median(times_s.windows(2).map(|pair| pair[1] - pair[0]).collect()).map_or(0.0, |s| 60.0 / s)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn report(songs: &[Heard], offset_ms: i32, each: Vec<SongScore>) -> BeatBenchReport {
    let count = each.len() as f64;
    let mean = |value: &dyn Fn(&SongScore) -> f64| each.iter().map(value).sum::<f64>() / count;
    let share = |is: &dyn Fn(&SongScore) -> bool| mean(&|s| f64::from(u8::from(is(s))));
    let downbeats: Vec<f64> = each.iter().filter_map(|s| s.downbeat_f).collect();
    let locked = median(each.iter().map(|s| s.locked_s.unwrap_or(f64::INFINITY)).collect());
    let sum = |value: &dyn Fn(&Heard) -> f64| songs.iter().map(value).sum::<f64>();
    BeatBenchReport {
        songs: each.len(),
        offset_ms,
        f: mean(&|s| s.f),
        f_median: median(each.iter().map(|s| s.f).collect()).unwrap_or(0.0),
        cmlt: mean(&|s| s.cmlt),
        amlt: mean(&|s| s.amlt),
        off_beat_share: share(&|s| s.off_beat),
        f_below_half_share: share(&|s| s.f < 0.5),
        never_locked_share: share(&|s| s.locked_s.is_none()),
        locked_s_median: locked.filter(|s| s.is_finite()),
        downbeat_f: (!downbeats.is_empty())
            .then(|| downbeats.iter().sum::<f64>() / downbeats.len() as f64),
        cost_ms_per_s: 1e3 * sum(&|s| s.cpu_s) / sum(&|s| s.audio_s).max(1e-9),
        each,
    }
}
