//! How well the causal beat tracker follows songs with known beats, and what it
//! costs: `servodance bench beats SONGS_DIR`.
//!
//! Beside each recording stands NAME.beats: a line a beat, its time in seconds and
//! its place in the bar from 1 (`audio/reference/fresh_songs.py` makes such a
//! folder). The first 5 s of a song are left out. One offset, the same for all
//! songs, is fitted, since what a "beat" of a recording is differs by some hundredths.

mod known_song;
mod own_motors;
mod scores;

use anyhow::Context;
use known_song::KnownSong;
use nix::time::{ClockId, clock_gettime};
use own_motors::{HeardBesideMotors, hear_beside_motors};
use scores::{continuity, f_measure, locked_s, off_beats};
use serde::Serialize;
use servodance_audio::MusicAnalyzer;
use servodance_model::Generator;
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::robot::Robot;
use servodance_runtime::session::dance::open_generator;
use servodance_training::song_file::songs_in;
use std::path::Path;

const SKIPPED_S: f64 = 5.0;
/// A lock counts if it holds so long.
const HELD_S: f64 = 4.0;
const OFFSETS_MS: [i32; 9] = [-30, -20, -10, 0, 10, 20, 30, 40, 50];
/// How long a song is heard from each start, and each of two songs around a jump.
const START_S: f64 = 60.0;
const JUMP_S: f64 = 30.0;
/// How far a robot's own motors are below the music.
const MOTORS_DB: f32 = 6.0;
/// Samples in a block.
const BLOCK: usize = 2048;

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
    /// Where asked for.
    pub starts: Option<StartScores>,
    pub noise: Option<NoiseScores>,
    pub jumps: Option<JumpScores>,
    pub motors: Option<MotorScores>,
}

/// What else is asked of the songs.
#[derive(Default)]
pub struct BeatBenchOptions {
    /// From how many places in it each song is also begun.
    pub starts: usize,
    /// Whether each song is also heard in a room, with noise and motors.
    pub noise: bool,
    /// Whether each song is also followed by the next one.
    pub jumps: bool,
    /// A robot that also dances to each song and hears its own motors.
    pub motors: Option<Robot>,
}

/// A minute of each song begun at several places.
#[derive(Clone, Debug, Serialize)]
pub struct StartScores {
    /// Places a song.
    pub starts: usize,
    /// Largest less smallest F of a song, mean over the songs.
    pub f_spread: f64,
    /// Mean F over songs and places.
    pub f: f64,
    /// Share of the minutes with F below 0.5.
    pub f_below_half_share: f64,
}

/// Scores in a room, with pink noise and motors.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct NoiseScores {
    pub f: f64,
    pub cmlt: f64,
    pub amlt: f64,
    pub off_beat_share: f64,
}

/// Scores of what a robot hears beside its own motors.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct MotorScores {
    pub robot: String,
    /// Power of the music over that of the motors, decibels, mean over the songs.
    pub motors_below_db: f64,
    pub f: f64,
    pub cmlt: f64,
    pub amlt: f64,
    pub off_beat_share: f64,
}

/// Half a minute of a song, then half a minute of another one.
#[derive(Clone, Debug, Serialize)]
pub struct JumpScores {
    /// Number of changes of song.
    pub jumps: usize,
    /// From the change to the right tempo and phase held for 4 s, median; none where
    /// most are never found.
    pub locked_s_median: Option<f64>,
    /// Share of the changes after which they are not found in half a minute.
    pub never_locked_share: f64,
}

/// What was found in a song.
struct Heard {
    /// Without its samples, which would fill the memory.
    song: KnownSong,
    audio_s: f64,
    found_s: Vec<f64>,
    downbeats_s: Vec<f64>,
    cpu_s: f64,
}

/// Hears and scores every song of a folder.
/// Fails for: a folder without such songs, or a song that cannot be read.
pub fn run(folder: &Path, options: &BeatBenchOptions) -> anyhow::Result<BeatBenchReport> {
    let paths = songs_in(folder)?;
    let mut songs = Vec::new();
    let (mut begun, mut noisy, mut joined) = (Vec::new(), Vec::new(), Vec::new());
    let mut beside_motors = Vec::new();
    let dancer = match &options.motors {
        Some(robot) => Some((robot, open_generator(None, EngineArgs::default())?)),
        None => None,
    };
    let mut before: Option<KnownSong> = None;
    for (seed, path) in paths.iter().enumerate() {
        let song = KnownSong::open(path).with_context(|| format!("{}", path.display()))?;
        let minutes = (0..options.starts).map(|start| hear(minute(&song, start, options.starts)));
        begun.push(minutes.collect::<Result<Vec<_>, _>>()?);
        if options.noise {
            noisy.push(hear(song.clone().in_noise(seed as u64))?);
        }
        if let Some((robot, generator)) = &dancer {
            beside_motors.push(hear_robot(&song, robot, generator)?);
        }
        let half = song.part(0.0, JUMP_S);
        if let (true, Some(before)) = (options.jumps, before.replace(half.clone())) {
            joined.push(hear(before.then(&half))?);
        }
        songs.push(hear(song)?);
    }
    let mean_f =
        |offset_ms: i32| -> f64 { songs.iter().map(|song| score(song, offset_ms).f).sum() };
    let best = OFFSETS_MS.into_iter().max_by(|&a, &b| mean_f(a).total_cmp(&mean_f(b)));
    let offset_ms = best.unwrap_or(0);
    let each = songs.iter().map(|song| score(song, offset_ms)).collect();
    Ok(BeatBenchReport {
        starts: (options.starts > 0).then(|| start_scores(&begun, offset_ms)),
        noise: options.noise.then(|| noise_scores(&noisy, offset_ms)),
        jumps: options.jumps.then(|| jump_scores(&joined, offset_ms)),
        motors: options.motors.as_ref().map(|robot| {
            let (heard, below_db): (Vec<Heard>, Vec<f64>) = beside_motors.into_iter().unzip();
            let NoiseScores { f, cmlt, amlt, off_beat_share } = noise_scores(&heard, offset_ms);
            let motors_below_db = mean(&below_db, |&db| db);
            MotorScores {
                robot: robot.name.clone(),
                motors_below_db,
                f,
                cmlt,
                amlt,
                off_beat_share,
            }
        }),
        ..report(&songs, offset_ms, each)
    })
}

/// A minute of a song from one of the places, which are spread evenly over it.
fn minute(song: &KnownSong, start: usize, starts: usize) -> KnownSong {
    let room_s = (song.duration_s() - START_S).max(0.0);
    // Not on a beat: 0.37 is no simple part of anything.
    song.part(room_s * (start as f64 + 0.37) / starts as f64, START_S)
}

fn start_scores(songs: &[Vec<Heard>], offset_ms: i32) -> StartScores {
    let of_song = |minutes: &Vec<Heard>| -> Vec<f64> {
        minutes.iter().map(|minute| score(minute, offset_ms).f).collect()
    };
    let all: Vec<Vec<f64>> = songs.iter().map(of_song).collect();
    let spread = |fs: &Vec<f64>| {
        let (low, high) = fs.iter().fold((1.0f64, 0.0f64), |(l, h), &f| (l.min(f), h.max(f)));
        high - low
    };
    let flat: Vec<f64> = all.iter().flatten().copied().collect();
    StartScores {
        starts: songs.first().map_or(0, Vec::len),
        f_spread: mean(&all, spread),
        f: mean(&flat, |&f| f),
        f_below_half_share: mean(&flat, |&f| f64::from(u8::from(f < 0.5))),
    }
}

fn noise_scores(songs: &[Heard], offset_ms: i32) -> NoiseScores {
    let each: Vec<SongScore> = songs.iter().map(|song| score(song, offset_ms)).collect();
    NoiseScores {
        f: mean(&each, |s| s.f),
        cmlt: mean(&each, |s| s.cmlt),
        amlt: mean(&each, |s| s.amlt),
        off_beat_share: mean(&each, |s| f64::from(u8::from(s.off_beat))),
    }
}

fn jump_scores(songs: &[Heard], offset_ms: i32) -> JumpScores {
    let after = |song: &Heard| {
        let late = |times: &[f64]| -> Vec<f64> {
            times.iter().copied().filter(|&t| t >= JUMP_S).collect()
        };
        let found = late(&moved(&song.found_s, offset_ms));
        locked_s(&late(&song.song.beats_s), &found, HELD_S).map(|time_s| time_s - JUMP_S)
    };
    let times: Vec<Option<f64>> = songs.iter().map(after).collect();
    JumpScores {
        jumps: songs.len(),
        locked_s_median: median_found(&times),
        never_locked_share: mean(&times, |time| f64::from(u8::from(time.is_none()))),
    }
}

/// What a robot hears of a song to which it dances, and how far its motors are below it.
fn hear_robot(
    song: &KnownSong,
    robot: &Robot,
    generator: &Generator,
) -> anyhow::Result<(Heard, f64)> {
    let heard = hear_beside_motors(song, robot, generator, MOTORS_DB)?;
    let HeardBesideMotors { found_s, downbeats_s, motors_below_db } = heard;
    let (audio_s, song) = (song.duration_s(), song.clone().silenced());
    Ok((Heard { song, audio_s, found_s, downbeats_s, cpu_s: 0.0 }, motors_below_db))
}

fn hear(song: KnownSong) -> anyhow::Result<Heard> {
    let mut analyzer = MusicAnalyzer::keeping_history(song.rate_hz)?;
    let mut cpu_s = 0.0;
    for block in song.samples.chunks(BLOCK) {
        let before_s = thread_cpu_s();
        analyzer.push(block);
        cpu_s += thread_cpu_s() - before_s;
        while analyzer.pop().is_some() {}
    }
    let history = analyzer.history().context("the analyzer keeps its history")?;
    let (found_s, downbeats_s) = (history.live_track().times_s, history.live_downbeats_s());
    let audio_s = song.duration_s();
    Ok(Heard { song: song.silenced(), audio_s, found_s, downbeats_s, cpu_s })
}

fn thread_cpu_s() -> f64 {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)
        .map_or(0.0, |time| time.tv_sec() as f64 + 1e-9 * time.tv_nsec() as f64)
}

fn moved(times_s: &[f64], offset_ms: i32) -> Vec<f64> {
    times_s.iter().map(|t| t + 1e-3 * f64::from(offset_ms)).collect()
}

fn score(heard: &Heard, offset_ms: i32) -> SongScore {
    let late =
        |times: &[f64]| -> Vec<f64> { times.iter().copied().filter(|&t| t >= SKIPPED_S).collect() };
    let (song, found) = (&heard.song, moved(&heard.found_s, offset_ms));
    let (truth, late_found) = (late(&song.beats_s), late(&found));
    let f = f_measure(&truth, &late_found);
    let between = f_measure(&off_beats(&truth), &late_found);
    let (cmlt, amlt) = continuity(&truth, &late_found);
    let downbeats = late(&moved(&heard.downbeats_s, offset_ms));
    SongScore {
        name: song.name.clone(),
        f,
        cmlt,
        amlt,
        off_beat: between > f && between > 0.5,
        locked_s: locked_s(&song.beats_s, &found, HELD_S),
        downbeat_f: true_downbeats(song).map(|truth| f_measure(&late(&truth), &downbeats)),
        tempo_bpm: tempo_bpm(&late_found),
        true_tempo_bpm: tempo_bpm(&truth),
    }
}

/// The downbeats of a song in three or four.
fn true_downbeats(song: &KnownSong) -> Option<Vec<f64>> {
    let beats = *song.places.iter().max()?;
    let placed = song.beats_s.iter().zip(&song.places);
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

/// The median where what was never found counts as the largest.
fn median_found(times_s: &[Option<f64>]) -> Option<f64> {
    let all = times_s.iter().map(|time| time.unwrap_or(f64::INFINITY));
    median(all.collect()).filter(|time_s| time_s.is_finite())
}

fn mean<T>(values: &[T], of: impl Fn(&T) -> f64) -> f64 {
    values.iter().map(of).sum::<f64>() / values.len().max(1) as f64
}

fn report(songs: &[Heard], offset_ms: i32, each: Vec<SongScore>) -> BeatBenchReport {
    let share = |is: &dyn Fn(&SongScore) -> bool| mean(&each, |s| f64::from(u8::from(is(s))));
    let downbeats: Vec<f64> = each.iter().filter_map(|s| s.downbeat_f).collect();
    let locked: Vec<Option<f64>> = each.iter().map(|s| s.locked_s).collect();
    let audio_s: f64 = songs.iter().map(|heard| heard.audio_s).sum();
    BeatBenchReport {
        songs: each.len(),
        offset_ms,
        f: mean(&each, |s| s.f),
        f_median: median(each.iter().map(|s| s.f).collect()).unwrap_or(0.0),
        cmlt: mean(&each, |s| s.cmlt),
        amlt: mean(&each, |s| s.amlt),
        off_beat_share: share(&|s| s.off_beat),
        f_below_half_share: share(&|s| s.f < 0.5),
        never_locked_share: share(&|s| s.locked_s.is_none()),
        locked_s_median: median_found(&locked),
        downbeat_f: (!downbeats.is_empty()).then(|| mean(&downbeats, |&f| f)),
        cost_ms_per_s: 1e3 * songs.iter().map(|heard| heard.cpu_s).sum::<f64>() / audio_s.max(1e-9),
        each,
        starts: None,
        noise: None,
        jumps: None,
        motors: None,
    }
}
